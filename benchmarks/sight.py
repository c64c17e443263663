"""What of a line on a surface is seen, by exact slow roads in double precision: for
`benchmarks/lines.py`.

Opinions on the same points: the rule of `Scene.seen`, which they share but for embree, its float32
and its rounds (`by_rule`); the smooth surface that the mesh stands for, from its normals
(`by_curved_faces`) or from a formula (`by_formula`); and the facets as they stand (`by_mesh`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from strokestyle.extract.rays import LIFT, NEAR
from strokestyle.mesh.surface import Surface

CELLS = 256  # per axis of the image, for finding the triangles that may stand before a point


@dataclass(frozen=True)
class Crossings:
    """Where straight lines from the eye to targets meet triangles on the way.

    Parameters
    ----------
    target, triangle : (X,) int
    gap : (X,), how far before the target
    """

    target: np.ndarray
    triangle: np.ndarray
    gap: np.ndarray


def crossings(corners: np.ndarray, eye: np.ndarray, targets: np.ndarray) -> Crossings:
    """All of them: triangles (T, 3, 3), targets (N, 3), all in front of the eye. Moller-Trumbore in
    double precision.

    A line can only meet a triangle whose image has the target's within its box: pairs come from a
    grid over the image."""
    forward = targets.mean(axis=0) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, np.eye(3)[np.abs(forward).argmin()])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right)], axis=1)

    def image(points):
        depth = (points - eye) @ forward
        if depth.min() <= 0.0:
            raise ValueError("a point lies behind the eye")
        return ((points - eye) @ axes) / depth[..., None]

    xy, box = image(targets), image(corners)
    low, high = xy.min(axis=0) - 1e-9, xy.max(axis=0) + 1e-9

    def cell(at):
        return np.floor((at - low) / (high - low) * CELLS).astype(np.int64)

    inside = cell(xy)
    first, last = (cell(edge).clip(0, CELLS - 1) for edge in (box.min(axis=1), box.max(axis=1)))
    meets = (box.max(axis=1) >= low).all(axis=1) & (box.min(axis=1) <= high).all(axis=1)
    wide, tall = np.where(meets[:, None], last - first + 1, 0).T
    triangle = np.repeat(np.arange(len(corners)), wide * tall)
    k = np.arange(len(triangle)) - np.repeat(np.cumsum(wide * tall) - wide * tall, wide * tall)
    column, row = first[triangle, 0] + k % wide[triangle], first[triangle, 1] + k // wide[triangle]
    order = np.argsort(row * CELLS + column, kind="stable")
    triangle, key = triangle[order], (row * CELLS + column)[order]
    own = inside[:, 1] * CELLS + inside[:, 0]
    begin, end = np.searchsorted(key, own, "left"), np.searchsorted(key, own, "right")
    target = np.repeat(np.arange(len(targets)), end - begin)
    k = np.arange(len(target)) - np.repeat(np.cumsum(end - begin) - (end - begin), end - begin)
    triangle = triangle[begin[target] + k]
    within = (xy[target] >= box.min(axis=1)[triangle]) & (xy[target] <= box.max(axis=1)[triangle])
    near = within.all(axis=1)
    target, triangle = target[near], triangle[near]

    a, b, c = (corners[triangle, i] for i in range(3))
    ray = targets[target] - eye
    first_side, second_side = b - a, c - a
    across = np.cross(ray, second_side)
    with np.errstate(divide="ignore", invalid="ignore"):
        f = 1.0 / np.einsum("ij,ij->i", first_side, across)
        u = f * np.einsum("ij,ij->i", eye - a, across)
        q = np.cross(eye - a, first_side)
        v, t = f * np.einsum("ij,ij->i", ray, q), f * np.einsum("ij,ij->i", second_side, q)
    hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1 - 1e-9)
    length = np.linalg.norm(ray[hit], axis=1)
    return Crossings(target[hit], triangle[hit], (1 - t[hit]) * length)


@dataclass(frozen=True)
class Places:
    """Points (N,) on lines of a surface, one per straight piece of line: their face, barycentric
    coordinates, the piece's length, its kind, and whether that kind is an edge of the mesh."""

    face: np.ndarray
    bary: np.ndarray
    length: np.ndarray
    kind: np.ndarray
    sharp: np.ndarray

    def on(self, surface: Surface, values: np.ndarray) -> np.ndarray:
        return np.einsum("ni,nik->nk", self.bary, values[surface.faces[self.face]])


def _edge(surface: Surface) -> np.ndarray:
    corner = surface.vertices[surface.faces]
    return np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2).mean(axis=1)


def _width(surface: Surface) -> np.ndarray:
    """Mean edges, or three times the mean height of the faces at a corner where that is less."""
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    longest = np.max([np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c)], axis=0)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / longest
    corner = surface.faces.ravel()
    mean = np.bincount(corner, np.repeat(height, 3)) / np.bincount(corner)
    return np.minimum(_edge(surface), 3.0 * mean[surface.faces].max(axis=1))


def _touches(surface: Surface, hit: np.ndarray, face: np.ndarray) -> np.ndarray:
    return (surface.faces[hit][:, :, None] == surface.faces[face][:, None, :]).any(axis=(1, 2))


def _seen(count: int, hiding: np.ndarray) -> np.ndarray:
    seen = np.ones(count, bool)
    seen[hiding] = False
    return seen


def by_rule(surface: Surface, eye: np.ndarray, places: Places) -> np.ndarray:
    """The rule of `Scene.seen`, over every triangle that a ray meets."""
    edge = _width(surface)[places.face]
    normal = surface.normals[surface.faces[places.face]].sum(axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    target = (
        places.on(surface, surface.vertices)
        + normal * np.where(places.sharp, 0.0, LIFT * edge)[:, None]
    )
    found = crossings(surface.vertices[surface.faces], eye, target)
    own = _touches(surface, found.triangle, places.face[found.target])
    ignored = ~places.sharp[found.target] & own & (found.gap < NEAR * edge[found.target])
    return _seen(len(target), found.target[~ignored & (found.gap > 1e-6)])


def by_mesh(surface: Surface, eye: np.ndarray, places: Places) -> np.ndarray:
    """The facets as they stand: whatever does not touch a point's own face hides it, be it by a
    hair of a fold."""
    found = crossings(surface.vertices[surface.faces], eye, places.on(surface, surface.vertices))
    own = _touches(surface, found.triangle, places.face[found.target])
    return _seen(len(places.face), found.target[~own & (found.gap > 1e-6)])


def by_curved_faces(
    surface: Surface, eye: np.ndarray, places: Places, parts: int = 3
) -> np.ndarray:
    """Every face as a curved point-normal triangle (Vlachos 2001), cut into parts^2, and the places
    lifted onto it by a tenth of an edge: the smooth surface whose normals the mesh has."""
    corner, normal = surface.vertices[surface.faces], surface.normals[surface.faces]
    middle = {}
    for i in range(3):
        for j in range(3):
            if i != j:
                height = np.einsum("fk,fk->f", corner[:, j] - corner[:, i], normal[:, i])[:, None]
                middle[i, j] = (2.0 * corner[:, i] + corner[:, j] - height * normal[:, i]) / 3.0
    ring = sum(middle.values()) / 6.0
    centre = ring + 0.5 * (ring - corner.mean(axis=1))

    def curved(face, bary):
        out = sum(bary[..., i, None] ** 3 * corner[face, i] for i in range(3))
        for (i, j), point in middle.items():
            out = out + 3.0 * (bary[..., i] ** 2 * bary[..., j])[..., None] * point[face]
        return out + 6.0 * bary.prod(axis=-1)[..., None] * centre[face]

    i, j = (
        n.ravel() for n in np.meshgrid(np.arange(parts + 1), np.arange(parts + 1), indexing="ij")
    )
    number = {(a, b): k for k, (a, b) in enumerate(zip(i, j, strict=True))}
    small = [
        [number[a, b], number[a + 1, b], number[a, b + 1]]
        for a in range(parts)
        for b in range(parts - a)
    ]
    small += [[number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]]
              for a in range(parts) for b in range(parts - a - 1)]  # fmt: skip
    grid = np.stack([1.0 - (i + j) / parts, i / parts, j / parts], axis=1)
    every = np.arange(len(corner))[:, None]
    corners = curved(every, grid[None])[:, np.array(small)].reshape(-1, 3, 3)
    lift = places.on(surface, surface.normals)
    lift /= np.maximum(np.linalg.norm(lift, axis=1, keepdims=True), 1e-12)
    target = (
        curved(places.face, places.bary)
        + np.where(places.sharp, 0.0, 0.1 * _edge(surface)[places.face])[:, None] * lift
    )
    found = crossings(corners, eye, target)
    own = places.sharp[found.target] & (found.triangle // parts**2 == places.face[found.target])
    return _seen(len(target), found.target[~own & (found.gap > 1e-5)])


def by_formula(
    height: Callable, eye: np.ndarray, position: np.ndarray, slack: float, steps: int = 1500
) -> np.ndarray:
    """The surface height(points (N, 3)) = 0, positive outside and nearly a distance: seen where the
    way to the eye never lies deeper than `slack`, the distance between mesh and surface."""
    seen = np.ones(len(position), bool)
    for t in np.linspace(0.0, 1.0, steps)[1:]:
        left = np.flatnonzero(seen)
        seen[left] = height(eye + (1.0 - t) * (position[left] - eye)) > -slack
    return seen
