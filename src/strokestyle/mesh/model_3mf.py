"""Read one model file of a 3MF package: its objects, and what is to be built of them.

Sections are those of the 3MF Core Specification 1.3, 3MF Consortium.
"""

from __future__ import annotations

from array import array
from collections import Counter
from dataclasses import dataclass, field
from typing import IO, Any
from xml.parsers import expat

import numpy as np

from ..files import quoted
from .pieces import check_corners
from .text_file import xml_problem

UNITS = {"micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0,
         "inch": 25.4, "foot": 304.8, "meter": 1000.0}  # fmt: skip
_CHUNK = 2**20
# geometry of extensions that is no triangles: what it is called here
_OTHER_GEOMETRY = {"beam": "beams", "ball": "balls of a lattice", "boolean": "boolean operations",
                   "slicestack": "slices", "levelset": "level sets",
                   "displacementmesh": "displacements"}  # fmt: skip


@dataclass
class Use:
    """An object put somewhere, by a component or for the build.

    Parameters
    ----------
    path : the model file it is in, "" for the one that says so
    id : its number there
    matrix : (4, 4), points as columns, to the frame of what uses it
    name : the part number that the build gives it
    """

    path: str
    id: str
    matrix: np.ndarray
    name: str = ""


@dataclass
class Object:
    """An object: a mesh or components.

    Parameters
    ----------
    name, type : as the file has them, the part number where there is no name
    numbers, corners : the coordinates of its vertices and the corners of its triangles, flat
    """

    name: str
    type: str
    numbers: array = field(default_factory=lambda: array("d"))
    corners: array = field(default_factory=lambda: array("q"))
    components: list[Use] = field(default_factory=list)

    @property
    def vertices(self) -> np.ndarray:
        """(V, 3) float64, in the unit of the model."""
        return np.frombuffer(self.numbers, np.float64).reshape(-1, 3)

    @property
    def faces(self) -> np.ndarray:
        """(F, 3) int64.

        Raises ValueError where one names a vertex that does not exist.
        """
        faces = np.frombuffer(self.corners, np.int64).reshape(-1, 3)
        check_corners(faces, len(self.numbers) // 3, self.name)
        return faces


class Model:
    """A model file, read from a stream of XML (4).

    Parameters
    ----------
    stream : the XML

    Attributes
    ----------
    unit : float, millimetres
    objects : by their numbers
    items : what is to be built
    left_out : Counter of the geometry of extensions that is not read
    required : names of extensions that the file asks a reader to know

    Raises
    ------
    ValueError
        where it is no XML, has a document type (which 3MF forbids), or numbers that are none.
    """

    def __init__(self, stream: IO[bytes]):
        self.unit = 1.0
        self.objects: dict[str, Object] = {}
        self.items: list[Use] = []
        self.left_out: Counter[str] = Counter()
        self.required: list[str] = []
        self._object: Object | None = None
        self._spaces: dict[str, str] = {}
        self._parse(stream)

    def _parse(self, stream: IO[bytes]) -> None:
        # not into a tree of elements: a million triangles would be one of 1.5 GB
        parser = expat.ParserCreate(namespace_separator=" ")
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.StartDoctypeDeclHandler = _refuse_doctype
        parser.StartNamespaceDeclHandler = lambda short, long: self._spaces.update({short: long})
        try:
            while data := stream.read(_CHUNK):
                parser.Parse(data)
            parser.Parse(b"", True)
        except expat.ExpatError as error:
            raise xml_problem(error) from None
        except (ValueError, OverflowError, KeyError) as error:
            what = f"no {error}" if isinstance(error, KeyError) else str(error)
            raise ValueError(f"line {parser.CurrentLineNumber}: {what}") from None

    def _start(self, tag: str, given: dict[str, str]) -> None:
        local = tag.rpartition(" ")[2]
        here = self._object
        if here is not None and local == "vertex":
            here.numbers.extend((float(given["x"]), float(given["y"]), float(given["z"])))
        elif here is not None and local == "triangle":
            here.corners.extend((int(given["v1"]), int(given["v2"]), int(given["v3"])))
        elif here is not None and local == "component":
            here.components.append(_use(given))
        elif local == "object":
            name = given.get("name", "").strip() or given.get("partnumber", "").strip()
            self._object = Object(name, given.get("type", "model").strip().lower())
            self.objects[given["id"].strip()] = self._object
        elif local == "item":
            self.items.append(_use(given))
        elif local == "model":
            self._start_model(given)
        elif local in _OTHER_GEOMETRY:
            self.left_out[_OTHER_GEOMETRY[local]] += 1

    def _start_model(self, given: dict[str, str]) -> None:
        unit = given.get("unit", "millimeter").strip().lower()
        if unit not in UNITS:
            raise ValueError(f"{quoted(unit)!r} is no unit")
        self.unit = UNITS[unit]
        prefixes = given.get("requiredextensions", "").split()
        self.required = [self._spaces.get(prefix, prefix) for prefix in prefixes]

    def _end(self, tag: str) -> None:
        if tag.rpartition(" ")[2] == "object":
            self._object = None


def _use(given: dict[str, str]) -> Use:
    """Read a component or an item (4.1.2, 4.2.2)."""
    path = next((v for k, v in given.items() if k.rpartition(" ")[2] == "path"), "")
    matrix = np.eye(4)
    if "transform" in given:
        numbers = np.array(given["transform"].split(), np.float64)
        if len(numbers) != 12:
            raise ValueError(f"a transform of {len(numbers)} numbers for 12")
        matrix[:3] = numbers.reshape(4, 3).T  # the file has points as rows
    name = given.get("partnumber", "").strip()
    return Use(path.strip(), given["objectid"].strip(), matrix, name)


def _refuse_doctype(*_: Any) -> None:
    raise ValueError("a document type, which 3MF files must not have")
