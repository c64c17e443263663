"""Reading a drawing: every kind of file and paper gives the ink back; all else is refused."""

import numpy as np
import pytest
from PIL import Image

from strokestyle.fit import exemplar as ex

SIZE = 256


def ring(width=6.0, radius=80.0, centre=(128.0, 128.0), shape=(SIZE, SIZE)):
    """Coverage (H, W) of a circle drawn with a round pen, and points (n, 2) on its centre line."""
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    distance = np.abs(np.hypot(x - centre[0], y - centre[1]) - radius)
    angle = np.linspace(0, 2 * np.pi, 200)
    points = np.stack(
        [centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], axis=1
    )
    return np.clip(width / 2 - distance + 0.5, 0, 1).astype(np.float32), points


def on_paper(coverage, ink, paper):
    return coverage[..., None] * np.asarray(ink) + (1 - coverage[..., None]) * np.asarray(paper)


def save(path, rgb, **options):
    Image.fromarray((np.clip(rgb, 0, 1) * 255 + 0.5).astype(np.uint8)).save(path, **options)
    return path


@pytest.mark.parametrize("suffix", ["png", "jpg", "tiff"])
def test_clean_ink_on_white_is_its_own_mask(tmp_path, suffix):
    coverage, points = ring()
    options = {"quality": 95} if suffix == "jpg" else {}
    path = save(tmp_path / f"d.{suffix}", on_paper(coverage, (0.1, 0.1, 0.1), (1, 1, 1)), **options)
    got, note = ex.load_exemplar(path, SIZE, SIZE, points)
    assert note == ""
    assert np.abs(got.mask - coverage).mean() < 0.01
    assert np.abs(got.ink[coverage > 0.99] - 0.1).max() < 0.06


def test_rgb_is_alpha_over_white(tmp_path):
    coverage, points = ring()
    drawn = on_paper(0.6 * coverage, (0.7, 0.2, 0.1), (1, 1, 1))
    got, _ = ex.load_exemplar(save(tmp_path / "d.png", drawn), SIZE, SIZE, points)
    assert np.abs(got.rgb - drawn).max() < 0.01
    assert (
        np.abs(
            got.rgb - on_paper(got.alpha, (0, 0, 0), (1, 1, 1)) - got.alpha[..., None] * got.ink
        ).max()
        < 1e-5
    )


def test_tinted_grainy_unevenly_lit_paper_is_taken_away(tmp_path):
    coverage, points = ring()
    rng = np.random.default_rng(3)
    light = np.linspace(1.0, 0.88, SIZE)[None, :, None]
    paper = np.array([0.93, 0.88, 0.76]) * light + rng.normal(0, 0.012, (SIZE, SIZE, 1))
    drawn = coverage[..., None] * np.array([0.15, 0.1, 0.1]) + (1 - coverage[..., None]) * paper
    got, _ = ex.load_exemplar(save(tmp_path / "d.png", drawn), SIZE, SIZE, points)
    away = coverage == 0
    assert (got.alpha[away] > 0.1).mean() < 0.001
    assert np.abs(got.rgb[away] - 1).mean() < 0.005
    assert np.abs(got.mask - coverage).mean() < 0.02
    assert np.abs(got.paper - [0.874, 0.827, 0.714]).max() < 0.03


def test_transparent_paper_keeps_colour_and_opacity_apart(tmp_path):
    coverage, points = ring()
    rgba = np.zeros((SIZE, SIZE, 4), np.uint8)
    rgba[..., 0] = 200
    rgba[..., 3] = coverage * 255
    Image.fromarray(rgba).save(tmp_path / "d.png")
    got, _ = ex.load_exemplar(tmp_path / "d.png", SIZE, SIZE, points)
    assert np.abs(got.alpha - coverage).max() < 0.02
    assert np.abs(got.ink[coverage > 0.9] - [200 / 255, 0, 0]).max() < 0.01


def test_sixteen_bit_grey(tmp_path):
    coverage, points = ring()
    Image.fromarray(((1 - coverage) * 65535).astype(np.uint16)).save(tmp_path / "d.png")
    got, _ = ex.load_exemplar(tmp_path / "d.png", SIZE, SIZE, points)
    assert np.abs(got.mask - coverage).mean() < 0.01


def test_grain_is_closed_and_clean_ink_is_not():
    coverage, _ = ring(width=12)
    rng = np.random.default_rng(0)
    grainy = coverage * (rng.random(coverage.shape) < 0.45)
    mask = ex.stroke_mask(grainy.astype(np.float32))
    # a hole of the grain inside the stroke is stroke; without closing, 55 % would be missing
    assert mask[coverage > 0.99].mean() > 0.9
    assert mask[ring(width=20)[0] == 0].max() == 0
    thin, _ = ring(width=2)
    assert np.abs(ex.stroke_mask(thin) - thin).mean() < 0.003


def test_paper_between_crossing_lines_is_no_grain():
    x, y = np.meshgrid(np.arange(SIZE) + 0.5, np.arange(SIZE) + 0.5)
    apart = np.minimum(np.abs((x - 4) % 8 - 4), np.abs((y - 4) % 8 - 4))
    inside = (np.abs(x - 80) < 50) & (np.abs(y - 80) < 50)
    coverage = (np.clip(2.5 - apart, 0, 1) * inside).astype(np.float32)
    mask = ex.stroke_mask(coverage)
    assert np.abs(mask - coverage)[inside].mean() < 0.03
    # in grainy ink the same lines are closed
    grainy = coverage * (np.random.default_rng(0).random(coverage.shape) < 0.45)
    assert ex.stroke_mask(grainy.astype(np.float32))[coverage > 0.99].mean() > 0.85


def test_thin_lines_of_a_low_resolution_are_no_grain():
    # 1.3 px wide, some of them about paper a few px across: nothing lies deep inside
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    rings = [
        np.abs(np.hypot(x - cx, y - cy) - radius)
        for cx in range(16, SIZE - 8, 24)
        for cy in range(16, SIZE - 8, 24)
        for radius in (3.0, 8.0)
    ]
    coverage = np.clip(1.15 - np.min(rings, axis=0), 0, 1).astype(np.float32)
    mask = ex.stroke_mask(coverage)
    assert mask[coverage == 0].max() == 0
    assert np.abs(mask - coverage).mean() < 0.04
    # the same lines on the tooth of paper are closed
    rng = np.random.default_rng(0)
    grainy = coverage * (rng.random(coverage.shape) < 0.45)
    assert ex.stroke_mask(grainy.astype(np.float32))[coverage > 0.99].mean() > 0.75


def test_any_size_keeps_the_registration(tmp_path):
    coverage, points = ring(width=18, radius=240, centre=(384, 384), shape=(768, 768))
    path = save(tmp_path / "d.png", on_paper(coverage, (0, 0, 0), (1, 1, 1)))
    got, note = ex.load_exemplar(path, SIZE, SIZE, points / 3)
    assert note == ""
    assert np.abs(got.mask - ring()[0]).mean() < 0.01


@pytest.mark.parametrize("shape, centre", [((256, 400), (200, 128)), ((400, 256), (128, 200))])
def test_another_aspect_is_laid_where_ink_meets_curves(tmp_path, shape, centre):
    coverage, _ = ring(centre=centre, shape=shape)
    path = save(tmp_path / "d.png", on_paper(coverage, (0, 0, 0), (1, 1, 1)))
    got, note = ex.load_exemplar(path, SIZE, SIZE, ring()[1])
    assert "cropped" in note
    assert np.abs(got.mask - ring()[0]).mean() < 0.01


def test_a_smaller_sheet_is_padded(tmp_path):
    wide = ring()[0][60:196]  # the artist cropped the sheet: 256 x 136
    flat = ring(radius=60)[0][60:196]
    path = save(tmp_path / "d.png", on_paper(flat, (0, 0, 0), (0.9, 0.9, 0.8)))
    got, note = ex.load_exemplar(path, SIZE, SIZE, ring(radius=60)[1])
    assert "fitted" in note and wide.shape[0] == 136
    assert np.abs(got.mask - ring(radius=60)[0]).mean() < 0.02


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: np.ones((SIZE, SIZE, 3)), "all white"),
        (lambda: np.zeros((SIZE, SIZE, 3)), "all black"),
        (lambda: np.random.default_rng(0).random((SIZE, SIZE, 3)), "a picture rather"),
        (
            lambda: on_paper(ring(centre=(60, 60), radius=30)[0], (0, 0, 0), (1, 1, 1)),
            "% of its ink lies farther",
        ),
    ],
    ids=["white", "black", "noise", "another-drawing"],
)
def test_what_is_no_drawing_of_the_shape_is_refused(tmp_path, make, words):
    path = save(tmp_path / "d.png", make())
    with pytest.raises(ValueError, match=words) as error:
        ex.load_exemplar(path, SIZE, SIZE, ring()[1])
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_agreement_is_measured_both_ways():
    coverage, points = ring()
    drawn = ex.separate(np.dstack([1 - coverage] * 3 + [np.ones_like(coverage)]))
    good = ex.agree(drawn, points)
    assert good.far_ink < 0.01 and good.bare_curve < 0.01
    assert 0.3 < ex.agree(drawn, np.concatenate([points, points * 0.3])).bare_curve < 0.6
