"""Outlines against the union of discs that a stroke is."""

import numpy as np
import pytest
from stroke_zoo import stroke, together, zoo

from strokestyle.drawing.outline import _same_points, exact_rings, outlines
from strokestyle.drawing.strokes import Strokes, signed_distance
from strokestyle.geometry.bezier import fit_cubics
from strokestyle.geometry.polygons import areas, winding_number


def outline(line, tolerance=0.1):
    """The rings of a drawing's only, or first, stroke."""
    return outlines(line, tolerance, [0])[0]


def walked(ring, steps=12):
    """A ring of cubics (K, 4, 2) as a fine polygon."""
    t = np.linspace(0, 1, steps, endpoint=False)[:, None]
    b = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3])
    return np.einsum("bti,kbj->ktj", b, ring).reshape(-1, 2)


@pytest.mark.parametrize("name", zoo())
def test_outline_is_the_union_of_discs_within_tolerance(name):
    line = zoo()[name]
    tolerance = 0.1
    rings = [walked(ring, 16) for ring in outline(line, tolerance)]
    x, y = np.meshgrid(np.arange(0, 140, 0.9) + 0.013, np.arange(0, 140, 0.9) + 0.017)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    distance = signed_distance(line.xy, 0.5 * line.thickness, points)
    near = (np.abs(distance) < 0.5) | ((distance < 3) & (np.arange(len(points)) % 7 == 0))
    points, distance = points[near], distance[near]
    filled = sum(winding_number(ring, points) for ring in rings) != 0
    wrong = filled != (distance < 0)
    assert (
        np.abs(distance[wrong]).max(initial=0) <= 1.2 * tolerance
    )  # holes, flips and spikes would be deep inside
    assert (
        signed_distance(line.xy, 0.5 * line.thickness, np.concatenate(rings)).max()
        <= 1.2 * tolerance
    )


def worst(line, tolerance=0.1, count=20000):
    """How deep in the stroke a point is that is not filled, or how far from it one that is: px.

    Of many points, most lie close to the outline's own curves: spikes and slits do.
    """
    rings = [walked(ring, 48) for ring in outline(line, tolerance)]
    on = np.concatenate(rings)
    rng = np.random.default_rng(0)
    reach = line.thickness.max()
    near = on[rng.integers(0, len(on), (3, count))] + rng.normal(
        0, [[[0.02]], [[0.1]], [[0.5]]], (3, count, 2)
    )
    far = rng.uniform(line.xy.min(axis=0) - reach, line.xy.max(axis=0) + reach, (count, 2))
    points = np.concatenate([near.reshape(-1, 2), far])
    filled = sum(winding_number(ring, points) for ring in rings) != 0
    distance = signed_distance(line.xy, 0.5 * line.thickness, points)
    return np.abs(distance[filled != (distance < 0)]).max(initial=0)


@pytest.mark.parametrize("width", [(0.5, 0.1), (1, 0.2), (1, 0), (0.3, 0), (2, 0)])
@pytest.mark.parametrize("length", [1, 1.3, 3, 10])
def test_short_tapers_have_no_spikes(length, width):
    assert worst(stroke([[60, 60], [60 + 0.8 * length, 60 + 0.6 * length]], width)) <= 0.1


@pytest.mark.parametrize(
    "xy, width",
    [
        ([[50, 50], [49.5, 50], [60, 50]], [12, 2, 2]),  # a short step back within the first disc
        ([[299.9, 299.9], [299.9, 299.7], [300, 301.8]], [6.5, 2.1, 4.5]),
        ([[60, 50], [50, 50], [50.2, 50.1]], [4, 6, 1]),
        ([[60, 50], [50, 50], [50, 49.7]], [2, 6, 1]),
    ],
)
def test_discs_that_hold_the_next_leave_no_slit(xy, width):
    assert worst(stroke(xy, width)) <= 0.1


@pytest.mark.parametrize("seed", [3, 8, 15, 22, 33, 48, 54, 60])
def test_tangles_are_filled_within_tolerance(seed):
    rng = np.random.default_rng(seed)
    count = rng.integers(3, 40)
    xy = np.cumsum(rng.normal(0, rng.choice([0.3, 1, 3, 10]), (count, 2)), axis=0) + 60
    width = np.abs(rng.normal(0, rng.choice([0.5, 3, 10]), count))
    closed = seed % 3 == 0
    rows = np.r_[np.arange(count), 0] if closed else np.arange(count)
    assert worst(stroke(xy[rows], width[rows], closed)) <= 0.1001


@pytest.mark.parametrize("tolerance", [0.02, 0.01, 0.005])
def test_a_fine_tolerance_is_held(tolerance):
    t = np.linspace(0, 1, 150)
    loop = np.stack(
        [60 + 80 * t + 25 * np.sin(4 * np.pi * t), 60 - 25 * np.cos(4 * np.pi * t)], axis=1
    )
    assert worst(stroke(loop, 2 + 6 * t), tolerance, 40000) <= tolerance + 3e-4


def test_cubics_keep_to_the_edges_of_a_polygon_between_its_points():
    """A thin wedge with round tips: a long edge beside a short one, which its tangents leave."""
    ring = np.array(
        [
            [0, 0.4],
            [3, 0.05],
            [3.05, 0],
            [3, -0.05],
            [0, -0.4],
            [-0.3, -0.25],
            [-0.4, 0],
            [-0.3, 0.25],
        ]
    )
    (cubics,) = fit_cubics([ring], [np.zeros(len(ring), bool)], 0.05)
    curve, step = walked(cubics, 48), np.roll(ring, -1, axis=0) - ring
    along = ((curve[:, None] - ring) * step).sum(axis=-1) / (step**2).sum(axis=-1)
    nearest = ring + np.clip(along, 0, 1)[..., None] * step
    assert np.linalg.norm(curve[:, None] - nearest, axis=-1).min(axis=1).max() <= 0.055


@pytest.mark.parametrize("seed", [7, 9, 16, 18, 116, 124, 379, 642, 771, 3128, 3425])
def test_scribbles_are_filled_too(seed):
    # tangles of short and fat pieces, found by search: here cutting loops off would open holes if
    # nothing looked
    rng = np.random.default_rng(seed)
    count = rng.integers(3, 14)
    xy = np.cumsum(rng.normal(0, rng.uniform(1, 8), (count, 2)), axis=0) + 60
    radius = rng.uniform(0.3, 9, count) * rng.uniform(0.3, 1)
    if rng.random() < 0.5:
        radius[:] = radius[0]
    points = rng.uniform(xy.min(axis=0) - 10, xy.max(axis=0) + 10, (400, 2))
    rings = exact_rings(xy, radius, False, 0.02)
    filled = sum(winding_number(ring, points) for ring, _ in rings) != 0
    distance = signed_distance(xy, radius, points)
    assert (filled == (distance < 0))[np.abs(distance) > 0.06].all()


@pytest.mark.parametrize("angle", np.linspace(0.1, 6.0, 7))
def test_exact_hairpins_have_a_round_turn_whichever_way_they_lie(angle):
    to = 60 + 40 * np.array([np.cos(angle), np.sin(angle)])
    (ring,) = outline(stroke([[60, 60], to, [60, 60]], 12))
    tip = to + 5.5 * np.array([np.cos(angle), np.sin(angle)])
    assert winding_number(walked(ring), tip[None])[0] != 0


@pytest.mark.parametrize("name", zoo())
def test_outlines_fill_the_same_by_any_rule(name):
    rings = [walked(ring) for ring in outline(zoo()[name])]
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 140, (3000, 2))
    often = sum(winding_number(ring, points) for ring in rings)
    assert set(np.abs(often).tolist()) <= {0, 1}


def test_a_figure_of_eight_has_two_holes_and_a_coil_none_where_it_lies_on_itself():
    t = np.linspace(0, 2 * np.pi, 80)
    eight = np.stack([70 + 40 * np.sin(t), 70 + 30 * np.sin(2 * t)], axis=1)
    outer, *holes = outline(stroke(eight, 6, closed=True))
    areas = [enclosed(ring) for ring in (outer, *holes)]
    assert len(holes) == 2 and areas[0] < 0 < min(areas[1:]) and areas[1] == pytest.approx(areas[2])
    coil = np.stack([70 + (20 + t) * np.cos(3 * t), 70 + (20 + t) * np.sin(3 * t)], axis=1)
    outer, hole = outline(stroke(coil, 12))
    # the inside of the first turn: by the outline's tolerance, and the centre line's own chords
    assert enclosed(hole) == pytest.approx(np.pi * 15.2**2, rel=0.05)


def test_outlines_that_do_not_cross_stay_as_they_were():
    t = np.linspace(0, 1, 100)
    line = stroke(np.stack([50 + 60 * t, 100 + 20 * np.sin(4 * t)], axis=1), 4 + 6 * t)
    rows = line.rows(0)
    made = exact_rings(line.xy[rows], 0.5 * line.thickness[rows], False, 0.02)
    fitted = fit_cubics([ring for ring, _ in made], [corner for _, corner in made], 0.08)
    assert all(np.array_equal(a, b) for a, b in zip(outline(line), fitted, strict=True))


def enclosed(ring):
    """The area in a ring of cubics, above 0 where it turns from x to y."""
    return areas(walked(ring), np.array([0, 12 * len(ring)]))[0]


@pytest.mark.parametrize("name", zoo())
def test_every_ring_closes_and_is_finite(name):
    for ring in outline(zoo()[name]):
        assert ring.shape[1:] == (4, 2) and np.isfinite(ring).all()
        assert np.array_equal(ring[:, 3], np.roll(ring[:, 0], -1, axis=0))


def test_smooth_strokes_take_few_nodes():
    t = np.linspace(0, 1, 100)
    xy = np.stack([50 + 300 * t, 100 + 40 * np.sin(4 * t)], axis=1)
    (ring,) = outline(stroke(xy, 4 + 6 * np.sin(np.pi * t)))
    assert len(ring) <= 20
    (loose,) = outline(stroke(xy, 4 + 6 * np.sin(np.pi * t)), 1.0)
    assert len(loose) < len(ring)


def test_closed_stroke_has_two_rings_and_a_hole():
    line = zoo()["closed"]
    rings = [walked(ring) for ring in outline(line)]
    assert len(rings) == 2
    assert sum(winding_number(ring, np.array([[60.0, 60.0]])) for ring in rings) == 0


def test_outlines_of_many_equal_those_of_each():
    parts = list(zoo().values())[:6]
    for i, rings in enumerate(outlines(together(*parts))):
        for ring, alone in zip(rings, outline(parts[i]), strict=True):
            assert ring == pytest.approx(alone, abs=1e-6)


def test_outline_needs_a_tolerance():
    with pytest.raises(ValueError, match="tolerance"):
        outline(zoo()["eight"], 0.0)


def test_without_strokes_there_are_no_outlines():
    assert outlines(Strokes(np.zeros((0, 2)), [], [0], [], [])) == []


def test_the_same_points_are_found_again():
    random = np.random.default_rng(0)
    among = random.integers(0, 20, (300, 2)) * 1.0  # many have the same x
    among, first = np.unique(among, axis=0)[::-1], np.arange(40)
    points = np.concatenate([among[first] + random.uniform(-5e-7, 5e-7, (40, 2)), among + 1e-5])
    assert np.array_equal(_same_points(points, among)[:40], first)
    assert (_same_points(points, among)[40:] == len(among)).all()
    assert _same_points(points[:0], among).shape == (0,)
