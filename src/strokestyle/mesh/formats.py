"""Say what would do with a file of a format that is not read here."""

from __future__ import annotations

import re

USE = "use obj, ply, stl, off, glb, 3mf, dae or step"
_EXPORT = "File > Export > glTF 2.0 makes a .glb of it"
_IMPORT = f"in Blender, File > Import, then {_EXPORT}; or `assimp export IN OUT.glb`"
_CAD = "export it as STEP (.step) from the CAD program"
_CLOUD = "a point cloud, which cannot be drawn: mesh it first, in MeshLab or CloudCompare"
_PICTURE = "a picture, not a mesh"
_UNPACK = "an archive: unpack it first"
_ADVICE = {
    ".blend": f"read by Blender alone: there, {_EXPORT}",
    ".skp": "read by SketchUp alone: there, File > Export > 3D Model makes a .dae or .glb of it",
    ".3dm": "read by Rhino: there, File > Save as makes an .obj or .step of it",
    ".scad": "a program of OpenSCAD: `openscad -o OUT.stl IN.scad` makes an .stl of it",
    ".ifc": "of a building: `IfcConvert IN.ifc OUT.glb` makes a .glb of it",
    ".ctm": "not read here: in MeshLab, File > Export Mesh As makes a .ply of it",
    ".dxf": "lines, not faces: export solids as .stl or .step from the CAD program",
    ".fcstd": "read by FreeCAD: there, File > Export makes a .step of it",
    ".gcode": "the path of a printer's nozzle: use the .stl or .3mf that it was made from",
    ".vtp": "not read here: in ParaView, File > Save Data makes a .ply of it",
}
_ADVICE |= dict.fromkeys(
    (".fbx", ".usd", ".usda", ".usdc", ".usdz", ".abc", ".x3d", ".wrl", ".3ds"),
    f"not read here: {_IMPORT}",
)
_ADVICE |= dict.fromkeys(
    (".amf", ".lwo", ".lws", ".x", ".ase", ".ac", ".md2", ".md3", ".md5mesh", ".b3d", ".ms3d"),
    "not read here: `assimp export IN OUT.glb` makes a .glb of it",
)
_ADVICE |= dict.fromkeys(
    (".max", ".ma", ".mb", ".c4d", ".ztl", ".zpr", ".lxo", ".hip", ".mud"),
    "read by one program alone: export it from there as .obj",
)
_ADVICE |= dict.fromkeys(
    (".sldprt", ".sldasm", ".ipt", ".iam", ".f3d", ".f3z", ".catpart", ".catproduct", ".prt",
     ".asm", ".par", ".psm", ".x_t", ".x_b", ".sat", ".sab", ".jt", ".brep", ".brp", ".dwg",
     ".3dxml", ".neu", ".easm", ".eprt"),
    f"of a CAD program: {_CAD}",
)  # fmt: skip
_ADVICE |= dict.fromkeys(
    (".xyz", ".pcd", ".las", ".laz", ".e57", ".pts", ".ptx", ".asc", ".splat", ".spz"), _CLOUD
)
_ADVICE |= dict.fromkeys(
    (".png", ".jpg", ".jpeg", ".gif", ".svg", ".tif", ".tiff", ".webp", ".pdf", ".bmp"), _PICTURE
)
_ADVICE |= dict.fromkeys((".gz", ".tgz", ".bz2", ".xz", ".7z", ".rar", ".tar", ".zst"), _UNPACK)


_WEB_PAGE = re.compile(rb"\s*(<!--.*?-->\s*)?<(!doctype\s+html|html)\b", re.IGNORECASE | re.DOTALL)


def what_was_saved(start: bytes) -> str:
    """Say, of a file's first bytes, that they are no mesh but what a site gave in place of one.

    "" where they are none of these.
    """
    if start.startswith(b"version https://git-lfs."):
        return "only a pointer to the mesh, of Git LFS: `git lfs pull` fetches the mesh itself"
    if _WEB_PAGE.match(start):
        return "a web page, not a mesh: download the mesh itself"
    return ""


def what_would_do(suffix: str) -> str:
    """Say, of a suffix that no reader has, what would do, in one line."""
    if not suffix:
        return f"no suffix to tell the mesh format by; {USE}"
    if suffix in _ADVICE:
        return f"{suffix} is {_ADVICE[suffix]}"
    return f"{suffix} is not a mesh format; {USE}"
