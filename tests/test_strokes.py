"""Outlines, u-v ribbons and the direct raster, against the union of discs that a stroke is."""

import numpy as np
import pytest

from strokestyle.curves import KINDS
from strokestyle.strokes import (
    Drawing,
    Strokes,
    Texture,
    coverage,
    crop_of,
    distance_map,
    exact_rings,
    outline,
    outlines,
    paint_order,
    rasterise,
    ribbon,
    ribbon_coordinates,
    ribbon_outlines,
    signed_distance,
    strip_points,
    strip_stretch,
    winding_number,
)

CONTOUR, VALLEY = KINDS.index("contour"), KINDS.index("valley")


def stroke(xy, thickness, closed=False, kind=CONTOUR):
    xy = np.asarray(xy, float)
    thickness = np.broadcast_to(np.asarray(thickness, float), (len(xy),))
    return Strokes(xy, thickness, [0, len(xy)], [kind], [closed])


def together(*parts):
    return Strokes(
        np.concatenate([p.xy for p in parts]),
        np.concatenate([p.thickness for p in parts]),
        np.cumsum([0] + [len(p.xy) for p in parts]),
        np.concatenate([p.kind for p in parts]),
        np.concatenate([p.closed for p in parts]),
    )


def zoo():
    t = np.linspace(0, 1, 40)
    ring = np.stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)], axis=1)
    ring[-1] = ring[0]
    rng = np.random.default_rng(0)
    wobble = np.stack([20 + 100 * t, 60 + 3 * rng.standard_normal(40)], axis=1)
    there_and_back = np.concatenate([np.stack([20 + 80 * t, 40 + 0 * t], 1), np.stack([100 - 80 * t, 46 + 0 * t], 1)])
    eight = np.stack([70 + 50 * np.sin(2 * np.pi * t), 70 + 40 * np.sin(4 * np.pi * t)], axis=1)
    eight[-1] = eight[0]
    return {
        "tapered line": stroke(np.stack([20 + 100 * t, 30 + 20 * t], 1), 10 * np.abs(np.sin(np.pi * t))),
        "sharp bend": stroke([[20, 20], [100, 20], [40, 90]], 14),
        "narrow hairpin": stroke(there_and_back, 14),
        "exact hairpin": stroke([[20, 40], [100, 40], [20, 40]], [4, 10, 14]),
        "closed": stroke(60 + 40 * ring, 6 + 4 * ring[:, 0], True),
        "closed, tighter than wide": stroke(60 + 5 * ring, 16, True),
        "half circle, tighter than wide": stroke(60 + 5 * ring[:25], 16),
        "eight": stroke(eight, 8, True),
        "pigtails": stroke(
            np.stack([20 + 100 * t + 30 * np.sin(4 * np.pi * t), 60 + 30 * np.cos(4 * np.pi * t)], 1), 9
        ),
        "nervous": stroke(wobble, 12),
        "nervous and uneven": stroke(wobble, 12 * rng.random(40)),
        "coincident points": stroke([[20, 20], [20, 20], [60, 30], [60, 30]], [3, 8, 2, 2]),
        "one point": stroke([[20, 20], [20, 20], [20, 20]], [3, 8, 2]),
        "tapered to nothing": stroke([[20, 20], [60, 30], [100, 20]], [0, 12, 0]),
        "one disc in another": stroke([[20, 40], [25, 40], [60, 45]], [30, 4, 20]),
        "spiral": stroke(np.stack([70 + 50 * t * np.cos(14 * t), 70 + 50 * t * np.sin(14 * t)], 1), 3 + 10 * t),
        "zigzag": stroke(np.stack([20 + 100 * t, 60 + 8.0 * (np.arange(40) % 2)], 1), 10),
    }


def walked(ring, steps=12):
    """A ring of cubics (K, 4, 2) as a fine polygon."""
    t = np.linspace(0, 1, steps, endpoint=False)[:, None]
    b = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3])
    return np.einsum("bti,kbj->ktj", b, ring).reshape(-1, 2)


@pytest.mark.parametrize("name", zoo())
def test_outline_is_the_union_of_discs_within_tolerance(name):
    line = zoo()[name]
    tolerance = 0.1
    rings = [walked(ring, 16) for ring in outline(line, 0, tolerance)]
    x, y = np.meshgrid(np.arange(0, 140, 0.9) + 0.013, np.arange(0, 140, 0.9) + 0.017)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    distance = signed_distance(line.xy, 0.5 * line.thickness, points)
    near = (np.abs(distance) < 0.5) | ((distance < 3) & (np.arange(len(points)) % 7 == 0))
    points, distance = points[near], distance[near]
    filled = sum(winding_number(ring, points) for ring in rings) != 0
    wrong = filled != (distance < 0)
    assert np.abs(distance[wrong]).max(initial=0) <= 1.2 * tolerance  # holes, flips and spikes would be deep inside
    assert signed_distance(line.xy, 0.5 * line.thickness, np.concatenate(rings)).max() <= 1.2 * tolerance


@pytest.mark.parametrize("seed", [7, 9, 16, 18, 116, 124, 379, 642, 771, 3128, 3425])
def test_scribbles_are_filled_too(seed):
    # tangles of short and fat pieces, found by search: here cutting loops off would open holes if nothing looked
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
    (ring,) = outline(stroke([[60, 60], to, [60, 60]], 12), 0)
    tip = to + 5.5 * np.array([np.cos(angle), np.sin(angle)])
    assert winding_number(walked(ring), tip[None])[0] != 0


@pytest.mark.parametrize("name", zoo())
def test_every_ring_closes_and_is_finite(name):
    for ring in outline(zoo()[name], 0):
        assert ring.shape[1:] == (4, 2) and np.isfinite(ring).all()
        assert np.array_equal(ring[:, 3], np.roll(ring[:, 0], -1, axis=0))


def test_signed_distance_of_a_round_cone():
    # discs of radius 3 at 0 and 1 at 10: a common tangent leans by asin(2 / 10)
    xy, radius = np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([3.0, 1.0])
    lean = np.arcsin(0.2)
    foot = np.array([5.0, 0.0]) + 2.0 * np.array([np.sin(lean), np.cos(lean)])
    points = np.array([[0.0, 5.0], [14.0, 0.0], foot, foot * [1, -1], [-4.0, 0.0], [0.0, 0.0]])
    expected = [np.hypot(0, 5) - 3, 3.0, 0.0, 0.0, 1.0]
    got = signed_distance(xy, radius, points)
    assert got[1:5] == pytest.approx(expected[1:], abs=1e-9)
    assert got[0] <= expected[0] and got[5] < -2.9


def test_smooth_strokes_take_few_nodes():
    t = np.linspace(0, 1, 100)
    xy = np.stack([50 + 300 * t, 100 + 40 * np.sin(4 * t)], axis=1)
    (ring,) = outline(stroke(xy, 4 + 6 * np.sin(np.pi * t)), 0)
    assert len(ring) <= 20
    (loose,) = outline(stroke(xy, 4 + 6 * np.sin(np.pi * t)), 0, tolerance=1.0)
    assert len(loose) < len(ring)


def test_closed_stroke_has_two_rings_and_a_hole():
    line = zoo()["closed"]
    rings = [walked(ring) for ring in outline(line, 0)]
    assert len(rings) == 2
    assert sum(winding_number(ring, np.array([[60.0, 60.0]])) for ring in rings) == 0


def test_outlines_of_many_equal_those_of_each():
    parts = list(zoo().values())[:6]
    for i, rings in enumerate(outlines(together(*parts))):
        for ring, alone in zip(rings, outline(parts[i], 0), strict=True):
            assert ring == pytest.approx(alone, abs=1e-6)


def test_outline_needs_a_tolerance():
    with pytest.raises(ValueError, match="tolerance"):
        outline(zoo()["eight"], 0, 0.0)


# ------------------------------------------------------------------------------------------------------- the raster


def supersampled(line, size, factor=5):
    x = (np.arange(size * factor) + 0.5) / factor
    grid = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    inside = signed_distance(line.xy, 0.5 * line.thickness, grid) < 0
    return inside.reshape(size, factor, size, factor).mean(axis=(1, 3))


@pytest.mark.parametrize("name", ["tapered line", "sharp bend", "closed", "nervous and uneven", "one disc in another"])
def test_flat_raster_is_the_covered_area(name):
    line = zoo()[name]
    image = rasterise(Drawing(line, (140, 140), [[0, 0, 0, 1]]), background=(1, 1, 1))
    exact = 255 * (1 - supersampled(line, 140))
    assert np.abs(image[..., 0] - exact).mean() < 0.25
    assert np.abs(image[..., 0] - exact).max() < 110  # joins: the largest of two parts is less than their union


def test_thin_strokes_fade_instead_of_vanishing():
    line = stroke([[10.0, 20.3], [60.0, 20.3]], 0.4)
    _, cover = coverage(line, 0, (70, 40))
    assert cover[:, 20].sum() == pytest.approx(0.4, abs=0.02)


def test_distance_map_agrees_with_the_reference():
    line = zoo()["nervous and uneven"]
    crop, near = distance_map(line, 0, (140, 140), 6.0)
    y, x = np.nonzero(np.isfinite(near))
    points = np.stack([x + crop.x0 + 0.5, y + crop.y0 + 0.5], axis=1)
    assert near[y, x] == pytest.approx(signed_distance(line.xy, 0.5 * line.thickness, points), abs=1e-9)
    assert np.isfinite(near).sum() > 2000


def test_strokes_over_the_edge_of_the_canvas_are_cut():
    line = stroke([[-30, 20], [30, 20], [90, 200]], 9)
    image = rasterise(Drawing(line, (64, 48), [[1, 0, 0, 1]]))
    assert image.shape == (48, 64, 4) and image[20, 10].tolist() == [255, 0, 0, 255]
    far = stroke([[-300, 20], [-200, 20]], 9)
    assert not rasterise(Drawing(far, (64, 48), [[1, 0, 0, 1]])).any()


def test_contours_are_painted_last_and_strokes_of_a_kind_as_given():
    line = together(
        stroke([[10, 20], [50, 20]], 6),
        stroke([[30, 5], [30, 40]], 6, kind=VALLEY),
        stroke([[20, 5], [20, 40]], 6),
    )
    assert paint_order(line).tolist() == [1, 0, 2]
    image = rasterise(Drawing(line, (60, 45), [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]]))
    assert image[20, 30, :3].tolist() == [255, 0, 0] and image[20, 20, :3].tolist() == [0, 0, 255]


def test_half_opaque_ink_builds_up_where_strokes_cross():
    line = together(stroke([[10, 20], [50, 20]], 6), stroke([[30, 5], [30, 40]], 6))
    image = rasterise(Drawing(line, (60, 45), [[0, 0, 0, 0.5]] * 2))
    assert image[20, 15, 3] == 128 and image[20, 30, 3] == 191


def test_raster_scales():
    drawing = Drawing(zoo()["sharp bend"], (120, 120), [[0, 0, 0, 1]])
    large = rasterise(drawing, 4.0, (1, 1, 1)).astype(float)
    assert large.shape == (480, 480, 3)
    small = large.reshape(120, 4, 120, 4, 3).mean(axis=(1, 3))
    assert np.abs(small - rasterise(drawing, 1.0, (1, 1, 1))).mean() < 0.3
    with pytest.raises(ValueError, match="scale"):
        rasterise(drawing, 0.0)


# ----------------------------------------------------------------------------------------------------------- u-v


def uv_texture(line, margin=3.0, rows=64, columns=16):
    """Red = u, green = v, opaque."""
    u = (np.arange(rows) + 0.5) / rows
    v = (np.arange(columns) + 0.5) / columns
    strip = np.zeros((rows, columns, 4), np.uint8)
    strip[..., 0], strip[..., 1], strip[..., 3] = 255 * u[:, None], 255 * v, 255
    count = len(line)
    return Texture(np.concatenate([strip] * count), np.arange(count + 1) * rows, margin)


def test_texture_lies_along_and_across_the_stroke():
    line = stroke(np.stack([np.linspace(20, 100, 30), np.full(30, 30.0)], 1), 10)
    image = rasterise(Drawing(line, (120, 60), [[0, 0, 0, 1]], uv_texture(line)))
    # the ribbon runs from 12 to 108 and 22 to 38; v grows along (-t_y, t_x), which is down here
    x, y = np.meshgrid(np.arange(14, 106), np.arange(24, 36))
    assert image[y, x, 0] == pytest.approx(255 * (x + 0.5 - 12) / 96, abs=3)
    assert image[y, x, 1] == pytest.approx(255 * (y + 0.5 - 22) / 16, abs=9)
    assert image[..., 3].sum() == pytest.approx(255 * 96 * 16, rel=0.02)


def test_strip_points_and_pixels_are_inverse():
    t = np.linspace(0, 1, 60)
    line = stroke(np.stack([30 + 150 * t, 100 + 30 * np.sin(5 * t)], 1), 6 + 4 * t)
    band = ribbon(line, 0, 3.0)
    at = strip_points(band, 50, 9)
    crop = crop_of(band.xy, band.half, (220, 160))
    u, v = np.full(crop.w * crop.h, np.nan), np.full(crop.w * crop.h, np.nan)
    for pixel, pu, pv in ribbon_coordinates(band, crop):
        u[pixel], v[pixel] = pu, pv
    pixel = np.floor(at).astype(int) - [crop.x0, crop.y0]
    index = (pixel[..., 1] * crop.w + pixel[..., 0])[2:-2, 1:-1]
    rows, columns = np.meshgrid((np.arange(50) + 0.5) / 50, (2 * np.arange(9) + 1.0) / 9 - 1, indexing="ij")
    assert np.abs(u[index] - rows[2:-2, 1:-1]).max() * band.length < 2.0  # within a pixel's diagonal and the bend
    assert (np.abs(v[index] - columns[2:-2, 1:-1]) * 8.0).max() < 1.6


def test_blunt_ends_keep_a_wide_ribbon():
    xy = np.stack([np.linspace(0, 60, 31), np.zeros(31)], 1)
    thickness = np.full(31, 12.0)
    thickness[[0, 30]] = 0.0
    band = ribbon(stroke(xy, thickness), 0, 2.0)
    assert band.half.min() > 7.0
    assert band.length == pytest.approx(60 + band.half[0] + band.half[-1])
    slim = ribbon(stroke(xy, 6 - np.abs(xy[:, 0] - 30) / 5), 0, 2.0)  # narrows by a tenth a px: as drawn
    assert slim.half[-1] == pytest.approx(2.0)


def test_a_closed_ribbon_wraps():
    line = zoo()["closed"]
    strip = np.zeros((6, 4, 4), np.uint8)  # rows of some 42 px: between two of them colours are interpolated
    strip[..., 3] = 255
    strip[3:, :, 0] = 255
    image = rasterise(Drawing(line, (120, 120), [[0, 0, 0, 1]], Texture(strip, [0, 6], 2.0)))
    seam = image[58:62, 98:102, 0].astype(int)  # on both sides of the stroke's beginning
    assert abs(seam - 127).max() < 20 and (image[58:62, 98:102, 3] == 255).all()


def test_strips_stretch_outside_a_bend_and_fold_inside_a_tight_one():
    t = np.linspace(0, np.pi, 200)
    gentle = stroke(100 + 50 * np.stack([np.cos(t), np.sin(t)], axis=1), 20)
    rows, columns = 120, 10
    band = ribbon(gentle, 0, 0.0)
    stretch = strip_stretch(band, rows, columns)[40:80]
    inward = ((2 * np.arange(columns) + 1) / columns - 1) * 10  # the normal (-t_y, t_x) points to the centre here
    assert stretch == pytest.approx(np.broadcast_to((50 - inward) / 50, stretch.shape), abs=0.02)
    tight = stroke(100 + 6 * np.stack([np.cos(t), np.sin(t)], axis=1), 20)
    assert strip_stretch(ribbon(tight, 0, 0.0), rows, columns).min() < 0


def test_where_a_stroke_crosses_itself_the_stronger_mark_shows():
    t = np.linspace(-0.25, 0.75, 100)  # through the crossing at (60, 60) a quarter and three quarters of the way
    line = stroke(np.stack([60 + 40 * np.sin(2 * np.pi * t), 60 + 30 * np.sin(4 * np.pi * t)], 1), 8)
    strip = np.zeros((100, 8, 4), np.uint8)
    strip[:50, :, 3] = 255  # the first half of the way is ink, the second is clear
    image = rasterise(Drawing(line, (120, 120), [[0, 0, 0, 1]], Texture(strip, [0, 100], 1.0)))
    x, y = np.floor(line.xy[20:30]).astype(int).T
    assert (np.hypot(x - 60, y - 60) < 5).any() and image[y, x, 3].min() == 255  # no notch in the ink's way


def test_texture_of_a_zoo_is_finite_and_stays_on_the_ribbon():
    line = together(*zoo().values())
    drawing = Drawing(line, (140, 140), np.tile([0, 0, 0, 1.0], (len(line), 1)), uv_texture(line))
    image = rasterise(drawing)
    assert (image[..., 3] > 0).mean() > 0.3
    for rings in ribbon_outlines(drawing):
        assert all(np.isfinite(ring).all() for ring in rings)


def test_without_strokes_the_canvas_stays_clear():
    nothing = Strokes(np.zeros((0, 2)), [], [0], [], [])
    assert not rasterise(Drawing(nothing, (20, 16), np.zeros((0, 4)))).any()
    assert outlines(nothing) == []


@pytest.mark.parametrize(
    "change, message",
    [
        ({"xy": np.zeros((2, 3))}, "xy must have shape"),
        ({"thickness": [1.0, -1.0]}, "must not be negative"),
        ({"thickness": [1.0]}, "thickness must have shape"),
        ({"xy": [[0, np.nan], [1, 1]]}, "not finite"),
        ({"offsets": [0, 1, 2]}, "offsets"),
        ({"kind": [99]}, "kind must lie"),
    ],
)
def test_strokes_refuse_bad_arrays(change, message):
    good = {"xy": np.zeros((2, 2)), "thickness": [1.0, 1.0], "offsets": [0, 2], "kind": [0], "closed": [False]}
    with pytest.raises(ValueError, match=message):
        Strokes(**(good | change))


def test_drawing_refuses_what_does_not_belong_together():
    line = stroke([[0, 0], [9, 0]], 2)
    with pytest.raises(ValueError, match="color must have shape"):
        Drawing(line, (10, 10), np.zeros((2, 4)))
    with pytest.raises(ValueError, match="between 0 and 1"):
        Drawing(line, (10, 10), [[0, 0, 0, 2]])
    with pytest.raises(ValueError, match="strips"):
        Drawing(line, (10, 10), [[0, 0, 0, 1]], Texture(np.zeros((4, 3, 4), np.uint8), [0, 2, 4], 1.0))
    with pytest.raises(ValueError, match="uint8"):
        Texture(np.zeros((4, 3, 4)), [0, 4], 1.0)
