"""The paper's intermediate figure: how a drawing comes about, from the plain curves to the textured strokes."""

from __future__ import annotations

import io
from dataclasses import dataclass

from PIL import Image

from ..drawing.strokes import Drawing
from ..extract.view import View
from ..geometry.curves import Curves
from ..svg.write import plain_svg, png_from_svg, write_svg

NAMES = ("1-curves", "2-displaced", "3-strokes", "4-textured")
GAP = 0.02  # of a panel's width, between the panels of the sheet


@dataclass(frozen=True)
class FigureStep:
    """One step of the making of a drawing: its name, one of NAMES, and what it looks like as SVG text."""

    name: str
    svg: str


def figure_steps(
    view: View, drawing: Drawing, *, title: str = "", background: str | None = None, **options
) -> list[FigureStep]:
    """The stages of a drawing of a view (Neural Strokes, figures 2 and 3), in the order in which they come about.

    1-curves: the view's curves, as geometry has them. 2-displaced: where the hand goes. 3-strokes: with thickness, in
    flat ink. 4-textured: with what the medium leaves. All on the same canvas.

    Parameters
    ----------
    view, drawing : a view and the drawing of it, of one size
    title, background : of every stage, as `write_svg` has them
    options : of `write_svg`, for the strokes; all stages are on the bare canvas, whatever the page

    Raises
    ------
    ValueError
        where view and drawing differ in size, or `write_svg` does not know an option.
    """
    size = (view.camera.width, view.camera.height)
    if drawing.size != size:
        raise ValueError(
            f"the view is {size[0]} x {size[1]} px, its drawing {drawing.size[0]} x {drawing.size[1]}"
        )
    strokes = drawing.strokes
    displaced = Curves(strokes.xy, strokes.offsets, strokes.kind, strokes.closed)
    curves, parts = view.pieces_by_part()
    page = {"title": title, "background": background}
    drawn = options | page | {"page_size": None, "plotter": False}
    texts = (
        plain_svg(curves, size, description="The curves of the shape", parts=parts, **page),
        plain_svg(
            displaced, size, description="The curves, displaced", parts=drawing.parts, **page
        ),
        write_svg(
            drawing, **(drawn | {"texture": "none", "description": "Strokes with thickness"})
        ),
        write_svg(drawing, **(drawn | {"description": "Strokes with thickness and texture"})),
    )
    return [FigureStep(name, text) for name, text in zip(NAMES, texts, strict=True)]


def side_by_side(pngs: list[bytes]) -> bytes:
    """PNGs of one size -> one PNG with all of them from left to right, on white."""
    pictures = [Image.open(io.BytesIO(png)).convert("RGB") for png in pngs]
    width, height = pictures[0].size
    step = width + round(GAP * width)
    sheet = Image.new("RGB", (step * (len(pictures) - 1) + width, height), (255, 255, 255))
    for k, picture in enumerate(pictures):
        sheet.paste(picture, (k * step, 0))
    out = io.BytesIO()
    sheet.save(out, format="PNG", optimize=True)
    return out.getvalue()


def figure_files(made: list[FigureStep], scale: float = 1.0) -> dict[str, bytes]:
    """What `render --stages` writes: {"1-curves.svg": ..., "1-curves.png": ..., ..., "sheet.png": ...}.

    `scale` : pixels of the PNGs per pixel of the canvas
    """
    files = {}
    for stage in made:
        files[f"{stage.name}.svg"] = stage.svg.encode("utf-8")
        files[f"{stage.name}.png"] = png_from_svg(stage.svg, scale)
    files["sheet.png"] = side_by_side([files[f"{stage.name}.png"] for stage in made])
    return files
