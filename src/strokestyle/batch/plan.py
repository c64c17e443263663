"""Plan a batch: which files are drawn, and which file each drawing is written to."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ..files import check_output

# What a folder of shapes is searched for.
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".3mf", ".dae", ".xyz", ".wrl")
VIEW_SUFFIXES = (".npz",)
SVG_SUFFIXES = (".svg", ".svgz")
STANDARD_OUTPUT = "-"


class Job(NamedTuple):
    """One drawing to be made.

    Parameters
    ----------
    shape : the mesh or the view that is drawn
    output : the SVG that is written, or STANDARD_OUTPUT
    """

    shape: str
    output: str


class UnclearOutput(ValueError):
    """The shapes and the output that were asked for do not go together."""


def plan_outputs(shapes: Sequence[str], output: str) -> list[Job]:
    """Plan which file each shape's drawing is written to, before anything is drawn.

    Parameters
    ----------
    shapes : files; a folder stands for all the meshes and views in it, by name
    output : a file for one drawing, OUT.svg or OUT.svgz; a folder, one that is there already or any
        name that ends in a slash or has no suffix, for SHAPE.svg each; or STANDARD_OUTPUT. The
        folder is made where it is missing.

    Raises
    ------
    UnclearOutput
        where several drawings would go to one file, or the output is no SVG.
    ValueError
        where a folder holds no shape, or an input would be overwritten.
    OSError
        where an output cannot be written.
    """
    found = find_shapes(shapes)
    folder = Path(output)
    to_folder = output != STANDARD_OUTPUT and (
        output.endswith(("/", os.sep)) or folder.is_dir() or folder.suffix == ""
    )
    if len(found) > 1 and not to_folder:
        raise UnclearOutput(
            f"{len(found)} shapes need a folder to go to, such as drawings/, not {output}"
        )
    if output == STANDARD_OUTPUT:
        return [Job(found[0], STANDARD_OUTPUT)]
    if not to_folder:
        if folder.suffix.lower() not in SVG_SUFFIXES:
            raise UnclearOutput(f"{output}: drawings are .svg or .svgz, or a folder of them")
        jobs = [Job(found[0], output)]
    else:
        jobs = [Job(shape, str(folder / (Path(shape).stem + ".svg"))) for shape in found]
        _refuse_two_to_one(jobs)
        folder.mkdir(parents=True, exist_ok=True)
    for job in jobs:
        check_output(job.output, found)
    return jobs


def find_shapes(paths: Sequence[str]) -> list[str]:
    """Put the meshes and views in a folder, sorted by name, in the place of every folder.

    Raises ValueError where there are none in it.
    """
    found = []
    for path in paths:
        if not Path(path).is_dir():
            found.append(path)
            continue
        suffixes = MESH_SUFFIXES + VIEW_SUFFIXES
        inside = sorted(file for file in Path(path).iterdir() if file.suffix.lower() in suffixes)
        if not inside:
            raise ValueError(
                f"{path}: no mesh and no view in this folder ({', '.join(MESH_SUFFIXES)}, .npz)"
            )
        found += [str(file) for file in inside]
    return found


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
                "draw them into two folders"
            )
        taken[output] = shape
