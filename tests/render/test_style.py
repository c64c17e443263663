"""Drawing needs no torch: what it computes is what the network of the fit computes."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch
from small_styles import plain_style

from strokestyle.drawing.raster import rasterise
from strokestyle.extract.pipeline import view_of_lines
from strokestyle.files import read_model, write_model
from strokestyle.geometry.curves import Curves
from strokestyle.geometry.parts import Parts
from strokestyle.render.config import StyleConfig
from strokestyle.render.features import FEATURES, FeatureScaling
from strokestyle.render.networks import AdditiveNet
from strokestyle.render.style import Style, SumOfCurves
from strokestyle.render.style_file import load_style, save_style
from strokestyle.render.texture_bank import TextureBank


def test_a_sum_of_curves_is_the_network_that_was_trained():
    torch.manual_seed(0)
    network = AdditiveNet(5, 8)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter)
    points = np.random.default_rng(0).normal(size=(40, 5))
    ours = SumOfCurves(**{name: value.numpy() for name, value in network.state_dict().items()})
    with torch.no_grad():
        theirs = network(torch.tensor(points, dtype=torch.float32)).numpy()
    np.testing.assert_allclose(ours(points), theirs, atol=2e-5)


def middles(drawing):
    """{part: where the middles of its strokes lie, to 10 px}"""
    found = {}
    for i, (a, b) in enumerate(
        zip(drawing.strokes.offsets[:-1], drawing.strokes.offsets[1:], strict=True)
    ):
        place = drawing.strokes.xy[a:b].mean(axis=0).round(-1).tolist()
        found.setdefault(drawing.parts.name(i), []).append(place)
    return {name: sorted(rows) for name, rows in found.items()}


def test_strokes_keep_the_part_of_the_curves_they_are_made_of():
    """Through joins, corners and changes of scale."""
    t = np.linspace(0, 1, 40)[:, None]
    lines = [
        [20, 20] + t * [60, 0],  # joined with the next
        [84, 20] + t * [90, 0],
        np.concatenate([[20, 60] + t * [80, 0], [100, 61] + t * [0, 80]]),  # cut at its corner
        [150, 60] + t * [0, 120],
        [20, 190] + t * [2, 0],  # too short to be drawn
    ]
    curves = Curves.from_list(lines, [0, 0, 2, 2, 0])
    parts = Parts(("a", "b", "c"), [0, 0, 1, -1, 2])
    view = view_of_lines(curves, 220, 200, parts=parts)
    drawn = plain_style(440).draw(view)  # two of its pixels to one
    assert middles(drawn) == {"a": [[100, 20]], "b": [[60, 60], [100, 100]], "": [[150, 120]]}
    faded = middles(
        plain_style(440, thin_above=True).draw(view)
    )  # strokes that are too thin are left out
    assert {name: [x for x, _ in rows] for name, rows in faded.items()} == {"b": [100], "": [150]}
    whole = plain_style(440).draw(replace(view, parts=None))
    assert whole.parts is None and np.array_equal(whole.strokes.xy, drawn.strokes.xy)


def test_a_stroke_that_runs_from_part_to_part_is_cut_and_looks_as_if_it_were_not():
    curves = Curves.from_list([[20, 20] + np.linspace(0, 1, 40)[:, None] * [150, 0]], [0])
    view = view_of_lines(curves, 768, 200)
    for share, count in ((80, 2), (30, 1)):  # 60 px on the first part, or 10
        drawn = plain_style().draw(
            replace(view, parts=Parts(("a", "b"), view.curves.xy[:, 0] > share))
        )
        assert [drawn.parts.name(i) for i in range(count)] == ["a", "b"][-count:] and len(
            drawn.strokes
        ) == count
        off = np.abs(rasterise(drawn).astype(float) - rasterise(plain_style().draw(view)))
        assert (
            (off > 0).sum() < 20 and off.max() < 100
        )  # round ends lie over each other: at their rims, half covered
    assert drawn.strokes.kind.tolist() == [0]


def test_curves_of_two_parts_may_be_drawn_in_one_go_and_are_two_strokes():
    two = Curves.from_list(
        [[x, 20] + np.linspace(0, 1, 40)[:, None] * [60, 0] for x in (20, 84)], [0, 0]
    )
    for parts, names in (
        (Parts(("a", "b"), [0, 1]), ["a", "b"]),
        (Parts(("a", "b"), [1, 1]), ["b"]),
    ):
        drawn = plain_style().draw(view_of_lines(two, 768, 200, parts=parts))
        assert [drawn.parts.name(i) for i in range(len(drawn.strokes))] == names


def test_a_model_without_a_part_of_its_texture_is_refused(tmp_path):
    count, path = len(FEATURES), tmp_path / "model.pt"
    network = {name: value.numpy() for name, value in AdditiveNet(count, 8).state_dict().items()}
    arrays = {f.name: np.zeros(1, np.float32) for f in fields(TextureBank)}
    bank = TextureBank(**arrays | {"margin": 2.0, "flat": False})
    each = np.zeros(count)
    scaling = FeatureScaling(each, each, each, each)
    style = Style(StyleConfig(), SumOfCurves(**network), np.zeros(8), scaling, bank=bank)
    save_style(path, style)
    assert load_style(path).bank is not None
    stored = read_model(path)
    del stored["texture"]["appearance"]
    write_model(path, stored)
    with pytest.raises(ValueError, match="model.pt.*appearance"):
        load_style(path)
