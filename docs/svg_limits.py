"""Write the table of limits into docs/svg-format.md anew: python docs/svg_limits.py"""

from __future__ import annotations

from pathlib import Path

from strokestyle import files
from strokestyle.svg.format import LIMITS

PAGE = Path(__file__).parent / "svg-format.md"
BEGIN, END = "<!-- limits, by docs/svg_limits.py -->\n", "<!-- end of limits -->\n"
OF_ANY_FILE = {  # by the names of constants in files.py
    "MAX_BYTES": "bytes, an .svgz's once unpacked",
    "MAX_ELEMENTS": "elements",
    "MAX_DEPTH": "elements inside one another",
    "MAX_CURVES": "curves",
    "MAX_POINTS": "points",
    "MAX_TEXT": "characters of one path",
}


def table() -> str:
    """Make the table of the limits that a file is read within."""
    rows = [(getattr(files, name), what) for name, what in OF_ANY_FILE.items()]
    rows += [(limit.value, limit.what) for limit in LIMITS.values()]
    lines = [f"| {value:,} | {what} |\n" for value, what in rows]
    return "| at most | of |\n| ---: | --- |\n" + "".join(lines)


def page(text: str) -> str:
    """Put the table into the document's text, in place of the one that stands there."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
