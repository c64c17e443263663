"""Corners of solids: as many strokes end there, or pass there, as edges are seen, exactly."""

import numpy as np
import pytest

from strokestyle.extract import pipeline
from strokestyle.extract.camera import fit_camera
from strokestyle.extract.lines import SurfaceLines
from strokestyle.extract.visible import look_along
from strokestyle.mesh.surface import make_surface

NEAR = 0.01  # px


def prism(sides, height=1.0, top=1.0):
    """A regular prism, or a pyramid's stump; a pyramid where `top` is 0."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    i = np.arange(sides)
    j = (i + 1) % sides
    below = [list(i)]
    if top == 0:
        tip = [[0.0, height, 0.0]]
        return np.r_[ring, tip], below + [[b, a, sides] for a, b in zip(i, j, strict=True)]
    sides_of = [[a, a + sides, b + sides, b] for a, b in zip(i, j, strict=True)]
    upper = ring * [top, 0, top] + [0, height, 0]
    return np.r_[ring, upper], below + sides_of + [list(sides + i[::-1])]


def cube():
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corner, faces


def box():
    corner, faces = cube()
    return corner * [3.0, 1.0, 0.4], faces


SOLIDS = {
    "cube": cube(),
    "box": box(),
    "pyramid": prism(4, 1.2, 0.0),
    "tetrahedron": prism(3, 1.4, 0.0),
    "triangular prism": prism(3, 1.5),
    "hexagonal prism": prism(6, 1.0),
    "stump": prism(5, 1.1, 0.5),
}


def seen_edges(vertices, faces, eye):
    """The edges of a convex solid that an eye sees: those of a face that faces it."""
    edges = set()
    centre = vertices.mean(axis=0)
    for face in faces:
        a, b, c = vertices[face[:3]]
        normal = np.cross(b - a, c - a)
        normal = normal if normal @ (a - centre) > 0 else -normal
        if normal @ (eye - a) > 0:
            around = zip(face, face[1:] + face[:1], strict=True)
            edges |= {(min(i, j), max(i, j)) for i, j in around}
    return edges


def strokes_of(surface, camera):
    """What `extract_view` draws, less the feature maps."""
    lines = SurfaceLines(surface)
    sight = look_along(surface, camera, lines.seen_from(camera), lines.bvh)
    return pipeline._tidied(surface, camera, sight.fragments(), 3.0).curves


def strokes_at(curves, point):
    """Ends of strokes at a point; a stroke that passes through it counts twice."""
    count = 0
    for i in range(len(curves)):
        gap = away_from(point, curves[i][:-1], curves[i][1:])
        ends = np.linalg.norm(curves[i][[0, -1]] - point, axis=1) <= NEAR
        count += int(ends.sum()) if ends.any() else 2 * int(gap.min() <= NEAR)
    return count


def away_from(point, a, b):
    """How far a point is from each of some segments."""
    t = np.einsum("ij,ij->i", point - a, b - a) / np.einsum("ij,ij->i", b - a, b - a)
    return np.linalg.norm(a + np.clip(t, 0, 1)[:, None] * (b - a) - point, axis=1)


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("size", [256, 768, 2400])
def test_strokes_meet_at_the_corners_of_a_solid(name, size):
    vertices, faces = SOLIDS[name]
    triangles = [[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)]
    surface = make_surface(vertices, np.array(triangles))
    vertices = surface.vertices  # scaled and centred
    asked = 0
    for azimuth, elevation in [(30, 20), (-50, 35), (100, 10), (10, 60), (200, -25)]:
        camera = fit_camera(surface.vertices, f"{azimuth},{elevation}", 30.0, size, size)
        curves = strokes_of(surface, camera)
        edges = seen_edges(vertices, faces, camera.eye)
        xy = camera.project(vertices)[0]
        for v in sorted({i for edge in edges for i in edge}):
            others = [i if j == v else j for i, j in edges if v in (i, j)]
            away = xy[others] - xy[v]
            length = np.linalg.norm(away, axis=1)
            heading = np.sort(np.degrees(np.arctan2(*away.T[::-1])))
            between = np.diff(np.r_[heading, heading[0] + 360])
            blunt = len(others) == 2 and between.max() < 190
            rest = np.array([edge for edge in edges if v not in edge])
            crowded = away_from(xy[v], *xy[rest.T]).min() < 8
            if length.min() < 20 or between.min() < 6 or blunt or crowded:
                continue
            asked += 1
            assert strokes_at(curves, xy[v]) == len(others), (azimuth, elevation, v, xy[v])
    assert asked >= 15
