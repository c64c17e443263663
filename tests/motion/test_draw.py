"""Frames of lines that move: what a track's hand did at a place, it did in all frames."""

from dataclasses import replace

import numpy as np
import pytest

from strokestyle.drawing.strokes import paint_order
from strokestyle.geometry.parts import Parts
from strokestyle.motion.chance import Luck, TrackChance
from strokestyle.motion.draw import draw_frames, steady_inks
from strokestyle.render.features import FEATURES
from strokestyle.render.quilt import synthesise
from strokestyle.render.residuals import Residuals
from strokestyle.render.restating import Restating
from strokestyle.render.texture_bank import ROWS
from strokestyle.svg.read import read_svg
from strokestyle.svg.write import write_frames
from tests.motion.moving import a_frame, a_grain, a_hand, a_line, laid_alone, straight

PLAIN = {"residuals": None, "overshoots": None}  # nothing but texture


def drawn(style, frames, seed=3, boil=0.0):
    return list(draw_frames(style, frames, seed, boil))


def same(one, other):
    return (
        np.array_equal(one.strokes.xy, other.strokes.xy)
        and np.array_equal(one.strokes.thickness, other.strokes.thickness)
        and (one.texture is other.texture or np.array_equal(one.texture.rgba, other.texture.rgba))
        and np.array_equal(one.color, other.color)
        and one.track == other.track
    )


def stroke(drawing, track):
    """The points (n, 2) and strip (m, A, 4) of a track's stroke."""
    i = drawing.track.index(track)
    return drawing.strokes.xy[drawing.strokes.rows(i)], drawing.texture.strip(i).astype(int)


# --------------------------------------------------------------------------------- closed forms


def test_a_line_that_is_moved_is_the_same_stroke_elsewhere():
    style = a_hand()
    moves = [(0, 0), (7, 3.5), (12, -4.25)]
    frames = [a_frame(style, a_line(4, straight(30, 150, 90) + by)) for by in moves]
    drawings = drawn(style, frames)
    for by, drawing in zip(moves, drawings, strict=True):
        assert drawing.track == ("4",)
        assert np.allclose(drawing.strokes.xy - by, drawings[0].strokes.xy, atol=1e-9)
        assert np.allclose(drawing.strokes.thickness, drawings[0].strokes.thickness)
        off = drawing.texture.rgba.astype(int) - drawings[0].texture.rgba
        assert np.abs(off).max() <= 1


def test_a_line_that_grows_keeps_what_was_drawn():
    style = a_hand()
    frames = [a_frame(style, a_line(2, straight(20, x1, 60))) for x1 in (80, 95, 140)]
    strokes = [stroke(drawing, "2") for drawing in drawn(style, frames)]
    for xy, strip in strokes[1:]:
        kept = strokes[0][0][:, 0] < 60
        wave = np.interp(strokes[0][0][kept, 0], *xy.T)
        assert np.allclose(wave, strokes[0][0][kept, 1], atol=0.05)  # of some px of residuals
        rows = slice(20, ROWS * 50)  # which lie up to 1/4 px apart: strips have whole rows
        one, other = strip[rows, :, 3].ravel(), strokes[0][1][rows, :, 3].ravel()
        assert np.corrcoef(one, other)[0, 1] > 0.93
    assert np.ptp(strokes[0][0][:, 1]) > 0.5


@pytest.mark.parametrize("turn", [1, -1])  # against the pull of a hand, too
def test_texture_lies_where_its_place_is(turn):
    style = a_hand(**PLAIN)
    line = straight(30, 160, 90)[::turn]
    frames = [a_frame(style, a_line(0, line, place)) for place in (0.0, 4.0, 9.5)]
    strips = [stroke(drawing, "0")[1][..., 3] for drawing in drawn(style, frames)]
    inner = slice(60, 200)  # away from the tips, which stay with the ends
    for place, strip in ((4.0, strips[1]), (9.5, strips[2])):
        rows = round(place * ROWS)
        moved = strips[0][inner.start + rows : inner.stop + rows]
        assert np.abs(strip[inner] - moved).mean() < 1.5
        assert np.abs(strip[inner] - strips[0][inner]).mean() > 20
    tip = slice(0, ROWS * 6)
    assert np.abs(strips[0][tip] - strips[2][tip]).mean() < 2


def test_between_two_rows_texture_moves_by_less_than_a_row():
    style = a_hand(**PLAIN)
    places = np.arange(5) * 0.25
    frames = [a_frame(style, a_line(0, straight(30, 160, 90), place)) for place in places]
    strips = [
        stroke(drawing, "0")[1][60:200, :, 3].astype(float) for drawing in drawn(style, frames)
    ]
    slope = np.gradient(strips[2], axis=0) * ROWS  # a px
    shift = [((strip - strips[2]) * slope).sum() / np.square(slope).sum() for strip in strips]
    assert shift == pytest.approx(places - 0.5, abs=0.12)
    contrast = [strip.std() for strip in strips]
    assert min(contrast) > 0.9 * max(contrast)


def test_a_line_that_turns_past_the_pull_keeps_its_texture():
    style = a_hand(**PLAIN)
    frames = []
    for degrees in (140, 146, 150, 154, 160):  # the pull turns at 149
        way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        line = (90, 90) + np.linspace(-60, 60, 100)[:, None] * way
        frames.append(a_frame(style, a_line(0, line)))
    strips = [stroke(drawing, "0")[1] for drawing in drawn(style, frames)]
    assert all(np.abs(strip - strips[0]).max() <= 2 for strip in strips)


def test_a_line_that_grows_in_is_as_thin_as_it_is_present():
    style = a_hand()
    frames = [
        a_frame(style, a_line(0, straight(30, 160, 90), presence=p)) for p in (0.02, 0.25, 0.5, 1)
    ]
    drawings = drawn(style, frames)
    assert [len(drawing.strokes) for drawing in drawings] == [0, 1, 1, 1]
    widest = [drawing.strokes.thickness.max() for drawing in drawings[1:]]
    assert widest == pytest.approx(np.array([0.25, 0.5, 1]) * widest[-1], rel=0.02)


def test_the_end_of_a_stroke_moves_with_its_line():
    style = a_hand()
    ends = np.linspace(100, 112, 25)
    frames = [a_frame(style, a_line(0, straight(30, x1, 90))) for x1 in ends]
    last = [drawing.strokes.xy[:, 0].max() for drawing in drawn(style, frames)]
    assert np.diff(last) == pytest.approx(0.5, abs=0.2)


# --------------------------------------------------------------------------------------- chance


def test_the_same_seed_draws_the_same_and_another_does_not():
    style = a_hand()
    frames = [a_frame(style, a_line(0, straight(30, 160 - i, 90))) for i in range(2)]
    assert all(map(same, drawn(style, frames), drawn(style, frames)))
    assert not same(drawn(style, frames)[0], drawn(style, frames, seed=4)[0])


def test_a_track_draws_the_same_beside_others_and_in_another_order():
    style = a_hand()
    lines = [a_line(t, straight(30, 160, 20 + 30 * t)) for t in range(4)]
    alone = drawn(style, [a_frame(style, lines[2])])[0]
    beside = drawn(style, [a_frame(style, *lines[::-1])])[0]
    assert beside.track == ("0", "1", "2", "3")
    assert np.array_equal(stroke(alone, "2")[0], stroke(beside, "2")[0])
    assert np.array_equal(stroke(alone, "2")[1], stroke(beside, "2")[1])


def test_drawings_of_one_frame_are_alike_without_boil_and_differ_the_more_the_more_it_boils():
    style = a_hand()
    frame = a_frame(style, *[a_line(t, straight(30, 160, 20 + 20 * t)) for t in range(8)])
    apart, anew = [], []
    for boil in (0.0, 0.3, 0.6, 1.0):
        one, other = drawn(style, [frame, frame], boil=boil)
        assert one.track == other.track
        pairs = [(stroke(one, name), stroke(other, name)) for name in one.track]
        off = [
            np.interp(np.arange(40, 150), *a.T) - np.interp(np.arange(40, 150), *b.T)
            for (a, _), (b, _) in pairs
        ]
        apart.append(np.std(off))
        anew.append(
            np.mean([a.shape != b.shape or np.abs(a - b).mean() > 5 for (_, a), (_, b) in pairs])
        )
    assert apart[0] == anew[0] == 0 and anew[-1] == 1
    assert (np.diff(apart) > 0).all() and 0 < anew[1] <= anew[2] <= 1


def test_boil_lies_between_0_and_1():
    with pytest.raises(ValueError, match="boil must lie between 0 and 1, got 1.5"):
        draw_frames(a_hand(), [], boil=1.5)
    assert drawn(a_hand(), []) == []


# ---------------------------------------------------------------------------------------- order


def test_strokes_lie_in_the_order_of_their_tracks_whatever_the_frame_has_them_in():
    style = a_hand()
    lines = [
        a_line(t, straight(30, 160, 90 + t), kind=k) for t, k in ((5, 0), (1, 2), (8, 0), (3, 2))
    ]
    orders = []
    for some in (lines, lines[::-1], lines[2:] + lines[:2]):
        drawing = drawn(style, [a_frame(style, *some)])[0]
        orders.append([drawing.track[i] for i in paint_order(drawing)])
    assert orders[0] == orders[1] == orders[2]


def test_a_line_whose_kind_changes_keeps_its_layer():
    style = a_hand()
    frames = [a_frame(style, a_line(0, straight(30, 160, 90), kind=k)) for k in (0, 2, 0)]
    assert [drawing.strokes.kind.tolist() for drawing in drawn(style, frames)] == [[0]] * 3


# ------------------------------------------------------------------------------------------ ink


def test_flat_ink_of_a_track_changes_slowly():
    bank = replace(a_grain(), flat=True)
    weights, ink, scale = bank.weights.copy(), bank.local_ink.copy(), bank.scale.copy()
    weights[0, 1], weights[1 + FEATURES.index("log_length"), 1] = 0.5, 0.3  # red: long
    ink[0, 1], ink[1, 1], scale[0] = 0.0, 1.0, 0.0
    style = a_hand(bank=replace(bank, weights=weights, local_ink=ink, scale=scale))
    frames = [a_frame(style, a_line(0, straight(30, 60 + 90 * (i % 2), 90))) for i in range(9)]
    drawings = drawn(style, frames)
    assert all(drawing.texture is None for drawing in drawings)
    red = [drawing.color[0, 0] for drawing in drawings]
    alone = [drawn(style, [frame])[0].color[0, 0] for frame in frames[:2]]
    assert abs(alone[0] - alone[1]) > 10 * np.abs(np.diff(red)).max() > 0


def test_the_tones_of_a_track_are_those_of_all_frames_and_all_frames_are_written_alike():
    style = a_hand()
    frames = [a_frame(style)] + [
        a_frame(style, a_line(0, straight(30, 60 + 25 * i, 90, n=60))) for i in range(5)
    ]
    texts = list(write_frames(draw_frames(style, frames), tones=2))
    assert ["texture=vector" in text for text in texts] == [False] + [True] * 5
    opacities = [text.split("fill-opacity=")[1:] for text in texts[1:]]
    assert len({tuple(part.split('"')[1] for part in some) for some in opacities}) == 1
    assert [read_svg(text).track for text in texts] == [None] + [("0",)] * 5
    assert all('id="s000"' in text for text in texts[1:])


# ------------------------------------------------------------------------------------------ zoo


RESTATED = Restating(np.array([0], np.int8), 2, 1.0, 1.5, 40.0)


@pytest.mark.parametrize(
    "fields",
    [
        {"bank": None},
        {"residuals": None},
        {"overshoots": None},  # as models of format 3
        {"residuals": Residuals(np.zeros((0, 2), np.float32), np.zeros(1, np.int64))},
        {"bank": replace(a_grain(), flat=True)},
        {"restating": RESTATED},
        {"restating": RESTATED, **PLAIN},
    ],
)
@pytest.mark.parametrize("boil", [0.0, 0.5])
def test_styles_of_all_sorts_draw_frames_of_all_sorts(fields, boil):
    style = a_hand(**fields)
    frames = [
        a_frame(style),
        a_frame(style, a_line(0, straight(30, 160, 90)), a_line(7, straight(50, 59, 20))),
        a_frame(style),
        a_frame(style, a_line(0, straight(30, 150, 92), 2.0), a_line(1, straight(5, 30, 20))),
    ]
    drawings = drawn(style, frames, boil=boil)
    passes = ["0", "0-2"] if style.restating else ["0"]
    assert [len(drawing.strokes) for drawing in drawings][::2] == [0, 0]
    for drawing in drawings[1::2]:
        assert [name for name in drawing.track if name.split("-")[0] == "0"] == passes
        assert drawing.size == (192, 192)
    assert len(list(write_frames(drawings))) == 4


def test_a_frame_of_a_larger_canvas_is_drawn_as_much_larger():
    style = a_hand()
    frame = a_frame(style, a_line(0, straight(30, 160, 90)))
    large = replace(frame, camera=replace(frame.camera, width=384, height=288))
    one, other = drawn(style, [frame])[0], drawn(style, [large])[0]
    assert other.size == (384, 288)
    assert np.allclose(other.strokes.xy, 2 * one.strokes.xy)
    assert np.allclose(other.texture.margin, 2 * one.texture.margin)


def test_pieces_on_named_parts_keep_their_names_where_one_appears_before_them():
    style = a_hand()
    line = a_line(0, straight(20, 170, 90))
    frames = []
    for cuts in ((200, 200), (110, 200), (70, 110)):
        frame = a_frame(style, line)
        x = frame.planned.xy[:, 0]
        index = np.where(x < cuts[0], 0, np.where(x < cuts[1], 1, 0))
        frames.append(replace(frame, parts=Parts(("body", "wheel"), index)))
    drawings = drawn(style, frames)
    named = [
        {drawing.track[i]: drawing.parts.name(i) for i in range(len(drawing.strokes))}
        for drawing in drawings
    ]
    assert named == [
        {"0": "body"},
        {"0": "body", "0.1": "wheel"},
        {"0": "body", "0.1": "wheel", "0.2": "body"},
    ]
    assert drawings[1].texture.opacities.shape == (2, 256)


@pytest.mark.parametrize("turn", [1, -1])
def test_a_beginning_is_laid_where_a_hand_begins_and_its_upper_side_above(turn):
    bank = a_grain()
    rgba = bank.rgba.copy()
    rgba[..., 3] = np.linspace(30, 220, rgba.shape[1])  # darker where v > 0: below, to the right
    for a, b in zip(bank.offsets[:-1], bank.offsets[1:], strict=True):
        rgba[a : a + 24, :, 3] = 250
        rgba[b - 24 : b, :, 3] = 5
    style = a_hand(**PLAIN, bank=replace(bank, rgba=rgba))
    line = straight(30, 160, 90)[::turn]
    strip = stroke(drawn(style, [a_frame(style, a_line(0, line))])[0], "0")[1][::turn, ::turn, 3]
    assert strip[:12].mean() > 200 and strip[-12:].mean() < 50
    across = strip[80:200].mean(axis=0)
    assert (np.diff(across) > 0).all() and across[-1] > 2 * across[0]


def test_what_auto_means_is_decided_once():
    style = a_hand()
    smooth = replace(a_grain(), rgba=np.full_like(a_grain().rgba, 128))
    frame = a_frame(style, a_line(0, straight(30, 160, 90)))
    grain, even = drawn(style, [frame])[0], drawn(replace(style, bank=smooth), [frame])[0]
    for first, then, texture in ((grain, even, "vector"), (even, grain, "image")):
        texts = list(write_frames([first, then]))
        assert [f"texture={texture}" in text for text in texts] == [True, True]


def test_a_short_stroke_is_as_dark_as_in_a_drawing_of_its_own():
    bank = a_grain()
    near = np.minimum(bank.ends.min(axis=1), 40)[:, None]
    rgba = bank.rgba.copy()
    rgba[..., 3] = np.clip(rgba[..., 3] + 60 - 2.5 * near, 0, 255)  # fainter far from the ends
    even = np.zeros_like(bank.appearance)  # joints are not seen
    style = a_hand(**PLAIN, bank=replace(bank, rgba=rgba, appearance=even))
    frames = [a_frame(style, a_line(0, straight(60, 110 + i, 90))) for i in range(4)]
    chance = TrackChance(Luck(0), style.config.spacing)
    laid = laid_alone(style, frames[0], chance)
    still, _ = synthesise(style.bank, laid.strokes, laid.features, 1)
    moving = drawn(style, frames)[0].texture
    assert moving.rgba[..., 3].mean() == pytest.approx(still.rgba[..., 3].mean(), rel=0.03)


def test_inks_are_smooth_over_the_end_of_a_loop():
    dark, light = np.zeros((1, 4)), np.ones((1, 4))
    frames = [([(1, 0)], dark if t < 6 else light) for t in range(12)]
    inks = np.array([ink[0, 0] for ink in steady_inks(frames, loop=True)])
    assert inks[0] == pytest.approx(inks[5], abs=1e-3) and inks[0] - inks[-1] > -0.2
    assert steady_inks(frames)[0][0, 0] < 0.05
    parted = [frame if t not in (3, 4) else ([], dark[:0]) for t, frame in enumerate(frames)]
    parted = [ink[0, 0] for t, ink in enumerate(steady_inks(parted, True)) if t not in (3, 4)]
    assert parted[0] > 0.2  # it was light before, at the end
