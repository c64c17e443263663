#!/bin/sh
# Draw one shape in every style of a folder, side by side on one page.
#
#     every_style.sh MODELS/ SHAPE OUT/ [OPTION ...]
#
# MODELS/NAME.pt draws OUT/NAME.svg; OUT/styles.html shows them all. OPTIONs go to
# `strokestyle render`.
# Exit code: 0; 1 where it could not be drawn in one of the styles.
set -eu

die() { echo "every_style.sh: $1" >&2; exit "${2:-1}"; }

[ $# -ge 3 ] || die "usage: every_style.sh MODELS/ SHAPE OUT/ [OPTION ...]" 2
command -v strokestyle > /dev/null || die "there is no strokestyle here: pip install strokestyle"
models=$1 shape=$2 out=$3
shift 3
mkdir -p "$out"

failed=0 drawn=0
for model in "$models"/*.pt; do
    [ -f "$model" ] || die "$models: no model (.pt) in this folder; strokestyle fit makes one"
    name=$(basename "$model" .pt)
    if strokestyle render "$model" "$shape" -o "$out/$name.svg" "$@"; then
        drawn=$((drawn + 1))
    else
        failed=1
    fi
done
[ "$drawn" -gt 0 ] || exit 1
strokestyle report "$out" -o "$out/styles.html" --title "$(basename "$shape")"
exit "$failed"
