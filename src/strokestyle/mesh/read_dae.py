"""Read COLLADA files, .dae, and .zae archives of them.

Chapters are those of the COLLADA 1.4.1 and 1.5.0 specifications, Khronos Group and Sony.
"""

from __future__ import annotations

import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np

from ..files import MAX_DEPTH, quoted
from .archive import zip_problem
from .dae_controllers import morphed, skinned
from .dae_geometry import Geometry, numbers_of, read_geometry, sources_of
from .messages import NotSupported, counted, warn
from .pieces import Piece, moved, together
from .text_file import xml_problem
from .triangles import Triangles

Element = ElementTree.Element
MAX_ARCHIVED = 2**31  # bytes of a document in an archive
MAX_USES = 100_000  # nodes drawn: a few that stand for one another may be billions
# asset/up_axis, to y up (chapter 5)
_UPRIGHT = {"Y_UP": np.eye(4), "Z_UP": np.eye(4)[[0, 2, 1, 3]] * [[1], [1], [-1], [1]],
            "X_UP": np.eye(4)[[1, 0, 2, 3]] * [[-1], [1], [1], [1]]}  # fmt: skip


class _Node(NamedTuple):
    """A node to be drawn: its matrix (4, 4) to the scene, names and ids of the nodes over it."""

    element: Element
    matrix: np.ndarray
    names: tuple[str, ...]
    above: tuple[int, ...]


def read_dae(path: Path) -> Triangles:
    """Read the visual scene of a COLLADA file, turned so that y is up.

    Nodes are placed by their transforms, one in another; nodes of the library as often as they are
    named. Polygons with notches and holes are cut at their ears. Skins stand in the pose of the
    file, morphs at its weights; animations do not move anything. Parts have the names of nodes,
    geometries, or those of nodes over them; where fewer than two have a name, materials.

    Raises
    ------
    OSError
        where it cannot be opened
    ValueError
        where it is damaged; NotSupported where it is sound, and says what would do
    """
    try:
        root = ElementTree.fromstring(_document(path))
    except ElementTree.ParseError as error:
        raise xml_problem(error) from None
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
    if root.tag != "COLLADA":
        raise ValueError(f"its XML is of {quoted(root.tag)!r}, not COLLADA")
    return _Document(root).triangles()


def _document(path: Path) -> bytes:
    """Give the XML, of an archive that of the document which its manifest names (1.5, 2)."""
    if not zipfile.is_zipfile(path):
        data = path.read_bytes()
        if data.startswith(b"PK\3\4"):
            raise zip_problem(path, zipfile.BadZipFile())
        return data
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            name = next((name for name in names if name.lower().endswith(".dae")), "")
            if "manifest.xml" in names:
                manifest = ElementTree.fromstring(archive.read("manifest.xml"))
                wanted = unquote(manifest.text or "").strip().partition("#")[0]
                name = str(PurePosixPath(wanted)) if str(PurePosixPath(wanted)) in names else name
            if not name:
                raise ValueError("there is no .dae in the archive")
            if archive.getinfo(name).file_size > MAX_ARCHIVED:
                raise ValueError(
                    f"{quoted(name)!r} in it is larger than {MAX_ARCHIVED // 2**20} MB"
                )
            return archive.read(name)
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:
        raise ValueError(f"its zip archive cannot be read: {error}") from None


class _Document:
    """A document: elements by their ids, geometries when a node asks for them."""

    def __init__(self, root: Element):
        self.root = root
        self.ids = {element.get("id", ""): element for element in root.iter() if element.get("id")}
        self.geometries: dict[int, Geometry] = {}
        self.left_out: Counter[str] = Counter()
        self.world: dict[int, np.ndarray] | None = None  # nodes' matrices, once a skin asks
        axis = root.find("asset/up_axis")
        up = (axis.text or "").strip() if axis is not None else "Y_UP"
        self.upright = _UPRIGHT.get(up, _UPRIGHT["Y_UP"])

    def triangles(self) -> Triangles:
        pieces = list(self._pieces())
        left_out = counted(self.left_out)
        if not pieces:
            only = f", only {left_out}" if left_out else ""
            raise NotSupported(f"no triangles or polygons in its scene{only}")
        if left_out:
            warn(f"left out: {left_out}")
        return together(pieces)

    def named(self, element: Element, key: str = "url") -> Element | None:
        """Find the element that a URL names, "#id"; None, and counted, where it is elsewhere."""
        url = unquote(element.get(key, ""))
        if not url.startswith("#"):
            self.left_out["things in other files"] += 1
            return None
        if url[1:] not in self.ids:
            raise ValueError(f"it names {quoted(url)}, and there is none")
        return self.ids[url[1:]]

    def _pieces(self) -> Iterator[Piece]:
        """Draw the nodes of the scene, in their order."""
        todo = [_Node(element, self.upright, (), ()) for element in reversed(self._roots())]
        count = 0
        while todo:
            node = todo.pop()
            count += 1
            if count > MAX_USES or len(node.above) > MAX_DEPTH:
                raise ValueError(f"more than {MAX_USES} nodes, or {MAX_DEPTH} one in another")
            element = node.element
            matrix = node.matrix @ _local(element)
            names = (*node.names, (element.get("name") or "").strip())
            below = []
            for child in element:
                inner: Element | None = child
                if child.tag in ("instance_geometry", "instance_controller"):
                    yield from self._drawn(child, matrix, names)
                    continue
                if child.tag == "instance_node":
                    inner = self.named(child)
                if inner is None or inner.tag != "node":
                    continue
                if id(inner) in (*node.above, id(element)):
                    raise ValueError(f"node {quoted(inner.get('id', ''))!r} hangs below itself")
                below.append(_Node(inner, matrix, names, (*node.above, id(element))))
            todo += reversed(below)

    def _roots(self) -> list[Element]:
        """Find the nodes of the scene: its own, the first of the library, or all geometries."""
        place = self.root.find("scene/instance_visual_scene")
        scene = self.root.find("library_visual_scenes/visual_scene")
        if place is not None:
            scene = self.named(place)
        if scene is not None:
            return scene.findall("node")
        top = Element("node")
        for geometry in self.root.findall("library_geometries/geometry"):
            ElementTree.SubElement(top, "instance_geometry", url="#" + geometry.get("id", ""))
        return [top]

    def _drawn(self, use: Element, matrix: np.ndarray, names: tuple[str, ...]) -> Iterator[Piece]:
        """Draw a geometry, or the one that a controller moves."""
        source = self.named(use)
        movers: list[Element] = []  # the first is the last to move
        while source is not None and source.tag == "controller" and len(movers) < MAX_DEPTH:
            mover = next((child for child in source if child.tag in ("skin", "morph")), None)
            if mover is None:
                raise ValueError("a controller that is neither skin nor morph")
            movers.append(mover)
            source = self.named(mover, "source")
        if source is None:
            return
        if source.tag != "geometry":
            raise ValueError(f"a {quoted(source.tag)} where a geometry is to be")
        if id(source) not in self.geometries:
            self.geometries[id(source)] = read_geometry(source, sources_of(source))
        geometry = self.geometries[id(source)]
        self.left_out += geometry.left_out
        name = next(filter(None, (names[-1], source.get("name"), *reversed(names[:-1]))), "")
        materials = self._materials(use)
        joints = self._joints(use) if any(mover.tag == "skin" for mover in movers) else _no_joint
        for part in geometry.parts:
            points, step = part.vertices, matrix
            for mover in reversed(movers):
                if mover.tag == "morph":
                    points = morphed(mover, points, self.ids)
                else:
                    points, step = skinned(mover, points, joints), self.upright
            vertices, faces = moved(points, part.faces, step)
            material = materials.get(part.material, part.material)
            yield Piece(vertices, faces, name.strip(), material, part.polygon)

    def _joints(self, use: Element) -> Callable[[str], np.ndarray | None]:
        """Give what finds a joint's matrix to the scene: below the skeletons, or anywhere."""
        roots = [self.ids.get((one.text or "").strip().lstrip("#")) for one in use.iter("skeleton")]
        if self.world is None:
            self.world = {}
            for root in self._roots():
                _place_all(root, self.world)
        world = self.world
        below = [node for root in roots if root is not None for node in root.iter("node")]
        by_sid = {node.get("sid"): node for node in reversed([*below, *self.root.iter("node")])}

        def find(name: str) -> np.ndarray | None:
            node = by_sid.get(name, self.ids.get(name))
            return None if node is None else world.get(id(node))

        return find

    def _materials(self, use: Element) -> dict[str, str]:
        """Look up what the symbols of materials stand for where a geometry is used."""
        found = {}
        for bound in use.iter("instance_material"):
            target = bound.get("target", "").lstrip("#")
            element = self.ids.get(target)
            name = (element.get("name") if element is not None else "") or target
            found[bound.get("symbol", "")] = name
        return found


def _no_joint(name: str) -> None:
    return None


def _place_all(root: Element, world: dict[int, np.ndarray]) -> None:
    """Note the matrix (4, 4) to the scene of each node below a root, by the node's identity."""
    todo = [(root, np.eye(4))]
    while todo:
        node, above = todo.pop()
        world[id(node)] = above @ _local(node)
        todo += [(child, world[id(node)]) for child in node.findall("node")]


def _local(node: Element) -> np.ndarray:
    """Multiply the transforms of a node in their order (5, node): a matrix (4, 4)."""
    matrix = np.eye(4)
    for child in node:
        make = _TRANSFORMS.get(child.tag)
        if make is not None:
            matrix = matrix @ make(child)
    return matrix


def _translation(element: Element) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = numbers_of(element, 3)
    return matrix


def _rotation(element: Element) -> np.ndarray:
    """Turn about an axis by degrees (Rodrigues)."""
    *axis, angle = numbers_of(element, 4)
    length = np.linalg.norm(axis)
    x, y, z = np.asarray(axis) / (length if length > 0 else 1.0)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    sine, cosine = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    matrix[:3, :3] += sine * cross + (1 - cosine) * (cross @ cross)
    return matrix


def _look_at(element: Element) -> np.ndarray:
    """Place at an eye what looks down -z at a point, with an up direction (5, lookat)."""
    eye, point, up = numbers_of(element, 9).reshape(3, 3)
    back = eye - point
    right = np.cross(up, back)
    axes = np.stack([right, np.cross(back, right), back], axis=1)
    length = np.linalg.norm(axes, axis=0)
    matrix = np.eye(4)
    matrix[:3, :3] = axes / np.where(length > 0, length, 1.0)
    matrix[:3, 3] = eye
    return matrix


def _skew(element: Element) -> np.ndarray:
    """Shift along an axis, by an angle, what is away from it along another (5, skew)."""
    angle, *axes = numbers_of(element, 7)
    turn, along = np.array(axes).reshape(2, 3)
    length = np.linalg.norm(turn) * np.linalg.norm(along)
    matrix = np.eye(4)
    matrix[:3, :3] += np.tan(np.radians(angle)) * np.outer(along, turn) / (length or 1.0)
    return matrix


_TRANSFORMS = {
    "matrix": lambda element: numbers_of(element, 16).reshape(4, 4),
    "translate": _translation,
    "rotate": _rotation,
    "scale": lambda element: np.diag([*numbers_of(element, 3), 1.0]),
    "lookat": _look_at,
    "skew": _skew,
}
