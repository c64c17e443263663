"""Solids with flat sides, as CAD and Blender write them: few and large polygons."""

from typing import NamedTuple

import numpy as np


class Solid(NamedTuple):
    """Polygons, and the vertices (V, 3) that they name."""

    vertices: np.ndarray
    polygons: list

    def moved(self, by):
        return Solid(self.vertices + np.asarray(by, float), self.polygons)

    def scaled(self, by):
        return Solid(self.vertices * by, self.polygons)

    def turned(self, degrees, axis=1):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn, i, j = np.eye(3), (axis + 1) % 3, (axis + 2) % 3
        turn[i, i], turn[i, j], turn[j, i], turn[j, j] = c, -s, s, c
        return Solid(self.vertices @ turn.T, self.polygons)

    @property
    def faces(self):
        """(F, 3), the polygons cut in fans."""
        return np.array(
            [(p[0], p[i], p[i + 1]) for p in self.polygons for i in range(1, len(p) - 1)]
        )

    @property
    def polygon(self):
        """(F,), which polygon each face was cut from."""
        return np.repeat(np.arange(len(self.polygons)), [len(p) - 2 for p in self.polygons])

    @property
    def soup(self):
        """The same with three vertices of its own for each face, as an STL file has it."""
        return self.vertices[self.faces].reshape(-1, 3), np.arange(3 * len(self.faces)).reshape(
            -1, 3
        )


def together(*solids):
    """Several solids as one, no vertex shared."""
    polygons, before = [], 0
    for solid in solids:
        polygons += [tuple(np.add(p, before)) for p in solid.polygons]
        before += len(solid.vertices)
    return Solid(np.vstack([solid.vertices for solid in solids]), polygons)


def box(low=(0, 0, 0), high=(1, 1, 1)):
    """Six quads, outward."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    bits = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
    polygons = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Solid(low + bits * (high - low), polygons)


def boxes(columns, rows=1):
    """Unit cubes side by side, no vertex shared."""
    return together(
        *(box((i, j, 0), (i + 1, j + 1, 1)) for i in range(columns) for j in range(rows))
    )


def prism(sides, height=1.0, radius=0.5, layers=1, twist=0.0):
    """A closed upright prism of quads between two caps, each layer turned by `twist` degrees."""
    at = 2 * np.pi * np.arange(sides) / sides + np.radians(twist) * np.arange(layers + 1)[:, None]
    y = np.linspace(0.0, height, layers + 1)[:, None] + 0 * at
    vertices = np.stack([radius * np.cos(at), y, radius * np.sin(at)], axis=2).reshape(-1, 3)
    polygons = []
    for k in range(layers):
        for i in range(sides):
            a, b = k * sides + i, k * sides + (i + 1) % sides
            polygons.append((a, a + sides, b + sides, b))
    top = layers * sides + np.arange(sides)
    return Solid(vertices, [*polygons, tuple(range(sides)), tuple(top[::-1])])
