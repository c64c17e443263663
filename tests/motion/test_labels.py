"""Which sheet a planned stroke is of, and which way it runs along it: lines on a plate."""

import numpy as np
import pytest

from strokestyle.motion.labels import label_strokes
from strokestyle.motion.sheets import Points
from tests.motion.plates import line, planned, sheet

UPPER, LOWER = line([20, 60], [180, 60]), line([20, 68], [180, 68])


def labelled(strokes, old, period=None):
    """The runs of strokes, sheet by sheet, and how many sheets were begun."""
    begun = []

    def begin(length):
        begun.append(length)
        return 100 + len(begun)

    runs = label_strokes(planned(strokes), Points.concatenate(old), period or {}, begin)
    return sorted(runs, key=lambda run: (run.sheet, run.along[0])), len(begun)


def test_a_stroke_goes_on_on_its_sheet_though_a_stretch_lies_nearer_to_another():
    stroke = UPPER.copy()
    stroke[20:25, 1] += 5.0  # 15 px that lie nearer to the other
    runs, begun = labelled([stroke], [sheet(1, UPPER), sheet(2, LOWER)])
    assert [run.sheet for run in runs] == [1] and not begun
    assert np.allclose(runs[0].along, UPPER[:, 0] - 20, atol=4.0)


def test_a_stroke_is_cut_where_it_goes_over_to_another_sheet():
    stroke = np.concatenate([UPPER[:28], LOWER[30:]])
    runs, begun = labelled([stroke], [sheet(1, UPPER), sheet(2, LOWER)])
    assert [run.sheet for run in runs] == [1, 2] and not begun
    assert abs(runs[0].along[-1] - 83) < 9 and abs(runs[1].along[0] - 87) < 9


@pytest.mark.parametrize("turned", [False, True])
def test_a_stroke_runs_the_way_of_its_sheet_however_it_was_planned(turned):
    stroke = UPPER[::-1] if turned else UPPER
    (run,), _ = labelled([stroke], [sheet(1, UPPER)])
    assert np.allclose(stroke[run.rows], UPPER) and np.allclose(run.along, UPPER[:, 0] - 20)


def test_what_goes_on_beyond_the_end_of_its_sheet_is_of_it_and_what_lies_alone_begins_one():
    alone = line([20, 150], [100, 150])
    runs, begun = labelled([UPPER, alone], [sheet(1, UPPER[10:40])])
    assert [run.sheet for run in runs] == [1, 101] and begun == 1
    assert len(runs[0].rows) == len(UPPER)
    assert np.allclose(np.diff(runs[0].along), 3.0, atol=0.1)
    assert list(runs[0].known) == [10 <= i < 40 for i in range(len(UPPER))]


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("begins", [0, 17, 60])
def test_a_closed_stroke_begins_where_its_sheet_begins(begins, way):
    angle = np.linspace(0, 2 * np.pi, 121)
    ring = 100 + 58 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    along = angle * 58
    order = np.r_[np.arange(begins, 120), np.arange(begins + 1)][::way]
    (run,), begun = labelled([ring[order]], [sheet(1, ring, along)], {1: along[-1]})
    assert not begun and len(run.rows) == 121
    start = ring[order][run.rows[0]]
    assert np.hypot(*(start - ring[0])) < 7.0
    assert (np.diff(run.along) > 0).all()


def test_two_strokes_on_one_sheet_do_not_lie_over_each_other():
    runs, _ = labelled([UPPER[:30], UPPER[28:] + [0, 1.0]], [sheet(1, UPPER)])
    assert [run.sheet for run in runs] == [1, 1]
    assert runs[0].along[-1] < runs[1].along[0]


def test_of_two_strokes_side_by_side_one_is_of_the_sheet():
    runs, begun = labelled([UPPER, UPPER[5:-5] + [0, 4.0]], [sheet(1, UPPER)])
    assert [run.sheet for run in runs] == [1, 101] and begun == 1
    assert len(runs[0].rows) == len(UPPER)
