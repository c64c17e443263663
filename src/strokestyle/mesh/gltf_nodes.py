"""Place the nodes of a glTF scene: where each stands, which are shown, and how often.

Sections are those of the glTF 2.0 specification, Khronos Group, version 2.0.1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..files import quoted
from .gltf_file import GltfFile
from .messages import warn


@dataclass(frozen=True)
class Nodes:
    """The nodes of a file.

    Parameters
    ----------
    items : the N nodes as the file has them
    parent : (N,) int, the node over each, -1 over a root
    world : (N, 4, 4) float64, from a node's frame to the scene's
    shown : nodes of the scene that are not hidden, each before its children
    """

    items: list[dict[str, Any]]
    parent: np.ndarray
    world: np.ndarray
    shown: list[int]

    def name(self, index: int, mesh: dict[str, Any]) -> str:
        """Name a node with a mesh: itself, else its mesh, else the nearest named node over it."""
        own = text_of(self.items[index], "name") or text_of(mesh, "name")
        while not own and (index := int(self.parent[index])) >= 0:
            own = text_of(self.items[index], "name")
        return own

    def instances(self, index: int, file: GltfFile) -> np.ndarray:
        """Place a node's mesh once, or as often as EXT_mesh_gpu_instancing has it, (I, 4, 4)."""
        extension = extension_of(self.items[index], "EXT_mesh_gpu_instancing")
        attributes = extension.get("attributes", {})
        if not attributes:
            return self.world[index : index + 1]
        found = {name: file.accessor(number) for name, number in attributes.items()}
        counts = {len(values) for values in found.values()}
        if len(counts) > 1:
            raise ValueError(f"instances of node {self._label(index)} are of {sorted(counts)}")
        own = compose(
            found.get("TRANSLATION"), found.get("ROTATION"), found.get("SCALE"), counts.pop()
        )
        return self.world[index] @ own

    def _label(self, index: int) -> str:
        name = text_of(self.items[index], "name")
        return repr(quoted(name)) if name else str(index)


def read_nodes(file: GltfFile) -> Nodes:
    """Read the nodes of a file, and which of them its scene shows (3.5).

    A node is hidden, with all below it, where KHR_node_visibility says so.

    Raises ValueError where a node is its own ancestor, or children or scenes name no node.
    """
    items = file.all("nodes")
    parent, children = _family(file, items)
    world = _locals(items)
    todo = np.flatnonzero(parent < 0).tolist()
    placed = np.zeros(len(items), bool)
    while todo:
        index = todo.pop()
        if parent[index] >= 0:
            world[index] = world[parent[index]] @ world[index]
        todo += children[index]
        placed[index] = True
    nodes = Nodes(items, parent, world, [])
    if not placed.all():
        raise ValueError(f"node {nodes._label(int(np.argmin(placed)))} hangs below itself")
    roots = _roots(file, np.flatnonzero(parent < 0).tolist())
    seen: set[int] = set()
    todo = roots[::-1]
    while todo:
        index = todo.pop()
        visible = extension_of(items[index], "KHR_node_visibility").get("visible", True)
        if index not in seen and visible:
            nodes.shown.append(index)
            todo += children[index][::-1]
        seen.add(index)
    return nodes


def _family(file: GltfFile, items: list[dict[str, Any]]) -> tuple[np.ndarray, list[list[int]]]:
    """Find parent (N,) and children of each node; one of several parents only has the node."""
    parent = np.full(len(items), -1)
    children: list[list[int]] = [[] for _ in items]
    twice = 0
    for index, node in enumerate(items):
        for child in node.get("children", []):
            file.one("nodes", child)
            if parent[child] >= 0:
                twice += 1
                continue
            parent[child] = index
            children[index].append(child)
    if twice:
        warn(f"nodes below several others, drawn only where they are named first: {twice}")
    return parent, children


def _roots(file: GltfFile, orphans: list[int]) -> list[int]:
    """Name the roots of the default scene, of the first, or where there is none those of all."""
    scenes = file.all("scenes")
    if not scenes:
        return orphans
    roots = file.one("scenes", file.content.get("scene", 0)).get("nodes", [])
    for index in roots:
        file.one("nodes", index)
    return list(roots)


def _locals(items: list[dict[str, Any]]) -> np.ndarray:
    """Give the matrices (N, 4, 4) from nodes to their parents' frames (3.5.2)."""
    values = {"translation": np.zeros((len(items), 3)), "scale": np.ones((len(items), 3)),
              "rotation": np.tile([0.0, 0.0, 0.0, 1.0], (len(items), 1)),
              "matrix": np.zeros((len(items), 16))}  # fmt: skip
    for index, node in enumerate(items):
        for key, rows in values.items():
            if key in node:
                rows[index] = _numbers(node[key], rows.shape[1])
    matrices = compose(values["translation"], values["rotation"], values["scale"], len(items))
    whole = [index for index, node in enumerate(items) if "matrix" in node]
    matrices[whole] = values["matrix"][whole].reshape(-1, 4, 4).transpose(0, 2, 1)
    return matrices


def compose(
    translation: np.ndarray | None,
    rotation: np.ndarray | None,
    scale: np.ndarray | None,
    count: int,
) -> np.ndarray:
    """Make matrices T R S (N, 4, 4) of translations (N, 3), quaternions xyzw (N, 4), scales (N, 3).

    What is None, of N = `count`, changes nothing. Quaternions are scaled to length 1.
    """
    matrix = np.tile(np.eye(4), (count, 1, 1))
    if rotation is not None:
        matrix[:, :3, :3] = _rotation(np.asarray(rotation, np.float64))
    if scale is not None:
        matrix[:, :3, :3] *= np.asarray(scale, np.float64)[:, None, :]
    if translation is not None:
        matrix[:, :3, 3] = translation
    return matrix


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    """Make rotations (N, 3, 3) of quaternions xyzw (N, 4); those of length 0 do not turn."""
    square = np.einsum("ni,ni->n", quaternion, quaternion)
    x, y, z, w = (quaternion / np.sqrt(np.where(square > 0, square, 1.0))[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _numbers(values: Any, count: int) -> np.ndarray:
    numbers = np.array(values, np.float64)
    if numbers.shape != (count,):
        raise ValueError(f"a node's transform has {numbers.size} numbers for {count}")
    return numbers


def extension_of(item: dict[str, Any], name: str) -> dict[str, Any]:
    """Give what an extension says about a node, ...; {} where it says nothing."""
    found = item.get("extensions", {}).get(name, {})
    return found if isinstance(found, dict) else {}


def text_of(item: dict[str, Any], key: str) -> str:
    """Give a text of the file, "" where there is none."""
    value = item.get(key, "")
    return value.strip() if isinstance(value, str) else ""
