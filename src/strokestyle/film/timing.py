"""When the pictures of a film change."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

MIN_RATE, MAX_RATE = 0.1, 240.0  # frames a second: a GIF's times, and screens, end beyond
LARGEST_DENOMINATOR = 60060  # of a rate as a fraction; 24000/1001 and its like are exact


class NoSuchRate(ValueError):
    """Frames come faster or slower than what is asked for can show them."""


def rate_of(fps: Fraction | float) -> Fraction:
    """Read frames a second as a fraction: 12, 12.5, or 23.976, which is 24000/1001.

    Raises NoSuchRate where it does not lie between MIN_RATE and MAX_RATE.
    """
    if not MIN_RATE <= float(fps) <= MAX_RATE:
        raise NoSuchRate(
            f"a film has {MIN_RATE:g} to {MAX_RATE:g} frames a second, got {float(fps):g}"
        )
    for whole in (24, 30, 48, 60, 120):
        ntsc = Fraction(1000 * whole, 1001)
        if abs(float(fps) - float(ntsc)) < 5e-4:
            return ntsc
    return Fraction(fps).limit_denominator(LARGEST_DENOMINATOR // 60)


def durations(held: Sequence[int], rate: Fraction, unit: int, shortest: int = 1) -> list[int]:
    """Find how long each picture is shown, in 1 / `unit` seconds, so that no rounding adds up.

    Parameters
    ----------
    held : for how many frames each picture is shown
    rate : frames a second
    unit : of a second, 100 for GIF
    shortest : of these, that each picture is shown at least: neighbours give what it lacks, so that
        the whole lasts as long, unless there is too little for all
    """
    ends, frames = [0], 0
    for count in held:
        frames += count
        end = int(frames * unit / rate + Fraction(1, 2))
        ends.append(max(end, ends[-1] + shortest))
    ends[-1] = max(int(frames * unit / rate + Fraction(1, 2)), shortest * len(held))
    for i in range(len(held) - 1, 0, -1):
        ends[i] = min(ends[i], ends[i + 1] - shortest)
    return [end - start for start, end in zip(ends, ends[1:], strict=False)]
