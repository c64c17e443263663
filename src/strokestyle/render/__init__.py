"""View + Style -> Drawing."""

import os

# torch makes its threads wait by spinning unless told otherwise before it is imported. On two cores
# shared with other work that made a fit 5 times slower (138 s for 25 s); sleeping at once made it a
# quarter slower on idle ones (17.3 s for 13.7 s). So they spin for some 30 microseconds, and then
# sleep. This is the one place that says so: whatever imports torch lies in this package or in
# `fit`, which imports this one.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
os.environ.setdefault("GOMP_SPINCOUNT", "30000")
