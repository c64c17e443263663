"""embree called straight against embreex's own road, and where its packets go wrong."""

import gc

import numpy as np
import pytest
import shapes

from strokestyle.extract import embree

BALL = shapes.sphere(3)
CORNERS = np.asarray(BALL.vertices, np.float32)


def needle(sides=200):
    """A long thin prism: its faces are slivers."""
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = np.stack([0.02 * np.cos(angle), 0.02 * np.sin(angle), np.full(sides, 0.5)], axis=1)
    here, after = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [[here, here + sides, after], [after, here + sides, after + sides]]
    vertices = np.concatenate([ring, ring * [1.0, 1.0, -1.0]]).astype(np.float32)
    return vertices, np.concatenate([np.stack(face, axis=1) for face in faces])


@pytest.mark.parametrize("mesh", [(CORNERS, BALL.faces), needle()], ids=["ball", "needle"])
@pytest.mark.parametrize("count", [1, 15, 16, 17, 20001])
def test_both_roads_hit_the_same(mesh, count):
    rng = np.random.default_rng(count)
    origins = rng.uniform(-1.5, 1.5, (count, 3)).astype(np.float32)
    directions = (rng.uniform(-0.3, 0.3, (count, 3)) - origins).astype(np.float32)
    fast, plain = (
        made(*mesh).first_hits(origins, directions) for made in (embree.Scene, embree.PlainScene)
    )
    np.testing.assert_array_equal(fast.face, plain.face)
    hit = plain.face >= 0
    assert hit.any() or count < 20
    for a, b in zip(fast[1:], plain[1:], strict=True):
        np.testing.assert_allclose(a[hit], b[hit], atol=1e-4)


@pytest.mark.parametrize("part", [0.0, -0.0, 1e-20, -1e-20, -1e-30])
def test_a_direction_that_hardly_leaves_a_plane(part):
    """With one such ray in a packet, embree loses faces that the others hit."""
    across = np.linspace(-0.04, 0.04, 4096)
    middle = np.flatnonzero(np.abs(across) < 1e-4)
    origins = np.stack([np.full(4096, 1.5), np.full(4096, -0.99), across], axis=1)
    directions = np.stack([np.full(4096, -1.0), np.full(4096, -4e-3), 0.02 * across], axis=1)
    origins[middle, 2] = directions[middle, 2] = part
    rays = origins.astype(np.float32), directions.astype(np.float32)
    found = embree.Scene(CORNERS, BALL.faces).first_hits(*rays)
    wanted = embree.PlainScene(CORNERS, BALL.faces).first_hits(*rays)
    assert (wanted.face >= 0).sum() > 1000
    np.testing.assert_array_equal(found.face >= 0, wanted.face >= 0)


def test_a_scene_keeps_the_arrays_that_it_shares():
    scene = embree.Scene(CORNERS.copy(), BALL.faces.copy())
    gc.collect()
    rubbish = [np.full(len(CORNERS) * 3 + 3, np.nan, np.float32) for _ in range(20)]
    ray = np.float32([[0.1, 0.2, 3.0]]), np.float32([[0.0, 0.0, -1.0]])
    assert scene.first_hits(*ray).face[0] >= 0 and len(rubbish) == 20


def test_another_embree_is_called_as_embreex_calls_it(monkeypatch):
    monkeypatch.setattr(embree, "VERSIONS", range(50000, 60000))
    embree._embree.cache_clear()
    try:
        assert isinstance(embree.scene(CORNERS, BALL.faces), embree.PlainScene)
    finally:
        embree._embree.cache_clear()
    monkeypatch.undo()
    assert isinstance(embree.scene(CORNERS, BALL.faces), embree.Scene)
