"""A drawing moved by a known homography is brought back; one that lies right is not moved."""

import numpy as np
import pytest

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.strokes import Drawing, Strokes
from strokestyle.fit.exemplar import load_exemplar, separate
from strokestyle.fit.registration import Homography, register
from strokestyle.geometry.curves import Curves

SIZE = 320
CENTRE, CANVAS = (SIZE / 2, SIZE / 2), (SIZE, SIZE)
MOVES = {
    "shift": Homography.similarity(1.0, 0.0, (11.3, -15.6), CANVAS),
    "turn": Homography.similarity(1.0, np.radians(-4.7), (0.0, 0.0), CANVAS),
    "scale": Homography.similarity(1.05, 0.0, (0.0, 0.0), CANVAS),
    "all": Homography.similarity(0.953, np.radians(4.6), (-14.2, 9.4), CANVAS),
}
CORNERS = np.array([[0, 0], [SIZE, 0], [SIZE, SIZE], [0, SIZE]])
TILTS = {
    "keystone": [[9, 5], [-8, 4], [4, -6], [-5, -3]],
    "framed": [[14, 16], [-4, 9], [7, -10], [-9, 3]],
    "lying": [[-20, 2], [-4, 20], [18, 4], [3, -22]],
}


def tilted(name):
    return Homography.of_points(CORNERS, CORNERS + np.array(TILTS[name]), CANVAS)


def lines(seed=5, count=14):
    """Wavy lines all over the canvas."""
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        heading = rng.uniform(0, 6.3) + np.cumsum(rng.normal(0, 0.12, 40))
        line = 3.0 * np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
        out.append(line - line.mean(axis=0) + rng.uniform(0.25, 0.75, 2) * SIZE)
    return Curves.from_list(out, [0] * count)


CURVES = lines()


def drawn(moved=None, thickness=4.0, wobble=0.0, seed=1):
    """RGBA (H, W, 4) of the lines under a hand that strays by `wobble` px, the sheet then moved."""
    rng, xy = np.random.default_rng(seed), CURVES.xy.copy()
    for a, b in zip(CURVES.offsets[:-1], CURVES.offsets[1:], strict=True):
        stray = rng.normal(0, 1, (b - a + 10, 2))
        xy[a:b] += wobble * np.stack(
            [np.convolve(s, np.ones(11) / 11**0.5, "valid") for s in stray.T], axis=1
        )
    xy = xy if moved is None else moved(xy)
    strokes = Strokes(xy, np.full(len(xy), thickness), CURVES.offsets, CURVES.kind, CURVES.closed)
    ink = np.tile([0.3, 0.1, 0.1, 1.0], (len(strokes), 1))
    return rasterise(Drawing(strokes, (SIZE, SIZE), ink)).astype(np.float32) / 255.0


def mask(*args, **options):
    return separate(drawn(*args, **options), transparent=True).mask


@pytest.mark.parametrize("name", MOVES)
@pytest.mark.parametrize("thickness, wobble, error", [(4.0, 0.0, 0.3), (6.0, 0.6, 0.8)])
def test_a_moved_drawing_is_brought_back(name, thickness, wobble, error):
    moved = MOVES[name]
    found = register(mask(moved, thickness, wobble), CURVES.xy).moved
    assert np.hypot(*(found(moved(CURVES.xy)) - CURVES.xy).T).mean() < error
    # what is simple is not made complicated
    assert abs(found.scale - 1) < 1e-9 or name in ("scale", "all")
    assert found.angle == 0 or name != "shift"
    assert found.beyond_similarity < 1e-6


@pytest.mark.parametrize("name", TILTS)
@pytest.mark.parametrize("thickness, wobble, error", [(4.0, 0.0, 0.3), (6.0, 0.6, 0.8)])
def test_a_sheet_seen_aslant_is_brought_back(name, thickness, wobble, error):
    moved = tilted(name)
    ink = mask(moved, thickness, wobble)
    found = register(ink, CURVES.xy)
    before = np.hypot(*(moved(CURVES.xy) - CURVES.xy).T).mean()
    after = np.hypot(*(found.moved(moved(CURVES.xy)) - CURVES.xy).T).mean()
    assert after < error < 0.4 * before
    assert found.off < 0.5 * found.off_before
    assert found.moved.farthest > 5 and "straightened by" in str(found)
    if not wobble:
        # curves that were not drawn, as many again as those that were, change little
        more = register(ink, np.concatenate([CURVES.xy, lines(seed=6).xy])).moved
        assert np.hypot(*(more(moved(CURVES.xy)) - CURVES.xy).T).mean() < error + 0.2


@pytest.mark.parametrize("thickness, wobble", [(1.5, 0.0), (4.0, 0.5), (10.0, 1.5)])
def test_a_drawing_that_lies_right_is_left_alone(thickness, wobble):
    assert register(mask(None, thickness, wobble), CURVES.xy).moved is None


def test_a_hand_that_draws_larger_keeps_its_habit():
    """An outline drawn 2 px too large is a habit; a sheet moved as well is only moved back."""
    angle = np.linspace(0, 2 * np.pi, 200)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    radii = {110: 112, 80: 80, 40: 40}
    points = np.concatenate([CENTRE + r * circle for r in radii])
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    for shift in ((0.0, 0.0), (6.0, -4.0)):
        from_centre = np.hypot(x - CENTRE[0] - shift[0], y - CENTRE[1] - shift[1])
        found = register(
            sum(np.clip(2.5 - abs(from_centre - r), 0, 1) for r in radii.values()), points
        ).moved
        if shift == (0.0, 0.0):
            assert found is None
        else:
            assert np.allclose(found.shift, [-6, 4], atol=0.3) and (found.scale, found.angle) == (
                1.0,
                0.0,
            )


def test_nothing_to_match_is_no_registration():
    blank, ink = np.zeros((SIZE, SIZE)), mask()
    for curves in (np.zeros((0, 2)), CURVES.xy[:1], np.repeat([[5.0, 5.0]], 40, axis=0)):
        assert register(ink, curves).moved is None
    assert register(blank, CURVES.xy).moved is None and np.isnan(register(blank, CURVES.xy).off)
    assert register(np.ones((SIZE, SIZE)), CURVES.xy).moved is None
    straight = np.stack([np.linspace(40, 280, 80), np.full(80, 160.0)], axis=1)
    found = register(
        np.roll(np.pad(np.ones((3, 240)), ((158, 159), (40, 40))), 9, axis=0), straight
    ).moved
    assert (
        abs(found.shift[1] + 9) < 0.6 and found.angle == 0
    )  # how far along a line is not to be told


def test_a_similarity_and_its_way_back():
    moved, xy = MOVES["all"], np.random.default_rng(0).uniform(0, SIZE, (20, 2))
    np.testing.assert_allclose(moved.back(moved(xy)), xy, atol=1e-9)
    assert str(moved) == "moved -14.2, +9.4 px, turned +4.6 degrees, scaled by 0.953"
    assert str(MOVES["shift"]) == "moved +11.3, -15.6 px"
    image = drawn()
    back = Homography.similarity(1 / moved.scale, -moved.angle, (0.0, 0.0), CANVAS)
    turned = Homography.similarity(moved.scale, moved.angle, (0.0, 0.0), CANVAS).warp(image)
    assert np.abs(back.warp(turned) - image)[60:-60, 60:-60].mean() < 0.02


def test_a_photographed_drawing_is_read_as_the_one_it_is(tmp_path):
    """Warm light, a shadow, grainy paper, ink of 60 % opacity, moved: all of it comes back."""
    from PIL import Image

    rng, moved = np.random.default_rng(2), MOVES["all"]
    alpha = 0.6 * drawn(moved)[..., 3:]
    light = np.linspace(1.0, 0.85, SIZE)[:, None, None]
    paper = np.array([0.95, 0.9, 0.8]) * light + rng.normal(0, 0.01, (SIZE, SIZE, 1))
    photo = (alpha * [0.2, 0.1, 0.3] + (1 - alpha)) * paper
    Image.fromarray((photo.clip(0, 1) * 255).astype(np.uint8)).save(tmp_path / "photo.png")
    found, note = load_exemplar(tmp_path / "photo.png", SIZE, SIZE, CURVES.xy)
    assert note.startswith("registered with the curves: moved ") and "\n" not in note
    right = drawn()[..., 3]
    assert np.abs(found.mask - right).mean() < 0.02
    assert np.abs(found.rgb[right == 0] - 1).mean() < 0.01
    # the strongest ink is opaque; what of the paper shines through it everywhere is its colour,
    # and white
    assert np.median(found.alpha[right > 0.99]) > 0.9
    seen = 0.6 * np.array([0.2, 0.1, 0.3]) + 0.4
    assert np.abs(np.median(found.rgb[right > 0.99], axis=0) - seen).max() < 0.04


def test_a_registered_file_is_read_as_before(tmp_path):
    from PIL import Image

    sheet = drawn(wobble=0.5)
    Image.fromarray((sheet * 255).astype(np.uint8)).save(tmp_path / "d.png")
    found, note = load_exemplar(tmp_path / "d.png", SIZE, SIZE, CURVES.xy)
    plain = separate(
        np.asarray(Image.open(tmp_path / "d.png"), np.float32) / 255.0, transparent=True
    )
    assert (
        note == ""
        and np.array_equal(found.rgb, plain.rgb)
        and np.array_equal(found.mask, plain.mask)
    )
