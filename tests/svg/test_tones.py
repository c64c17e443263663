"""Tones: regions against the texture they stand for, on strokes that are hard to lay."""

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import cKDTree
from stroke_zoo import stroke, together, zoo

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Texture
from strokestyle.geometry.curves import simplify_all
from strokestyle.geometry.polygons import areas, united
from strokestyle.svg.tones import HELD, fit_bsplines, tone_shapes, tones, without_spikes
from strokestyle.svg.write import png_from_svg, write_svg


def inked(line, margin=2.0, columns=12, edge=0.75):
    """Opaque ink within `edge` of the ribbon's half width and of its length, clear outside."""
    v = np.abs((2 * np.arange(columns) + 1) / columns - 1)
    strip = np.zeros((120, columns, 4), np.uint8)
    strip[..., 3] = 255 * (v < edge)
    count = len(line)
    texture = Texture(np.concatenate([strip] * count), 120 * np.arange(count + 1), margin)
    return Drawing(line, (140, 140), np.tile([0, 0, 0, 1.0], (count, 1)), texture)


def rendered(text, scale=1.0):
    import io

    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(png_from_svg(text, scale))).convert("RGB")).astype(
        float
    )


@pytest.mark.parametrize("name", zoo())
def test_ink_of_a_zoo_is_where_the_raster_has_it(name):
    made = inked(zoo()[name])
    got, want = (
        rendered(write_svg(made, texture="vector", tones=2), 2.0),
        rasterise(made, 2.0, (1, 1, 1)).astype(float),
    )
    dark = (255 - want).mean()
    assert np.isfinite(got).all() and np.abs(got - want).mean() < 0.3 * dark + 0.1


def test_a_closed_stroke_is_a_ring_without_a_seam():
    t = np.linspace(0, 2 * np.pi, 61)
    line = stroke(70 + 40 * np.stack([np.cos(t), np.sin(t)], axis=1), 10, True)
    picture = rendered(write_svg(inked(line), texture="vector", tones=1), 4.0)[..., 0]
    assert (
        picture[4 * 70 - 8 : 4 * 70 + 8, 4 * 110 - 8 : 4 * 110 + 8].max() < 8
    )  # where it begins and ends
    assert picture[280, 280] == 255  # and its middle is open
    regions = tones(inked(line), [0], 1)
    assert len(regions.stroke) == 2


def test_the_inside_of_a_tight_bend_is_filled_once():
    t = np.linspace(0, np.pi, 40)
    line = stroke(70 + 6 * np.stack([np.cos(t), np.sin(t)], axis=1), 24)
    picture = rendered(write_svg(inked(line), texture="vector", tones=1), 4.0)[..., 0]
    y, x = np.mgrid[0:560, 0:560] / 4 - 70
    within = (np.hypot(x, y) < 12) & (y > 1)
    assert (picture[within] < 10).mean() > 0.99  # no hole where the strip would be folded


def test_tones_of_a_stroke_that_crosses_itself_fill_the_same_by_any_rule():
    t = np.linspace(0, 2 * np.pi, 60)
    line = stroke(np.stack([60 + 40 * np.sin(t), 60 + 30 * np.sin(2 * t)], axis=1), 14, closed=True)
    noise = ndimage.gaussian_filter(np.random.default_rng(4).normal(0, 1, (400, 16)), 1.5)
    rgba = np.zeros((400, 16, 4), np.uint8)
    rgba[..., 3] = np.clip(130 + 500 * noise, 0, 255)
    drawing = Drawing(line, (120, 120), [[0, 0, 0, 1]], Texture(rgba, [0, 400], 1.0))
    text = write_svg(drawing, texture="vector")
    even_odd = text.replace("<path ", '<path fill-rule="evenodd" ')
    assert np.abs(rendered(text, 4) - rendered(even_odd, 4)).mean() < 1e-3
    made = tones(drawing, [0])
    for k in range(3):
        mine = [r for r in range(len(made.tone)) if made.tone[r] == k]
        rings = [made.points[made.offsets[r] : made.offsets[r + 1]] for r in mine]
        assert united([ring.astype(float) for ring in rings], 0.5) is None


def test_tones_add_up_to_the_mean_opacity():
    rng = np.random.default_rng(0)
    line = stroke(np.stack([np.linspace(20, 120, 40), np.full(40, 70.0)], 1), 20)
    strip = np.zeros((200, 24, 4), np.uint8)
    strip[..., 3] = np.kron(rng.integers(0, 256, (50, 6)), np.ones((4, 4)))
    made = Drawing(line, (140, 140), [[0, 0, 0, 1]], Texture(strip, [0, 200], 0.0))
    want = (255 - rasterise(made, 1.0, (1, 1, 1)).astype(float)).sum()
    for count in (1, 2, 3, 8):
        got = (255 - rendered(write_svg(made, texture="vector", tones=count))).sum()
        assert got == pytest.approx(want, rel=0.05)


@pytest.mark.parametrize(
    "share", [(0.1, 0.1, 0.7), (0.7, 0.1, 0.1), (0.02, 0.02, 0.4), (0.3, 0.0, 0.3), (0.0, 0.0, 0.9)]
)
def test_opacities_of_a_texture_in_tones_are_found_again(share):
    rng = np.random.default_rng(3)
    line = stroke(np.stack([np.linspace(20, 120, 40), np.full(40, 70.0)], 1), 20)
    wanted = np.array([0, 79, 163, 237])
    strip = np.zeros((400, 24, 4), np.uint8)
    strip[..., 3] = np.kron(
        rng.choice(wanted, (50, 6), p=[1 - sum(share), *share]), np.ones((8, 4))
    )
    regions = tones(
        Drawing(line, (140, 140), [[0, 0, 0, 1]], Texture(strip, [0, 400], 0.0)), [0], 3
    )
    shown = np.unique(strip[..., 3])[1:]
    level = 255 * (1 - np.cumprod(1 - regions.opacity[0]))[: len(shown)]
    assert level == pytest.approx(shown, abs=0.6)
    assert np.unique(regions.tone).tolist() == list(range(len(shown)))  # and there are no more


def test_edges_are_fitted_to_the_whole_contour(monkeypatch):
    rng = np.random.default_rng(0)
    angle = np.linspace(0, 2 * np.pi, 401)
    radius = 30 + ndimage.gaussian_filter1d(rng.normal(0, 5, 400), 6, mode="wrap")[np.r_[:400, 0]]
    ring = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    two, ends = (
        np.concatenate([ring, ring[::2] + 100]),
        np.array([0, 401, 602]),
    )  # contours do not touch each other
    keep = simplify_all(two, ends, 0.4)
    keep[ends[1:] - 1] = False
    offsets = np.r_[0, np.cumsum(keep)][ends]

    def errors():
        control = fit_bsplines(two, ends, keep, offsets)
        for k, xy in enumerate((ring, ring[::2] + 100)):
            here = control[offsets[k] : offsets[k + 1]][:, None]
            before, after, t = (
                np.roll(here, 1, axis=0),
                np.roll(here, -1, axis=0),
                np.linspace(0, 1, 20)[:, None],
            )
            spline = 0.5 * (1 - t) ** 2 * before + (0.5 + t * (1 - t)) * here + 0.5 * t * t * after
            yield np.sqrt(np.square(cKDTree(spline.reshape(-1, 2)).query(xy)[0]).mean())

    fitted = np.array(list(errors()))
    monkeypatch.setattr(
        "strokestyle.svg.tones.HELD", 1e9
    )  # through the points that were kept, and no others
    assert (fitted < 0.2).all() and (fitted < 0.9 * np.array(list(errors()))).all()


def test_splines_solve_their_equations():
    """Rings of one to nine kept points, in one go, as they come out of a dense matrix."""
    rng, rings, kept = np.random.default_rng(3), [], []
    for count in (1, 2, 3, 4, 5, 9):
        ring = rng.normal(size=(3 * count, 2)) * 20
        rings.append(np.concatenate([ring, ring[:1]]))
        keep = np.zeros(len(ring) + 1, bool)
        keep[rng.permutation(np.arange(1, len(ring)))[: count - 1]] = keep[0] = True
        kept.append(keep)
    xy, keep = np.concatenate(rings), np.concatenate(kept)
    ends = np.cumsum([0] + [len(ring) for ring in rings])
    offsets = np.cumsum([0] + [flag.sum() for flag in kept])
    found = fit_bsplines(xy, ends, keep, offsets)
    for k, ring in enumerate(rings):
        at = np.flatnonzero(kept[k])
        n, arc = len(at), np.r_[0, np.cumsum(np.hypot(*np.diff(ring, axis=0).T))]
        rows, values = np.zeros((len(ring) - 1, n)), ring[:-1]
        for i in range(len(ring) - 1):
            piece = np.searchsorted(at, i, "right") - 1
            start, end = arc[at[piece]], arc[np.r_[at, len(ring) - 1][piece + 1]]
            t = (arc[i] - start) / (end - start)
            middle, t = (piece, t + 0.5) if t < 0.5 else (piece + 1, t - 0.5)
            for j, weight in ((-1, (1 - t) ** 2 / 2), (0, 0.5 + t * (1 - t)), (1, t * t / 2)):
                rows[i, (middle + j) % n] += weight
        point, held = ring[at], HELD**0.5
        through = 1.25 * point - 0.125 * (np.roll(point, 1, axis=0) + np.roll(point, -1, axis=0))
        rows = np.concatenate([rows, held * np.eye(n)])
        values = np.concatenate([values, held * through])
        expected = np.linalg.lstsq(rows, values, rcond=None)[0]
        np.testing.assert_allclose(found[offsets[k] : offsets[k + 1]], expected, atol=1e-3)


def test_spikes_are_left_out():
    ring = [
        [0, 0],
        [9, 0],
        [9, 5],
        [9, 0],
        [9, 9],
        [4, 9],
        [4, 12],
        [4, 9],
        [4, 12],
        [4, 9],
        [0, 9],
    ]
    whole, line, point = (
        [[0, 0], [9, 0], [0, 9]],
        [[1, 1], [5, 1], [1, 1], [5, 1]],
        [[3, 3], [3, 3]],
    )
    given = (line, ring, point, whole)
    offsets = np.cumsum([0, *map(len, given)])
    kept, ends = without_spikes(np.concatenate(given), offsets)
    left = [kept[a:b].tolist() for a, b in zip(ends[:-1], ends[1:], strict=True)]
    assert [len(one) for one in left[::2]] == [0, 0] and left[3] == whole
    assert sorted(left[1]) == [[0, 0], [0, 9], [4, 9], [9, 0], [9, 9]]


def test_no_piece_ends_where_it_begins():
    rng = np.random.default_rng(5)
    offsets = np.cumsum([0, *rng.integers(1, 40, 200)])
    polygon = rng.integers(0, 4, (offsets[-1], 2))  # many spikes, and ways to the same point
    kept, ends = without_spikes(polygon, offsets)
    np.testing.assert_allclose(areas(kept, ends), areas(polygon, offsets))
    for a, b in zip(ends[:-1], ends[1:], strict=True):
        ring = kept[a:b]
        middle = ring + np.roll(ring, -1, axis=0)
        assert b - a < 3 or (middle != np.roll(middle, 1, axis=0)).any(axis=1).all()


def test_dense_grain_is_simplified_until_it_fits(monkeypatch):
    rng = np.random.default_rng(0)
    line = stroke(np.stack([np.linspace(20, 120, 40), np.full(40, 70.0)], 1), 20)
    strip = np.zeros((200, 40, 4), np.uint8)
    strip[..., 3] = rng.integers(0, 2, (200, 40)) * 255
    made = Drawing(line, (140, 140), [[0, 0, 0, 1]], Texture(strip, [0, 200], 0.0))
    fine = len(tones(made, [0]).points)
    monkeypatch.setattr("strokestyle.svg.tones.MAX_POINTS", fine // 2)
    assert len(tones(made, [0]).points) < 0.65 * fine


def test_what_shows_nothing_has_no_paths():
    line = together(stroke([[20, 20], [60, 30]], 8), stroke([[20, 60], [60, 70]], 8))
    strips = np.zeros((40, 6, 4), np.uint8)
    strips[20:, 1:5, 3] = 255
    made = Drawing(
        line, (140, 140), np.tile([0, 0, 0, 1.0], (2, 1)), Texture(strips, [0, 20, 40], 1.0)
    )
    paths = tone_shapes(tones(made, [0, 1]))
    assert paths[0] == [] and len(paths[1]) >= 1
    assert tone_shapes(tones(made, [])) == []
    assert "nan" not in write_svg(made, texture="vector")
