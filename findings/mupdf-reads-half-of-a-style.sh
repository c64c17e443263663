#!/usr/bin/env bash
# MuPDF 1.28.5 (PyMuPDF 2.0) reads the colour of an SVG path's style attribute, and not its opacity;
# and where the colour stands as an attribute as well, the style loses.
#
# A path that covers the page is drawn on white, its colour and opacity told in either way.
# Guessed: as CSS has it, a style says what an attribute says, and wins over it. Found: fill-opacity
# and opacity in a style draw an opaque path, and fill="#000" style="fill:#ff8040" is black, though
# style="fill:#ff8040" alone is orange.
#
# Output seen:
#   fill="#ff8040" fill-opacity=".4" (255, 204, 178)
#   fill="#ff8040" style="fill-opacity:.4" (255, 128, 64)
#   fill="#ff8040" style="opacity:.4" (255, 128, 64)
#   style="fill:#ff8040" (255, 128, 64)
#   fill="#000" style="fill:#ff8040" (0, 0, 0)
#
# Found on 2026-11-28 with Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install --quiet pymupdf==2.0 2> /dev/null

cat > try.py <<'PY'
import pymupdf

for told in (
    'fill="#ff8040" fill-opacity=".4"',
    'fill="#ff8040" style="fill-opacity:.4"',
    'fill="#ff8040" style="opacity:.4"',
    'style="fill:#ff8040"',
    'fill="#000" style="fill:#ff8040"',
):
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" width="20" height="20" viewBox="0 0 20 20">'
        f'<path d="M0 0H20V20H0Z" {told}/></svg>'
    )
    page = pymupdf.open(stream=svg.encode(), filetype="svg")[0]
    print(told, page.get_pixmap(alpha=False).pixel(10, 10))
PY
seen=$(venv/bin/python try.py)
echo "$seen"
test "$seen" = 'fill="#ff8040" fill-opacity=".4" (255, 204, 178)
fill="#ff8040" style="fill-opacity:.4" (255, 128, 64)
fill="#ff8040" style="opacity:.4" (255, 128, 64)
style="fill:#ff8040" (255, 128, 64)
fill="#000" style="fill:#ff8040" (0, 0, 0)'
