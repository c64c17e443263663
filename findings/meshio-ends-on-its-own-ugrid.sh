#!/usr/bin/env bash
# meshio 5.3.5 cannot read the text UGRID file that it wrote, and ends the process that asks.
#
# A tetrahedron and its four triangles were written as UGRID in its four forms and read again.
# Guessed: all four come back. Found: the three binary forms do; of the text form (.ugrid)
# meshio.read prints that the header is ill-formed and calls sys.exit(1), so that no `except
# Exception` of the program that calls it sees anything: it is a SystemExit, not meshio's ReadError.
#
# Output seen:
#   a.b8.ugrid (4, 3)
#   a.lb8.ugrid (4, 3)
#   a.r8.ugrid (4, 3)
#   a.ugrid SystemExit 1
#
# Found on 2026-11-28 with Python 3.11, numpy 2.2.6.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install --quiet meshio==5.3.5 numpy==2.2.6 2> /dev/null

cat > try.py <<'PY'
import contextlib
import io

import meshio
import numpy as np

points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
sides = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
mesh = meshio.Mesh(points, [("triangle", sides), ("tetra", np.array([[0, 1, 2, 3]]))])
for name in ("a.b8.ugrid", "a.lb8.ugrid", "a.r8.ugrid", "a.ugrid"):
    with contextlib.redirect_stdout(io.StringIO()):
        mesh.write(name)
        try:
            found = str(meshio.read(name).points.shape)
        except SystemExit as end:
            found = f"SystemExit {end.code}"
    print(name, found)
PY
seen=$(venv/bin/python try.py 2> /dev/null)
echo "$seen"
test "$seen" = "a.b8.ugrid (4, 3)
a.lb8.ugrid (4, 3)
a.r8.ugrid (4, 3)
a.ugrid SystemExit 1"
