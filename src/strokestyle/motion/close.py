"""Close a loop: the last frame of a turn goes over into its first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from .compose import Composed

SAME = 4.0  # px between points of one stroke as it is before the turn, and after it
MOST = 0.5  # of a stroke's points


def close(frames: list[list[Composed]], first: int, count: int) -> list[list[Composed]]:
    """Choose the frames of one turn out of more, and let tracks go on over its end.

    Behind the turn follows its first frame once more, whose strokes continue those of the last. As
    they are the same strokes as in the turn's own first frame, those go by their names from then
    on, and have their places; what a track that lives all the turn has gained in it is taken off
    bit by bit.

    Parameters
    ----------
    frames : strokes of the frames before the turn, of the turn, and of those that follow it
    first, count : the first frame of the turn, and how many it has
    """
    turn = [list(strokes) for strokes in frames[first : first + count]]
    if first + count >= len(frames):
        return turn
    for own, name, shift in _same(turn[0], frames[first + count]):
        lives = [t for t, some in enumerate(turn) if any(s.track == own for s in some)]
        if own == name:
            if len(lives) == count:
                for t, some in enumerate(turn):
                    turn[t] = [_moved(s, shift * t / count, own, own) for s in some]
                    # at the first frame nothing, at the end all: shift is what the turn lost
                continue
            end = next(t for t in range(count) if t not in lives)
            for t in range(end):
                turn[t] = [_moved(s, -shift, own, own) for s in turn[t]]
        elif not any({own, name} <= {s.track for s in some} for some in turn):
            for t in range(count):
                turn[t] = [_moved(s, -shift, own, name) for s in turn[t]]
    return turn


def _moved(stroke: Composed, shift: float, track: int, name: int) -> Composed:
    """Move the places of a stroke, and name it anew, if it is of a track."""
    if stroke.track != track:
        return stroke
    return replace(stroke, track=name, place=stroke.place + shift)


def _same(here: list[Composed], again: list[Composed]) -> list[tuple[int, int, float]]:
    """Pair strokes of a frame with those of the same frame seen again.

    Returns
    -------
    of each pair the names of both, and by how much the places of the first are above those of the
    second, px
    """
    if not here or not again:
        return []
    xy = np.concatenate([stroke.xy for stroke in again])
    of = np.repeat(np.arange(len(again)), [len(stroke.xy) for stroke in again])
    place = np.concatenate([stroke.place for stroke in again])
    tree = cKDTree(xy)
    votes: list[tuple[int, int, int]] = []
    for i, stroke in enumerate(here):
        away, row = tree.query(stroke.xy, distance_upper_bound=SAME)
        near = of[row[away < np.inf]]
        for k, count in enumerate(np.bincount(near, minlength=len(again)).tolist()):
            if count > MOST * min(len(stroke.xy), len(again[k].xy)):
                votes.append((count, i, k))
    out, done = [], (set(), set())  # type: ignore[var-annotated]
    for _, i, k in sorted(votes, reverse=True):
        if i in done[0] or k in done[1]:
            continue
        done[0].add(i)
        done[1].add(k)
        away, row = tree.query(here[i].xy, distance_upper_bound=SAME)
        near = (away < np.inf) & (of[np.minimum(row, len(of) - 1)] == k)
        shift = float(np.mean(here[i].place[near] - place[row[near]]))
        out.append((here[i].track, again[k].track, shift))
    return out
