"""Call embree: what do rays hit first?

embreex carries the library, and is asked for nothing else: its own interface copies a mesh index by
index, has embree spend more on the hierarchy than all of a drawing's rays are worth, and traces ray
by ray. At a million faces that is ten times what it takes here, where embree's C interface is
called: arrays are shared, the fast builder builds, and rays are traced by sixteen.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import cache
from typing import NamedTuple

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

RAYS = 16  # in a packet
CHUNK = 1024  # packets in memory at a time: they stay in the processor's cache
VERSIONS = range(40000, 50000)  # of embree, whose interface this is
NOTHING = 0xFFFFFFFF  # embree's number of no face
# Rows of a packet, RTCRayHit16 of embree4/rtcore_ray.h: RAYS words each, and room for rows that may
# be added behind.
ORIGIN, NEAREST, DIRECTION, TIME, FARTHEST, MASK = slice(0, 3), 3, slice(4, 7), 7, 8, 9
U, V, FACE, GEOMETRY, ROWS = 15, 16, 17, 18, 24
# Enumerations of embree4/rtcore.h
VERSION, TRIANGLES, FAST, COMPACT, ROBUST = 0, 0, 0, 2, 4
INDICES, VERTICES, UINT3, FLOAT3 = 0, 1, 0x5003, 0x9003
COHERENT, ALL_FEATURES = 1 << 16, 0xFFFFFFFF
# Coherent packets miss faces where a direction's part is less than 1e-18: embree turns it round.
LEAST_PART = 1e-15

_TYPES = {
    " ": None,
    "p": ctypes.c_void_p,
    "i": ctypes.c_uint,
    "n": ctypes.c_size_t,
    "v": ctypes.c_ssize_t,
}
_FUNCTIONS = {  # types of the result and the arguments
    "rtcNewDevice": "pp",
    "rtcReleaseDevice": " p",
    "rtcGetDeviceProperty": "vpi",
    "rtcGetDeviceError": "ip",
    "rtcNewScene": "pp",
    "rtcReleaseScene": " p",
    "rtcSetSceneBuildQuality": " pi",
    "rtcSetSceneFlags": " pi",
    "rtcCommitScene": " p",
    "rtcNewGeometry": "ppi",
    "rtcReleaseGeometry": " p",
    "rtcSetGeometryBuildQuality": " pi",
    "rtcSetSharedGeometryBuffer": " piiipnnn",
    "rtcCommitGeometry": " p",
    "rtcAttachGeometry": "ipp",
    "rtcIntersect16": " pppp",
}


class FirstHits(NamedTuple):
    """What N rays hit first.

    Parameters
    ----------
    face : (N,) int32, -1 where a ray hits nothing
    u, v : (N,) float32, weights of the face's second and third corner there; any on a miss
    distance : (N,) float32, in lengths of the ray's direction; any on a miss
    """

    face: np.ndarray
    u: np.ndarray
    v: np.ndarray
    distance: np.ndarray


def scene(vertices: np.ndarray, faces: np.ndarray) -> Scene | PlainScene:
    """Make a scene of triangles: `vertices` (V, 3) float32, `faces` (F, 3) int, at least one."""
    return PlainScene(vertices, faces) if _embree() is None else Scene(vertices, faces)


@cache
def _embree() -> ctypes.CDLL | None:
    """Find embree's functions; None where they cannot be had, or are of another version.

    They are looked up in the extension that is linked to the library, whatever that is called.
    """
    library = ctypes.CDLL(rtcore_scene.__file__)
    try:
        for name, types in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, *function.argtypes = (_TYPES[letter] for letter in types)
    except AttributeError:
        return None
    device = library.rtcNewDevice(None)
    version = library.rtcGetDeviceProperty(device, VERSION)
    library.rtcReleaseDevice(device)
    return library if version in VERSIONS else None


class Scene:
    """Triangles that rays may hit, by embree's C interface; arguments as of `scene`.

    Raises MemoryError where embree has no room for them.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        library = _embree()
        assert library is not None  # `scene` sees to it
        # embree reads four numbers of a vertex, one more than the last has
        self._vertices = np.zeros((len(vertices) + 1, 3), np.float32)
        self._vertices[:-1] = vertices
        self._faces = np.ascontiguousarray(faces, np.uint32)
        device = library.rtcNewDevice(None)
        self._scene = library.rtcNewScene(device)
        weakref.finalize(self, _release, library, self._scene, device).atexit = False
        library.rtcSetSceneBuildQuality(self._scene, FAST)
        library.rtcSetSceneFlags(self._scene, COMPACT | ROBUST)
        self._attach(library, device)
        library.rtcCommitScene(self._scene)
        if library.rtcGetDeviceError(device):
            raise MemoryError(f"embree has no room for {len(faces)} faces")

    def __reduce__(self) -> tuple:
        """Copy the triangles, which another process hands over anew."""
        return scene, (self._vertices[:-1], self._faces)

    def _attach(self, library: ctypes.CDLL, device: int) -> None:
        """Share the triangles with the scene."""
        triangles = library.rtcNewGeometry(device, TRIANGLES)
        library.rtcSetGeometryBuildQuality(triangles, FAST)
        count = len(self._vertices) - 1, len(self._faces)
        for kind, form, array, n in (
            (VERTICES, FLOAT3, self._vertices, count[0]),
            (INDICES, UINT3, self._faces, count[1]),
        ):
            library.rtcSetSharedGeometryBuffer(
                triangles, kind, 0, form, array.ctypes.data, 0, array.strides[0], n
            )
        library.rtcCommitGeometry(triangles)
        library.rtcAttachGeometry(self._scene, triangles)
        library.rtcReleaseGeometry(triangles)

    def first_hits(self, origins: np.ndarray, directions: np.ndarray) -> FirstHits:
        """Trace rays from origins along directions, (N, 3) or (N / RAYS, RAYS, 3) each, float32.

        Rays that follow each other should run alongside each other: that is faster.
        """
        count = origins.size // 3
        out = FirstHits(np.empty(count, np.int32), *np.empty((3, count), np.float32))
        origins, directions = _in_packets(origins), _in_packets(directions)
        packets = _Packets(min(CHUNK, len(origins)))
        for first in range(0, len(origins), CHUNK):
            some = slice(first, first + CHUNK)
            packets.trace(self._scene, origins[some], directions[some])
            rays = slice(first * RAYS, (first + CHUNK) * RAYS)
            packets.read(FirstHits(*(column[rays] for column in out)))
        return out


def _release(library: ctypes.CDLL, scene: int, device: int) -> None:
    library.rtcReleaseScene(scene)
    library.rtcReleaseDevice(device)


class _Arguments(ctypes.Structure):
    """RTCIntersectArguments: how rays are traced."""

    _fields_ = (
        ("flags", ctypes.c_uint),
        ("feature_mask", ctypes.c_uint),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("intersect", ctypes.c_void_p),
    )


class _Packets:
    """Up to `count` packets of RAYS rays, in embree's order, and what they hit."""

    def __init__(self, count: int) -> None:
        self._words = _aligned((count, ROWS, RAYS))
        self._words[:, [NEAREST, TIME]] = 0.0
        self._numbers = self._words.view(np.uint32)
        self._numbers[:, MASK:ROWS] = 0
        self._numbers[:, MASK] = NOTHING  # of no face is it hidden
        self._all = _aligned((RAYS,)).view(np.int32)
        self._all[:] = -1
        self._arguments = _Arguments(COHERENT, ALL_FEATURES, None, None, None)

    def trace(self, scene: int, origins: np.ndarray, directions: np.ndarray) -> None:
        """Trace at most `count` packets: origins and directions (n, RAYS, 3)."""
        count = len(origins)
        words, numbers = self._words[:count], self._numbers[:count]
        words[:, ORIGIN], words[:, DIRECTION] = origins.swapaxes(1, 2), directions.swapaxes(1, 2)
        words[:, DIRECTION][np.abs(words[:, DIRECTION]) < LEAST_PART] = LEAST_PART
        words[:, FARTHEST] = np.inf
        numbers[:, [FACE, GEOMETRY]] = NOTHING
        library = _embree()
        assert library is not None  # there is a scene of it
        intersect = library.rtcIntersect16
        every, arguments = self._all.ctypes.data, ctypes.addressof(self._arguments)
        first, size = words.ctypes.data, words.strides[0]
        for packet in range(first, first + count * size, size):
            intersect(every, scene, packet, arguments)

    def read(self, out: FirstHits) -> None:
        """Copy what the first n rays hit to `out`."""
        count = len(out.face)
        for column, row in zip(out, (FACE, U, V, FARTHEST), strict=True):
            packets = self._words[: -(-count // RAYS), row].view(column.dtype)
            column[:] = packets.reshape(-1)[:count]


def _aligned(shape: tuple[int, ...]) -> np.ndarray:
    """Make an array of float32 that starts where embree wants its packets to: at 64 bytes."""
    size = 4 * int(np.prod(shape))
    memory = np.empty(size + 64, np.uint8)
    start = -memory.ctypes.data % 64
    return memory[start : start + size].view(np.float32).reshape(shape)


def _in_packets(rows: np.ndarray) -> np.ndarray:
    """Put rows (n, 3) in packets, (n / RAYS, RAYS, 3); the last is filled up with the last row."""
    if rows.ndim == 3:
        return rows
    left = -len(rows) % RAYS
    if left:
        rows = np.concatenate([rows, np.broadcast_to(rows[-1], (left, 3))])
    return rows.reshape(-1, RAYS, 3)


class PlainScene:
    """Triangles that rays may hit, by embreex's own interface; arguments as of `scene`."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self._scene = rtcore_scene.EmbreeScene()
        TriangleMesh(self._scene, np.asarray(vertices, np.float32), faces.astype(np.int32))

    def first_hits(self, origins: np.ndarray, directions: np.ndarray) -> FirstHits:
        """Trace rays as `Scene.first_hits` does."""
        origins, directions = (
            np.ascontiguousarray(x, np.float32).reshape(-1, 3) for x in (origins, directions)
        )
        found = self._scene.run(origins, directions, output=1)
        return FirstHits(found["primID"], found["u"], found["v"], found["tfar"])
