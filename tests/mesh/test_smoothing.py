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
    np.testing.assert_allclose(many, few, rtol=0.0, atol=3e-5)


def test_waves_round_a_ring_shrink_as_averaging_says(monkeypatch):
    monkeypatch.setattr(module, "MIN_SORTED", 0)
    ends = np.stack([np.arange(60), (np.arange(60) + 1) % 60], axis=1)
    for waves in (0, 1, 5, 15, 30):
        angle = 2.0 * np.pi * waves / 60
        wave = np.cos(angle * np.arange(60))[:, None]
        shrunk = (0.5 + 0.5 * np.cos(angle)) ** 36 * wave
        np.testing.assert_allclose(smoothing(ends, 60, 3.0)(wave), shrunk, rtol=0.0, atol=3e-5)


def _fans() -> np.ndarray:
    """The edges of two fans, of 200 and of 70 vertices round a middle, that share one of those; 300
    vertices, some apart."""
    first = np.stack([np.zeros(200, int), np.arange(1, 201)], axis=1)
    second = np.stack([np.full(70, 270), np.arange(200, 270)], axis=1)
    rim = np.stack([np.arange(1, 200), np.arange(2, 201)], axis=1)
    return np.sort(np.concatenate([second, first, rim]), axis=1)


@pytest.mark.parametrize("block", [1 << 14, 7])
@pytest.mark.parametrize("columns", [1, 2, 3, 6, 9])
@pytest.mark.parametrize("least", [0, 100_000])
def test_a_step_is_a_product_with_a_matrix(block, columns, least, monkeypatch):
    monkeypatch.setattr(module, "BLOCK", block)
    monkeypatch.setattr(module, "MIN_SORTED", least)
    links = np.zeros((300, 300))
    one, two = _fans().T
    links[one, two] = links[two, one] = 1.0
    alone = np.flatnonzero(links.sum(axis=1) == 0)
    links[alone, alone] = 1.0
    step = 0.5 * np.eye(300) + 0.5 * links / links.sum(axis=1, keepdims=True)
    values = np.random.default_rng(2).normal(size=(300, columns))
    expected, given = step @ step @ step @ step @ values, values.copy()
    np.testing.assert_allclose(smoothing(_fans(), 300, 1.0)(values), expected, atol=1e-13)
    np.testing.assert_array_equal(values, given)


def test_values_that_are_alike_stay_so(ring):
    for smooth in (0.3, 1.0, 3.0):
        found = smoothing(*ring, smooth)(np.full((61, 3), 0.7))
        np.testing.assert_allclose(found, 0.7, rtol=1e-14)
