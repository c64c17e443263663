"""Keys are sorted with their places, however large they are."""

from __future__ import annotations

import numpy as np
import pytest

from strokestyle.mesh import triangles
from strokestyle.mesh.triangles import Edges, in_order


@pytest.mark.parametrize("largest", [0, 1, 7, 1 << 40, (1 << 62) - 1, (1 << 63) - 1])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 1000])
def test_equal_keys_keep_their_order(largest, count):
    key = np.random.default_rng(0).integers(0, largest, count, endpoint=True)
    key[: count // 3] = largest
    found, order = in_order(key.copy())
    expected = np.argsort(key, kind="stable")
    np.testing.assert_array_equal(order, expected)
    np.testing.assert_array_equal(found, key[expected])


def test_edges_are_the_same_where_keys_do_not_fit(monkeypatch):
    faces = np.random.default_rng(1).integers(0, 40, (300, 3))
    packed = Edges.of(faces, 40)
    monkeypatch.setattr(triangles, "WORD", 0)
    apart = Edges.of(faces, 40)
    for name in ("ends", "of_side", "uses", "sides"):
        np.testing.assert_array_equal(getattr(packed, name), getattr(apart, name))
        assert getattr(packed, name).dtype == getattr(apart, name).dtype
