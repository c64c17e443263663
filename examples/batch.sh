#!/bin/sh
# Draw all shapes of a folder, as many at a time as there are processors, and report on them.
#
#     batch.sh MODEL SHAPES/ OUT/ [OPTION ...]
#
# OPTIONs go to `strokestyle render`. The report is OUT/report.html. After a stop, the same command
# goes on where it was. JOBS says how many to draw at a time: JOBS=4 batch.sh ...
# Exit code: 0; 1 where a shape could not be drawn, which the report names.
set -eu

die() { echo "batch.sh: $1" >&2; exit "${2:-1}"; }

[ $# -ge 3 ] || die "usage: batch.sh MODEL SHAPES/ OUT/ [OPTION ...]" 2
command -v strokestyle > /dev/null || die "there is no strokestyle here: pip install strokestyle"
model=$1 shapes=$2 out=$3
shift 3
[ -d "$shapes" ] || die "$shapes: no such folder of shapes"
jobs=${JOBS:-$(getconf _NPROCESSORS_ONLN 2> /dev/null || echo 1)}

failed=0
strokestyle render "$model" "$shapes" -o "$out/" --jobs "$jobs" --resume "$@" || failed=$?
[ "$failed" -le 1 ] || exit "$failed"
[ -f "$out/batch.jsonl" ] || exit 1
strokestyle report "$out" -o "$out/report.html"
exit "$failed"
