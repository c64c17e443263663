"""Drawing: the curves of thickness, the parts of strokes, and styles that are refused."""

from dataclasses import asdict, fields, replace

import numpy as np
import pytest
from known_law import level, planned
from scipy import ndimage
from small_styles import plain_style

from strokestyle.drawing.raster import rasterise
from strokestyle.extract.camera import Camera
from strokestyle.extract.feature_maps import FeatureMaps
from strokestyle.extract.pipeline import view_of_lines
from strokestyle.extract.view import View
from strokestyle.files import read_model, write_model
from strokestyle.geometry.curves import KINDS, Curves
from strokestyle.geometry.parts import Parts
from strokestyle.render.config import StyleConfig
from strokestyle.render.displacement import DEFORMATIONS
from strokestyle.render.features import FEATURES, NIB_ANGLES, FeatureScaling
from strokestyle.render.residuals import Residuals
from strokestyle.render.style import Style, SumOfCurves, trim_invisible_ends, without_hairs
from strokestyle.render.style_file import load_style, save_style
from strokestyle.render.texture_bank import OWN_REGRESSORS, TextureBank


def sum_of_curves(count, hidden=8):
    """Curves of `count` features, any."""
    random = np.random.default_rng(0)
    shapes = [(count, hidden)] * 3 + [(count,), ()]
    return SumOfCurves(*(random.normal(size=shape).astype(np.float32) for shape in shapes))


def test_a_sum_of_curves_adds_what_each_feature_says():
    curves, points = sum_of_curves(5), np.random.default_rng(1).normal(size=(40, 5))
    zero = curves(np.zeros((40, 5)))
    parts = [curves(points * (np.arange(5) == k)) - zero for k in range(5)]
    assert curves(points) - zero == pytest.approx(sum(parts), abs=1e-5)
    assert curves(np.zeros((0, 5))).shape == (0,)
    one = SumOfCurves(*(np.full(shape, 0.5) for shape in [(1, 2)] * 3 + [(1,), ()]))
    assert one(np.array([[2.0]])) == pytest.approx([2 * 0.5 * np.tanh(1.5) + 1.0 + 0.5])


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
    arrays = {f.name: np.zeros(1, np.float32) for f in fields(TextureBank)}
    bank = TextureBank(**arrays | {"margin": 2.0, "flat": False})
    each = np.zeros(count)
    scaling = FeatureScaling(each, each, each, each)
    style = Style(StyleConfig(), sum_of_curves(count), np.zeros(8), scaling, bank=bank)
    save_style(path, style)
    assert load_style(path).bank is not None
    stored = read_model(path)
    del stored["texture"]["appearance"]
    write_model(path, stored)
    with pytest.raises(ValueError, match="model.pt.*appearance"):
        load_style(path)


# -------------------------------------------------------------------------- what was learned, drawn


def ring_view(size=768, radius=150.0, kind="contour"):
    """Three quarters of a circle about the middle, with normals that point away from there."""
    middle = size / 2
    count = int(1.5 * np.pi * radius / 3)
    angle = np.linspace(0.1, 0.1 + 1.5 * np.pi, count)
    line = middle + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    y, x = np.mgrid[:size, :size] + 0.5 - middle
    away = np.stack([x, y]) / np.maximum(np.hypot(x, y), 1.0)
    names = ("depth", "n_dot_v", "view_curvature", "normal_x", "normal_y")
    maps = FeatureMaps(names, np.stack([0 * x + 1, 0 * x, 0 * x, *away]), x > -1e9)
    camera = Camera([0, 0, 3], [0, 0, 0], [0, 1, 0], 30, size, size)
    return View(camera, Curves.from_list([line], [KINDS.index(kind)]), maps)


def with_weights(style, **weights):
    return replace(style, displacement=np.array([weights.get(n, 0.0) for n in DEFORMATIONS]))


def test_what_was_learned_of_displacement_is_done():
    """A circle is inflated outwards, and smoothed inwards by what a Gaussian takes from it."""
    view, plain = ring_view(), plain_style()
    for weights, change in (
        ({}, 0.0),
        ({"inflate": 4.0}, 4.0 * np.exp(-0.5 * (12 / 150) ** 2)),
        ({"smooth_24": 2.0}, 2 * 150 * (np.exp(-0.5 * (24 / 150) ** 2) - 1)),
        ({"smooth_12": -1.0, "inflate": -2.0}, 150 * (1 - np.exp(-0.5 * 0.08**2)) - 2 * 0.9968),
    ):
        strokes = with_weights(plain, **weights).draw(view).strokes
        radius = np.hypot(*(strokes.xy - 384).T)[50:-50]
        assert radius == pytest.approx(np.full(len(radius), 150 + change), abs=0.05)


def test_what_was_learned_of_thickness_is_drawn_where_its_feature_is():
    """log(thickness + 0.5) is linear in the height on the picture: from 4 px to 12 px."""
    view = view_of_lines(Curves.from_list([np.linspace([384, 84], [384, 684], 201)], [0]), 768, 768)
    plain = plain_style()
    line = np.where(np.array(FEATURES) == "height", np.log(12.5 / 4.5), 0.0)
    curves = replace(plain.log_width, line=line, base=np.array(np.log(4.5), np.float32))
    strokes = replace(plain, log_width=curves).draw(view).strokes
    height = np.clip((strokes.xy[:, 1] - 84) / 600, 0, 1)
    assert strokes.thickness == pytest.approx(4.5 * (12.5 / 4.5) ** height - 0.5, abs=1e-4)


def test_features_are_scaled_as_they_were_in_training():
    """A height is cut to 0.25 to 0.75, and told from 0.5 in units of 0.25."""
    view = view_of_lines(Curves.from_list([np.linspace([384, 84], [384, 684], 201)], [0]), 768, 768)
    plain, height = plain_style(), np.array(FEATURES) == "height"
    low, high = np.where(height, 0.25, -9.0), np.where(height, 0.75, 9.0)
    scaling = FeatureScaling(low, high, np.where(height, 0.5, 0.0), np.where(height, 0.25, 1.0))
    curves = replace(plain.log_width, line=0.3 * height)
    laid = replace(plain, log_width=curves, scaling=scaling).lay_strokes(view)
    share = np.clip((laid.strokes.xy[:, 1] - 84) / 600, 0.25, 0.75)
    assert laid.features[:, height][:, 0] == pytest.approx((share - 0.5) / 0.25)
    wanted = np.exp(1.5 + 0.3 * (share - 0.5) / 0.25) - 0.5
    assert laid.strokes.thickness == pytest.approx(wanted, abs=1e-4)


def test_features_are_those_of_the_points_that_are_left():
    """The upper part of a line is too thin to see."""
    view = view_of_lines(Curves.from_list([np.linspace([384, 84], [384, 684], 201)], [0]), 768, 768)
    laid = plain_style(thin_above=True).lay_strokes(view)
    xy, height = laid.strokes.xy, laid.features[:, FEATURES.index("height")]
    assert xy[0, 1] > 200 and laid.features.shape == (len(xy), len(FEATURES))
    assert height == pytest.approx(np.clip((xy[:, 1] - 84) / 600, 0, 1))


def some_residuals():
    values = np.random.default_rng(1).normal(size=(90, 2)) * [1, 0.1]
    return Residuals(values.astype(np.float32), np.array([0, 90]))


def grain_bank():
    """Two strips of noise, ready to be copied."""
    rng = np.random.default_rng(0)
    rgba = np.zeros((400, 20, 4), np.uint8)
    grain = ndimage.gaussian_filter(rng.normal(size=(400, 20)), 1.5)
    rgba[..., 3] = np.clip(128 + 240 * grain, 0, 255)
    ink = np.tile([0.5, 0.0, 0.0, 0.0], (400, 1)).astype(np.float32)
    ends = np.minimum(np.stack([np.arange(400) % 200, 199 - np.arange(400) % 200], 1) / 2, 40)
    count = len(FEATURES) + OWN_REGRESSORS
    weights = np.zeros((1 + 2 * count, 4), np.float32)
    weights[0, 0] = 0.5
    return TextureBank(
        rgba=rgba,
        offsets=np.array([0, 200, 400]),
        width=np.full(400, 4.0, np.float32),
        ends=ends.astype(np.float32),
        occlusion=np.zeros(400, np.float32),
        appearance=rng.normal(size=(400, 8)).astype(np.float32),
        local_ink=ink,
        predicted_ink=ink,
        weights=weights,
        scale=np.stack([np.zeros(count), np.ones(count)]).astype(np.float32),
        noise=np.full(4, 0.1, np.float32),
        margin=2.5,
        flat=False,
    )


def test_a_view_twice_as_large_is_drawn_twice_as_large():
    """Residuals, displacement and texture with it: strips are the same, their margin is doubled."""
    residuals = some_residuals()
    style = with_weights(plain_style(), inflate=4.0, smooth_12=1.0)
    style = replace(style, residuals=residuals, bank=grain_bank())
    view = ring_view()
    curves = replace(view.curves, xy=2 * view.curves.xy)
    maps = replace(view.maps, values=view.maps.values.repeat(2, 1).repeat(2, 2),
                   covered=view.maps.covered.repeat(2, 0).repeat(2, 1))  # fmt: skip
    large = View(replace(view.camera, width=1536, height=1536), curves, maps)
    one, two = style.draw(view, 3), style.draw(large, 3)
    assert two.size == (1536, 1536) and len(one.strokes) == 1
    assert two.strokes.xy == pytest.approx(2 * one.strokes.xy, abs=1e-6)
    assert two.strokes.thickness == pytest.approx(2 * one.strokes.thickness, abs=1e-6)
    assert one.texture.margin.tolist() == [2.5] and two.texture.margin.tolist() == [5.0]
    assert (one.texture.rgba != two.texture.rgba).mean() < 0.01
    assert np.array_equal(one.texture.offsets, two.texture.offsets)
    assert np.allclose(one.color, two.color)
    laid = style.lay_strokes(large, 3).strokes
    assert laid.xy == pytest.approx(one.strokes.xy, abs=1e-6)  # in the style's own pixels


def test_the_seed_decides_residuals_and_joints():
    residuals = some_residuals()
    style, view = replace(plain_style(), bank=grain_bank()), ring_view()
    one, same, other = (style.draw(view, seed) for seed in (1, 1, 2))
    assert np.array_equal(one.texture.rgba, same.texture.rgba)
    assert not np.array_equal(one.texture.rgba, other.texture.rgba)
    assert np.array_equal(one.strokes.xy, other.strokes.xy)  # no residuals: nothing else is chance
    strayed = [replace(style, residuals=residuals).draw(view, seed).strokes.xy for seed in (1, 2)]
    assert not np.array_equal(*strayed)


# ------------------------------------------------------------------------------------- trimmed ends


def test_ends_are_trimmed_to_one_point_beside_what_is_seen():
    thickness = np.array([0.1, 0.2, 0.6, 3, 0.3, 2, 0.4, 0.1, 0.1])
    rows, offsets, kept = trim_invisible_ends(thickness, np.array([0, 9]))
    assert rows.tolist() == [1, 2, 3, 4, 5, 6] and offsets.tolist() == [0, 6]
    assert kept.tolist() == [0]


def test_strokes_that_cannot_be_seen_are_left_out_whole():
    thickness = np.r_[np.zeros(4), [0.5, 0.5], [9.0, 0.1, 0.1], [0.1, 1.0, 1.0, 1.0]]
    rows, offsets, kept = trim_invisible_ends(thickness, np.array([0, 4, 6, 9, 13]))
    assert rows.tolist() == [4, 5, 9, 10, 11, 12] and offsets.tolist() == [0, 2, 6]
    assert kept.tolist() == [1, 3]
    rows, offsets, kept = trim_invisible_ends(np.zeros(5), np.array([0, 5]))
    assert rows.tolist() == [] and offsets.tolist() == [0] and kept.tolist() == []


# -------------------------------------------------------------------------------------- model files


def full_style():
    residuals = some_residuals()
    config = StyleConfig(512, 2.0, 8.0, 70.0, 20.0, 8)
    scaling = FeatureScaling(*np.random.default_rng(2).uniform(1, 2, (4, len(FEATURES))))
    style = replace(
        with_weights(plain_style(), inflate=4.0), config=config, scaling=scaling,
        residuals=residuals, bank=grain_bank(), color=np.array([0.1, 0.2, 0.3, 0.9]),
        about={"seed": 3},
    )  # fmt: skip
    return style


def same_style(one, two):
    """Whether all that two styles hold is the same."""

    def same(a, b):
        if isinstance(a, dict):
            return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
        return np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b

    return same(asdict(one), asdict(two))


def test_a_style_is_stored_whole(tmp_path):
    style = full_style()
    save_style(tmp_path / "a.pt", style)
    assert same_style(load_style(tmp_path / "a.pt"), style)
    assert read_model(tmp_path / "a.pt")["format"] == 4
    save_style(tmp_path / "b.pt", plain_style())
    found = load_style(tmp_path / "b.pt")
    assert found.residuals is None and found.bank is None


def test_a_model_of_format_3_draws_what_it_drew_without_the_features_that_came_later(tmp_path):
    """As one that knows them and gives them no weight."""
    style, later = plain_style(thin_above=True), len(NIB_ANGLES)
    line = np.random.default_rng(3).normal(0, 0.3, len(FEATURES))
    line[-later:] = 0.0
    style = replace(style, log_width=replace(style.log_width, base=np.array(1.5), line=line))
    save_style(tmp_path / "new.pt", style)
    old = read_model(tmp_path / "new.pt") | {"format": 3}
    for part in ("log_width", "features"):
        old[part] = {k: v[:-later] if np.size(v) > 1 else v for k, v in old[part].items()}
    write_model(tmp_path / "old.pt", old)
    drawn = load_style(tmp_path / "old.pt").draw(ring_view()).strokes
    expected = style.draw(ring_view()).strokes
    assert np.array_equal(drawn.xy, expected.xy)
    assert drawn.thickness == pytest.approx(expected.thickness, rel=1e-6)
    save_style(tmp_path / "again.pt", load_style(tmp_path / "old.pt"))
    assert load_style(tmp_path / "again.pt").scaling.names == FEATURES[:-later]
    old["features"]["names"] = [*FEATURES[: -later - 1], "mood"]
    write_model(tmp_path / "strange.pt", old)
    with pytest.raises(ValueError, match=r"strange.pt: a damaged .*features"):
        load_style(tmp_path / "strange.pt")


def in_format_2(style):
    """What strokestyle 0.1 wrote of a style."""
    bank, scaling, config = style.bank, style.scaling, style.config
    return {
        "format": 2,
        "strokestyle": "0.1.0",
        "about": style.about,
        "config": {
            "size": config.size,
            "spacing": config.spacing,
            "join": config.join_gap,
            "corner": config.corner_angle,
            "extend": config.max_overshoot,
            "hidden": config.hidden_units,
        },
        "network": asdict(style.log_width),
        "moves": style.displacement,
        "features": {
            "names": list(FEATURES),
            "centre": scaling.centre,
            "spread": scaling.spread,
            "low": scaling.low,
            "high": scaling.high,
            "color": style.color,
        },
        "hand": {"stray": style.residuals.values, "offsets": style.residuals.offsets},
        "texture": {
            "rgba": bank.rgba,
            "offsets": bank.offsets,
            "row": np.concatenate(
                [bank.width[:, None], bank.ends, bank.occlusion[:, None]], axis=1
            ),
            "look": bank.appearance,
            "tone": bank.local_ink,
            "fitted": bank.predicted_ink,
            "weights": bank.weights,
            "scale": bank.scale,
            "noise": bank.noise,
            "margin": np.array([bank.margin], np.float32),
            "flat": np.array([bank.flat], np.float32),
        },
    }


def test_a_model_of_format_2_is_read(tmp_path):
    style = full_style()
    write_model(tmp_path / "old.pt", in_format_2(style))
    found = load_style(tmp_path / "old.pt")
    assert same_style(found, style)
    assert type(found.bank.margin) is float and type(found.bank.flat) is bool
    plain = in_format_2(style) | {"hand": None, "texture": None}
    write_model(tmp_path / "plain.pt", plain)
    found = load_style(tmp_path / "plain.pt")
    assert found.residuals is None and found.bank is None


def test_a_model_of_another_version_is_refused_by_name(tmp_path):
    write_model(tmp_path / "new.pt", in_format_2(full_style()) | {"format": 5})
    with pytest.raises(ValueError, match=r"new.pt: .*format 5.*update strokestyle"):
        load_style(tmp_path / "new.pt")
    broken = in_format_2(full_style())
    del broken["hand"]
    write_model(tmp_path / "broken.pt", broken)
    with pytest.raises(ValueError, match=r"broken.pt: a damaged strokestyle model.*hand"):
        load_style(tmp_path / "broken.pt")


def test_what_overshoots_as_a_hair_is_left_out():
    """A thickness of 0.8 px past the end of a thick stroke is none; of a thin one it is its own."""
    strokes = planned(level(40, 30, 90), level(80, 30, 90), past=2)
    thick = np.where(strokes.on_curve, 10.0, 0.8)
    thick[strokes.offsets[1] :] = np.where(strokes.on_curve, 2.0, 0.8)[strokes.offsets[1] :]
    left = without_hairs(thick, strokes)
    first = np.arange(len(left)) < strokes.offsets[1]
    assert (left[first & ~strokes.on_curve] == 0).all() and (left[~first] == thick[~first]).all()
    assert (left[strokes.on_curve] == thick[strokes.on_curve]).all()
