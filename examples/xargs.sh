#!/bin/sh
# Draw all shapes beneath a folder, some in each of several runs at the same time.
#
#     xargs.sh MODEL SHAPES/ OUT/ [OPTION ...]
#
# `find SHAPES/ ... -print0 | strokestyle render MODEL - -o OUT/` does the same in one run
# and is quicker; this is a pattern for when another program stands in between, such as `nice`,
# `timeout`, or a batch system's `srun`, or when find is to choose the shapes. JOBS says how many
# runs at a time (as many as there are processors), EACH how many shapes in each (20).
# Exit code: 0; 1 where a shape could not be drawn.
set -eu

die() { echo "xargs.sh: $1" >&2; exit "${2:-1}"; }

[ $# -ge 3 ] || die "usage: xargs.sh MODEL SHAPES/ OUT/ [OPTION ...]" 2
command -v strokestyle > /dev/null || die "there is no strokestyle here: pip install strokestyle"
model=$1 shapes=$2 out=$3
shift 3
[ -d "$shapes" ] || die "$shapes: no such folder of shapes"

shapes() {
    find "$shapes" -type f \( -name '*.obj' -o -name '*.ply' -o -name '*.stl' -o -name '*.glb' \
        -o -name '*.gltf' -o -name '*.off' -o -name '*.3mf' -o -name '*.dae' \) "$@"
}

[ -n "$(shapes -print | head -n 1)" ] || die "$shapes: no shape in this folder"
twice=$(shapes -print | sed 's|.*/||; s|\.[^.]*$||' | sort | uniq -d | head -n 1)
[ -z "$twice" ] || die "two shapes are called $twice: both would be drawn into $out/$twice.svg"
mkdir -p "$out"
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}" # a processor for each run

# --resume makes each run a batch, even of one shape, with its lines in OUT/batch.jsonl
shapes -print0 | xargs -0 -n "${EACH:-20}" \
    -P "${JOBS:-$(getconf _NPROCESSORS_ONLN 2> /dev/null || echo 1)}" \
    strokestyle render "$model" -o "$out/" --jobs 1 --resume "$@" || exit 1
