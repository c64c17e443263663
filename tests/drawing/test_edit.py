"""Edits of drawings: what moves and what stays, and the texture on it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from svg_programs import small, with_parts

from strokestyle.drawing import edit as edits
from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strip import wider
from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.geometry.curves import KINDS, arc_length
from strokestyle.geometry.parts import Parts
from strokestyle.svg.read import read_svg_file
from strokestyle.svg.write import write_svg

CONTOUR = KINDS.index("contour")


def straight(texture=True, length=90.0, width=8.0):
    """A level stroke whose texture is dark on its first third only, with 1 px of soft edge."""
    x = np.linspace(0, length, 31)
    strokes = Strokes(
        np.stack([15 + x, 0 * x + 40], axis=1), np.full(31, width), [0, 31], [0], [False]
    )
    strips = None
    if texture:
        rgba = np.zeros((200, 40, 4), np.uint8)
        v = np.abs((2 * np.arange(40) + 1) / 40 - 1) * (width / 2 + 2)
        rgba[:, v < width / 2, 3] = 100
        rgba[:67, v < width / 2, 3] = 250
        strips = Texture(rgba, [0, 200], 2.0)
    return Drawing(strokes, (120, 80), np.array([[0.0, 0, 0, 1]]), strips)


def ink(drawing):
    return rasterise(drawing, 2.0)[..., 3].astype(float) / 255


def points(drawing, i):
    return drawing.strokes.xy[drawing.strokes.offsets[i] : drawing.strokes.offsets[i + 1]]


EDITS = [
    lambda d, only: edits.thicken(d, 1.7, only),
    lambda d, only: edits.wiggle(d, 3, 20, 0, only),
    lambda d, only: edits.smooth(d, 5, only),
    lambda d, only: edits.simplify(d, 2, only),
    lambda d, only: edits.taper(d, 15, only),
    lambda d, only: edits.recolor(d, (1, 0, 0), only),
]


@pytest.mark.parametrize("texture", [None, "grain", "colours"])
@pytest.mark.parametrize("edit", EDITS)
def test_only_the_strokes_that_are_meant_change(edit, texture):
    drawing = small(texture)
    only = drawing.strokes.kind == CONTOUR
    changed = edit(drawing, only)
    for i in range(5):
        a, b = edits.keep(drawing, [i]), edits.keep(changed, [i])
        same = [
            np.array_equal(getattr(a.strokes, n), getattr(b.strokes, n))
            for n in ("xy", "thickness")
        ]
        same.append(np.array_equal(a.color, b.color))
        if texture:
            strip = wider(
                a.texture.rgba, b.texture.rgba.shape[1]
            )  # thicker strokes want more texels across
            same.append(np.array_equal(strip, b.texture.rgba))
        assert all(same) == (not only[i])
    assert np.array_equal(changed.strokes.closed, drawing.strokes.closed)
    ring = points(changed, 4)
    assert np.array_equal(ring[0], ring[-1])


@pytest.mark.parametrize(
    "encoding, texture", [("vector", "grain"), ("image", "colours"), ("none", None)]
)
def test_strokes_that_are_not_meant_are_written_as_they_were(encoding, texture):
    def by_id(text):
        strokes = text.split(' id="s0')[1:]
        return {stroke[:2]: re.split("</g>\n?</g>|\n<g id=", stroke)[0] for stroke in strokes}

    text = write_svg(small(texture), texture=encoding)
    file = read_svg_file(text)
    only = file.drawing.strokes.kind == KINDS.index("contour")
    edited = edits.thicken(file.drawing, 2.5, only)  # its strips need more texels across
    again = by_id(write_svg(edited, file.options, ids=file.ids, kept=file.kept))
    same = [again[name] == stroke for name, stroke in by_id(text).items()]
    assert sum(same) == (~only).sum() and 0 < sum(same) < len(same)


def test_strips_of_one_column_are_edited_too():
    drawing = small("grain")
    texture = replace(drawing.texture, rgba=drawing.texture.rgba[:, 8:9])
    only = drawing.strokes.kind == CONTOUR
    thick = edits.thicken(replace(drawing, texture=texture), 3.0, only).texture
    assert thick.rgba.shape[1] == 3  # a strip that is not meant has its column three times
    still = int(np.flatnonzero(~only)[0])
    assert np.array_equal(thick.strip(still), np.repeat(texture.strip(still), 3, axis=1))


def test_nothing_is_an_edit_that_changes_nothing():
    drawing = small("grain")
    for same in (
        edits.thicken(drawing, 1), edits.wiggle(drawing, 0, 9), edits.smooth(drawing, 0),
        edits.simplify(drawing, 0),
        edits.taper(drawing, 0), edits.move(drawing, 0, 0.5, (0, 0)),
    ):  # fmt: skip
        assert same is drawing


@pytest.mark.parametrize(
    "edit, found",
    [
        (lambda d: edits.thicken(d, -1), "factor must lie between 0 and 1000, got -1"),
        (lambda d: edits.wiggle(d, -1, 9), "amplitude must lie between 0 and 10000, got -1"),
        (lambda d: edits.wiggle(d, 1, 0), "wavelength must lie between 0.5 and 100000, got 0"),
        (lambda d: edits.smooth(d, np.nan), "sigma must lie between 0 and 10000, got nan"),
        (lambda d: edits.simplify(d, -2), "tolerance must lie between 0 and 10000, got -2"),
        (lambda d: edits.taper(d, -3), "length must lie between 0 and 100000, got -3"),
        (lambda d: edits.move(d, 5, 0.5, (1, 0)), "there is no stroke 5; the drawing has 5"),
        (lambda d: edits.move(d, 0, 2, (1, 0)), "point must lie between 0 and 1, got 2"),
        (lambda d: edits.move(d, 0, 0, (1, np.inf)), "by must lie between"),
    ],
)
def test_a_bad_number_is_refused_by_the_name_of_its_argument(edit, found):
    with pytest.raises(ValueError) as error:
        edit(small(None))
    assert str(error.value).startswith(found) and "--" not in str(error.value)


@pytest.mark.parametrize("factor", [0.5, 1.5, 3.0])
def test_thicker_ink_is_thicker_by_as_much_and_its_edge_as_soft(factor):
    drawing = straight()
    thick = edits.thicken(drawing, factor)
    assert thick.strokes.thickness == pytest.approx(factor * drawing.strokes.thickness)
    columns = [ink(d)[:, 60:80].mean(axis=1) for d in (drawing, thick)]  # the dark third
    widths = [c.sum() / c.max() / 2 for c in columns]
    assert widths[0] == pytest.approx(8, abs=0.4) and widths[1] == pytest.approx(
        8 * factor, rel=0.08
    )
    light = ink(thick)[80, 150:180].mean()
    assert light == pytest.approx(100 / 255, abs=0.05)  # tone stays where it was


def test_grain_is_not_stretched():
    drawing = straight()
    rng = np.random.default_rng(0)
    rgba = drawing.texture.rgba.copy()
    rgba[..., 3] = (
        255 * (rng.random((100, 20)).repeat(2, 0).repeat(2, 1) < 0.5) * (rgba[..., 3] > 0)
    )
    grain = replace(drawing, texture=replace(drawing.texture, rgba=rgba))
    thick = edits.thicken(grain, 3)

    def run(d):  # px between changes of colour, across
        a = ink(d)[:, 60:200] > 0.5
        inside = a[a.any(axis=1)]
        return inside.size / max((inside[1:] != inside[:-1]).sum(), 1) / 2

    assert run(thick) < 2.2 * run(grain)  # and not three times as long
    assert ink(thick)[70:90, 60:200].mean() == pytest.approx(
        ink(grain)[74:86, 60:200].mean(), abs=0.08
    )


def test_wiggle_strays_by_its_amplitude_and_keeps_ends_and_seed():
    drawing = straight(length=600.0)
    wild = edits.wiggle(drawing, 4.0, 30.0, seed=1)
    y = points(wild, 0)[:, 1] - 40
    assert np.array_equal(points(wild, 0)[[0, -1]], points(drawing, 0)[[0, -1]])
    assert 2.4 < np.abs(y).max() <= 4.0
    crossings = (np.sign(y[:-1]) * np.sign(y[1:]) < 0).sum()
    assert 600 / 30 * 2 * 0.7 < crossings < 600 / 30 * 2 * 1.3
    assert np.array_equal(edits.wiggle(drawing, 4.0, 30.0, seed=1).strokes.xy, wild.strokes.xy)
    assert not np.array_equal(edits.wiggle(drawing, 4.0, 30.0, seed=2).strokes.xy, wild.strokes.xy)


def test_smoothing_takes_wiggles_out_and_keeps_the_ends():
    wild = edits.wiggle(straight(length=600.0), 4.0, 20.0)
    calm = edits.smooth(wild, 20.0)
    assert np.abs(points(calm, 0)[:, 1] - 40).max() < 0.8
    assert points(calm, 0)[[0, -1]] == pytest.approx(points(wild, 0)[[0, -1]])
    ring = small(None)
    shrunk = edits.smooth(ring, 6.0)
    assert np.ptp(points(shrunk, 4), axis=0).max() < np.ptp(points(ring, 4), axis=0).max()


def test_simplified_lines_stay_near_and_smooth():
    drawing = edits.wiggle(straight(length=400.0), 1.0, 25.0)
    simple = edits.simplify(drawing, 3.0)
    assert np.abs(points(simple, 0)[:, 1] - 40).max() < 3.0
    corner = Strokes([[10, 10], [50, 10], [50, 50]], [3, 3, 3], [0, 3], [0], [False])
    kept = edits.simplify(Drawing(corner, (60, 60), np.array([[0, 0, 0, 1.0]])), 1.0)
    assert np.abs(kept.strokes.xy - [50, 10]).sum(axis=1).min() < 1e-9  # corners stay corners
    assert (
        np.minimum(np.abs(kept.strokes.xy[:, 1] - 10), np.abs(kept.strokes.xy[:, 0] - 50)).max()
        < 1e-6
    )


def test_a_moved_point_takes_its_neighbours_and_its_texture_along():
    drawing = straight(length=90.0)
    moved = edits.move(drawing, 0, 0.5, (0, 20))
    xy = points(moved, 0)
    s = arc_length(points(edits.move(drawing, 0, 0.5, (0, 1e-9)), 0), np.array([0, len(xy)]))
    assert xy[np.abs(s - 45).argmin()] == pytest.approx([60, 60], abs=0.2)
    assert xy[[0, -1]] == pytest.approx(points(drawing, 0)[[0, -1]])
    assert (np.diff(xy[s < 44][:, 1]) >= -1e-9).all() and (np.diff(xy[s > 46][:, 1]) <= 1e-9).all()
    # dark to the point at a third of the stroke, which lies lower now
    dark = ink(moved) > 0.7
    assert np.flatnonzero(dark.any(axis=0)).max() / 2 == pytest.approx(15 + 30, abs=2.5)
    ring = edits.move(small(None), 4, 0.0, (10, 0))
    assert np.array_equal(points(ring, 4)[0], points(ring, 4)[-1]) and points(ring, 4)[
        0
    ] == pytest.approx([104, 45])


def test_tapers_end_in_nothing_and_leave_rings_alone():
    drawing = edits.taper(straight(texture=False), 20.0)
    assert (
        drawing.strokes.thickness[[0, -1]] == pytest.approx(0)
        and drawing.strokes.thickness.max() == 8
    )
    inked = ink(edits.taper(straight(), 30.0)).sum(axis=0)
    assert inked[32] < 0.35 * inked[60] and inked[200] < 0.45 * inked[150]
    ring = small(None)
    assert np.array_equal(points(edits.taper(ring, 20.0), 4), points(ring, 4))


def test_recolouring_keeps_opacity_and_variation():
    plain = edits.recolor(small("grain"), (0.8, 0.2, 0.1))
    assert (plain.texture.rgba[..., :3] == [204, 51, 26]).all()
    assert np.array_equal(plain.texture.rgba[..., 3], small("grain").texture.rgba[..., 3])
    assert plain.color[0] == pytest.approx([0.8, 0.2, 0.1, 0.8])
    colours = edits.recolor(small("colours"), (0.5, 0.5, 0.5)).texture.rgba
    assert colours[..., 0].std() > 30 and colours[..., 0][
        colours[..., 3] > 0
    ].mean() == pytest.approx(128, abs=6)


def test_one_colour_and_the_other_again_are_the_colours_that_were():
    drawing = edits.recolor(small("colours"), (0.45, 0.5, 0.5))
    was = edits.recolor(drawing, (0.45, 0.5, 0.5)).texture.rgba.astype(int)
    back = edits.recolor(edits.recolor(drawing, (0.5, 0.4, 0.6)), (0.45, 0.5, 0.5))
    away = np.abs(back.texture.rgba - drawing.texture.rgba.astype(int))
    assert np.abs(was - drawing.texture.rgba).max() == 0
    assert away.max() <= 13 and (away > 0).mean() < 0.1  # but for what left the range of colours


def test_the_ink_is_the_mean_colour_where_the_stroke_is_told_to_have_quite_another():
    drawing = small("colours")
    stale = replace(drawing, color=drawing.color * [0, 0, 0, 1] + [0, 1, 0, 0])
    assert np.array_equal(
        edits.recolor(stale, (0.5, 0.4, 0.6)).texture.rgba,
        edits.recolor(
            replace(stale, color=stale.color[:, [1, 2, 0, 3]]), (0.5, 0.4, 0.6)
        ).texture.rgba,
    )


def test_texture_of_a_copy_edited_by_nothing_is_nearly_the_same():
    drawing = small("grain")
    almost = edits.thicken(drawing, 1.0000001)
    assert np.abs(almost.texture.rgba.astype(int) - drawing.texture.rgba)[..., 3].mean() < 3.0


@pytest.mark.parametrize("edit", EDITS)
def test_degenerate_strokes_come_through(edit):
    xy = np.array(
        [[5, 5], [5, 5], [9, 9], [20, 9], [9, 9], [9, 9.5], [9, 9], [1, 1], [1, 2]], float
    )
    strokes = Strokes(
        xy,
        [0, 0, 0, 9, 0, 1, 0, 1e-9, 0],
        [0, 2, 4, 7, 9],
        [0, 1, 2, 3],
        [False, False, True, False],
    )
    strip = Texture(np.full((40, 6, 4), 200, np.uint8), [0, 10, 20, 30, 40], 1.0)
    for texture in (None, strip):
        made = edit(Drawing(strokes, (30, 30), np.full((4, 4), 0.5), texture), None)
        assert np.isfinite(made.strokes.xy).all() and len(made.strokes) == 4
        assert np.isfinite(rasterise(made)).all()
    nothing = Drawing(Strokes(np.zeros((0, 2)), [], [0], [], []), (1, 1), np.zeros((0, 4)))
    assert not len(edit(nothing, None).strokes)


@pytest.mark.parametrize("texture", [None, "grain", "colours"])
def test_strokes_are_cut_at_parts_and_nothing_is_seen_of_it(texture):
    drawing = small(texture)
    offsets = drawing.strokes.offsets
    index = np.zeros(offsets[-1], int)
    index[offsets[0] + 6 : offsets[1]] = 1  # half of a stroke, and of the ring
    index[offsets[4] + 8 : offsets[5]] = 1
    along = arc_length(drawing.strokes.xy, offsets)
    cut = edits.cut_at_parts(drawing, Parts(("a", "b"), index).cut(offsets, along))
    assert [cut.parts.name(i) for i in range(7)] == ["a", "b", "a", "a", "a", "a", "b"]
    assert not cut.strokes.closed.any() and len(cut.color) == 7
    assert cut.strokes.kind.tolist() == drawing.strokes.kind[[0, 0, 1, 2, 3, 4, 4]].tolist()
    # of pieces of flat, clear ink it would be seen that their round ends lie over each other
    opaque = [
        replace(d, color=np.c_[d.color[:, :3], np.ones(len(d.color))]) for d in (drawing, cut)
    ]
    before, after = (rasterise(d, 3.0)[..., 3].astype(float) for d in opaque)
    assert np.abs(before - after).mean() < (0.2 if texture else 0.02)
    blob = rasterise(replace(opaque[1], texture=None), 3.0)[..., 3]
    if texture:
        assert np.abs(before - after).mean() < 0.1 * np.abs(before - blob).mean()
    same = edits.cut_at_parts(drawing, Parts(("a", "b"), 0 * index).cut(offsets, along))
    assert np.array_equal(same.strokes.xy, drawing.strokes.xy) and same.texture is drawing.texture


@pytest.mark.parametrize("edit", EDITS)
def test_edits_keep_parts(edit):
    drawing = with_parts(small("grain"))
    assert edit(drawing, None).parts is drawing.parts


def test_scaling_across_leaves_strips_to_the_texel_and_its_inverse_undoes_it():
    was = small("grain")
    got = edits.scale_across(was, 1.25)
    assert np.array_equal(got.texture.rgba, was.texture.rgba)
    assert got.texture.margin == pytest.approx(1.25 * was.texture.margin)
    assert got.strokes.thickness == pytest.approx(1.25 * was.strokes.thickness)
    back = edits.scale_across(got, 0.8)
    assert back.strokes.thickness == pytest.approx(was.strokes.thickness)
    assert back.texture.margin == pytest.approx(was.texture.margin)
