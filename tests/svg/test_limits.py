"""docs/svg-format.md tells the limits that the reader keeps."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_the_documents_limits_are_the_codes():
    made = runpy.run_path(str(DOCS / "svg_limits.py"))
    text = (DOCS / "svg-format.md").read_text(encoding="utf-8")
    assert made["page"](text) == text, "run: python docs/svg_limits.py"
