"""The cover of strokes and its derivatives, by numpy, are those of torch's coverage."""

import numpy as np
import pytest
import torch

from strokestyle.fit.cover import cover_strokes
from strokestyle.render.coverage import coverage

SIZE = 40


def scribbles(seed, bend, low, high, count=6, n=10):
    rng = np.random.default_rng(seed)
    heading = rng.uniform(0, 7, (count, 1)) + np.cumsum(rng.normal(0, bend, (count, n)), axis=1)
    lines = 5 * np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=2), axis=1)
    lines += rng.uniform(0, SIZE, (count, 1, 2)) - lines[:, :1]
    ends = rng.uniform(low, high, (count, 2, 1))
    thickness = ends[:, 0] + (ends[:, 1] - ends[:, 0]) * np.linspace(0, 1, n)
    return lines.reshape(-1, 2), thickness.ravel(), np.arange(count + 1) * n


def both(xy, thickness, offsets):
    """Image, derivatives by xy and by thickness, as torch has them, and ours."""
    weight = np.random.default_rng(9).uniform(-1, 1, (SIZE, SIZE)).astype(np.float32)
    a, b = (torch.tensor(v, dtype=torch.float32, requires_grad=True) for v in (xy, thickness))
    theirs = coverage(a, b, torch.tensor(offsets), SIZE, SIZE)
    (theirs * torch.tensor(weight)).sum().backward()
    cover = cover_strokes(xy, thickness, offsets, SIZE, SIZE)
    ours = np.zeros(SIZE * SIZE, np.float32)
    ours[cover.full], ours[cover.pixel] = 1, cover.value
    pulled = cover.pull(weight.ravel()[cover.pixel])
    image = theirs.detach().numpy()
    return (image, a.grad.numpy(), b.grad.numpy()), (ours.reshape(SIZE, SIZE), *pulled)


@pytest.mark.parametrize(
    "bend, low, high", [(0.2, 0.2, 0.8), (0.2, 0.8, 4), (0.2, 4, 14), (1.2, 1, 6), (0.3, -1, 3)]
)
def test_cover_and_derivatives_are_those_of_torch(bend, low, high):
    for theirs, ours in zip(*both(*scribbles(1, bend, low, high)), strict=True):
        assert np.abs(theirs - ours).max() < 1e-5 * max(np.abs(theirs).max(), 1.0)
        assert np.abs(theirs).max() > 0.1


def test_dots_points_that_repeat_and_strokes_outside():
    xy = np.array([[8, 8], [20, 9], [20, 9], [28, 15], [30, 30], [30, 30], [-50, 5], [-60, 5.0]])
    offsets = np.array([0, 1, 4, 6, 6, 8])
    for theirs, ours in zip(*both(xy, np.full(8, 5.0), offsets), strict=True):
        assert theirs == pytest.approx(ours, abs=2e-5)


def test_points_a_hair_apart_of_other_thickness():
    xy = np.array([[8, 8.2], [20.3, 9.5], [20.3004, 9.5], [31, 15]])
    images, slopes = zip(*(out[:2] for out in both(xy, np.array([3, 4, 6, 5.0]), np.array([0, 4]))),
                         strict=True)  # fmt: skip
    assert images[1] == pytest.approx(images[0], abs=2e-5)
    assert slopes[1] == pytest.approx(slopes[0], rel=1e-3, abs=1e-3)


def test_no_strokes_cover_nothing():
    cover = cover_strokes(np.zeros((0, 2)), np.zeros(0), np.zeros(1, int), SIZE, SIZE)
    assert len(cover.pixel) == 0
    outside = cover_strokes(np.array([[-90.0, 0.0]]), np.ones(1), np.array([0, 1]), SIZE, SIZE)
    assert outside.pull(outside.value)[0].tolist() == [[0, 0]]


def test_full_pixels_of_segments_that_widen_steeply():
    begin = np.stack([np.full(8, 6.0), 6 + 4 * np.arange(8) + np.arange(8) / 8], axis=1)
    for start in begin:
        for step in ([2.0, 0.0], [1.6, 1.2]):
            xy = np.stack([start, start + step])
            pairs = zip(*both(xy, np.array([3.0, 9.0]), np.array([0, 2])), strict=True)
            for theirs, ours in pairs:
                most = 2e-5 * max(float(np.abs(theirs).max()), 1)
                assert theirs == pytest.approx(ours, abs=most)
