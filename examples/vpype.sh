#!/bin/sh
# Draw lines that vpype has made fewer and longer: extracted, joined and sorted by it, drawn.
#
#     vpype.sh MODEL SHAPE OUT.svg [OPTION ...]
#
# OPTIONs of the view (--view, --size, --camera ...) go to both steps. COMMANDS says what vpype does
# with the curves ("linemerge --tolerance 2px filter --min-length 12px"): see vpype --help.
set -eu

die() { echo "vpype.sh: $1" >&2; exit "${2:-1}"; }

[ $# -ge 3 ] || die "usage: vpype.sh MODEL SHAPE OUT.svg [OPTION ...]" 2
command -v strokestyle > /dev/null || die "there is no strokestyle here: pip install strokestyle"
command -v vpype > /dev/null || die "there is no vpype here: pip install vpype"
model=$1 shape=$2 out=$3
shift 3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM

strokestyle extract "$shape" -o "$work/curves.svg" "$@"
# vpype keeps our layers, which are the kinds of line; COMMANDS is words for it, so it is not quoted
# shellcheck disable=SC2086
vpype read "$work/curves.svg" \
    ${COMMANDS:-linemerge --tolerance 2px filter --min-length 12px} write "$work/joined.svg"
strokestyle render "$model" "$shape" -o "$out" --curves "$work/joined.svg" "$@"
