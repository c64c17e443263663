"""Make a page to look at drawings and play with them.

It is one HTML file that needs no server and asks the network for nothing. What it does lies beside
this file: scripts that know each other by name, and take what they share with Python from
`CONSTANTS`, which stands before them.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .. import __version__
from .constants import shared_constants

FOLDER = Path(__file__).parent
# in the order in which they stand; the first are the script of the page's workers as well
PAINTER = ("geometry.js", "paint.js", "strips.js", "marks.js")
SCRIPTS = ("outline.js", "png.js", "tones.js", "document.js", "app.js")


def page_html(drawings: list[tuple[str, str]]) -> str:
    """Make the page that shows drawings.

    Parameters
    ----------
    drawings : (name, SVG text) of each. The text must come from `write_svg` with `strips`: the page
        trusts its form. It is data there, never markup, and the page's content security policy
        lets nothing run but the page's own script.

    Returns
    -------
    the text of an HTML file

    Raises
    ------
    ValueError
        where there is nothing to show.
    """
    if not drawings:
        raise ValueError("a page needs at least one drawing")
    style = page_text("base.css") + page_text("page.css")
    constants = f"const CONSTANTS = {json.dumps(shared_constants())};\n"
    painter = '"use strict";\n' + constants + "".join(map(page_text, PAINTER))
    script = '"use strict";\n' + "".join(map(page_text, SCRIPTS))
    parts = {
        "policy": policy([painter, script], style, "worker-src blob:"),
        "generator": f"strokestyle {__version__}",
        "title": html.escape(
            ", ".join(name for name, _ in drawings[:3]) + (" ..." if len(drawings) > 3 else "")
        ),
        "style": style,
        "painter": painter,
        "script": script,
        "data": json_text([{"name": name, "svg": svg} for name, svg in drawings]),
    }
    return filled(page_text("page.html"), parts)


def policy(scripts: Sequence[str], style: str, *more: str) -> str:
    """Make the security policy of a page: it runs its own scripts, and asks the network for
    nothing.

    Parameters
    ----------
    scripts, style : all that stands in its script elements, and in its style element
    more : further rules, such as "img-src blob:"
    """
    run = " ".join(f"'{_hash(script)}'" for script in scripts)
    rules = ("default-src 'none'", f"script-src {run}", *more, f"style-src '{_hash(style)}'")
    return "; ".join((*rules, "base-uri 'none'", "form-action 'none'"))


def filled(template: str, parts: Mapping[str, str]) -> str:
    """Put parts in the places of a template that are marked as @name@."""
    return re.sub(r"@(\w+)@", lambda match: parts[match[1]], template)


def page_text(name: str, folder: Path = FOLDER) -> str:
    """Read a part of a page that lies beside this module, or in another folder."""
    return (folder / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode(
        "ascii"
    )


def json_text(value: Any) -> str:
    """Write JSON that can stand inside a script element: nothing in it ends that element."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
