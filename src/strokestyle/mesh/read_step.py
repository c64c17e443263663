"""Read STEP and IGES files: solids of CAD programs, cut into triangles by Open CASCADE."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from .messages import NotSupported, silence
from .read_gltf import read_gltf
from .triangles import Triangles

# radians between neighbouring triangles of what is round: 63 sides of a circle leave it by 1/800 of
# its radius, under half a pixel of a circle as large as a drawing
ANGLE = 0.1
DEFLECTION = 0.01  # of an edge's length: how far triangles may be from the face


def read_step(path: Path) -> Triangles:
    """Read the solids of a STEP or IGES file, as fine as a drawing of them needs.

    cascadio, which has Open CASCADE in it, makes glTF of them, in metres; parts keep their names.

    Raises
    ------
    OSError
        where it cannot be opened
    ValueError
        where it is damaged or holds no solid; NotSupported where cascadio is not there
    """
    try:
        import cascadio
    except ImportError:
        raise NotSupported(
            f"reading {path.suffix.lower()} files needs another package: pip install cascadio"
        ) from None
    if not hasattr(cascadio, "load"):
        raise NotSupported("the cascadio that is installed is too old: pip install -U cascadio")
    iges = path.suffix.lower() in (".iges", ".igs")
    kind: Literal["iges", "step"] = "iges" if iges else "step"
    data = path.read_bytes()
    with silence():
        try:
            glb = cascadio.load(
                data, kind, tol_linear=DEFLECTION, tol_angular=ANGLE, tol_relative=True
            )
        except Exception as error:  # Open CASCADE's own, of many kinds
            raise ValueError(" ".join(str(error).split())[:120]) from None
    if not glb:
        raise ValueError("no solids or surfaces in it")
    return read_gltf(path, glb)
