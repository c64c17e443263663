"""Set before anything imports torch, for the reason that strokestyle/cli/__init__.py gives."""

import os

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
os.environ.setdefault("GOMP_SPINCOUNT", "30000")
