#!/usr/bin/env bash
# svgelements 1.9.6 leaves an inner <svg> without a viewBox at the origin: its x and y count only
# beside a viewBox.
#
# Two inner <svg> of 50 by 50 at x="5" y="5" hold the same line from (0, 0) to (10, 10); one of them
# has viewBox="0 0 50 50", which changes nothing in SVG (its scale is 1). Guessed: both lines go
# from (5, 5) to (15, 15), where CairoSVG draws them. Found: that with the viewBox does; the other
# goes from (0, 0) to (10, 10). Programs that read SVG by svgelements, such as vpype and MeerK40t,
# put such parts of a drawing elsewhere, without a word.
#
# Output seen:
#   svgelements with a viewBox (5, 5)
#   svgelements without (0, 0)
#   CairoSVG with a viewBox (5, 5)
#   CairoSVG without (5, 5)
#
# Found on 2026-11-29 with Python 3.11, pillow 12.0.0.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv tools
tools/bin/pip install --quiet svgelements==1.9.6 CairoSVG==2.9.1 pillow==12.0.0

cat > look.py << 'PYTHON'
import io

import cairosvg
from PIL import Image
from svgelements import SVG, Path

LINE = '<path d="M0 0L10 10" fill="none" stroke="black" stroke-linecap="square"/>'
for name, more in (("with a viewBox", 'viewBox="0 0 50 50"'), ("without", "")):
    inner = f'<svg x="5" y="5" width="50" height="50" {more}>{LINE}</svg>'
    text = f'<svg xmlns="http://www.w3.org/2000/svg" width="100" height="100" viewBox="0 0 100 100">{inner}</svg>'
    line = next(one for one in SVG.parse(io.StringIO(text)).elements() if isinstance(one, Path))
    print("svgelements", name, f"({line.first_point.x:g}, {line.first_point.y:g})")
    picture = Image.open(io.BytesIO(cairosvg.svg2png(bytestring=text.encode())))
    left, top, _, _ = picture.getchannel("A").getbbox()
    print("CairoSVG", name, f"({left}, {top})")
PYTHON
seen=$(tools/bin/python look.py | sort -k1,1r -s)
echo "$seen"
test "$seen" = "svgelements with a viewBox (5, 5)
svgelements without (0, 0)
CairoSVG with a viewBox (5, 5)
CairoSVG without (5, 5)"
