"""Write a film as one HTML page that plays its drawings, and needs no network."""

from __future__ import annotations

import base64
import html
import zlib
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

from .. import __version__
from ..files import replace_file
from ..viewer.page import filled, json_text, page_text, policy
from .spool import Spool
from .timing import rate_of

FOLDER = Path(__file__).parent
LEVEL = 8  # of zlib; 9 takes a half longer for a thousandth less


class FilmPage:
    """The drawings of a film, and the page that plays them. Used as a context.

    Parameters
    ----------
    title : of the page
    rate : frames a second, as `rate_of` reads them
    loop : whether the first drawing follows the last
    background : "#rrggbb" or a CSS colour's name; "" for none, None for white
    """

    def __init__(
        self, title: str, rate: Fraction | float, loop: bool, background: str | None = None
    ):
        self.title, self.rate, self.loop, self.background = title, rate_of(rate), loop, background
        self.held: list[int] = []
        self.size = (0.0, 0.0)
        self.drawings = Spool()

    def __enter__(self) -> FilmPage:
        return self

    def __exit__(self, *error: object) -> None:
        self.drawings.__exit__(*error)

    def add(self, svg: str, size: tuple[float, float], held: int = 1) -> None:
        """Put a drawing at the end.

        Parameters
        ----------
        svg : text of `write_svg`; data in the page, never markup
        size : (width, height), px of the drawing
        held : for how many frames it is shown
        """
        packer = zlib.compressobj(LEVEL, zlib.DEFLATED, -15)
        self.drawings.add(packer.compress(svg.encode("utf-8")) + packer.flush())
        self.held.append(held)
        self.size = size

    def write(self, path: str | Path) -> None:
        """Write the page, whole or not at all.

        Raises ValueError where there are no drawings, OSError where it cannot be written.
        """
        if not self.held:
            raise ValueError(f"{path}: a film needs at least one drawing")

        def write(name: str) -> None:
            with open(name, "w", encoding="utf-8", newline="\n") as file:
                file.writelines(self._text())

        replace_file(path, write)

    def _text(self) -> Iterator[str]:
        """The page, a drawing at a time."""
        script = '"use strict";\n' + page_text("page.js", FOLDER)
        style = page_text("base.css") + page_text("page.css", FOLDER)
        about = {
            "title": self.title,
            "fps": round(float(self.rate), 6),
            "loop": self.loop,
            "size": list(self.size),
            "held": self.held,
            "background": self.background,
        }
        parts = {
            "policy": policy([script], style, "img-src blob: data:"),
            "generator": f"strokestyle {__version__}",
            "title": html.escape(self.title),
            "style": style,
            "script": script,
            "data": "\0",
        }
        before, after = filled(page_text("page.html", FOLDER), parts).split("\0")
        yield before + json_text(about).removesuffix("}") + ',"frames":['
        for i, drawing in enumerate(self.drawings):
            yield "," * bool(i) + '"' + base64.b64encode(drawing).decode("ascii") + '"'
        yield "]}" + after
