"""Show how a drawing comes about, step by step, from the plain curves to the textured strokes.

After the intermediate figures of Neural Strokes (Liu et al. 2021, figures 2 and 3).
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

from PIL import Image

from ..drawing.strokes import Drawing
from ..extract.view import View
from ..geometry.curves import Curves
from ..geometry.parts import Parts
from ..svg.write import plain_svg, png_from_svg, write_svg

STEP_NAMES = ("1-curves", "2-displaced", "3-strokes", "4-textured")
GAP = 0.02  # of a panel's width, between the panels that stand side by side


@dataclass(frozen=True)
class FigureStep:
    """One step of the making of a drawing: its name, of STEP_NAMES, and its picture as SVG text."""

    name: str
    svg: str


def figure_steps(
    view: View, drawing: Drawing, *, title: str = "", background: str | None = None, **options: Any
) -> list[FigureStep]:
    """Draw the steps in which a drawing of a view comes about, in order, on one canvas.

    1-curves: the view's curves, as geometry has them. 2-displaced: where the style moves them.
    3-strokes: with thickness, in flat ink. 4-textured: with the texture of the medium.

    Parameters
    ----------
    view, drawing : a view and the drawing of it, of one size
    title, background : of every step, as `write_svg` has them
    options : of `write_svg`, for the strokes; all steps are on the bare canvas, whatever the page

    Raises
    ------
    ValueError
        where view and drawing differ in size, or `write_svg` does not know an option.
    """
    size = (view.camera.width, view.camera.height)
    if drawing.size != size:
        raise ValueError(
            f"the view is {size[0]} x {size[1]} px, "
            f"its drawing {drawing.size[0]} x {drawing.size[1]}"
        )
    strokes = drawing.strokes
    displaced = Curves(strokes.xy, strokes.offsets, strokes.kind, strokes.closed)
    curves, parts = view.pieces_by_part()

    def lines(curves: Curves, parts: Parts | None, description: str) -> str:
        return plain_svg(
            curves,
            size,
            title=title,
            description=description,
            background=background,
            parts=parts,
        )

    def inked(**changes: str) -> str:
        bare = {"page_size": None, "plotter": False}
        look = {"title": title, "background": background}
        return write_svg(drawing, **(options | look | bare | changes))

    texts = (
        lines(curves, parts, "The curves of the shape"),
        lines(displaced, drawing.parts, "The curves, displaced"),
        inked(description="Strokes with thickness", texture="none"),
        inked(description="Strokes with thickness and texture"),
    )
    return [FigureStep(name, text) for name, text in zip(STEP_NAMES, texts, strict=True)]


def side_by_side(pngs: list[bytes]) -> bytes:
    """Paste PNGs of one size into one PNG, from left to right, on white."""
    panels = [Image.open(io.BytesIO(png)).convert("RGB") for png in pngs]
    width, height = panels[0].size
    pitch = width + round(GAP * width)
    row = Image.new("RGB", (pitch * (len(panels) - 1) + width, height), (255, 255, 255))
    for k, panel in enumerate(panels):
        row.paste(panel, (k * pitch, 0))
    out = io.BytesIO()
    row.save(out, format="PNG", optimize=True)
    return out.getvalue()


def figure_files(steps: list[FigureStep], scale: float = 1.0) -> dict[str, bytes]:
    """Make the figure's files: {"1-curves.svg": ..., "1-curves.png": ..., ..., "sheet.png": ...}.

    Each step is an SVG and a PNG; the sheet has all of them side by side.

    Parameters
    ----------
    steps : of `figure_steps`
    scale : pixels of the PNGs per pixel of the canvas
    """
    files = {}
    for step in steps:
        files[f"{step.name}.svg"] = step.svg.encode("utf-8")
        files[f"{step.name}.png"] = png_from_svg(step.svg, scale)
    files["sheet.png"] = side_by_side([files[f"{step.name}.png"] for step in steps])
    return files
