"""Values at vertices are smoothed alike step by step and by a series."""

from __future__ import annotations

import numpy as np
import pytest

from strokestyle.mesh import smoothing as module
from strokestyle.mesh.smoothing import smoothing


@pytest.fixture
def ring() -> tuple[np.ndarray, int]:
    """The edges of a closed ring of 60 vertices in any order, and one vertex apart."""
    order = np.random.default_rng(0).permutation(60)
    return np.sort(np.stack([order, np.roll(order, 1)], axis=1), axis=1), 61


@pytest.mark.parametrize("smooth", [1.42, 2.0, 3.0, 9.3])
@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_many_vertices_are_smoothed_as_few(ring, smooth, precision, monkeypatch):
    values = np.random.default_rng(1).normal(size=(61, 3)).astype(precision)
    few = smoothing(*ring, smooth)(values)
    monkeypatch.setattr(module, "MIN_SORTED", 0)
    many = smoothing(*ring, smooth)(values)
    assert many.dtype == few.dtype == precision
    np.testing.assert_allclose(many, few, rtol=0.0, atol=5e-6)


def test_waves_round_a_ring_shrink_as_averaging_says(monkeypatch):
    monkeypatch.setattr(module, "MIN_SORTED", 0)
    ends = np.stack([np.arange(60), (np.arange(60) + 1) % 60], axis=1)
    for waves in (0, 1, 5, 15, 30):
        angle = 2.0 * np.pi * waves / 60
        wave = np.cos(angle * np.arange(60))[:, None]
        shrunk = (0.5 + 0.5 * np.cos(angle)) ** 36 * wave
        np.testing.assert_allclose(smoothing(ends, 60, 3.0)(wave), shrunk, rtol=0.0, atol=1e-6)
