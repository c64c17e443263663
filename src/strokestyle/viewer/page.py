"""A page to look at drawings and play with them: one HTML file that needs no server and asks the network for nothing.

What the page does lies beside this file, a script in parts that know each other by name, in this order.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from pathlib import Path

from .. import __version__

FOLDER = Path(__file__).parent
PAINTER = (
    "geometry.js",
    "paint.js",
    "strips.js",
    "marks.js",
)  # the script of the page's workers as well
SCRIPTS = ("outline.js", "png.js", "tones.js", "document.js", "app.js")


def page_html(drawings: list[tuple[str, str]]) -> str:
    """The page that shows drawings.

    Parameters
    ----------
    drawings : (name, SVG text) of each. The text must come from `write_svg` with `strips`: the page trusts its form. It
        is data there, never markup, and the page's content security policy lets nothing run but the page's own script.

    Raises
    ------
    ValueError
        where there is nothing to show.
    """
    if not drawings:
        raise ValueError("a page needs at least one drawing")
    style = _text("page.css")
    painter, script = (
        '"use strict";\n' + "".join(map(_text, names)) for names in (PAINTER, SCRIPTS)
    )
    parts = {
        "policy": "; ".join(
            (
                "default-src 'none'",
                f"script-src '{_hash(painter)}' '{_hash(script)}'",
                "worker-src blob:",
                f"style-src '{_hash(style)}'",
                "base-uri 'none'",
                "form-action 'none'",
            )
        ),
        "generator": f"strokestyle {__version__}",
        "title": html.escape(
            ", ".join(name for name, _ in drawings[:3]) + (" ..." if len(drawings) > 3 else "")
        ),
        "style": style,
        "painter": painter,
        "script": script,
        "data": _json([{"name": name, "svg": svg} for name, svg in drawings]),
    }
    return re.sub(r"@(\w+)@", lambda match: parts[match[1]], _text("page.html"))


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode(
        "ascii"
    )


def _json(value) -> str:
    """JSON that can stand inside a script element: nothing in it ends that element."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
