"""Read the container of glTF 2.0: JSON, chunks, buffers, buffer views and accessors.

Sections are those of the glTF 2.0 specification, Khronos Group, version 2.0.1.
"""

from __future__ import annotations

import base64
import binascii
import json
import re
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np

from ..files import quoted
from .messages import NotSupported
from .text_file import one_byte_text

_MAGIC, _JSON, _BIN = b"glTF", 0x4E4F534A, 0x004E4942
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MAX_ZEROS = 100_000_000  # elements of an accessor that no bytes of the file stand behind
_ELSEWHERE = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:|//")
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class GltfFile:
    """A glTF file: its JSON, and the numbers that its accessors name.

    Parameters
    ----------
    path : .gltf or .glb; which of the two the first bytes tell
    data : its bytes, where they are known already

    Raises
    ------
    OSError
        where it, or later a buffer that it names, cannot be opened
    ValueError
        where it is damaged; NotSupported where it is of glTF 1.0
    """

    def __init__(self, path: Path, data: bytes | None = None):
        self.path = path
        text, self._chunk = _chunks(memoryview(path.read_bytes() if data is None else data))
        try:
            # some writers fill a chunk up with zeros, for spaces
            content = json.loads(one_byte_text(bytes(text)).rstrip(b"\0").decode())
        except json.JSONDecodeError as error:
            what = (
                "cut short: its JSON ends too early"
                if _is_cut(error)
                else "its JSON cannot be read"
            )
            raise ValueError(f"{what} ({error})") from None
        except (UnicodeDecodeError, RecursionError) as error:
            raise ValueError(f"its JSON cannot be read ({' '.join(str(error).split())})") from None
        if not isinstance(content, dict):
            raise ValueError("its JSON is no object")
        self.content: dict[str, Any] = content
        self._check_version()
        self._lists: dict[str, list[dict[str, Any]]] = {}
        self._buffers: dict[int, bytes | memoryview] = {}
        self._accessors: dict[int, np.ndarray] = {}

    def _check_version(self) -> None:
        """Raise NotSupported unless it is of glTF 2 (3.2)."""
        version = str(self.content.get("asset", {}).get("version", "2.0"))
        if not version.startswith("2") or isinstance(self.content.get("meshes"), dict):
            raise _old(version)

    def all(self, kind: str) -> list[dict[str, Any]]:
        """List the nodes, meshes, ... of the file."""
        if kind not in self._lists:
            items = self.content.get(kind, [])
            if not isinstance(items, list) or not all(isinstance(item, dict) for item in items):
                raise ValueError(f"{kind} is no list of objects")
            self._lists[kind] = items
        return self._lists[kind]

    def one(self, kind: str, index: Any) -> dict[str, Any]:
        """Give the node, mesh, ... of a number."""
        items = self.all(kind)
        if not isinstance(index, int) or not 0 <= index < len(items):
            raise ValueError(f"it names {kind} {index}, and there are {len(items)}")
        return items[index]

    def accessor(self, index: Any) -> np.ndarray:
        """Read an accessor (3.6.2): (N, W) of W components, integers as float where normalized.

        Bytes of the file that are laid out one after the other are not copied.
        """
        if index not in self._accessors:
            self._accessors[index] = self._read_accessor(self.one("accessors", index))
        return self._accessors[index]

    def _read_accessor(self, accessor: dict[str, Any]) -> np.ndarray:
        dtype = np.dtype(_of(_COMPONENTS, accessor.get("componentType"), "component type"))
        width = _of(_WIDTHS, accessor.get("type"), "accessor type")
        count = _whole(accessor, "count")
        if "bufferView" in accessor:
            values = self._elements(accessor, "accessor", dtype, width, count)
        elif count <= MAX_ZEROS:
            values = np.zeros((count, width), dtype)
        else:
            raise ValueError(f"an accessor of {count} elements without a buffer view")
        if "sparse" in accessor:
            values = self._with_sparse(values, accessor["sparse"])
        return normalized(values) if accessor.get("normalized") else values

    def _with_sparse(self, values: np.ndarray, sparse: dict[str, Any]) -> np.ndarray:
        """Replace some elements (3.6.2.3)."""
        count, place = _whole(sparse, "count"), sparse["indices"]
        kind = np.dtype(_of(_COMPONENTS, place.get("componentType"), "component type"))
        rows = self._elements(place, "sparse accessor", kind, 1, count).ravel().astype(np.int64)
        if count and not 0 <= rows.min() <= rows.max() < len(values):
            raise ValueError(
                f"a sparse accessor replaces element {rows.max()}, and there are {len(values)}"
            )
        values = values.copy()
        values[rows] = self._elements(
            sparse["values"], "sparse accessor", values.dtype, values.shape[1], count
        )
        return values

    def _elements(
        self, place: dict[str, Any], what: str, dtype: np.dtype, width: int, count: int
    ) -> np.ndarray:
        """Read `count` elements from `place`, a buffer view and an offset in it: (count, width)."""
        view = self.one("bufferViews", place.get("bufferView"))
        data = self.view_bytes(place.get("bufferView"))
        offset, size = _whole(place, "byteOffset", 0), width * dtype.itemsize
        stride = _whole(view, "byteStride", 0) or size
        if not count:
            return np.zeros((0, width), dtype)
        if offset + stride * (count - 1) + size > len(data):
            raise ValueError(
                f"cut short: an {what} of {count} elements reaches beyond its buffer view of "
                f"{len(data)} bytes"
            )
        return np.ndarray((count, width), dtype, data, offset, strides=(stride, dtype.itemsize))

    def view_bytes(self, index: Any) -> memoryview:
        """Give the bytes of a buffer view (3.6.1.2)."""
        view = self.one("bufferViews", index)
        data = self._buffer(view.get("buffer"), view)
        start, length = _whole(view, "byteOffset", 0), _whole(view, "byteLength")
        if start + length > len(data):
            raise ValueError(
                f"cut short: a buffer view reaches to byte {start + length} of a buffer of "
                f"{len(data)}"
            )
        return memoryview(data)[start : start + length]

    def _buffer(self, index: Any, view: dict[str, Any]) -> bytes | memoryview:
        if index not in self._buffers:
            buffer = self.one("buffers", index)
            self._buffers[index] = self._read_buffer(index, buffer, view)
        return self._buffers[index]

    def _read_buffer(
        self, index: int, buffer: dict[str, Any], view: dict[str, Any]
    ) -> bytes | memoryview:
        """Read a buffer (3.6.1.1): a data URI, a file beside this one, or the chunk of a .glb."""
        length, uri = _whole(buffer, "byteLength"), buffer.get("uri")
        data: bytes | memoryview
        if uri is None and index == 0 and self._chunk is not None:
            data = self._chunk
        elif uri is None and any(name in view.get("extensions", {}) for name in _MESHOPT):
            raise _compressed_by_meshopt()
        elif not isinstance(uri, str):
            raise ValueError(f"cut short: there are no bytes of buffer {index}")
        elif uri[:5].lower() == "data:":
            data = _data_of(uri)
        else:
            data = self._read_beside(uri, length)
        if len(data) < length:
            raise ValueError(
                f"cut short: {len(data)} of {length} bytes of buffer {index} are there"
            )
        return data

    def _read_beside(self, uri: str, length: int) -> bytes:
        """Read the file that a URI names, relative to this one (2.8)."""
        if _ELSEWHERE.match(uri):
            raise NotSupported(
                f"its buffer lies at {quoted(uri)!r}, and nothing is fetched from elsewhere: save "
                "it as one .glb file"
            )
        beside = self._beside(uri)
        if beside is None:
            raise FileNotFoundError(
                f"{self.path}: the file {quoted(unquote(uri))!r} that it names is not there: put "
                "it beside it, or save it as one .glb file"
            )
        with open(beside, "rb") as file:
            return file.read(length)

    def files_beside(self) -> list[Path]:
        """Name the files that hold buffers of this one, as far as they are there."""
        uris = [buffer.get("uri") for buffer in self.content.get("buffers", ())]
        beside = [uri for uri in uris if isinstance(uri, str) and not _ELSEWHERE.match(uri)]
        return [found for uri in beside if (found := self._beside(uri))]

    def _beside(self, uri: str) -> Path | None:
        # the specification asks for percent-encoding; some programs write names as they are
        for name in (unquote(uri), uri, unquote(uri).replace("\\", "/")):
            try:
                beside = _in_any_case(self.path.parent / name)
                if beside.is_file():
                    return beside
            except (OSError, ValueError):  # a name that no file can have
                continue
        return None


def _is_cut(error: json.JSONDecodeError) -> bool:
    """Tell whether JSON ends where more must come."""
    ends = error.pos >= len(error.doc.rstrip())
    return bool(error.doc.strip()) and (ends or error.msg.startswith("Unterminated string"))


def _in_any_case(path: Path) -> Path:
    """Find a file whose name differs in upper and lower case, which some systems do not tell."""
    if path.exists() or not path.parent.is_dir():
        return path
    alike = (one for one in path.parent.iterdir() if one.name.lower() == path.name.lower())
    return next(alike, path)


def _chunks(data: memoryview) -> tuple[memoryview, memoryview | None]:
    """Split a .glb into its JSON and the bytes of its first buffer (4.4); a .gltf is JSON alone."""
    if data[:4] != _MAGIC:
        return data, None
    if len(data) < 20:
        raise ValueError("cut short: a .glb begins with 20 bytes")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise _old(str(version))
    if length > len(data):
        raise ValueError(f"cut short: {len(data)} of {length} bytes are there")
    found: dict[int, memoryview] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > len(data):
            raise ValueError("cut short: a chunk reaches beyond the file")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if _JSON not in found:
        raise ValueError("a .glb without a JSON chunk")
    return found[_JSON], found.get(_BIN)


def _data_of(uri: str) -> bytes:
    """Decode a data URI (RFC 2397)."""
    head, comma, body = uri.partition(",")
    if not comma:
        raise ValueError("a data URI without data")
    if not head.lower().endswith(";base64"):
        return unquote_to_bytes(body)
    try:
        text = re.sub(rb"\s+", b"", unquote_to_bytes(body))
        return base64.b64decode(text + b"=" * (-len(text) % 4))
    except binascii.Error as error:
        raise ValueError(f"a data URI cannot be decoded: {error}") from None


def normalized(values: np.ndarray) -> np.ndarray:
    """Map integers to [0, 1] or [-1, 1] (3.6.2.2); fractions stay."""
    if values.dtype.kind == "f":
        return values
    return np.maximum(values / np.float64(np.iinfo(values.dtype).max), -1.0)


def _of(table: dict, key: Any, what: str) -> Any:
    if not isinstance(key, (int, str)) or key not in table:
        raise ValueError(f"{quoted(str(key))!r} is no {what}")
    return table[key]


def _whole(item: dict[str, Any], key: str, default: int | None = None) -> int:
    """Look up a number of bytes or elements."""
    value = item.get(key, default)
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(f"{key} is {quoted(str(value))!r}, no number of bytes or elements")
    return value


def _old(version: str) -> NotSupported:
    return NotSupported(
        f"of glTF {quoted(version)}, and 2.0 is read: `npx gltf-pipeline -i OLD -o NEW.glb` "
        "makes a newer one of it"
    )


def _compressed_by_meshopt() -> NotSupported:
    return NotSupported(
        "compressed by meshopt, which is not read here: `npx @gltf-transform/cli copy IN OUT.glb` "
        "undoes it"
    )
