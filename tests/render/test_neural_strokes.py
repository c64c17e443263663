"""The paper's preset: patches, losses in closed form, a few steps from drawing to model file."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from small_views import SIZE, TINY, a_drawing, a_view

from strokestyle.drawing.strokes import Strokes
from strokestyle.extract.feature_maps import FeatureMaps
from strokestyle.fit.losses import blur, holds_stroke, lsgan_loss, smoothness_loss
from strokestyle.fit.neural_strokes import falling_rate
from strokestyle.fit.patches import crop, cut_curves, patch_corners, turned_patches
from strokestyle.fit.train import PRESETS, fit_style
from strokestyle.geometry.curves import Curves
from strokestyle.geometry.parts import Parts
from strokestyle.render.neural_strokes import (
    NeuralStrokesStyle,
    curve_features,
    look_up,
    outside_white,
)
from strokestyle.render.style_file import load_style, save_style


def test_the_schedule_is_the_papers():
    paper = PRESETS["paper"]
    assert (paper.geometry_steps, paper.texture_steps) == (45_000, 62_500)
    assert (paper.patches, paper.batch, paper.rate, paper.smoothness) == (
        (64, 128, 192, 256),
        16,
        2e-4,
        0.02,
    )


def test_the_rate_is_constant_then_falls_to_zero():
    weight = torch.nn.Parameter(torch.zeros(1))
    optimiser = torch.optim.SGD([weight], 1.0)
    steps, schedule = falling_rate(optimiser, 90, 30, 1.0)
    rates = []
    for _ in range(steps):
        rates.append(optimiser.param_groups[0]["lr"])
        optimiser.step()
        schedule.step()
    assert (
        rates[:60] == [1.0] * 60
        and rates[61] < 1
        and np.isclose(rates[75], 0.5)
        and 0 < rates[-1] < 0.05
    )


def test_curves_are_cut_at_the_border_of_patches():
    xy = np.array([[1.0, 1], [3, 1], [5, 1], [7, 1], [3, 3], [5, 3], [9, 9]])
    curve = np.array([0, 0, 0, 0, 1, 1, 1])
    rows, offsets, image = cut_curves(xy, curve, np.array([[2, 0], [0, 0], [50, 50]]), 4)
    # patch 0 sees points 1, 2 of curve 0 and 4, 5 of curve 1; patch 1 sees 0, 1 and (alone, left
    # out) 4
    assert rows.tolist() == [1, 2, 4, 5, 0, 1]
    assert offsets.tolist() == [0, 2, 4, 6] and image.tolist() == [0, 0, 0, 0, 1, 1]
    rows, offsets, image = cut_curves(xy, curve, np.array([[50, 50]]), 4)
    assert len(rows) == 0 and offsets.tolist() == [0]


def test_patches_hold_a_stroke_in_their_centre():
    view = a_view()
    corners = patch_corners(view, 64)
    line = view.maps["plain"] > 0.5
    inner = [line[y + 17 : y + 47, x + 17 : x + 47].any() for x, y in corners[::50]]
    assert len(corners) and all(inner)
    empty = replace(
        view, maps=FeatureMaps(view.maps.names, np.zeros_like(view.maps.values), view.maps.covered)
    )
    with pytest.raises(ValueError, match="nothing to learn from"):
        patch_corners(empty, 64)


def test_turning_by_nothing_is_a_crop_and_beyond_the_canvas_is_background():
    image = torch.rand(1, 3, 40, 50)
    at = np.array([[5, 7], [20, 10]])
    assert torch.allclose(
        turned_patches(image, at, 16, np.zeros(2)), crop(image[0], at, 16), atol=1e-5
    )
    quarter = turned_patches(image, at, 16, np.full(2, np.pi / 2))
    assert torch.allclose(quarter[0], torch.rot90(image[0, :, 7:23, 5:21], 1, (1, 2)), atol=1e-4)
    assert torch.allclose(
        turned_patches(image, np.array([[-100, -100]]), 16, np.zeros(1)),
        torch.ones(1, 3, 16, 16),
    )


def test_smoothness_in_closed_form():
    d = torch.tensor([[0.0, 0], [1, 0], [3, 0], [0, 0], [0, 2]])
    # path 1: (1 + 4) / 2; path 2: 4 / 1; the step between the paths does not count
    assert torch.isclose(smoothness_loss(d, torch.tensor([0, 3, 5])), torch.tensor((2.5 + 4) / 2))


def test_only_patches_with_stroke_in_the_centre_are_judged():
    white = torch.ones(2, 64, 64)
    white[0, 32, 32] = 0
    white[1, 2, 2] = 0
    assert holds_stroke(white).tolist() == [1, 0]
    verdict = torch.tensor([0.0, 100.0]).view(2, 1, 1, 1)
    assert lsgan_loss(verdict, 1.0, torch.tensor([1.0, 0.0])) == 1.0
    assert lsgan_loss(verdict, 1.0, torch.zeros(2)) == 0.0


def test_a_blur_keeps_the_mean_of_a_flat_image():
    assert torch.allclose(blur(torch.full((1, 3, 20, 20), 0.3)), torch.full((1, 3, 20, 20), 0.3))


def test_a_few_steps_from_drawing_to_file_and_back(tmp_path):
    view = a_view()
    seen = []
    styles = [
        fit_style(view, a_drawing(view), TINY, seed=4, device="cpu", progress=seen.append)
        for _ in range(2)
    ]
    assert isinstance(styles[0], NeuralStrokesStyle)
    assert {event.stage for event in seen} == {"geometry", "texture"}
    for i, style in enumerate(styles):
        save_style(tmp_path / f"{i}.pt", style)
    assert (tmp_path / "0.pt").read_bytes() == (tmp_path / "1.pt").read_bytes()
    drawing, again = styles[0].draw(view), load_style(tmp_path / "0.pt").draw(view)
    assert len(drawing.strokes) == 2
    assert np.array_equal(drawing.strokes.xy, again.strokes.xy)
    assert np.array_equal(drawing.texture.rgba, again.texture.rgba)
    other = fit_style(view, a_drawing(view), TINY, seed=5, device="cpu").draw(view)
    assert not np.array_equal(drawing.strokes.xy, other.strokes.xy)
    named = styles[0].draw(replace(view, parts=Parts(("a", "b"), np.repeat([1, 0], 26))))
    assert drawing.parts is None and [named.parts.name(i) for i in (0, 1)] == ["b", "a"]
    halves = styles[0].draw(
        replace(view, parts=Parts(("a", "b"), np.repeat([1, 0, 1], [13, 13, 26])))
    )
    assert [halves.parts.name(i) for i in range(3)] == ["b", "a", "b"] and len(halves.strokes) == 3


def test_geometry_learns_the_thickness():
    """60 short steps on a drawing of 9 px strokes bring the strokes from a hair to most of that."""
    view = a_view()
    config = replace(TINY, geometry_steps=60, geometry_decay=10, texture_steps=1, rate=4e-3)
    drawing = fit_style(view, a_drawing(view, 9.0), config, seed=0, device="cpu").draw(view)
    assert 5 < np.median(drawing.strokes.thickness) < 13


def test_an_empty_view_is_an_empty_drawing():
    view = a_view()
    style = fit_style(view, a_drawing(view), TINY, device="cpu")
    assert len(style.draw(replace(view, curves=Curves.empty())).strokes) == 0


def test_features_turn_with_the_curve():
    f = curve_features(a_view())
    assert f.shape == (52, 7)
    assert torch.allclose(f[26:, 2:4], torch.tensor([1.0, 0.0])) and torch.allclose(
        f[26:, 4:6], torch.tensor([0.0, 1.0])
    )
    assert torch.allclose(f[26:, 6], torch.linspace(0, 1, 26))


def test_texture_looked_up_on_white_gives_the_image_back():
    view = a_view()
    c = view.curves
    strokes = Strokes(c.xy, np.full(len(c.xy), 8.0), c.offsets, c.kind, c.closed)
    image = np.ones((SIZE, SIZE, 3), np.float32)
    image[60:80] = [0.2, 0.4, 0.6]
    texture, color = look_up(strokes, image)
    rgba = texture.rgba[texture.offsets[1] :].astype(float) / 255
    middle = rgba[20:-20, 10:14]
    on_white = middle[..., :3] * middle[..., 3:] + 1 - middle[..., 3:]
    assert np.abs(on_white - [0.2, 0.4, 0.6]).max() < 0.01
    assert texture.rgba[: texture.offsets[1], :, 3].max() == 0 and color[0, 3] == 0


def test_colours_beyond_the_grown_mask_are_white():
    mask = np.ones((9, 9))
    mask[4, 4] = 0
    got = outside_white(np.zeros((9, 9, 3)), mask)
    assert (got[2:7, 2:7] == 0).all() and got.sum() == 3 * (81 - 25)
