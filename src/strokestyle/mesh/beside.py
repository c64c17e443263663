"""Name the files beside a mesh file that its shape lies in."""

from __future__ import annotations

import re
from pathlib import Path

_HDF5 = re.compile(r">\s*([^<>:]+\.(?:h5|hdf5|hdf))\s*:", re.IGNORECASE)


def files_beside(path: str | Path) -> list[Path]:
    """Name the files that a mesh file says its shape lies in, as far as they are there.

    Those of glTF, which are its buffers, and of XDMF: every other format holds its shape itself.
    Materials and textures are not among them. Where the file is damaged or cannot be read there are
    none: reading it as a mesh says why.
    """
    path = Path(path)
    try:
        if path.suffix.lower() in (".gltf", ".glb", ".vrm"):
            from .gltf_file import GltfFile

            found = GltfFile(path).files_beside()
        elif path.suffix.lower() in (".xdmf", ".xmf"):
            names = [path.parent / name for name in _HDF5.findall(path.read_text("utf-8"))]
            found = [name for name in names if name.is_file()]
        else:
            found = []
    except (OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError):
        return []
    return list(dict.fromkeys(found))
