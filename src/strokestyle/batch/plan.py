"""Plan a batch: which files are drawn, and which file each drawing is written to."""

from __future__ import annotations

import codecs
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from ..files import check_output

# What a folder of shapes is searched for.
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".3mf", ".dae", ".xyz", ".wrl")
VIEW_SUFFIXES = (".npz",)
SVG_SUFFIXES = (".svg", ".svgz")
DRAWING_SUFFIXES = (*SVG_SUFFIXES, ".pdf", ".png")
STANDARD_OUTPUT = "-"


class Job(NamedTuple):
    """One drawing to be made.

    Parameters
    ----------
    shape : the mesh or the view that is drawn
    output : the file that is written, or STANDARD_OUTPUT
    """

    shape: str
    output: str


class UnclearOutput(ValueError):
    """The shapes and the output that were asked for do not go together."""


def plan_outputs(
    shapes: Sequence[str], output: str, mirror: bool = False, suffix: str = ".svg"
) -> list[Job]:
    """Plan which file each shape's drawing is written to, before anything is drawn.

    Parameters
    ----------
    shapes : files; a folder stands for all the meshes and views in it, by name
    output : a file for one drawing, OUT.svg, .svgz, .pdf or .png; a folder, one that is there
        already or any name that ends in a slash or has no suffix, for SHAPE.svg each; or
        STANDARD_OUTPUT. The folder is made where it is missing.
    mirror : whether shapes keep their folders, which are made in the output's, and are looked for
        in the folders of a folder as well. A shape found in a folder keeps its folders from there
        on, others from the folder on that is common to all of those.
    suffix : of the files in a folder

    Raises
    ------
    UnclearOutput
        where several drawings would go to one file, or the output is no file of a drawing.
    ValueError
        where a folder holds no shape, or an input would be overwritten.
    OSError
        where an output cannot be written.
    """
    found, beneath = _found_beneath(shapes) if mirror else (find_shapes(shapes), None)
    folder, to_folder = Path(output), is_folder(output)
    if mirror and not to_folder:
        raise UnclearOutput(f"folders are mirrored in a folder, such as drawings/, not {output}")
    if len(found) > 1 and not to_folder:
        raise UnclearOutput(
            f"{len(found)} shapes need a folder to go to, such as drawings/, not {output}"
        )
    if output == STANDARD_OUTPUT:
        return [Job(found[0], STANDARD_OUTPUT)]
    if not to_folder:
        if folder.suffix.lower() not in DRAWING_SUFFIXES:
            raise UnclearOutput(
                f"{output}: drawings are {', '.join(DRAWING_SUFFIXES)}, or a folder of them"
            )
        jobs = [Job(found[0], output)]
    else:
        places = beneath or [""] * len(found)
        jobs = [
            Job(shape, str(folder / place / (Path(shape).stem + suffix)))
            for shape, place in zip(found, places, strict=True)
        ]
        _refuse_two_to_one(jobs)
        for place in dict.fromkeys(places):
            (folder / place).mkdir(parents=True, exist_ok=True)
    for job in jobs:
        check_output(job.output, found)
    return jobs


def is_folder(output: str) -> bool:
    """Whether an output stands for a folder of drawings, which need not be there yet."""
    if output == STANDARD_OUTPUT:
        return False
    path = Path(output)
    return output.endswith(("/", os.sep)) or path.is_dir() or path.suffix == ""


def split_list(data: bytes) -> list[str]:
    """Split a list of files as `ls` or `find` print it: a line each, or with NULs in between.

    Blank lines are passed over; a name keeps its blanks. A mark of the byte order is no part of a
    name, and one of UTF-16, as Windows PowerShell writes lists, tells how the list is read.
    """
    data = data.removeprefix(codecs.BOM_UTF8)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        data = os.fsencode(data.decode("utf-16", "replace"))
    if b"\0" in data:
        names = data.split(b"\0")
    else:
        lines = data.split(b"\n")
        names = [line.removesuffix(b"\r") for line in lines]
    return [os.fsdecode(name) for name in names if name.strip()]


def find_shapes(paths: Sequence[str]) -> list[str]:
    """Put the meshes and views in a folder, sorted by name, in the place of every folder.

    Raises ValueError where there are none in it.
    """
    found = []
    for path in paths:
        if not Path(path).is_dir():
            found.append(path)
            continue
        found += _shapes_in(path, Path(path).iterdir())
    return found


def _shapes_in(folder: str, files: Iterable[Path]) -> list[str]:
    suffixes = MESH_SUFFIXES + VIEW_SUFFIXES
    inside = sorted(file for file in files if file.suffix.lower() in suffixes and not file.is_dir())
    if not inside:
        raise ValueError(
            f"{folder}: no mesh and no view in this folder ({', '.join(MESH_SUFFIXES)}, .npz)"
        )
    return [str(file) for file in inside]


def _found_beneath(paths: Sequence[str]) -> tuple[list[str], list[str]]:
    """The shapes, and the folders that each keeps."""
    files = [os.path.abspath(path) for path in paths if not Path(path).is_dir()]
    common = os.path.commonpath([os.path.dirname(file) for file in files]) if files else ""
    found, beneath = [], []
    for path in paths:
        top, inside = common, [path]
        if Path(path).is_dir():
            top, inside = os.path.abspath(path), _shapes_in(path, Path(path).rglob("*"))
        found += inside
        beneath += [os.path.relpath(os.path.dirname(os.path.abspath(one)), top) for one in inside]
    return found, beneath


def numbered_output(output: str, index: int, count: int) -> str:
    """Name picture `index` of `count` after the drawing they belong to: OUT.svg -> OUT-000.svg."""
    path = Path(output)
    return str(path.with_name(f"{path.stem}{picture_suffix(index, count)}{path.suffix}"))


def picture_suffix(index: int, count: int) -> str:
    """Number picture `index` of `count`: "-000", with as many digits as the last one needs."""
    return f"-{index:0{max(3, len(str(count - 1)))}d}"


def _refuse_two_to_one(jobs: list[Job]) -> None:
    taken: dict[str, str] = {}
    for shape, output in jobs:
        if output in taken:
            raise UnclearOutput(
                f"{taken[output]} and {shape} would both be written to {output}: "
                "draw them into two folders, or mirror theirs"
            )
        taken[output] = shape
