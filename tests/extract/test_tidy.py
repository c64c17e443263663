"""Fragments in, strokes out: each rule of `tidy` on lines drawn here, noise, and any input."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial import cKDTree

from strokestyle.extract import tidy_merge
from strokestyle.extract.tidy import TidyOptions, subtract_parallel, tidy, tidy_with_source
from strokestyle.extract.tidy_lines import evenly, near_others
from strokestyle.geometry.curves import KINDS, Curves, arc_length, owner

CONTOUR, CREASE, SUGGESTIVE, RIDGE, VALLEY = (
    KINDS.index(kind) for kind in ("contour", "crease", "suggestive", "ridge", "valley")
)


def line(a, b, step=2.0):
    a, b = np.array(a, float), np.array(b, float)
    count = max(int(np.linalg.norm(b - a) / step), 1) + 1
    return a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)


def arc(centre, radius, start, stop, step=2.0):
    count = max(int(np.radians(abs(stop - start)) * radius / step), 2) + 1
    t = np.radians(np.linspace(start, stop, count))
    return np.array(centre, float) + radius * np.stack([np.cos(t), np.sin(t)], axis=1)


def draw(*lines, kind=CONTOUR, strength=1.0, size=(768, 768), options=None):
    kind = np.broadcast_to(kind, len(lines))
    curves = Curves.from_list(list(lines), kind)
    value = (
        np.broadcast_to(strength, len(lines))[owner(curves.offsets)] if len(lines) else np.zeros(0)
    )
    return tidy(curves, value, size, options)


# ------------------------------------------------------------------------------------------ merging


@pytest.mark.parametrize("kind", [CONTOUR, CREASE, SUGGESTIVE])
def test_parallel_lines_become_one_and_the_earlier_kind_stays(kind):
    out = draw(line((100, 100), (300, 100)), line((120, 102), (280, 101)), kind=[CONTOUR, kind])
    assert len(out) == 1 and out.kind[0] == CONTOUR
    assert np.allclose(out[0][:, 1], 100.0) and abs(out.lengths()[0] - 200) < 1


def test_direction_does_not_matter_when_merging():
    out = draw(line((100, 100), (300, 100)), line((280, 101.5), (120, 101.5)))
    assert len(out) == 1


def test_a_weaker_soft_line_gives_way_whatever_its_kind():
    strong, weak = line((100, 100), (300, 100)), line((150, 102), (200, 102))
    out = draw(weak, strong, kind=[SUGGESTIVE, VALLEY])
    assert len(out) == 1 and out.kind[0] == VALLEY and abs(out.lengths()[0] - 200) < 1


def test_strength_counts_as_much_as_length():
    out = draw(
        line((100, 100), (300, 100)), line((150, 103), (250, 103)), kind=RIDGE, strength=[0.3, 0.9]
    )
    middle = out.xy[np.abs(out.xy[:, 0] - 200) < 20]
    assert np.allclose(middle[:, 1], 103, atol=0.1)


@pytest.mark.parametrize(
    "kinds, far, left",
    [
        ((VALLEY, SUGGESTIVE), 10, 1),
        ((RIDGE, SUGGESTIVE), 10, 1),
        ((CREASE, SUGGESTIVE), 10, 1),
        ((VALLEY, SUGGESTIVE), 14, 2),
        ((VALLEY, RIDGE), 10, 2),
        ((VALLEY, VALLEY), 10, 2),
        ((SUGGESTIVE, SUGGESTIVE), 10, 2),
        ((CONTOUR, SUGGESTIVE), 10, 2),
        ((CREASE, VALLEY), 10, 2),
    ],
)
def test_a_suggestive_contour_and_another_line_of_the_same_form_are_one(kinds, far, left):
    for order in (slice(None), slice(None, None, -1)):
        lines = [line((100, 100), (300, 100)), line((110, 100 + far), (290, 100 + far))]
        out = draw(*lines, kind=kinds[order])
        assert len(out) == left
        if left == 1:
            assert out.kind[0] == (CREASE if CREASE in kinds else SUGGESTIVE)
    slanted = [line((100, 100), (300, 100)), line((150, 75), (250, 125))]
    assert len(draw(*slanted, kind=kinds)) == 2


def test_only_the_parallel_part_goes():
    bent = np.concatenate([line((100, 101), (200, 101)), line((202, 103), (280, 181))])
    out = draw(line((80, 100), (320, 100)), bent, kind=[CONTOUR, CREASE])
    assert sorted(out.kind) == [CONTOUR, CREASE]
    crease = out[int(np.flatnonzero(out.kind == CREASE)[0])]
    assert crease[:, 1].min() > 101.5 and np.allclose(crease[:, 1].max(), 181, atol=0.1)


def test_crossing_lines_both_stay_whole():
    out = draw(
        line((100, 100), (300, 300)), line((100, 300), (300, 100)), kind=[CONTOUR, SUGGESTIVE]
    )
    assert len(out) == 2 and np.allclose(out.lengths(), 200 * np.sqrt(2), atol=1)


def test_a_line_that_turns_back_on_itself_is_drawn_once():
    fold = np.concatenate([line((100, 100), (300, 100)), line((299, 100.8), (220, 101.2))])
    out = draw(fold)
    assert len(out) == 1 and abs(out.lengths()[0] - 200) < 2


def test_lines_farther_apart_both_stay():
    out = draw(
        line((100, 100), (300, 100)), line((100, 112), (300, 112)), kind=[CONTOUR, SUGGESTIVE]
    )
    assert len(out) == 2


def test_what_runs_along_another_drawing_goes():
    drawn = Curves.from_list([line((100, 100), (300, 100))], [CONTOUR])
    others = [
        line((50, 101.5), (200, 101.5)),
        line((150, 50), (150, 150)),
        line((100, 104), (300, 104)),
    ]
    left, _ = subtract_parallel(Curves.from_list(others, [CREASE] * 3), drawn)
    assert left.lengths() == pytest.approx([50, 100, 200], abs=2.5)  # crossing lines stay whole
    again, _ = subtract_parallel(Curves.from_list(others, [CREASE] * 3), drawn, (3072, 3072))
    assert again.xy == pytest.approx(left.xy)  # px are px
    for a, b in ((drawn, Curves.empty()), (Curves.empty(), drawn)):
        assert subtract_parallel(a, b)[0] is a
    assert len(subtract_parallel(drawn, drawn)[0]) == 0


# --------------------------------------------------------------------------------------------- cost


def spokes(count):
    angles = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return [line((384, 384), (384 + 300 * np.cos(t), 384 + 300 * np.sin(t))) for t in angles]


def hatching(count):
    return [line((20, y), (748, y)) for y in np.linspace(100, 160, count)]


def crumbs(count):
    rng = np.random.default_rng(2)
    at, turn = rng.normal(384, 3, (count, 2)), rng.uniform(0, 2 * np.pi, count)
    return [
        line(a, a + 10 * np.array([np.cos(t), np.sin(t)])) for a, t in zip(at, turn, strict=True)
    ]


@pytest.mark.parametrize("kind", [CONTOUR, SUGGESTIVE])
@pytest.mark.parametrize("dense, count", [(spokes, 150), (hatching, 60), (crumbs, 1500)])
def test_cost_grows_as_the_number_of_points_however_dense(monkeypatch, dense, count, kind):
    """Pairs of points looked at, and bytes beyond 60 MB, for each point, of ever more lines."""
    looked = 0
    near = tidy_merge._Grid.near

    def counted(*args):
        nonlocal looked
        for pairs in near(*args):
            looked += pairs.shape[1]
            yield pairs

    monkeypatch.setattr(tidy_merge._Grid, "near", counted)
    tracemalloc.start()
    cost = []
    for many in (count, 4 * count):
        lines = dense(many)
        points = sum(len(p) for p in lines)
        looked = 0
        tracemalloc.reset_peak()
        start = tracemalloc.get_traced_memory()[0]
        draw(*lines, kind=kind)
        peak = tracemalloc.get_traced_memory()[1] - start
        cost.append((looked / points, max(peak - 60e6, 0.0) / points))
    tracemalloc.stop()
    assert cost[1][0] <= 150
    assert cost[1][1] <= 500


def test_dense_lines_leave_a_pen_width_between_them():
    """The best go first: what is left is the same as of lines settled one after the other."""
    out = draw(*hatching(600))
    y = np.sort([line[:, 1].mean() for line in (out[i] for i in range(len(out)))])
    assert np.diff(y).min() > 2.5 and np.diff(y).max() < 2 * 2.5 and out.lengths().min() > 727


def test_batches_settle_as_one_does(monkeypatch):
    lines, kind, strength = scribble(1, 400)
    whole = draw(*lines, kind=kind, strength=strength)
    monkeypatch.setattr(tidy_merge, "BATCH_FLOOR", 0)
    monkeypatch.setattr(tidy_merge, "BATCH_PAIRS", 60)
    monkeypatch.setattr(tidy_merge, "CHUNK", 1000)
    parts = draw(*lines, kind=kind, strength=strength)
    assert np.array_equal(whole.xy, parts.xy) and np.array_equal(whole.kind, parts.kind)


# ------------------------------------------------------------------------------------------ joining


def test_a_chain_of_fragments_becomes_one_stroke():
    pieces = [line((100 + 40 * i, 100), (134 + 40 * i, 100)) for i in range(8)]
    pieces[2::3] = [p[::-1] for p in pieces[2::3]]
    out = draw(*pieces)
    assert len(out) == 1 and abs(out.lengths()[0] - (7 * 40 + 34)) < 1


@pytest.mark.parametrize(
    ("second", "joined"),
    [
        (line((206, 100), (300, 100)), True),
        (line((206, 102), (300, 110)), True),
        (line((196, 101), (300, 101)), True),  # overlapping ends
        (line((225, 100), (300, 100)), False),  # too far
        (line((204, 103), (270, 190)), False),  # another way
        (line((203, 110), (300, 110)), False),  # beside
    ],
)
def test_what_is_joined(second, joined):
    out = draw(line((100, 100), (200, 100)), second, kind=SUGGESTIVE)
    assert len(out) == (1 if joined else 2)


@pytest.mark.parametrize("start", [195.0, 197.6, 198.6])
def test_overlapping_ends_leave_no_fold(start):
    out = draw(line((100, 100), (200, 100)), line((start, 101.8), (300, 101.8)))
    assert len(out) == 1 and (np.diff(out[0][:, 0]) > 0).all()


def test_no_bridge_across_a_third_line():
    out = draw(
        line((100, 100), (200, 100)), line((206, 100), (300, 100)), line((203, 40), (203, 160))
    )
    assert len(out) == 3


def test_kinds_of_joined_strokes():
    out = draw(
        line((100, 100), (200, 100)), line((204, 100), (260, 100)), kind=[VALLEY, SUGGESTIVE]
    )
    assert len(out) == 1 and out.kind[0] == VALLEY
    out = draw(
        line((100, 100), (150, 100)), line((154, 100), (220, 100)), kind=[CONTOUR, SUGGESTIVE]
    )
    assert len(out) == 1 and out.kind[0] == CONTOUR


def test_the_straightest_pair_meets_at_a_junction():
    out = draw(
        line((100, 100), (200, 100)), line((201, 100), (300, 100)), line((201, 102), (240, 170))
    )
    assert len(out) == 2 and abs(out.lengths().max() - 200) < 1


# ------------------------------------------------------------------------ closed curves and corners


def test_two_arcs_close_to_a_circle_that_starts_at_its_top():
    out = draw(arc((300, 300), 80, 10, 178), arc((300, 300), 80, 182, 368))
    assert len(out) == 1 and out.closed[0]
    assert np.array_equal(out[0][0], out[0][-1]) and np.linalg.norm(out[0][0] - (300, 220)) < 3
    assert np.abs(np.linalg.norm(out[0] - 300, axis=1) - 80).max() < 0.5


def test_where_a_loop_starts_in_the_input_does_not_matter():
    ring = arc((300, 300), 80, 0, 360, step=1.0)
    ring[-1] = ring[0]
    first = draw(ring)
    turned = np.r_[ring[37:-1], ring[:38]]
    second = draw(turned)
    assert first.closed.all() and second.closed.all()
    assert np.linalg.norm(first[0][0] - second[0][0]) < 1.0


def test_a_square_is_four_strokes_and_a_zigzag_is_one():
    corners = np.array([(100, 100), (300, 100), (300, 300), (100, 300), (100, 100)], float)
    square = np.concatenate(
        [line(a, b)[:-1] for a, b in zip(corners[:-1], corners[1:], strict=True)] + [corners[:1]]
    )
    out = draw(np.roll(square[:-1], 20, axis=0)[np.r_[0 : len(square) - 1, 0]])
    assert len(out) == 4 and not out.closed.any()
    assert np.allclose(out.lengths(), 200, atol=2)
    x = np.arange(100.0, 300.0, 2.0)
    zigzag = np.stack([x, 100 + np.where(np.arange(len(x)) % 2, 0.9, -0.9)], axis=1)
    assert len(draw(zigzag, kind=RIDGE)) == 1


@pytest.mark.parametrize(
    "length, angle, left", [(6, 90, 100), (6, 150, 100), (4, 90, 100), (6, 40, 106), (20, 90, 120)]
)
def test_hooks_at_the_ends_go(length, angle, left):
    t = np.radians(angle)
    hook = line((200, 100), (200 + length * np.cos(t), 100 + length * np.sin(t)), step=1)[1:]
    shaft = line((100, 100), (200, 100))
    for stroke in (np.vstack([shaft, hook]), np.vstack([shaft, hook])[::-1]):
        out = draw(stroke)
        assert out.lengths().sum() == pytest.approx(left, abs=3.0)
        assert len(out) == (2 if length == 20 else 1)
    assert draw(arc((100, 100), 30, 0, 300)).lengths().sum() == pytest.approx(
        np.radians(300) * 30, rel=0.01
    )


def test_a_dent_is_no_corner():
    dent = np.array([(200, 100), (204, 103.6), (208, 100)], float)
    out = draw(np.concatenate([line((100, 100), (199, 100)), dent, line((209, 100), (300, 100))]))
    assert len(out) == 1 and not out.closed[0]


def test_an_open_corner_is_split_where_it_is():
    out = draw(np.concatenate([line((100, 100), (200, 100)), line((200, 102), (200, 200))]))
    assert len(out) == 2
    meeting = np.array([out[0][[0, -1]], out[1][[0, -1]]]).reshape(-1, 2)
    assert (np.linalg.norm(meeting - (200, 100), axis=1) < 1.5).sum() == 2


# ------------------------------------------------------------------------------ dropping, smoothing


def test_specks_go_rungs_stay():
    rails = [line((100, 100), (300, 100)), line((100, 112), (300, 112))]
    assert len(draw(*rails, line((200, 101), (200, 111)))) == 3
    assert len(draw(*rails, line((200, 200), (200, 210)))) == 2
    assert len(draw(*rails, line((200, 200), (200, 220)))) == 3


def test_a_weak_line_must_be_longer():
    piece = line((100, 100), (130, 100))
    assert len(draw(piece, kind=VALLEY, strength=0.9)) == 1
    assert len(draw(piece, kind=VALLEY, strength=0.4)) == 0
    assert len(draw(piece, kind=CONTOUR, strength=0.4)) == 1


@pytest.mark.parametrize("kind", [RIDGE, CREASE])
def test_swarms_of_short_lines_are_noise(kind):
    rng = np.random.default_rng(5)
    swarm = []
    for _ in range(600):
        start, angle = rng.uniform(150, 600, 2), rng.uniform(0, 2 * np.pi)
        swarm.append(
            line(start, start + rng.uniform(3, 20) * np.array([np.cos(angle), np.sin(angle)]))
        )
    feature = arc((700, 100), 40, 90, 270)
    out = draw(feature, *swarm, kind=[SUGGESTIVE] + [kind] * len(swarm))
    assert abs(out.lengths()[out.kind == SUGGESTIVE].max() - np.pi * 40) < 3
    assert out.lengths()[out.kind == kind].sum() < 0.06 * sum(
        np.linalg.norm(p[-1] - p[0]) for p in swarm
    )


@pytest.mark.parametrize(("kind", "limit"), [(CONTOUR, 0.5), (RIDGE, 1.5)])
def test_zigzag_is_smoothed_within_bounds(kind, limit):
    x = np.arange(100.0, 400.0, 3.0)
    rough = np.stack(
        [x, 200 + 30 * np.sin(x / 40) + np.where(np.arange(len(x)) % 2, 1.0, -1.0)], axis=1
    )
    out = draw(rough, kind=kind)
    assert len(out) == 1
    smooth = out[0]

    def wiggle(p):
        return np.abs(np.diff(np.unwrap(np.arctan2(*np.diff(p, axis=0).T[::-1])))).sum()

    assert wiggle(smooth) < (0.5 if kind == CONTOUR else 0.15) * wiggle(rough)
    dense = (
        rough[0]
        + np.concatenate([line(a, b, 0.05) for a, b in zip(rough[:-1], rough[1:], strict=True)])
        - rough[0]
    )
    assert cKDTree(dense).query(smooth)[0].max() <= limit + 0.1
    ends = {tuple(p.round(9)) for p in (smooth[0], smooth[-1])}
    assert ends == {tuple(p.round(9)) for p in (rough[0], rough[-1])}


@pytest.mark.parametrize(("kind", "limit"), [(CONTOUR, 0.5), (RIDGE, 1.5)])
def test_a_bend_keeps_its_place(kind, limit):
    a = np.radians(66.0)
    tip = np.array((200.0, 200.0))
    leg = line(tip, tip + 100 * np.array((np.cos(a), np.sin(a))))
    out = draw(np.concatenate([line((100, 200), tip), leg[1:]]), kind=kind)
    assert len(out) == 1
    away = cKDTree(out.xy).query(tip)[0]
    # a hard line's corner between straight sides is exact
    assert away < 1e-9 if kind == CONTOUR else 0.2 * limit < away <= limit + 0.01


# ------------------------------------------------------------------------------ sizes of the canvas


@pytest.mark.parametrize("size", [768, 1536, 3072, 8192])
def test_hard_lines_are_drawn_by_their_length_in_pixels(size):
    rails = [line((100, 100), (300, 100)), line((100, 103), (300, 103))]
    alone, crumb = line((400, 400), (416, 400)), line((500, 500), (512, 500))
    out = draw(*rails, alone, crumb, size=(size, size))
    assert sorted(out.lengths().round()) == [16, 200, 200]
    gap = [line((100, 100), (150, 100)), line((165, 100), (200, 100))]
    assert len(draw(*gap, kind=KINDS.index("other"), size=(size, size))) == 2


@pytest.mark.parametrize("size", [768, 1536, 3072])
def test_soft_lines_are_drawn_by_their_length_in_the_picture(size):
    k = size / 768
    first = [line((100, 100), (300, 100)), line((150, 103), (250, 103)), line((20, 20), (37, 20))]
    second = line((308, 100), (400, 100))
    out = draw(*[k * p for p in (*first, second)], kind=VALLEY, size=(size, size))
    assert out.lengths() / k == pytest.approx([300], abs=1)
    x = np.arange(100.0, 400.0, 3.0)
    rough = np.stack([x, 200 + np.where(np.arange(len(x)) % 2, 1.0, -1.0)], axis=1)
    out = draw(k * rough, kind=VALLEY, size=(size, size))
    assert np.abs(out.xy[20:-20, 1] / k - 200).max() < 0.35


def test_lengths_do_not_shrink_to_nothing():
    rails = [line((5, 10), (60, 10)), line((5, 11.2), (60, 11.2)), line((5, 30), (60, 30))]
    specks = [line((20, 40), (22.5, 40)), line((50, 40), (56, 40))]
    out = draw(*rails, *specks, size=(64, 64))
    assert len(out) == 2 and out.lengths() == pytest.approx([55, 55], abs=0.5)


# ------------------------------------------------------------------------------------ for any input


def scribble(seed, count=250):
    rng = np.random.default_rng(seed)
    lines = []
    for _ in range(count):
        n = int(rng.integers(2, 60))
        heading = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.normal(0, 0.2, n))
        lines.append(
            rng.uniform(0, 768, 2)
            + np.cumsum(2.5 * np.stack([np.cos(heading), np.sin(heading)], 1), axis=0)
        )
        if rng.random() < 0.1:
            lines[-1] = np.r_[lines[-1], lines[-1][:1]]
    return lines, rng.integers(0, len(KINDS), count), rng.uniform(0, 1, count)


@pytest.mark.parametrize("seed", range(4))
def test_any_scribble_gives_clean_strokes(seed):
    lines, kind, strength = scribble(seed)
    out = draw(*lines, kind=kind, strength=strength)
    lengths = out.lengths()
    assert len(out) and lengths.min() >= 5.0
    step = np.diff(arc_length(out.xy, out.offsets))[np.diff(owner(out.offsets)) == 0]
    assert step.min() > 0 and step.max() < 2.0
    for i in np.flatnonzero(out.closed):
        assert np.array_equal(out[i][0], out[i][-1]) and len(out[i]) > 4
    assert (np.diff(out.kind) >= 0).all()
    # every stroke lies along the input: bridges span no more than the largest gap
    ink = np.concatenate(
        [
            np.concatenate([line(a, b, 0.5) for a, b in zip(p[:-1], p[1:], strict=True)])
            for p in lines
        ]
    )
    assert cKDTree(ink).query(out.xy)[0].max() < 0.5 * TidyOptions().contour_gap + 1.5


@pytest.mark.parametrize("at", [0.0, -3e7])
def test_ends_near_other_lines_are_those_found_by_asking_all_points(at):
    rng = np.random.default_rng(5)
    starts = rng.uniform(0, 300, (150, 2))
    curves = [line(start, start + rng.normal(0, 25, 2)) + at for start in starts]
    count = sum(map(len, curves))
    lines = evenly(Curves.from_list(curves), 1.0, np.ones(count), np.zeros(count, bool))
    tips = lines.xy[np.stack([lines.first, lines.last], axis=1).ravel()]
    away = np.linalg.norm(lines.xy - tips[:, None], axis=2)
    away[lines.of == np.arange(2 * len(lines))[:, None] // 2] = np.inf
    for radius in (1.0, 2.5, 6.0):
        near = away.min(axis=1) <= radius
        assert np.array_equal(near_others(lines, radius), near) and 0.05 < near.mean() < 0.9
        asked = rng.random(len(tips)) < 0.3
        assert np.array_equal(near_others(lines, radius, asked), near & asked)


def test_the_same_input_gives_the_same_bytes():
    lines, kind, strength = scribble(9)
    first, again = (draw(*lines, kind=kind, strength=strength) for _ in range(2))
    assert first.xy.tobytes() == again.xy.tobytes() and np.array_equal(first.offsets, again.offsets)


def test_degenerate_input():
    point = np.full((3, 2), 50.0)
    assert len(draw()) == 0
    assert len(draw(point)) == 0
    assert len(draw(point, line((0, 0), (1e-9, 0)), line((0, 0), (1, 1)))) == 0
    assert len(draw(point, line((100, 100), (200, 100)))) == 1
    same = line((100, 100), (200, 100))
    assert len(draw(same, same, same[::-1], kind=[RIDGE, VALLEY, CONTOUR])) == 1
    far = line((-1e6, 5), (-1e6 + 100, 5))
    assert len(draw(far)) == 1
    tiny = arc((50, 50), 0.5, 0, 360)
    tiny[-1] = tiny[0]
    assert len(draw(tiny)) == 0


def test_errors_name_what_is_wrong():
    curves = Curves.from_list([line((0, 0), (10, 0))])
    with pytest.raises(ValueError, match="strength must be 6"):
        tidy(curves, np.ones(5))
    with pytest.raises(ValueError, match="strength"):
        tidy(curves, np.full(6, np.nan))
    with pytest.raises(ValueError, match="canvas"):
        tidy(curves, np.ones(6), (0, 768))
    with pytest.raises(ValueError, match="tidy option gap"):
        TidyOptions(gap=-1.0)
    with pytest.raises(ValueError, match="tidy option corner"):
        TidyOptions(corner=float("nan"))


# --------------------------------------------------------------------------- where points come from


def test_points_know_the_fragment_that_they_come_from():
    """Two halves of a line with a gap, a doubled line beside it, a closed curve, a corner."""
    given = [
        line((100, 100), (200, 100)),
        line((206, 100), (300, 100)),
        line((100, 101.5), (180, 101.5)),
        arc((400, 400), 60, 0, 360),
        np.concatenate([line((500, 100), (600, 100)), line((600, 101), (600, 200))]),
    ]
    fragments = Curves.from_list(given, [CONTOUR, CONTOUR, SUGGESTIVE, CONTOUR, CREASE])
    curves, source, _ = tidy_with_source(fragments, np.ones(len(fragments.xy)))
    assert source.shape == (len(curves.xy),)
    away = np.linalg.norm(fragments.xy[source] - curves.xy, axis=1)
    assert away.max() < 4.5  # half the gap, and half the step of the given points
    joined = [i for i in range(len(curves)) if abs(curves.lengths()[i] - 200) < 2]
    of = owner(fragments.offsets)[source]
    rows = slice(*curves.offsets[joined[0] : joined[0] + 2])
    left = curves.xy[rows, 0] < 203
    assert (of[rows][left] == 0).all() and (of[rows][~left] == 1).all()
    assert not (of == 2).any()  # the doubled line is gone


def test_what_is_left_beside_others_knows_its_rows():
    drawn = Curves.from_list([line((100, 100), (300, 100))], [CONTOUR])
    given = Curves.from_list([line((50, 101.5), (200, 101.5)), line((150, 50), (150, 150))])
    left, source = subtract_parallel(given, drawn)
    assert np.linalg.norm(given.xy[source] - left.xy, axis=1).max() < 1.5
