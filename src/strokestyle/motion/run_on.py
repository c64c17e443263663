"""Let strokes run on past the ends of their lines, as far as a pen may go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..render.plan import HEADING_SPAN, Planned, heading


def run_on(planned: Planned, most: float, spacing: float) -> tuple[Planned, np.ndarray, np.ndarray]:
    """Let strokes run on straight past both ends, as `plan_strokes` does.

    Parameters
    ----------
    planned : strokes that end where their lines do
    most : px past an end
    spacing : px between points

    Returns
    -------
    the strokes; the row (M,) of `planned` that each of their points is at, or past; and how many px
    past it, (M,), below 0 before a stroke's first point
    """
    steps = np.arange(1, int(most / spacing) + 1) * spacing
    span = max(1, round(HEADING_SPAN / spacing))
    xy, rows, past = [np.zeros((0, 2))], [np.zeros(0, np.int64)], [np.zeros(0)]
    for a, b in zip(planned.offsets[:-1], planned.offsets[1:], strict=True):
        line = planned.xy[a:b]
        before = line[0] + steps[::-1, None] * heading(line[::-1], span)
        after = line[-1] + steps[:, None] * heading(line, span)
        xy.append(np.concatenate([before, line, after]))
        rows.append(np.pad(np.arange(a, b), len(steps), mode="edge"))
        past.append(np.r_[-steps[::-1], np.zeros(b - a), steps])
    row, beyond = np.concatenate(rows), np.concatenate(past)
    count = np.diff(planned.offsets) + 2 * len(steps)
    longer = replace(
        planned,
        xy=np.concatenate(xy),
        offsets=np.r_[0, np.cumsum(count)].astype(np.int64),
        source=planned.source[row],
        mix=planned.mix[row],
        overshoot=np.abs(beyond),
    )
    return longer, row, beyond
