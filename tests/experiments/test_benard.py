"""Benard 2013: planted patches are found, guides are followed, the same seed draws the same."""

from dataclasses import replace

import numpy as np
import pytest
from baselines import benard
from baselines.benard import Field, Settings, reach_of, synthesise

SIZE = 40
QUICK = Settings(levels=2, rounds=(2, 2), searches=2)


def ring(radius, sign=1.0, size=SIZE):
    """A circle's field: distance, tangents, and normals that point from its centre times sign."""
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    far = np.hypot(x, y)
    guides = np.zeros((size, size, 5), np.float32)
    guides[..., 0], guides[..., 1] = sign * x / far, sign * y / far
    guides[..., 3] = far < radius
    return Field(
        np.abs(far - radius).astype(np.float32), np.arctan2(x, -y).astype(np.float32), guides
    )


def painted(field, thickness=4.0):
    """A line along a field: red where its normal points right, blue where left."""
    ink = np.where(field.guides[..., :1] > 0, [0.9, 0.1, 0.1], [0.1, 0.1, 0.9])
    cover = np.clip(thickness / 2 + 0.5 - field.distance, 0, 1)[..., None]
    return (1 - cover * (1 - ink)).astype(np.float32)


@pytest.fixture(scope="module")
def source():
    return ring(13.0)


def test_a_planted_patch_is_found(source):
    """A blot that stands once in the drawing is copied to where the image asks for it."""
    rng = np.random.default_rng(1)
    drawing = np.ones((SIZE, SIZE, 3), np.float32)
    drawing[5:10, 18:23] = rng.uniform(0, 1, (5, 5, 3))
    field = benard.level_of(source, 1, replace(QUICK, normal=0, depth=0, cover=0, end=0))
    band, example = benard.band_of(field, 5.0), benard.source_of(drawing, field, 5.0)
    search = benard.Search(example, band, drawing, replace(QUICK, histogram=0), rng)
    found = benard._first_matches(search, None)
    for _ in range(8):
        search.improve(found)
    pixel = band.number[7, 20]
    assert np.abs(found.place[pixel] - [20.5, 7.5]).max() < 0.5
    assert np.abs(search.copied(found)[6:9, 19:22] - drawing[6:9, 19:22]).mean() < 0.05


def test_guides_are_followed(source):
    """Where the light comes from the other side, the colours change sides."""
    drawing = painted(source)
    there = ring(9.0, sign=-1)
    made = synthesise(drawing, source, there, QUICK, 0)
    wanted = painted(there)
    assert np.abs(made - wanted).mean() < 0.25 * np.abs(1 - wanted).mean()


def test_search_comes_near_to_what_trying_all_finds(source):
    """PatchMatch against every place of the drawing, both ways along the line."""
    drawing, there = painted(source), ring(8.0)
    here, lesson = (benard.level_of(f, 1, Settings()) for f in (there, source))
    reach = reach_of(drawing, source.distance) * np.sqrt(Settings().distance)
    band, example = benard.band_of(here, reach), benard.source_of(drawing, lesson, reach)
    image = painted(there)
    search = benard.Search(
        example, band, image, replace(Settings(), histogram=0.0), np.random.default_rng(0)
    )
    best = np.full(len(band.yx), np.inf)
    for place in example.places:
        places = np.tile(place, (len(best), 1))
        for half in (0, np.pi):
            best = np.minimum(best, search.matches(places, np.full(len(best), half)).cost)
    found = benard._first_matches(search, None)
    started = found.cost.mean()
    for _ in range(10):
        search.improve(found)
    assert np.median(found.cost) < 1.25 * np.median(best) < 0.01 * started


def test_what_is_used_often_becomes_dear(source):
    drawing = painted(source)
    field = benard.level_of(source, 1, Settings())
    band, example = benard.band_of(field, 1.0), benard.source_of(drawing, field, 1.0)
    search = benard.Search(example, band, drawing, Settings(), np.random.default_rng(0))
    one_place = np.tile(example.places[0], (len(band.yx), 1))
    search.count(search.matches(one_place, np.zeros(len(one_place))))
    dear = search.usage[example.cells(example.places)]
    assert dear[0] == dear.max() > 0 and np.median(dear) == 0


def test_seeds_and_size(source):
    drawing = painted(source)
    first, again, other = (
        synthesise(drawing, source, ring(7.0, size=32), QUICK, seed) for seed in (0, 0, 1)
    )
    assert first.shape == (32, 32, 3) and first.tobytes() == again.tobytes() != other.tobytes()


def test_reach_is_where_the_ink_ends(source):
    assert reach_of(painted(source, 8.0), source.distance) == pytest.approx(4.5 + 1, abs=0.5)
    assert reach_of(np.ones((SIZE, SIZE, 3)), source.distance) == 2


def test_blank_paper_and_no_lines_stay_ground(source):
    paper = np.full((SIZE, SIZE, 3), 0.9, np.float32)
    assert np.allclose(synthesise(paper, source, source, QUICK, 0), 0.9)
    nothing = replace(source, distance=np.full_like(source.distance, 99.0))
    assert np.allclose(synthesise(painted(source), source, nothing, QUICK, 0), 1)
