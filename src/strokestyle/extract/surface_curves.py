"""Curves that still know where on the mesh they lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.curves import KINDS, check_offsets, kept_stretches, owner, take_ragged
from ..mesh.surface import Surface
from ..mesh.triangles import row_dot


@dataclass(frozen=True)
class SurfaceCurves:
    """Polylines that know where on the mesh they lie.

    Parameters
    ----------
    face : (N,) int64; the segment from row i to row i + 1 of a curve lies in (or along) face[i]
    bary : (N, 3) float64, weights of the corners of that face
    offsets : (C+1,) int64, curve i is rows offsets[i]:offsets[i+1], at least two
    kind : (C,) int8, index into curves.KINDS
    closed : (C,) bool; a closed curve repeats its first point as its last
    strength : (N,) float64 in 0..1, how far above its threshold the line is there; 1 for contours,
        creases and boundaries

    Raises
    ------
    ValueError
        on a wrong shape or a value that is not finite.
    """

    face: np.ndarray
    bary: np.ndarray
    offsets: np.ndarray
    kind: np.ndarray
    closed: np.ndarray
    strength: np.ndarray

    def __post_init__(self):
        face, bary = np.asarray(self.face, np.int64), np.asarray(self.bary, np.float64)
        offsets, kind = np.asarray(self.offsets, np.int64), np.asarray(self.kind, np.int8)
        closed, strength = np.asarray(self.closed, bool), np.asarray(self.strength, np.float64)
        if face.ndim != 1 or bary.shape != (len(face), 3) or strength.shape != (len(face),):
            raise ValueError(
                f"SurfaceCurves.face, .bary and .strength must have shapes (N,), (N, 3) and (N,), "
                f"got {face.shape}, {bary.shape} and {strength.shape}"
            )
        if not (np.isfinite(bary).all() and np.isfinite(strength).all()):
            raise ValueError("SurfaceCurves holds values that are not finite")
        check_offsets(offsets, len(face), 2, "SurfaceCurves")
        count = len(offsets) - 1
        if kind.shape != (count,) or closed.shape != (count,):
            raise ValueError(
                f"SurfaceCurves.kind and .closed must have shape ({count},), "
                f"got {kind.shape} and {closed.shape}"
            )
        if count and not (0 <= kind.min() and kind.max() < len(KINDS)):
            raise ValueError(f"SurfaceCurves.kind must lie in 0..{len(KINDS) - 1}")
        for name, value in zip(
            ("face", "bary", "offsets", "kind", "closed", "strength"),
            (face, bary, offsets, kind, closed, strength),
            strict=True,
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @classmethod
    def empty(cls) -> SurfaceCurves:
        """Make no curves."""
        none = np.zeros(0)
        return cls(none, np.zeros((0, 3)), np.zeros(1, np.int64), none, none, none)

    @classmethod
    def concatenate(cls, parts: list[SurfaceCurves]) -> SurfaceCurves:
        """Put curves of one surface one after the other."""
        if not parts:
            return cls.empty()
        counts = np.concatenate([np.diff(part.offsets) for part in parts])
        columns = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("face", "bary", "kind", "closed", "strength")
        )
        face, bary, kind, closed, strength = columns
        return cls(face, bary, np.r_[0, np.cumsum(counts)], kind, closed, strength)

    def take(self, index: np.ndarray) -> SurfaceCurves:
        """Take the curves of an index or mask over C, in that order."""
        index = np.arange(len(self))[np.asarray(index)]
        rows, offsets = take_ragged(self.offsets, index)
        return SurfaceCurves(
            self.face[rows],
            self.bary[rows],
            offsets,
            self.kind[index],
            self.closed[index],
            self.strength[rows],
        )

    def where(self, keep: np.ndarray) -> SurfaceCurves:
        """Cut out stretches of two or more kept points, `keep` (N,) bool; cut loops are open."""
        if keep.all():
            return self
        rows, offsets, of, whole = kept_stretches(owner(self.offsets), keep)
        return SurfaceCurves(
            self.face[rows],
            self.bary[rows],
            offsets,
            self.kind[of],
            self.closed[of] & whole,
            self.strength[rows],
        )

    def points(self, surface: Surface) -> np.ndarray:
        """Place the points in space, (N, 3)."""
        return self.interpolate(surface, surface.vertices)

    def interpolate(self, surface: Surface, values: np.ndarray) -> np.ndarray:
        """Interpolate per-vertex values (V,) or (V, k) at every point, (N,) or (N, k)."""
        return interpolate_on_faces(surface, self.face, self.bary, values)


def interpolate_on_faces(
    surface: Surface, face: np.ndarray, bary: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """Interpolate per-vertex values (V,) or (V, k) at places in faces, (...,) or (..., k).

    `face` : (...) int; `bary` : (..., 3), weights of its corners
    """
    columns = values.reshape(len(values), -1)
    found = np.einsum("...i,...ik->...k", bary, columns[surface.faces[face]])
    return found.reshape(bary.shape[:-1] + values.shape[1:])


def barycentric(corner: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Weigh the corners (S, 3, 3) of faces at points (S, k, 3) in them, (S, k, 3)."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(a, b)
    # each at right angles to the other side
    across = np.stack([np.cross(b, normal), np.cross(normal, a)], axis=1)
    rel = points - corner[:, :1]
    weight = np.einsum("sek,sik->sei", rel, across) / row_dot(normal, normal)[:, None, None]
    own = 1.0 - weight.sum(axis=2, keepdims=True)
    bary = np.clip(np.concatenate([own, weight], axis=2), 0.0, 1.0)
    return bary / bary.sum(axis=2, keepdims=True)
