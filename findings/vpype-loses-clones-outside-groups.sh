#!/usr/bin/env bash
# vpype 1.15.0 `read` leaves out clones that stand in no group, and says nothing; with
# --single-layer, or with --attr, the same file is read whole.
#
# An SVG holds a line and a clone of it (<use>, as Inkscape's Edit > Clone writes) straight in the
# root, and the same two in a group, an Inkscape layer. Guessed: all four lines are read, in any
# mode, as svgelements, which vpype reads by, knows <use>. Found: `read` yields three, without the
# clone in the root, and exit code 0; `read --single-layer` and `read --attr stroke` yield four. So
# a plot of layers lacks lines that a plot of one layer has. (What stands in the root in <a>,
# <switch> or a nested <svg> is read in all modes.)
#
# Output seen:
#   layers 3
#   single layer 4
#   by stroke 4
#
# Found on 2026-11-29 with Python 3.11, svgelements 1.9.6.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv tools
tools/bin/pip install --quiet vpype==1.15.0 svgelements==1.9.6

two_lines() { # a name
    echo "<path id=\"$1\" d=\"M10 10H40\" fill=\"none\" stroke=\"black\"/>"
    echo "<use xlink:href=\"#$1\" x=\"0\" y=\"20\"/>"
}
{
    echo '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    echo ' width="100" height="100" viewBox="0 0 100 100">'
    two_lines root
    echo '<g id="layer1" transform="translate(50 0)">'
    two_lines grouped
    echo '</g></svg>'
} > lines.svg

count() { # a name, options of read
    lines=$(tools/bin/vpype read "${@:2}" lines.svg stat | sed -n 's/^  Path count: //p' | tail -1)
    echo "$1 $lines"
}
seen=$(
    count layers
    count "single layer" --single-layer
    count "by stroke" --attr stroke
)
echo "$seen"
test "$seen" = "layers 3
single layer 4
by stroke 4"
