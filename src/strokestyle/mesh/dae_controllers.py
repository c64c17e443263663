"""What moves a geometry of a COLLADA file: skins, by joints, and morphs, by other geometries.

Chapters are those of the COLLADA 1.4.1 specification, Khronos Group and Sony.
"""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np

from ..files import quoted
from .dae_geometry import numbers_of, sources_of
from .triangles import scatter_sum

Element = ElementTree.Element


def morphed(morph: Element, points: np.ndarray, ids: dict[str, Element]) -> np.ndarray:
    """Move points (N, 3) to the targets of a <morph>, as far as the weights say (5, morph).

    `ids` : the elements of the file by their ids
    """
    sources = {child.get("id", ""): child for child in morph.findall("source")}
    inputs = {one.get("semantic"): one.get("source", "").lstrip("#") for one in morph.iter("input")}
    names, weights = inputs.get("MORPH_TARGET", ""), inputs.get("MORPH_WEIGHT", "")
    if names not in sources or weights not in sources:
        return points
    amounts = _numbers_in(sources[weights])
    whole = points
    if morph.get("method", "NORMALIZED") == "NORMALIZED":
        whole = (1.0 - amounts.sum()) * points
    for name, amount in zip(_words_in(sources[names]), amounts, strict=False):
        if amount:
            target = next(iter(sources_of(_one(ids, name)).values()), np.zeros((0, 3)))
            if len(target) != len(points):
                raise ValueError(f"a morph has {len(target)} positions for {len(points)}")
            whole = whole + amount * target
    return whole


def skinned(
    skin: Element, points: np.ndarray, world: Callable[[str], np.ndarray | None]
) -> np.ndarray:
    """Place points (N, 3) in the scene by the joints of a <skin> (4, skinning).

    Weights that do not sum to 1 are scaled so that they do; where there are none the point stays
    where the shape was bound.

    `world` : gives a joint's matrix (4, 4) to the scene by its name, None where there is none
    """
    sources = {child.get("id", ""): child for child in skin.findall("source")}
    shape = skin.find("bind_shape_matrix")
    bound = np.eye(4) if shape is None else numbers_of(shape, 16).reshape(4, 4)
    matrices = _joint_matrices(skin, sources, world)
    joint, weight, vertex = _influences(skin, sources, len(points))
    if len(joint) and joint.max() >= len(matrices):
        raise ValueError(f"a vertex hangs on joint {joint.max()} of {len(matrices)}")
    # -1 is the shape as it was bound
    matrices = np.concatenate([matrices, np.eye(4)[None]]) @ bound
    at = np.einsum("nij,nj->ni", matrices[joint][:, :3, :3], points[vertex])
    at += matrices[joint][:, :3, 3]
    total = scatter_sum(vertex, weight, len(points))
    sums = np.stack([scatter_sum(vertex, weight * at[:, i], len(points)) for i in range(3)], axis=1)
    still = points @ bound[:3, :3].T + bound[:3, 3]
    divided = sums / np.where(total > 0, total, 1.0)[:, None]
    return np.where(total[:, None] > 0, divided, still)


def _joint_matrices(
    skin: Element, sources: dict[str, Element], world: Callable[[str], np.ndarray | None]
) -> np.ndarray:
    """Give the matrices (J, 4, 4) from the bound shape to the scene, one a joint."""
    inputs = {
        one.get("semantic"): one.get("source", "").lstrip("#")
        for one in skin.findall("joints/input")
    }
    names = _words_in(_one(sources, inputs.get("JOINT", "")))
    inverse = np.tile(np.eye(4), (len(names), 1, 1))
    if "INV_BIND_MATRIX" in inputs:
        numbers = _numbers_in(_one(sources, inputs["INV_BIND_MATRIX"]))
        if len(numbers) < 16 * len(names):
            raise ValueError(f"a skin of {len(names)} joints has {len(numbers) // 16} matrices")
        inverse = numbers[: 16 * len(names)].reshape(-1, 4, 4)
    found = []
    for name in names:
        matrix = world(name)
        if matrix is None:
            raise ValueError(f"a skin names joint {quoted(name)!r}, and there is none")
        found.append(matrix)
    return np.array(found, np.float64).reshape(-1, 4, 4) @ inverse


def _influences(
    skin: Element, sources: dict[str, Element], count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read joints (M,), weights (M,) and the vertices (M,) that they move."""
    table = skin.find("vertex_weights")
    nothing = np.zeros(0, np.int64)
    if table is None:
        return nothing, np.zeros(0), nothing
    place = {one.get("semantic"): int(one.get("offset", 0)) for one in table.findall("input")}
    weights = next(
        one.get("source", "") for one in table.findall("input") if one.get("semantic") == "WEIGHT"
    )
    stride = 1 + max(place.values())
    each, rows = table.find("vcount"), table.find("v")
    if each is None or rows is None:
        return nothing, np.zeros(0), nothing
    many = numbers_of(each, kind=np.int64)
    pairs = numbers_of(rows, kind=np.int64)
    if len(many) != count or len(pairs) < stride * many.sum() or many.min(initial=0) < 0:
        raise ValueError(f"cut short: weights of {len(many)} vertices for {count}")
    pairs = pairs[: stride * many.sum()].reshape(-1, stride)
    amounts = _numbers_in(_one(sources, weights.lstrip("#")))
    index = pairs[:, place["WEIGHT"]]
    if len(index) and not 0 <= index.min() <= index.max() < len(amounts):
        raise ValueError(f"a vertex has weight {index.max()} of {len(amounts)}")
    return pairs[:, place["JOINT"]], amounts[index], np.repeat(np.arange(count), many)


def _one(elements: dict[str, Element], name: str) -> Element:
    if name not in elements:
        raise ValueError(f"it names {quoted(name)!r}, and there is none")
    return elements[name]


def _numbers_in(source: Element) -> np.ndarray:
    array = source.find("float_array")
    return np.zeros(0) if array is None else numbers_of(array)


def _words_in(source: Element) -> list[str]:
    """Read the names of a <source>."""
    for tag in ("Name_array", "IDREF_array", "SIDREF_array"):
        array = source.find(tag)
        if array is not None:
            return (array.text or "").split()
    return []
