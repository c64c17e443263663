#!/usr/bin/env bash
# svgo 4.1.0 draws a shape at 89 % of its size: it rounds the product of two scales by the digits of
# one of them.
#
# A path under scale(.15), in a group under matrix(1.5 0 0 1.5 10 10), is optimised with svgo's
# default plugins. (The path has a style, which keeps svgo from working the transform into its
# coordinates.) Guessed: .225, since svgo's transformPrecision is five digits. Found: the two become
# matrix(.2 0 0 .2 10 10), and a square of 180 units is drawn with 160; with scale(.155), .2325
# becomes .2, too. The very same product as a list on the path itself, "translate(10 10) scale(1.5)
# scale(.15)", stays .225.
#
# Output seen:
#   group matrix(.2 0 0 .2 10 10)
#   finer matrix(.2 0 0 .2 10 10)
#   list translate(10 10)scale(.225)
#
# Found on 2026-11-28 with Node.js 20.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm init --yes > /dev/null
npm install --silent --no-save svgo@4.1.0 > /dev/null

optimised() { # a name, what stands around the path, the path's own transform
    local square="<path style=\"opacity:.5\" transform=\"$3\" d=\"M0 0H800V800H0Z\"/>"
    printf '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 200 200">%s</svg>' \
        "${2:+<g transform=\"$2\">}$square${2:+</g>}" > "$1.svg"
    npx --no-install svgo --quiet --input "$1.svg" --output "$1.out.svg"
    echo "$1 $(sed 's/.*transform="\([^"]*\)".*/\1/' "$1.out.svg")"
}
seen=$(
    optimised group "matrix(1.5 0 0 1.5 10 10)" "scale(.15)"
    optimised finer "matrix(1.5 0 0 1.5 10 10)" "scale(.155)"
    optimised list "" "translate(10 10) scale(1.5) scale(.15)"
)
echo "$seen"
test "$seen" = "group matrix(.2 0 0 .2 10 10)
finer matrix(.2 0 0 .2 10 10)
list translate(10 10)scale(.225)"
