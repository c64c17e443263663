"""Read 3MF packages.

Sections are those of the 3MF Core Specification 1.3 and the Production Extension 1.2, 3MF
Consortium.
"""

from __future__ import annotations

import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple
from xml.etree import ElementTree

import numpy as np

from ..files import MAX_BYTES, MAX_DEPTH, quoted
from .archive import zip_problem
from .messages import NotSupported, counted, warn
from .model_3mf import Model, Object, Use
from .pieces import Piece, moved, together
from .text_file import xml_problem
from .triangles import Triangles

MAX_MODEL = 2**31  # bytes of one model file: some 25 million triangles
MAX_USES = 100_000  # objects put somewhere: a few lines of components may ask for billions
_BAMBU = "metadata/model_settings.config"
_PRUSA = "metadata/slic3r_pe_model.config"
_MODEL_TYPE = "/3dmodel"
# Objects of other types are no shape: supports, and in the files of slicers modifiers and blockers.
_SHAPES = ("model", "surface")
# Extensions that leave triangles as they are: materials, production, slices, triangle sets; and
# those whose geometry is counted when it is met.
_KNOWN = re.compile(
    "/3dmanufacturing/(core|material|production|slice|beamlattice|trianglesets|displacement|"
    "booleanoperations|volumetric|implicit)/"
)


class _Volume(NamedTuple):
    """What a slicer knows of a part of an object: a range of its triangles, or a component."""

    name: str
    is_shape: bool
    first: int = 0
    last: int | None = None


class _Place(NamedTuple):
    """An object to be put somewhere.

    path, id : of its model file, and in it
    matrix : (4, 4), from the object's own unit and frame to the build's
    names : of what it is part of, outermost first
    chain : path and id of the objects that it is a component of, and of itself
    """

    path: str
    id: str
    matrix: np.ndarray
    names: tuple[str, ...]
    chain: tuple[tuple[str, str], ...]


def read_3mf(path: Path) -> Triangles:
    """Read what a 3MF package is to build, in the unit of its root model.

    Items and components are placed by their transforms; objects are told apart by number and model
    file (Production Extension, 3.1), and each file has its own unit. Objects of other types than
    "model" and "surface" are left out, as slicers leave them out. Where nothing is to be built, all
    objects that are part of no other are drawn. Parts have the names of objects, the innermost
    first; Bambu Studio, OrcaSlicer and PrusaSlicer keep those of volumes in a file of their own.

    Raises
    ------
    OSError
        where it cannot be opened
    ValueError
        where it is damaged; NotSupported where it is sound, and says what would do
    """
    try:
        with zipfile.ZipFile(path) as package:
            return _Package(package).triangles()
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
        raise zip_problem(path, error) from None
    except RuntimeError as error:  # zipfile's word for a password
        raise NotSupported(f"it is encrypted ({error}): save it without a password") from None


class _Package:
    """An open package: its model files are read when something in them is asked for."""

    def __init__(self, package: zipfile.ZipFile):
        self.package = package
        self.names = {_plain(name): name for name in package.namelist()}
        self.models: dict[str, Model] = {}
        self.root = self._root()
        self.left_out: Counter[str] = Counter()
        self.volumes = _volumes(self)

    def triangles(self) -> Triangles:
        root = self.model(self.root)
        pieces = [piece for piece in self._pieces(root) if len(piece.faces)]
        for model in self.models.values():
            self.left_out += model.left_out
        if pieces:
            del self.left_out["slices"]  # of what is there as triangles too
        left_out = counted(self.left_out)
        if not pieces:
            only = f", only {left_out}" if left_out else ""
            raise NotSupported(f"no triangles in what it is to build{only}")
        if left_out:
            warn(f"left out: {left_out}; only the triangles of models are drawn")
        unknown = [name for name in root.required if not _KNOWN.search(name)]
        if unknown:
            warn(f"it requires {quoted(', '.join(unknown))}, which is not read here: drawn without")
        return together(pieces)

    def model(self, path: str) -> Model:
        """Read a model file of the package, once."""
        key = _plain(path)
        if key not in self.models:
            with self.open(key, MAX_MODEL) as stream:
                try:
                    self.models[key] = Model(stream)
                except ValueError as error:
                    raise ValueError(f"{quoted(key)}: {error}") from None
        return self.models[key]

    def open(self, path: str, limit: int) -> IO[bytes]:
        """Open a file of the package that is no larger than `limit`."""
        name = self.names.get(_plain(path))
        if name is None:
            raise ValueError(f"there is no {quoted(path)!r} in it")
        if self.package.getinfo(name).file_size > limit:
            raise ValueError(f"{quoted(name)!r} in it is larger than {limit // 2**20} MB")
        return self.package.open(name)

    def _root(self) -> str:
        """Find the root model (2.1.1): the one that _rels/.rels names."""
        if "_rels/.rels" in self.names:
            tree = self.xml("_rels/.rels")
            for relation in tree.iter():
                target = _plain(relation.get("Target", ""))
                if relation.get("Type", "").endswith(_MODEL_TYPE) and target in self.names:
                    return target
        models = sorted(name for name in self.names if name.endswith(".model"))
        if not models:
            raise ValueError("there is no model in it")
        return next((name for name in models if name == "3d/3dmodel.model"), models[0])

    def xml(self, path: str) -> ElementTree.Element:
        """Read a small XML file of the package."""
        with self.open(path, MAX_BYTES) as stream:
            text = stream.read()
        if b"<!DOCTYPE" in text:
            raise ValueError(f"{quoted(path)}: a document type, which 3MF files must not have")
        try:
            return ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise ValueError(f"{quoted(path)}: {xml_problem(error)}") from None

    def _pieces(self, root: Model) -> Iterator[Piece]:
        """Put the objects of the build where it wants them, components one in another."""
        items = root.items
        if not items:
            inner = {part.id for one in root.objects.values() for part in one.components}
            items = [Use("", number, np.eye(4)) for number in root.objects if number not in inner]
        todo = [self._place(item, self.root, np.eye(4), (), ()) for item in reversed(items)]
        count = 0
        while todo:
            place = todo.pop()
            count += 1
            if count > MAX_USES or len(place.chain) > MAX_DEPTH:
                raise ValueError(f"it puts more than {MAX_USES} objects somewhere")
            one = self.model(place.path).objects.get(place.id)
            if one is None:
                what = f"object {quoted(place.id)} of {quoted(place.path)}"
                raise ValueError(f"it names {what}, and there is none")
            if one.type not in _SHAPES:
                self.left_out[f"objects of type {quoted(one.type)!r}"] += 1
                continue
            volumes = self.volumes.get((place.chain[0][1], place.id), [])
            names = (*place.names, one.name)
            if len(one.corners):
                yield from self._volumes_of(one, place, volumes or [_Volume("", True)])
            else:
                names = (*names, *(volume.name for volume in volumes))
            todo += [self._place(part, place.path, place.matrix, names, place.chain)
                     for part in reversed(one.components)]  # fmt: skip

    def _place(
        self,
        use: Use,
        path: str,
        matrix: np.ndarray,
        names: tuple[str, ...],
        chain: tuple[tuple[str, str], ...],
    ) -> _Place:
        """Follow a component or item that stands in the model file `path`."""
        target = _plain(use.path) if use.path else path
        if (target, use.id) in chain:
            raise ValueError(f"object {quoted(use.id)} is a component of itself")
        unit = self.model(target).unit / self.model(path).unit
        matrix = matrix @ use.matrix @ np.diag([unit, unit, unit, 1.0])
        return _Place(target, use.id, matrix, (*names, use.name), (*chain, (target, use.id)))

    def _volumes_of(self, one: Object, place: _Place, volumes: list[_Volume]) -> Iterator[Piece]:
        """Give the triangles of an object, those of each of a slicer's volumes by themselves."""
        vertices, faces = moved(one.vertices, one.faces, place.matrix)
        for volume in volumes:
            if volume.is_shape:
                some = faces[volume.first : volume.last]
                names = (volume.name, one.name, *reversed(place.names))
                yield Piece(vertices, some, next(filter(None, names), ""))
            else:
                self.left_out["modifiers"] += 1


def _plain(name: str) -> str:
    """Write the name of a file in a package as names are compared: case does not count (OPC)."""
    return name.replace("\\", "/").lstrip("/").lower()


def _volumes(package: _Package) -> dict[tuple[str, str], list[_Volume]]:
    """Look up what slicers know of the parts of objects, in files of their own.

    Bambu Studio and OrcaSlicer have a component a part, PrusaSlicer a range of an object's
    triangles. Returns them by number of the object in the root model, and of the part's object.
    """
    found: dict[tuple[str, str], list[_Volume]] = {}
    if _BAMBU in package.names:
        for one in package.xml(_BAMBU).iter("object"):
            number = one.get("id", "")
            found[number, number] = [_Volume(_metadata(one, "name"), True)]
            for part in one.iter("part"):
                kind = part.get("subtype", "normal_part")
                volume = _Volume(_metadata(part, "name"), kind == "normal_part")
                found[number, part.get("id", "")] = [volume]
    if _PRUSA in package.names:
        for one in package.xml(_PRUSA).iter("object"):
            number = one.get("id", "")
            ranges = [_range(volume) for volume in one.iter("volume")]
            if ranges:
                found[number, number] = ranges
    return found


def _range(volume: ElementTree.Element) -> _Volume:
    """Read a volume of PrusaSlicer's: triangles `firstid` to `lastid`, that one included."""
    kind = _metadata(volume, "volume_type") or "ModelPart"
    is_shape = kind == "ModelPart" and _metadata(volume, "modifier") != "1"
    first, last = int(volume.get("firstid", 0)), volume.get("lastid")
    return _Volume(
        _metadata(volume, "name"), is_shape, first, None if last is None else int(last) + 1
    )


def _metadata(element: ElementTree.Element, key: str) -> str:
    """Give the value of <metadata key="..." value="..."/>, a child of an element; "" for none."""
    for child in element.findall("metadata"):
        if child.get("key") == key:
            return child.get("value", "").strip()
    return ""
