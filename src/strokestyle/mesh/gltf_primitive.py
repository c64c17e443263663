"""Read a primitive of a glTF mesh: its triangles, morph targets and joints.

Sections are those of the glTF 2.0 specification, Khronos Group, version 2.0.1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..files import quoted
from .gltf_file import GltfFile, normalized
from .gltf_nodes import extension_of
from .messages import NotSupported, warn
from .pieces import check_corners, label

_STRIP, _FAN = 5, 6
_DRACO = "KHR_draco_mesh_compression"
Attribute = Callable[[str], "np.ndarray | None"]


@dataclass(frozen=True)
class Primitive:
    """Triangles in the frame of their mesh.

    Parameters
    ----------
    points : (V, 3) float64
    faces : (F, 3) int64
    polygon : (F,) int64, the first face of the polygon that each is of, where FB_ngon_encoding
        tells
    targets : displacements (V, 3) of each morph target, None of one that moves nothing
    joints, weights : (V, K) int64 and float64, of the K joints that move a vertex; K may be 0
    """

    points: np.ndarray
    faces: np.ndarray
    polygon: np.ndarray | None
    targets: tuple[np.ndarray | None, ...]
    joints: np.ndarray
    weights: np.ndarray

    @property
    def has_joints(self) -> bool:
        return self.joints.shape[1] > 0

    def morphed(self, weights: list[float]) -> np.ndarray:
        """Move the points (V, 3) to the targets, each as far as its weight says (3.7.2.2)."""
        points = self.points
        for weight, target in zip(weights, self.targets, strict=False):
            if weight and target is not None:
                points = points + weight * target
        return points

    def skinned(self, points: np.ndarray, matrices: np.ndarray) -> np.ndarray:
        """Move points (V, 3) by joints' matrices (J, 4, 4), a weighted mean for each (3.7.3.3).

        Weights that do not sum to 1 are scaled so that they do; where all are 0, the first joint
        moves the point, as in three.js.
        """
        total = self.weights.sum(axis=1)
        weights = self.weights / np.where(total > 0, total, 1.0)[:, None]
        weights[total <= 0, 0] = 1.0
        joints = np.where(weights != 0, self.joints, 0)
        if len(joints) and joints.max() >= len(matrices):
            raise ValueError(f"a vertex hangs on joint {joints.max()} of {len(matrices)}")
        moved = np.zeros_like(points)
        for joint, weight in zip(joints.T, weights.T, strict=True):
            matrix = matrices[joint]
            at = np.einsum("vij,vj->vi", matrix[:, :3, :3], points) + matrix[:, :3, 3]
            moved += weight[:, None] * at
        return moved


def read_primitive(file: GltfFile, entry: dict[str, Any], name: str) -> Primitive:
    """Read a primitive (3.7.2.1), without the vertices that none of its triangles has.

    Raises
    ------
    ValueError
        naming the part, where a triangle names a vertex that does not exist, or numbers are
        missing.
    """
    attribute, faces = _attributes(file, entry)
    points = attribute("POSITION")
    if points is None or points.shape[1] != 3:
        raise ValueError(f"the positions of {label(name)} are not of three coordinates")
    count = len(points)
    check_corners(faces, count, name)
    polygon = None
    if "FB_ngon_encoding" in entry.get("extensions", {}) and len(faces):
        starts = np.r_[True, faces[1:, 0] != faces[:-1, 0]]  # the triangles of one share the first
        polygon = np.flatnonzero(starts)[np.cumsum(starts) - 1]
    rows: np.ndarray | slice = slice(None)
    if faces.size < count:  # many primitives may share the vertices of a whole file
        rows, faces = np.unique(faces, return_inverse=True)
        faces = faces.reshape(-1, 3)

    def of_rows(values: np.ndarray | None, what: str) -> np.ndarray | None:
        if values is not None and len(values) != count:
            raise ValueError(f"{len(values)} {what} of {label(name)} for {count} vertices")
        return None if values is None else values[rows]

    targets = [target.get("POSITION") for target in entry.get("targets", [])]
    moves = [None if at is None else of_rows(file.accessor(at), "targets") for at in targets]
    joints, weights = _influences(lambda key: of_rows(attribute(key), "joints"), len(points[rows]))
    return Primitive(
        points[rows].astype(np.float64),
        faces.astype(np.int64),
        polygon,
        tuple(moves),
        joints,
        weights,
    )


def _influences(attribute: Attribute, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Lay the sets JOINTS_n and WEIGHTS_n side by side: (V, K) each."""
    joints, weights = [np.zeros((count, 0), np.int64)], [np.zeros((count, 0))]
    for number in range(16):
        joint, weight = attribute(f"JOINTS_{number}"), attribute(f"WEIGHTS_{number}")
        if joint is None or weight is None:
            break
        joints.append(joint.astype(np.int64))
        weights.append(weight.astype(np.float64))
    return np.concatenate(joints, axis=1), np.concatenate(weights, axis=1)


def _attributes(file: GltfFile, entry: dict[str, Any]) -> tuple[Attribute, np.ndarray]:
    """Give what looks up an attribute by its name, and the faces (F, 3)."""
    numbers = entry["attributes"]
    compressed = extension_of(entry, _DRACO)

    def plain(key: str) -> np.ndarray | None:
        return file.accessor(numbers[key]) if key in numbers else None

    if compressed and not _stands_plain(file, entry):
        decoded, faces = _decoded(file, entry, compressed)
        return lambda key: decoded[key] if key in decoded else plain(key), faces
    if "indices" in entry:
        corners = file.accessor(entry["indices"])
        if corners.dtype.kind == "f" or corners.shape[1] != 1:
            raise ValueError("the indices of a primitive are no whole numbers")
        corners = corners.ravel()
    else:
        positions = plain("POSITION")
        corners = np.arange(0 if positions is None else len(positions))
    restarts = np.zeros(len(corners), bool)
    if corners.dtype.kind == "u" and "indices" in entry:
        highest = np.iinfo(corners.dtype).max
        if highest >= len(file.accessor(numbers["POSITION"])):
            restarts = corners == highest
    return plain, triangulated(corners.astype(np.int64), entry.get("mode", 4), restarts)


def triangulated(corners: np.ndarray, mode: int, restarts: np.ndarray) -> np.ndarray:
    """Take the triangles (F, 3) of a list, strip or fan of corners (N,) (3.7.2.1).

    `restarts` : (N,) bool, corners that only end one strip, fan or list and begin the next
    """
    run = np.cumsum(restarts)
    at = np.arange(len(corners))
    first = np.r_[0, np.flatnonzero(restarts) + 1][run]  # where the run of each corner begins
    place = at - first  # of a corner in its run, -1 of a restart
    whole = np.zeros(len(corners), bool)  # does a triangle begin here?
    whole[:-2] = (run[:-2] == run[2:]) & (place[:-2] >= 0)
    if mode == _STRIP:
        begin = at[whole]
        odd = place[whole] % 2
        picked = np.stack([begin, begin + 1 + odd, begin + 2 - odd], axis=1)
    elif mode == _FAN:
        begin = at[whole]
        picked = np.stack([begin + 1, begin + 2, first[whole]], axis=1)
    else:
        begin = at[whole & (place % 3 == 0)]
        picked = begin[:, None] + np.arange(3)
        spare = len(corners) - restarts.sum() - picked.size
        if spare:
            warn(f"left out: corners that make no triangle ({spare})")
    return corners[picked]


def _stands_plain(file: GltfFile, entry: dict[str, Any]) -> bool:
    """Tell whether what Draco compressed is there uncompressed too."""
    numbers = [entry["attributes"]["POSITION"]]
    numbers += [entry["indices"]] if "indices" in entry else []
    return all("bufferView" in file.one("accessors", number) for number in numbers)


def _decoded(
    file: GltfFile, entry: dict[str, Any], compressed: dict[str, Any]
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Decode what KHR_draco_mesh_compression says: attributes by their names, faces (F, 3)."""
    try:
        import DracoPy
    except ImportError:
        raise NotSupported(
            "compressed by Draco, and reading that needs another package: pip install DracoPy"
        ) from None
    data = bytes(file.view_bytes(compressed["bufferView"]))
    try:
        mesh = DracoPy.decode(data)
        found = {
            key: np.asarray(mesh.get_attribute_by_unique_id(number)["data"])
            for key, number in compressed["attributes"].items()
        }
        faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    except Exception as error:  # of DracoPy's own kinds, and of what it calls
        what = quoted(" ".join(str(error).split()))
        raise ValueError(f"what Draco compressed cannot be decoded ({what})") from None
    for key, number in entry["attributes"].items():
        if key in found and file.one("accessors", number).get("normalized"):
            found[key] = normalized(found[key])
    return found, faces
