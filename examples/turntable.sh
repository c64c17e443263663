#!/bin/sh
# Draw a shape as it turns, as a GIF that loops: small enough to post.
#
#     turntable.sh MODEL SHAPE OUT.gif [OPTION ...]
#
# OPTIONs go to `strokestyle render`: --on-twos for the look of hand-drawn film, --boil 0.5, --view
# 0,40 to look down on it, another -o for an .mp4 or a page (.html) of the same animation.
# FRAMES says how many drawings (36), FPS how many a second (12), SIZE how many pixels (480).
set -eu

die() { echo "turntable.sh: $1" >&2; exit "${2:-1}"; }

[ $# -ge 3 ] || die "usage: turntable.sh MODEL SHAPE OUT.gif [OPTION ...]" 2
command -v strokestyle > /dev/null || die "there is no strokestyle here: pip install strokestyle"
model=$1 shape=$2 out=$3
shift 3

strokestyle render "$model" "$shape" -o "$out" --turntable "${FRAMES:-36}" --fps "${FPS:-12}" \
    --size "${SIZE:-480}" "$@"
