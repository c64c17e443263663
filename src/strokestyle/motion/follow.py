"""Follow the lines of an animation through its frames."""

from __future__ import annotations

import numpy as np

from .candidates import Candidates
from .labels import label_strokes
from .sheets import Points, carried, found_points, left_over, without_strays

JUMP = 0.2  # of the canvas, the median move of lines above which a shot is another scene
FRESH = 1  # frames since a line was seen, up to which strokes are looked for on it though hidden


class Follower:
    """Follows sheets from frame to frame; `step` goes on by one."""

    def __init__(self) -> None:
        self.count = 0
        self.period: dict[int, float] = {}
        self.steps = 0
        self.cuts: set[int] = set()  # the steps at which another scene begins
        self.points = Points.none()
        self.before: Candidates | None = None

    def step(self, here: Candidates) -> Points:
        """Find the sheets in the next frame, and begin new ones; none goes on over a cut."""
        old, before = carried(self.points, here.shot, here.scale), self.before
        moves = before is not None and before.shot.surface is not here.shot.surface
        if self._is_cut(old, here):
            old, before = Points.none(), None
            self.cuts.add(self.steps)
        self.steps += 1
        may = old.take(old.seen | (old.age <= FRESH))
        runs = label_strokes(here, may, self.period, self._begin)
        found = found_points(here, runs, before)
        left = left_over(here, old, found, moves)
        points = without_strays(Points.concatenate([found, left]))
        self.points, self.before = points, here
        return points

    def _is_cut(self, old: Points, here: Candidates) -> bool:
        """Tell whether lines jump so far that this is another scene."""
        if self.before is None or not old.seen.any():
            return False
        was = old.places.seen(self.before.shot)[0] / here.scale
        moved = np.median(np.hypot(*(old.xy - was)[old.seen].T))
        size = max(here.shot.camera.width, here.shot.camera.height) / here.scale
        return bool(moved > JUMP * size)

    def _begin(self, period: float) -> int:
        """Begin a sheet; a closed one has a `period` above 0."""
        self.count += 1
        if period > 0.0:
            self.period[self.count - 1] = period
        return self.count - 1
