"""A sheet on a table is found and laid flat; a drawing that fills its picture is not cropped."""

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from strokestyle.fit.exemplar import load_exemplar
from strokestyle.fit.registration import Homography
from strokestyle.fit.sheet import find_sheet

SIDE = 240  # px, of the drawing and its view
PHOTO = 400, 320  # px, width and height


def drawing():
    """Ink (SIDE, SIDE) of circles and lines, and points (n, 2) on them."""
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    ink, points, turn = np.zeros((SIDE, SIDE)), [], np.linspace(0, 2 * np.pi, 150)
    for cx, cy, r in ((100, 110, 55), (150, 90, 30), (140, 170, 25)):
        ink = np.maximum(ink, np.clip(2.5 - abs(np.hypot(x - cx, y - cy) - r), 0, 1))
        points.append(np.stack([cx + r * np.cos(turn), cy + r * np.sin(turn)], axis=1))
    ink = np.maximum(ink, np.clip(2.5 - abs(x - 0.4 * y - 20), 0, 1) * (y > 60) * (y < 190))
    at = np.linspace(60, 190, 60)
    points.append(np.stack([0.4 * at + 20, at], axis=1))
    return ink, np.concatenate(points)


INK, POINTS = drawing()
TABLES = {"dark": (0.3, 0.25, 0.2), "light": (0.84, 0.83, 0.82), "wood": (0.6, 0.42, 0.28)}
PAPER = np.array([0.96, 0.95, 0.92])


def photograph(corners, table="dark", sheet=None):
    """A sheet whose corners (4, 2) lie in a photograph of a table."""
    sheet = PAPER * (1 - 0.9 * INK[..., None]) if sheet is None else sheet
    square = np.array([[0, 0], [SIDE, 0], [SIDE, SIDE], [0, SIDE]], float)
    to_photo = Homography.of_points(square, np.array(corners, float), PHOTO)
    y, x = np.mgrid[: PHOTO[1], : PHOTO[0]] + 0.5
    u, v = np.moveaxis(to_photo.back(np.stack([x, y], axis=-1)), -1, 0)
    inside = np.clip(np.minimum.reduce([u, v, SIDE - u, SIDE - v]) + 0.5, 0, 1)[..., None]
    top = np.broadcast_to(TABLES[table], (*PHOTO[::-1], 3)).copy()
    if table == "wood":
        top *= (0.85 + 0.15 * np.sin(x / 5 + 3 * np.sin(y / 60)))[..., None]
    shade = ndimage.gaussian_filter(inside[..., 0], 3.0)[..., None]
    rng = np.random.default_rng(1)
    light = (1 - 0.25 * x / PHOTO[0])[..., None]
    photo = (inside * to_photo.warp(sheet) + (1 - inside) * top * (1 - 0.3 * shade)) * light
    return np.clip(photo + rng.normal(0, 0.008, photo.shape), 0, 1)


QUADS = {
    "turned": [[120, 30], [340, 85], [290, 300], [70, 245]],
    "aslant": [[110, 40], [300, 60], [330, 290], [60, 270]],
    "corner out": [[130, -14], [372, 30], [330, 280], [90, 230]],
}


@pytest.mark.parametrize(
    "table, quad", [("dark", "turned"), ("light", "aslant"), ("wood", "corner out")]
)
def test_a_sheet_is_found_on_a_table(table, quad):
    found = find_sheet(photograph(QUADS[quad], table))
    assert np.abs(found.corners - QUADS[quad]).max() < 2.5
    assert 0.3 < found.share < 0.6


def test_what_lies_on_the_sheet_is_laid_on_the_view(tmp_path):
    corners = np.roll(QUADS["aslant"], 1, axis=0)  # photographed from the side
    photo = photograph(corners, "wood")
    Image.fromarray((photo * 255).astype(np.uint8)).save(tmp_path / "d.png")
    found, note = load_exemplar(tmp_path / "d.png", SIDE, SIDE, POINTS)
    assert note.startswith("a sheet of paper found that fills ")
    assert np.abs(found.mask - INK).mean() < 0.03
    assert found.registration.off < 1.0
    assert np.abs(found.rgb[INK == 0] - 1).mean() < 0.02


def framed(kind):
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    sheet = PAPER * (1 - 0.9 * INK[..., None])
    near = np.minimum.reduce([x, y, SIDE - x, SIDE - y])
    if kind == "frame":
        return sheet * (1 - 0.9 * (abs(near - 9) < 1.5))[..., None]
    if kind == "thick frame":
        return sheet * (1 - 0.9 * (abs(near - 10) < 4))[..., None]
    if kind == "vignette":
        return sheet * (1 - 0.75 * np.exp(-near / 18))[..., None]
    return sheet * np.where(x < 120, 1.0, 0.8)[..., None]


@pytest.mark.parametrize("kind", ["plain", "frame", "thick frame", "vignette", "fold"])
def test_a_drawing_that_fills_its_picture_is_not_cropped(tmp_path, kind):
    sheet = PAPER * (1 - 0.9 * INK[..., None]) if kind == "plain" else framed(kind)
    assert find_sheet(sheet) is None
    if kind == "thick frame":
        return  # most of its ink is the frame's, and far from every curve
    Image.fromarray((sheet * 255).astype(np.uint8)).save(tmp_path / "d.png")
    found, note = load_exemplar(tmp_path / "d.png", SIDE, SIDE, POINTS)
    assert "sheet" not in note and "registered" not in note
    assert (found.mask * INK).sum() > 0.9 * INK.sum()


def test_no_sheet_in_noise_or_nothing():
    assert find_sheet(np.random.default_rng(0).random((60, 90, 3))) is None
    assert find_sheet(np.full((40, 40, 3), 0.7)) is None
    assert find_sheet(np.zeros((16, 400, 3))) is None
