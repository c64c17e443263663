"""Measuring across strokes, on bands of ink whose place and width are known."""

import numpy as np
import pytest
from known_law import jitter, level, normals, planned, smoothed

from strokestyle.fit.observe import HALF_CONFIDENCE, measure_across, sample_image

WIDTH, HEIGHT = 300, 120


def across(strokes):
    lines = [
        strokes.xy[a:b] for a, b in zip(strokes.offsets[:-1], strokes.offsets[1:], strict=True)
    ]
    return np.concatenate([normals(line) for line in lines])


def band(middle, width, image=None):
    """A mask with a level band of ink, anti-aliased, laid over another one."""
    y = np.arange(HEIGHT)[:, None] + 0.5
    ink = np.clip(width / 2 - np.abs(y - middle) + 0.5, 0, 1) * np.ones(WIDTH)
    return ink if image is None else np.maximum(image, ink)


def measured(mask, strokes, **options):
    return measure_across(mask, strokes, across(strokes), **options)


@pytest.mark.parametrize("offset", [-7.0, -2.5, 0.0, 0.25, 3.0, 9.0])
@pytest.mark.parametrize("thickness", [2.0, 5.5, 9.0])
def test_offset_has_the_sign_of_the_normal_and_thickness_is_the_full_width(offset, thickness):
    strokes = planned(level(60))
    seen = measured(band(60 + offset, thickness), strokes)
    assert across(strokes)[0].tolist() == [0, 1]  # of a line to the right the normal points down
    assert seen.offset == pytest.approx(np.full(len(strokes.xy), offset), abs=0.1)
    assert seen.thickness == pytest.approx(np.full(len(strokes.xy), thickness), abs=0.2)
    assert seen.confidence == pytest.approx(1 / (1 + (offset / HALF_CONFIDENCE) ** 2), abs=0.02)


def test_the_other_way_round_the_offset_has_the_other_sign():
    seen = measured(band(63, 5.0), planned(level(60)[::-1]))
    assert seen.offset == pytest.approx(-3.0, abs=0.05)


def test_of_a_curved_line_the_offset_is_along_its_own_normal():
    angle = np.linspace(0.2, 2.8, 60)
    arc = [150, 100] + 70 * np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    mask = np.clip(2.5 - np.abs(np.hypot(x - 150, y - 100) - 74) + 0.5, 0, 1)
    seen = measured(mask, planned(arc))
    outside = np.sign((across(planned(arc)) * (arc - [150, 100])).sum(axis=1))
    assert (seen.offset * outside)[2:-2] == pytest.approx(4.0, abs=0.1)


def test_without_ink_in_reach_nothing_is_known():
    for mask in (np.zeros((HEIGHT, WIDTH)), band(60 + 20, 4.0), np.ones((HEIGHT, WIDTH))):
        assert not measured(mask, planned(level(60))).confidence.any()
    assert measured(band(60 + 20, 4.0), planned(level(60)), reach=24.0).confidence.all()


def test_ink_whose_middle_is_out_of_reach_or_whose_end_is_not_seen_is_not_believed():
    assert not measured(band(60 + 19, 8.0), planned(level(60))).confidence.any()
    y = np.arange(HEIGHT)[:, None] + 0.5
    for ink in (y > 55, y < 65):  # to one side it goes on farther than is looked
        assert not measured(ink * np.ones(WIDTH), planned(level(60))).confidence.any()


def test_the_nearest_of_several_lines_is_measured():
    mask = band(66, 6.0, band(51, 3.0))
    seen = measured(mask, planned(level(60)))
    assert seen.offset == pytest.approx(6.0, abs=0.1)
    assert seen.thickness == pytest.approx(6.0, abs=0.1)


def test_a_stroke_seen_lengthwise_is_not_believed():
    """Where a bar of ink crosses, the run across the stroke is as long as the bar."""
    mask = band(60, 4.0)
    mask[40:80, 140:150] = 1.0
    strokes = planned(level(60))
    seen = measured(mask, strokes)
    crossed = (strokes.xy[:, 0] > 141) & (strokes.xy[:, 0] < 149)
    away = (strokes.xy[:, 0] < 137) | (strokes.xy[:, 0] > 153)
    assert crossed.any() and not seen.confidence[crossed].any() and seen.confidence[away].all()


def test_what_runs_past_an_end_is_not_measured():
    strokes = planned(level(60), past=4)
    seen = measured(band(60, 4.0), strokes)
    assert (seen.confidence > 0).tolist() == strokes.on_curve.tolist()


def test_a_wavering_band_is_followed_point_by_point():
    x = np.arange(WIDTH) + 0.5
    middle = (
        60 + smoothed(np.stack([x, jitter(WIDTH, 4.0, np.random.default_rng(0))], 1), 40.0)[:, 1]
    )
    y = np.arange(HEIGHT)[:, None] + 0.5
    strokes = planned(level(60))
    seen = measured(np.clip(2.5 - np.abs(y - middle) + 0.5, 0, 1), strokes)
    assert seen.offset == pytest.approx(np.interp(strokes.xy[:, 0], x, middle) - 60, abs=0.15)


def test_pixel_centres_lie_at_a_half_and_outside_is_nothing():
    image = np.arange(12.0).reshape(3, 4)
    at = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [2.0, 1.5], [3.5, 2.5], [-1, 1], [4.6, 9]])
    assert sample_image(image, at).tolist() == [0, 1, 4, 5.5, 11, 0, 0]
