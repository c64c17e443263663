"""Read glTF 2.0 files, .gltf and .glb.

Sections are those of the glTF 2.0 specification, Khronos Group, version 2.0.1.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from ..files import quoted
from .gltf_file import GltfFile
from .gltf_nodes import Nodes, read_nodes, text_of
from .gltf_primitive import Primitive, read_primitive
from .messages import NotSupported, counted, warn
from .pieces import Piece, together
from .triangles import Triangles

# Extensions that leave the shape as it is, or whose shape is read here.
_KNOWN = re.compile(
    r"(KHR|EXT|ADOBE|MSFT|NV|FB|MOZ|GRIFFEL|WEB3D)_(materials?|textures?|lights?|xmp|image|audio)_?"
    r"|KHR_(mesh_quantization|draco_mesh_compression|node_visibility|animation_pointer|xmp_json_ld)"
    r"|EXT_mesh_(gpu_instancing|features|manifold)|(EXT|KHR)_meshopt_compression"
    r"|EXT_(structural_metadata|instance_features)|KHR_(node_(hover|select)ability|interactivity)"
    r"|CESIUM_(RTC|primitive_outline)|VRMC?_?|KHR_physics|OMI_|FB_(ngon_encoding|geometry_metadata)"
)
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
# what writers that name all that they write call what had no name, by the names of the writers
_MADE_UP = {
    "https://github.com/mikedh/trimesh": r"(geometry|GLTF)(_\d+)?",
    "Open CASCADE": r"Open CASCADE STEP translator .*|SOLID|SHELL|COMPOUND|\d+",
}


def read_gltf(path: Path, data: bytes | None = None) -> Triangles:
    """Read the meshes of a glTF 2.0 file's scene, as they stand in the file's own pose.

    The default scene; else the first; else all nodes. Every mesh is placed by its nodes (3.5.2), by
    EXT_mesh_gpu_instancing, or by its skin's joints (3.7.3.3), morphed with the weights of the file
    (3.7.2.2). What KHR_node_visibility hides is left out. Animations do not move anything.
    Triangles, strips and fans are read, of numbers of all kinds (KHR_mesh_quantization), sparse
    (3.6.2.3) or compressed by Draco where DracoPy is there. Images are not opened.

    Parts are nodes by their names, meshes', or those of nodes over them; where fewer than two have
    a name, materials.

    `data` : the file's bytes, where they are known already

    Raises
    ------
    OSError
        where the file, or a buffer that it names, cannot be opened
    ValueError
        where it is damaged; NotSupported where it is sound, and says what would do
    """
    try:
        with np.errstate(all="ignore"):  # numbers that are not finite are refused with the surface
            return together(_pieces(GltfFile(path, data)))
    except (KeyError, TypeError, IndexError, AttributeError, OverflowError) as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())
        raise ValueError(f"not built as glTF is: {what[:100]}") from None


def _pieces(file: GltfFile) -> list[Piece]:
    """Place the triangles of all that is shown."""
    _check_extensions(file)
    nodes = read_nodes(file)
    primitives: dict[tuple[int, int], Primitive] = {}
    left_out: Counter[str] = Counter()
    pieces = []
    for index in nodes.shown:
        node = nodes.items[index]
        if "mesh" not in node:
            continue
        mesh = file.one("meshes", node["mesh"])
        name = _given_name(file, nodes.name(index, mesh))
        for number, entry in enumerate(mesh["primitives"]):
            mode = entry.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in entry["attributes"]:
                left_out[_kind(mode)] += 1
                continue
            key = node["mesh"], number
            if key not in primitives:
                primitives[key] = read_primitive(file, entry, name)
            material = _material(file, entry)
            pieces += _placed(file, nodes, index, mesh, primitives[key], (name, material))
    _tell(file, nodes, left_out, pieces)
    return pieces


def _check_extensions(file: GltfFile) -> None:
    """Warn of extensions that the file requires and that nothing is known of."""
    required = file.content.get("extensionsRequired", [])
    unknown = [name for name in required if isinstance(name, str) and not _KNOWN.match(name)]
    if unknown:
        warn(f"it requires {quoted(', '.join(unknown))}, which is not read here: drawn without")


def _placed(
    file: GltfFile,
    nodes: Nodes,
    index: int,
    mesh: dict[str, Any],
    primitive: Primitive,
    names: tuple[str, str],
) -> list[Piece]:
    """Place a primitive of a node's mesh in the scene."""
    if not len(primitive.faces):
        return []
    node = nodes.items[index]
    points = primitive.morphed(node.get("weights", mesh.get("weights", [])))
    if "skin" in node and primitive.has_joints:
        joints = _joints(file, nodes, node["skin"])
        points = primitive.skinned(points, joints)
        mirrored = np.array([np.median(np.linalg.det(joints[:, :3, :3])) < 0])
        placed = points[None]
    else:
        matrices = nodes.instances(index, file)
        mirrored = np.linalg.det(matrices[:, :3, :3]) < 0  # turns triangles about (3.7.2.1)
        placed = np.einsum("nij,vj->nvi", matrices[:, :3, :3], points) + matrices[:, None, :3, 3]
    faces = np.where(mirrored[:, None, None], primitive.faces[:, ::-1], primitive.faces)
    copy = np.arange(len(placed))[:, None]
    faces = faces + (copy * len(points))[:, :, None]
    polygon = primitive.polygon
    if polygon is not None:
        polygon = (polygon + copy * len(primitive.faces)).ravel()
    return [Piece(placed.reshape(-1, 3), faces.reshape(-1, 3), *names, polygon)]


def _joints(file: GltfFile, nodes: Nodes, index: Any) -> np.ndarray:
    """Give the matrices (J, 4, 4) from a skinned mesh to the scene, one a joint (3.7.3.3)."""
    skin = file.one("skins", index)
    joints = skin["joints"]
    for joint in joints:
        file.one("nodes", joint)
    world = nodes.world[joints]
    if "inverseBindMatrices" not in skin:
        return world
    inverse = file.accessor(skin["inverseBindMatrices"])
    if len(inverse) < len(joints) or inverse.shape[1] != 16:
        raise ValueError(f"a skin of {len(joints)} joints has {len(inverse)} matrices")
    return world @ inverse[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)


def _material(file: GltfFile, entry: dict[str, Any]) -> str:
    """Name the material of a primitive, "" where it has none, or the file does not have it."""
    materials, number = file.all("materials"), entry.get("material")
    if not isinstance(number, int) or not 0 <= number < len(materials):
        return ""
    return text_of(materials[number], "name")


def _given_name(file: GltfFile, name: str) -> str:
    """Keep the name that a file gives a part, "" where the program made one up."""
    generator = text_of(file.content.get("asset", {}), "generator")
    made_up = (form for writer, form in _MADE_UP.items() if generator.startswith(writer))
    return "" if any(re.fullmatch(form, name) for form in made_up) else name


def _kind(mode: Any) -> str:
    kinds = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
    return kinds.get(mode, "primitives without positions")


def _tell(file: GltfFile, nodes: Nodes, left_out: Counter[str], pieces: list[Piece]) -> None:
    """Warn of what is left out; raise where that is all."""
    kinds = counted(left_out)
    if pieces:
        if left_out:
            warn(f"left out: {kinds}; only triangles are drawn")
        return
    if left_out:
        raise NotSupported(f"no triangles in it, only {kinds}: make surfaces of them first")
    if not file.all("meshes"):
        raise NotSupported("no mesh in it")
    hidden = "" if nodes.shown else ", or all is hidden"
    raise NotSupported(
        f"no triangles in its scene{hidden}; meshes in all: {len(file.all('meshes'))}"
    )
