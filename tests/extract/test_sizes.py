"""A larger canvas shows more, never less: each line of 768 px is there at 1536 and 3072."""

from pathlib import Path

import numpy as np
import pytest
import shapes
from scipy.spatial import cKDTree

from strokestyle.extract.camera import fit_camera
from strokestyle.extract.lines import SurfaceLines
from strokestyle.extract.tidy import tidy
from strokestyle.extract.visible import look_along
from strokestyle.geometry.curves import Curves, resample_curves
from strokestyle.mesh.surface import load_surface, make_surface

EXAMPLES = Path(__file__).parents[2] / "examples" / "shapes"


def box(low, high):
    low, high = np.array(low, float), np.array(high, float)
    vertices, faces = shapes.cube(2)
    share = (vertices - vertices.min(axis=0)) / np.ptp(vertices, axis=0)
    return low + share * (high - low), faces


def joined(parts):
    count = np.cumsum([0] + [len(vertices) for vertices, _ in parts[:-1]])
    faces = [faces + n for (_, faces), n in zip(parts, count, strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def pins():
    """A bar with two rows of thin pins."""
    rods = [box((i, 0, k), (i + 0.25, 3, k + 0.25)) for i in np.arange(20) for k in (0.0, 0.8)]
    return joined([box((-0.5, 0.8, -0.3), (20, 1.6, 1.4)), *rods])


def facade():
    """A wall with many small windows that stand out a little."""
    panes = [
        box((x, y, 1.0), (x + 0.25, y + 0.35, 1.05))
        for x in np.arange(0.3, 11.5, 0.6)
        for y in np.arange(0.3, 4.5, 0.8)
    ]
    return joined([box((0, 0, 0), (12, 5, 1)), *panes])


def bumps():
    """A dented ball: contours, suggestive contours, ridges, valleys, and some noise."""
    vertices, faces = shapes.sphere(5)
    x, y, z = vertices.T
    height = 0.12 * np.sin(5 * x + 1) * np.cos(4 * y) + 0.08 * np.sin(6 * z)
    noise = np.random.default_rng(3).normal(0.0, 0.001, len(vertices))
    return vertices * (1.0 + height + noise)[:, None], faces


MADE = {"pins": pins, "facade": facade, "bumps": bumps, "torus": shapes.torus}


def drawn(lines, size):
    """Strokes at a size of the canvas, in px of a canvas of 768."""
    camera = fit_camera(lines.surface.vertices, width=size, height=size)
    sight = look_along(lines.surface, camera, lines.seen_from(camera), lines.bvh)
    fragments = sight.fragments()
    curves = tidy(fragments.curves, fragments.strength, (size, size))
    return Curves(curves.xy * 768 / size, curves.offsets, curves.kind, curves.closed)


@pytest.mark.parametrize("name", [*MADE, "bracket", "cloth", "elephant", "hand", "teapot"])
def test_each_line_of_a_canvas_is_there_on_a_larger_one(name):
    if name in MADE:
        vertices, faces = MADE[name]()
        surface = make_surface(vertices, faces)
    else:
        surface = load_surface(str(EXAMPLES / f"{name}.ply"))
    lines = SurfaceLines(surface)
    first = drawn(lines, 768)
    asked, length = resample_curves(first, 1.0).xy, first.lengths().sum()
    for size in (1536, 3072):
        larger = drawn(lines, size)
        away = cKDTree(resample_curves(larger, 0.5).xy).query(asked)[0]
        assert (away <= 2.0).mean() >= 0.99
        assert larger.lengths().sum() >= 0.995 * length


@pytest.mark.parametrize("name", ["pins", "facade"])
def test_small_things_are_drawn_where_there_is_room(name):
    lines = SurfaceLines(make_surface(*MADE[name]()))
    length = [drawn(lines, size).lengths().sum() for size in (192, 384, 768, 1536, 3072)]
    assert (np.diff(length) > -0.002 * length[-1]).all() and length[-1] > 1.03 * length[2]
