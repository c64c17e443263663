#!/bin/sh
# Draw the lines that you leave in Inkscape: its curves are extracted, you edit them, they are drawn.
#
#     inkscape.sh MODEL SHAPE OUT.svg [OPTION ...]
#
# Inkscape opens with the curves; delete, move, bend and add lines, save, and close it. The curves
# stay beside the drawing, as OUT-curves.svg: where that is there already, it is opened as it is.
# OPTIONs of the view (--view, --size, --camera ...) go to both steps.
# ACTIONS says what Inkscape does in place of you, and no window opens:
#
#     ACTIONS='select-all;path-simplify' inkscape.sh MODEL SHAPE OUT.svg
set -eu

die() { echo "inkscape.sh: $1" >&2; exit "${2:-1}"; }

[ $# -ge 3 ] || die "usage: inkscape.sh MODEL SHAPE OUT.svg [OPTION ...]" 2
command -v strokestyle > /dev/null || die "there is no strokestyle here: pip install strokestyle"
command -v inkscape > /dev/null || die "there is no inkscape here: see https://inkscape.org"
model=$1 shape=$2 out=$3
shift 3
curves=${out%.svg}-curves.svg

[ -f "$curves" ] || strokestyle extract "$shape" -o "$curves" "$@"
if [ -n "${ACTIONS:-}" ]; then
    inkscape "$curves" --actions="$ACTIONS;export-filename:$curves;export-overwrite;export-do"
else
    inkscape "$curves"
fi
strokestyle render "$model" "$shape" -o "$out" --curves "$curves" "$@"
