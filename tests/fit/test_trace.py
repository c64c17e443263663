"""Tracing through the rasteriser: every term of its loss, and drawings whose strokes come back."""

from dataclasses import replace

import numpy as np
import pytest
from known_law import level, normals, planned

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.fit.checkpoint import Checkpoint
from strokestyle.fit.observe import Observation
from strokestyle.fit.trace import (
    AGREES,
    DISAGREES,
    OVERSHOOT_WEIGHT,
    PAST_END,
    PAST_END_HIDDEN,
    PULL_WEIGHT,
    THICKNESS_ROUGHNESS,
    MaskPyramid,
    Traced,
    TraceLoss,
    interior,
    optimise_strokes,
    pyramid,
    thickness_of,
)
from strokestyle.fit.train import PRESETS
from strokestyle.render.config import HAIR
from strokestyle.render.displacement import Frame, displaced

CONFIG = replace(PRESETS["quick"], trace_steps=100)
WIDTH, HEIGHT = 200, 120


def frame_of(strokes, deformations=None):
    lines = [
        strokes.xy[a:b] for a, b in zip(strokes.offsets[:-1], strokes.offsets[1:], strict=True)
    ]
    across = np.concatenate([normals(line) for line in lines])
    if deformations is None:
        deformations = np.zeros((len(across), 1, 2))
    return Frame(strokes.xy, across, deformations, strokes.offsets, strokes.on_curve)


def two_lines(past=0):
    return planned(level(40, 30, 170), level(80, 30, 170), past=past)


def mask_of(xy, thickness, offsets):
    count = len(offsets) - 1
    strokes = Strokes(xy, thickness, offsets, np.zeros(count), np.zeros(count, bool))
    drawing = Drawing(strokes, (WIDTH, HEIGHT), np.tile([0.0, 0, 0, 1], (count, 1)))
    return rasterise(drawing)[..., 3].astype(np.float64) / 255


def start_of(strokes, thickness=4.0):
    log_width = np.where(strokes.on_curve, np.log(thickness + HAIR), np.log(HAIR))
    return Traced(strokes.xy, log_width)


def traced(strokes, mask, config=CONFIG, thickness=4.0):
    frame = frame_of(strokes)
    target = MaskPyramid.of(mask, strokes.xy, config.levels)
    start = start_of(frame, thickness)
    out = optimise_strokes(frame, start, target, config, lambda *_: None, Checkpoint())
    offset = frame.across(out.xy - frame.xy)
    return offset, out.thickness, out


# ------------------------------------------------------------------------ drawings come back


def test_thickness_and_offset_come_back_point_by_point():
    strokes = two_lines()
    x = strokes.xy[:, 0]
    offset = np.where(strokes.xy[:, 1] < 60, 3.0 + 1.5 * np.sin(x / 12), -2.0)
    thickness = np.where(strokes.xy[:, 1] < 60, 5.0, 5.0 + 2.5 * np.cos(x / 15))
    mask = mask_of(strokes.xy + offset[:, None] * [0, 1], thickness, strokes.offsets)
    got_offset, got_thickness, out = traced(strokes, mask)
    inner = (x > 36) & (x < 164)
    assert np.abs(got_offset - offset)[inner].max() < 0.35
    assert np.abs(got_thickness - thickness)[inner].max() < 0.6
    assert np.corrcoef(got_thickness[inner], thickness[inner])[0, 1] > 0.99
    assert out.xy[:, 0] == pytest.approx(x, abs=1e-4)  # points move across only


def test_where_the_drawing_is_as_it_was_begun_nothing_moves():
    strokes = two_lines()
    mask = mask_of(strokes.xy, np.full(len(strokes.xy), 4.0), strokes.offsets)
    offset, thickness, _ = traced(strokes, mask)
    assert np.abs(offset).max() < 0.1 and np.abs(thickness - 4.0).max() < 0.3


def test_a_stroke_runs_on_past_its_end_only_where_the_drawing_does():
    strokes = two_lines(past=6)
    drawn = (strokes.overshoot < 13) & ((strokes.xy[:, 1] < 60) | strokes.on_curve)
    lines = [strokes.xy[drawn & (strokes.xy[:, 1] == y)] for y in (40, 80)]
    offsets = np.r_[0, np.cumsum([len(line) for line in lines])]
    mask = mask_of(np.concatenate(lines), np.full(offsets[-1], 5.0), offsets)
    _, thickness, _ = traced(strokes, mask)
    upper, past = strokes.xy[:, 1] < 60, strokes.overshoot
    assert thickness[upper & (past > 5) & (past < 11)].min() > 2.5
    assert thickness[upper & (past > 16)].max() < 0.3
    assert thickness[~upper & (past > 4)].max() < 0.3


def test_a_stroke_that_the_drawing_lacks_stays_where_it_was_begun_and_fades():
    strokes = two_lines()
    upper = strokes.xy[:, 1] < 60
    mask = mask_of(strokes.xy[upper], np.full(upper.sum(), 4.0), [0, upper.sum()])
    offset, thickness, _ = traced(strokes, mask)
    assert np.abs(offset).max() < 0.3
    assert thickness[upper].min() > 3.5 and thickness[~upper].max() < 0.5


# ------------------------------------------------------------------------------ terms of the loss


def losses(across, widening, strokes=None, roughness=0.3, mask=None):
    """The loss without its misfit, of changes (N,) to two lines; and the misfit."""
    strokes = strokes or two_lines()
    frame = frame_of(strokes)
    mask = np.zeros((HEIGHT, WIDTH)) if mask is None else mask
    target = MaskPyramid.of(mask, strokes.xy, 3)
    start = start_of(frame)
    found = TraceLoss(target, frame, start, roughness)(across, widening)
    return found.loss - found.mask, found.mask


COUNT = len(two_lines().xy)
NOTHING = np.zeros(COUNT)


def second_differences(values, offsets):
    pieces = [np.diff(values[a:b], 2) for a, b in zip(offsets[:-1], offsets[1:], strict=True)]
    return np.concatenate(pieces)


def test_roughness_counts_second_differences_within_strokes():
    offsets = two_lines().offsets
    bumpy = np.random.default_rng(0).normal(size=COUNT)
    square = np.mean(second_differences(bumpy, offsets) ** 2)
    pull = PULL_WEIGHT * np.mean(bumpy**2)
    assert losses(bumpy, NOTHING)[0] == pytest.approx(0.3 * square + pull, rel=1e-3)
    small = 0.05 * bumpy
    square = THICKNESS_ROUGHNESS * np.mean(second_differences(small, offsets) ** 2)
    pull = PULL_WEIGHT * np.mean(small**2)
    assert losses(NOTHING, small)[0] == pytest.approx(0.3 * square + pull, rel=1e-3)


def test_slopes_and_steps_between_strokes_are_not_rough():
    first = np.arange(COUNT) < two_lines().offsets[1]
    slanted = np.where(first, 5.0, 0.02 * np.arange(COUNT))
    assert losses(slanted, NOTHING)[0] == pytest.approx(PULL_WEIGHT * np.mean(slanted**2), rel=1e-3)


def test_changes_are_pulled_back_to_the_start():
    assert losses(NOTHING + 2.0, NOTHING)[0] == pytest.approx(4 * PULL_WEIGHT, rel=1e-3)
    assert losses(NOTHING, NOTHING - 0.5)[0] == pytest.approx(0.25 * PULL_WEIGHT, rel=1e-3)
    assert losses(NOTHING, NOTHING)[0] == pytest.approx(0, abs=1e-6)


def test_ink_past_the_ends_costs_by_its_thickness():
    strokes = two_lines(past=2)
    past = strokes.overshoot > 0
    wide = np.where(past, np.log(2.0 + HAIR) - np.log(HAIR), 0.0)
    flat = losses(np.zeros(len(past)), wide, strokes, roughness=0.0)[0]
    pull = PULL_WEIGHT * np.mean(wide**2)
    assert flat - pull == pytest.approx(OVERSHOOT_WEIGHT * 2.0 * past.mean(), rel=1e-3)
    thin = losses(np.zeros(len(past)), np.where(past, -1.0, 0.0), strokes, roughness=0.0)[0]
    assert thin == pytest.approx(PULL_WEIGHT * past.mean(), rel=1e-3)  # below 0 there is no ink


def test_the_misfit_is_least_at_the_truth_and_falls_towards_it_from_afar():
    strokes = two_lines()
    mask = mask_of(strokes.xy + [0, 6], np.full(COUNT, 4.0), strokes.offsets)
    misfit = [losses(NOTHING + d, NOTHING, mask=mask)[1] for d in (-6, -2, 2, 5, 6, 7)]
    assert misfit[4] == min(misfit) < 0.05 and misfit[:5] == sorted(misfit[:5], reverse=True)
    wide = [losses(NOTHING + 6, NOTHING + w, mask=mask)[1] for w in (-0.5, 0.0, 0.5)]
    assert wide[1] == min(wide)


def test_the_misfit_is_a_mean_over_levels_per_pixel_of_ink():
    """Strokes that are not there miss about all ink, at each level, however much ink there is."""
    strokes = two_lines()
    for thickness in (3.0, 8.0):
        mask = mask_of(strokes.xy, np.full(COUNT, thickness), strokes.offsets)
        for levels in (1, 2, 3):
            target = MaskPyramid.of(mask, strokes.xy, levels)
            missed = target.loss(strokes.xy, np.full(COUNT, -1.0), strokes.offsets)[0]
            assert missed == pytest.approx(1.0, abs=0.1)
            assert len(target.masks) == len(target.weights) == levels


@pytest.mark.parametrize(
    "size, levels", [((HEIGHT, WIDTH), 3), ((HEIGHT - 17, WIDTH - 53), 3), ((HEIGHT, WIDTH), 1)]
)
def test_the_derivatives_are_differences_of_the_loss(size, levels):
    """On even and odd canvases, whose pyramids end with whole and with half pixels."""
    strokes, rng = two_lines(past=2), np.random.default_rng(3)
    mask = rng.random((HEIGHT, WIDTH))[: size[0], : size[1]]
    frame = frame_of(strokes)
    target = MaskPyramid.of(mask, strokes.xy, levels)
    loss = TraceLoss(target, frame, start_of(frame), 0.3)
    at = [rng.normal(0, 1, len(strokes.xy)), rng.normal(0, 0.2, len(strokes.xy))]
    got = loss(*at)
    for k, slopes in enumerate((got.by_across, got.by_widening)):
        way = np.sign(slopes) * rng.random(len(slopes))
        ends = [loss(*(v + d * way if k == i else v for i, v in enumerate(at))).loss
                for d in (2e-3, -2e-3)]  # fmt: skip
        assert (ends[0] - ends[1]) / 4e-3 == pytest.approx(slopes @ way, rel=0.03)


def test_a_thin_line_weighs_as_much_as_a_thick_one():
    strokes = two_lines()
    thickness = np.where(strokes.xy[:, 1] < 60, 1.5, 12.0)
    mask = mask_of(strokes.xy, thickness, strokes.offsets)
    target = MaskPyramid.of(mask, strokes.xy, 1)
    ink = (target.masks[0] * target.weights[0]).sum(axis=1)
    rows = np.arange(len(ink)) + target.corner[1]
    thin, thick = ink[rows < 60].sum(), ink[rows > 60].sum()
    assert thin + thick == pytest.approx(float(target.masks[0].sum()), rel=1e-4)
    assert 0.35 < thin / thick < 1.2  # by area it would be an eighth


def test_the_crop_keeps_its_place():
    strokes = two_lines()
    mask = np.zeros((HEIGHT, WIDTH))
    mask[70, 60] = 1.0
    target = MaskPyramid.of(mask, strokes.xy + [60.0, 20.0], 1)
    x, y = (int(v) for v in target.corner)
    assert (x, y) == (58, 28) and target.masks[0][70 - y, 60 - x] == 1.0


def test_the_pyramid_halves_and_blurs_and_keeps_its_sum():
    image = np.zeros((64, 64), np.float32)
    image[32, 32] = 1.0
    levels = pyramid(image, 4)
    assert [level.shape[-1] for level in levels] == [64, 32, 16, 8]
    sums = [float(level.sum()) * 4**i for i, level in enumerate(levels)]
    assert sums == pytest.approx([1, 1, 1, 1], rel=1e-5)
    assert [int((level > 0).sum()) for level in levels] == [1, 9, 9, 9]
    assert [level.shape[-1] for level in pyramid(np.zeros((7, 7), np.float32), 2)] == [7, 4]


# --------------------------------------------------------------------------- records of strokes


def test_frames_of_strokes():
    strokes = planned(level(40, 30, 60), level(80, 30, 60), past=1)
    deformations = np.zeros((len(strokes.xy), 2, 2))
    deformations[:, 0] = [1.0, 2.0]
    deformations[:, 1] = [0.0, -1.0]
    frame = frame_of(strokes, deformations)
    moved = displaced(frame, np.array([2.0, 3.0])) - frame.xy
    assert moved == pytest.approx(np.tile([2.0, 1.0], (len(moved), 1)))
    assert frame.deformations_across() == pytest.approx(np.tile([2.0, -1.0], (len(moved), 1)))
    assert frame.across(moved) == pytest.approx(1.0)
    n = strokes.offsets[1]
    inner = np.ones(2 * n - 2, bool)
    inner[[n - 2, n - 1]] = False
    assert interior(strokes.offsets).tolist() == inner.tolist()
    assert float(thickness_of(np.log(5.0 + HAIR))) == pytest.approx(5.0)
    below = np.array([-9.0])
    assert thickness_of(below) < 0 and Traced(frame.xy[:1], below).thickness.tolist() == [0]


def test_a_traced_stroke_is_believed_where_both_ways_of_seeing_agree():
    strokes = planned(level(40, 30, 90), past=3)
    frame, count = frame_of(strokes), len(strokes.xy)
    offset, thickness = np.full(count, 2.0), np.full(count, 4.0)
    inner = np.flatnonzero(strokes.on_curve)
    measured = Observation(offset.copy(), thickness.copy(), np.ones(count))
    measured.confidence[inner[0]] = 0.0
    measured.offset[inner[1]] += 1.4
    measured.offset[inner[2]] += 1.6
    measured.offset[inner[3]] *= -1
    measured.thickness[inner[4]] = 3.5
    measured.thickness[inner[5]] = 3.0
    ink = np.zeros(count)
    ink[[0, 1]] = 1.0  # past the start: ink that may be another stroke's
    thickness[[0, 1]] = 0.4, 3.0
    traced = Traced(
        frame.xy + 2.0 * frame.normals,
        np.log(thickness + HAIR),
    )
    seen, agrees = traced.observed(frame, measured, ink)
    assert seen.offset == pytest.approx(2.0, abs=1e-5)
    assert seen.thickness == pytest.approx(thickness, abs=1e-5)
    told = {k: seen.confidence[inner[k]] for k in range(7)}
    assert told == {
        0: DISAGREES, 1: AGREES, 2: DISAGREES, 3: DISAGREES, 4: AGREES, 5: DISAGREES, 6: AGREES
    }  # fmt: skip
    assert seen.confidence[:3].tolist() == [PAST_END_HIDDEN, PAST_END, PAST_END]
    assert (agrees[inner] == (seen.confidence[inner] == AGREES)).all()


def test_traced_strokes_lose_ends_that_are_too_thin_to_see():
    strokes = planned(level(40, 30, 90), level(80, 30, 90), past=2)
    log_width = np.log(np.where(strokes.overshoot > 3, 0.0, 4.0) + HAIR)
    log_width[strokes.offsets[1] :] = np.log(HAIR)
    traced = Traced(
        strokes.xy,
        log_width,
    )
    drawn, rows = traced.strokes(strokes)
    assert len(drawn) == 1 and rows.tolist() == list(range(strokes.offsets[1]))
    assert drawn.thickness[1:-1] == pytest.approx(4.0, abs=1e-4)
    assert drawn.xy == pytest.approx(strokes.xy[rows])
