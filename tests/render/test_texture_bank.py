"""Texture by example on drawings whose law is known."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy import ndimage

from strokestyle.drawing.raster import rasterise
from strokestyle.drawing.ribbon import ribbon
from strokestyle.drawing.strokes import Drawing, Strokes, Texture
from strokestyle.files import read_model, write_model
from strokestyle.fit.exemplar import Exemplar
from strokestyle.fit.texture import learn_texture
from strokestyle.render.quilt import synthesise
from strokestyle.render.texture_bank import END, ROWS, TextureBank, stroke_rows

SIZE = 320


def lines(count, seed, thickness=9.0, points=60):
    """Wavy strokes from left to right, one below the other, 240 px long."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, points)
    y = (np.arange(count) + 0.5) * SIZE / count
    wave = rng.uniform(2, 5, (count, 1)) * np.sin(
        rng.uniform(4, 8, (count, 1)) * t + rng.uniform(0, 6, (count, 1))
    )
    xy = np.stack([np.broadcast_to(40 + 240 * t, (count, points)), y[:, None] + wave], axis=-1)
    width = np.full((count, points), thickness)
    offsets = points * np.arange(count + 1)
    return Strokes(
        xy.reshape(-1, 2), width.ravel(), offsets, np.zeros(count), np.zeros(count, bool)
    )


def exemplar(rgba):
    """Straight RGBA (H, W, 4) -> Exemplar on white paper."""
    rgba = np.asarray(rgba, np.float32)
    ink = np.where(rgba[..., 3:] > 0, rgba[..., :3], 1.0)
    alpha = rgba[..., 3]
    return Exemplar(
        alpha[..., None] * ink + 1 - alpha[..., None], alpha, ink, (alpha > 0.2), np.ones(3)
    )


def painted(strokes, color, texture=None):
    drawing = Drawing(strokes, (SIZE, SIZE), np.broadcast_to(color, (len(strokes), 4)), texture)
    return rasterise(drawing) / 255.0


def tooth(seed):
    """Grain in [0, 1], blotches of about 3 px."""
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).random((SIZE, SIZE)), 1.2)
    return np.clip(0.5 + 6 * (noise - 0.5), 0, 1)


def grainy(strokes, seed=0, color=(0.1, 0.1, 0.1, 1.0)):
    rgba = painted(strokes, color)
    rgba[..., 3] *= tooth(seed)
    return exemplar(rgba)


def nothing(strokes):
    return np.zeros((len(strokes.xy), 1))


def along(strokes):
    """A feature: 0 at the beginning of each stroke, 1 at its end."""
    count = np.diff(strokes.offsets)
    return np.concatenate([np.linspace(0, 1, n) for n in count])[:, None]


def core(texture, strokes, i, part=0.5):
    """Straight RGBA of strip i within `part` of the thickness, and without the caps: (n, a, 4) in
    [0, 1]."""
    band = ribbon(strokes, i, texture.margin[i])
    strip = texture.rgba[texture.offsets[i] : texture.offsets[i + 1]] / 255.0
    n, a = strip.shape[:2]
    cap = int(np.ceil(n * band.half[0] / band.length)) + 8
    v = np.abs((2 * np.arange(a) + 1.0) / a - 1)
    half = 0.5 * strokes.thickness.max()
    return strip[cap : n - cap, v * (half + texture.margin[i]) < part * half]


# ----------------------------------------------------------------------------------- flat or strips


def test_clean_ink_becomes_flat_ink():
    train, new = lines(9, 0), lines(5, 1)
    bank = learn_texture(train, nothing(train), exemplar(painted(train, [0.2, 0.1, 0.4, 1.0])))
    texture, color = synthesise(bank, new, nothing(new))
    assert texture is None
    assert color == pytest.approx(np.tile([0.2, 0.1, 0.4, 1.0], (5, 1)), abs=0.02)


def test_one_pale_ink_stays_pale():
    train = lines(9, 0)
    bank = learn_texture(train, nothing(train), exemplar(painted(train, [0.8, 0.2, 0.1, 0.6])))
    texture, color = synthesise(bank, lines(3, 1), nothing(lines(3, 1)))
    assert texture is None and color == pytest.approx(
        np.tile([0.8, 0.2, 0.1, 0.6], (3, 1)), abs=0.03
    )


def test_grain_is_copied_with_its_contrast_and_size():
    train, new = lines(9, 0), lines(5, 1)
    bank = learn_texture(train, nothing(train), grainy(train))
    texture, _ = synthesise(bank, new, nothing(new))
    truth = Texture(bank.rgba, bank.offsets, texture.margin[0])
    got = np.concatenate([core(texture, new, i)[..., 3].ravel() for i in range(5)])
    want = np.concatenate([core(truth, train, i)[..., 3].ravel() for i in range(9)])
    assert got.mean() == pytest.approx(want.mean(), abs=0.05) and got.std() == pytest.approx(
        want.std(), rel=0.12
    )
    step = [
        np.abs(np.diff(core(t, s, 0)[..., 3], axis=0)).mean()
        for t, s in ((texture, new), (truth, train))
    ]
    assert step[0] == pytest.approx(step[1], rel=0.2)


# ----------------------------------------------------------------------------------------- features


def test_colour_and_opacity_follow_the_features():
    train, new = lines(9, 0), lines(6, 1)
    # tone by a feature: red and faint at 0, blue and strong at 1, along strokes of which half run
    # the other way
    feature = along(train)
    feature[train.offsets[4] :] = 1 - feature[train.offsets[4] :]
    strips = []
    for i in range(9):
        u = np.linspace(0, 1, 200)[:, None] if i < 4 else np.linspace(1, 0, 200)[:, None]
        column = np.concatenate([1 - u, 0 * u, u, 0.35 + 0.6 * u], axis=1)
        strips.append(np.repeat(column[:, None], 8, axis=1))
    texture = Texture(
        np.rint(255 * np.concatenate(strips)).astype(np.uint8), 200 * np.arange(10), 0.5
    )
    rgba = painted(train, [0, 0, 0, 1], texture)
    rgba[..., 3] *= 0.75 + 0.25 * tooth(0)
    bank = learn_texture(train, feature, exemplar(rgba))
    asked = np.repeat([0.0, 0.2, 0.4, 0.6, 0.8, 1.0], 60)[:, None]
    made, color = synthesise(bank, new, asked)
    got = np.stack([core(made, new, i).mean(axis=(0, 1)) for i in range(6)])
    assert (np.diff(got[:, 2]) > 0.05).all() and (np.diff(got[:, 3]) > 0.02).all()
    assert got[[0, -1], 0] == pytest.approx([0.9, 0.1], abs=0.15)
    assert (np.diff(color[:, 2]) > 0.05).all()


def test_a_stroke_keeps_the_colour_that_chance_gave_it():
    pens = np.array([[0.8, 0.1, 0.1, 1.0], [0.1, 0.2, 0.8, 1.0]])
    train = replace(
        lines(8, 0), thickness=np.repeat(np.linspace(5.0, 12.0, 8), 60)
    )  # a stroke for every thickness
    new = replace(
        lines(6, 1), thickness=np.tile(np.linspace(5.0, 12.0, 60), 6)
    )  # made of several of them
    rgba = rasterise(Drawing(train, (SIZE, SIZE), pens[[0, 1, 1, 0, 1, 0, 0, 1]])) / 255.0
    rgba[..., 3] *= 0.4 + 0.6 * tooth(3)
    texture, _ = synthesise(
        learn_texture(train, nothing(train), exemplar(rgba)), new, nothing(new), seed=2
    )
    for i in range(len(new)):
        part = core(texture, new, i)
        away = np.abs(part[..., :3][part[..., 3] > 0.2][:, None] - pens[None, :, :3]).max(axis=2)
        pen = int(away.mean(axis=0).argmin())
        assert np.quantile(away[:, pen], 0.95) < 0.12  # all of it, not a mixture of both


def test_tones_between_those_of_the_drawing_are_mixed():
    train, new = lines(8, 0), lines(3, 1)
    strong = np.repeat(np.arange(8) % 2, 60)[:, None] * 1.0
    rgba = painted(train, [0.2, 0.2, 0.2, 0.9])
    faint = np.zeros((SIZE, 1))
    for i in range(0, 8, 2):
        faint[i * SIZE // 8 : (i + 1) * SIZE // 8] = 1
    rgba[..., 3] *= (1 - 0.6 * faint) * (0.8 + 0.2 * tooth(0))
    bank = learn_texture(train, strong, exemplar(rgba))
    opacity = []
    for asked in (0.0, 0.5, 1.0):
        made, _ = synthesise(bank, new, np.full((180, 1), asked))
        opacity.append(np.mean([core(made, new, i)[..., 3].mean() for i in range(3)]))
    assert opacity[0] == pytest.approx(0.36, abs=0.04) and opacity[2] == pytest.approx(
        0.81, abs=0.05
    )
    assert opacity[1] == pytest.approx(0.5 * (opacity[0] + opacity[2]), abs=0.1)


def test_a_stroke_that_fades_in_does_so_at_its_beginning_whichever_way_its_points_run():
    train, new = lines(9, 0), lines(4, 1)
    u = np.linspace(0, 1, 240)[:, None]
    fade = np.concatenate([0 * u, 0 * u, 0 * u, np.clip(u / 0.15, 0.05, 1)], axis=1)
    strip = np.rint(255 * np.repeat(fade[:, None], 8, axis=1)).astype(np.uint8)
    texture = Texture(np.concatenate([strip] * 9), 240 * np.arange(10), 1.0)
    rgba = painted(train, [0, 0, 0, 1], texture)
    rgba[..., 3] *= 0.7 + 0.3 * tooth(0)
    bank = learn_texture(train, nothing(train), exemplar(rgba))
    backwards = Strokes(
        new.xy.reshape(4, -1, 2)[:, ::-1].reshape(-1, 2),
        new.thickness,
        new.offsets,
        *[new.kind] * 2,
    )
    for strokes, sign in ((new, 1), (backwards, -1)):
        made, _ = synthesise(bank, strokes, nothing(strokes))
        for i in range(4):
            alpha = core(made, strokes, i)[::sign, :, 3]
            assert alpha[:20].mean() < 0.6 * alpha[-60:].mean()
            assert alpha[-20:].mean() > 0.8 * alpha[-120:-20].mean()


def test_a_line_that_crosses_leaves_no_trace():
    train, new = lines(7, 0), lines(5, 1)
    bar = Strokes([[160, 5], [160, 315]], [12, 12], [0, 2], [0], [False])
    rgba = painted(train, [0.9, 0.2, 0.2, 0.9])
    rgba[..., 3] *= tooth(0)
    over = painted(bar, [0, 0, 0, 1])
    rgba = np.where(over[..., 3:] > 0.01, over, rgba)
    xy, thickness = np.concatenate([train.xy, bar.xy]), np.r_[train.thickness, bar.thickness]
    both = Strokes(xy, thickness, np.r_[train.offsets, len(xy)], np.zeros(8), np.zeros(8, bool))
    is_bar = np.r_[np.zeros(len(train.xy)), 1, 1][:, None]
    bank = learn_texture(both, is_bar, exemplar(rgba))
    made, _ = synthesise(bank, new, nothing(new))
    shown = made.rgba[made.rgba[..., 3] > 60].astype(float)
    assert np.median(shown[:, 0]) == pytest.approx(0.9 * 255, abs=8)
    assert (shown[:, 0] < 120).mean() < 0.002


def test_tone_is_continuous_where_runs_meet():
    train, new = lines(9, 0), lines(4, 1)
    soft = ndimage.gaussian_filter(np.random.default_rng(5).random((SIZE, SIZE)), 12)
    rgba = painted(train, [0.2, 0.3, 0.8, 1.0])
    rgba[..., 3] *= np.clip(
        0.6 + 8 * (soft - 0.5), 0.25, 1
    )  # a wash: slow, random changes of opacity
    bank = learn_texture(train, nothing(train), exemplar(rgba))
    bank = replace(bank, flat=False)
    made, _ = synthesise(bank, new, nothing(new))
    truth = Texture(bank.rgba, bank.offsets, made.margin[0])

    def steps(texture, strokes):
        rows = [core(texture, strokes, i)[..., 3].mean(axis=1) for i in range(len(strokes))]
        return np.concatenate([np.abs(row[6:] - row[:-6]) for row in rows])

    assert np.quantile(steps(made, new), 0.99) < 2.0 * np.quantile(steps(truth, train), 0.99) + 0.02


def test_a_closed_stroke_joins_up():
    train = lines(9, 0)
    t = np.linspace(0, 2 * np.pi, 120)
    ring = np.stack([160 + 80 * np.cos(t), 160 + 80 * np.sin(t)], axis=1)
    ring[-1] = ring[0]
    new = Strokes(ring, np.full(120, 9.0), [0, 120], [0], [True])
    bank = learn_texture(train, nothing(train), grainy(train))
    made, _ = synthesise(bank, new, nothing(new))
    alpha = made.rgba[..., 3].astype(float)
    middle = alpha[:, alpha.shape[1] // 3 : -alpha.shape[1] // 3]
    usual = np.abs(np.diff(middle, axis=0)).mean(axis=1)
    assert np.abs(middle[0] - middle[-1]).mean() < np.quantile(usual, 0.98) + 5


# ------------------------------------------------------------------------------------------- rows


def test_rows_tell_width_ends_and_features_along_a_stroke():
    """60 px of 8 px, and of margins of 2 px: the ribbon is 72 px long, 6 px past either end."""
    xy = np.stack([np.linspace(50, 110, 21), np.full(21, 90.0)], axis=1)
    for points, turned in ((xy, False), (xy[::-1], True)):
        stroke = Strokes(points, np.full(21, 8.0), np.array([0, 21]), np.zeros(1), np.zeros(1))
        rows = stroke_rows(stroke, points[:, :1], 2.0)
        assert rows.offsets.tolist() == [0, 72 * ROWS] and rows.turned.tolist() == [turned]
        at = (np.arange(72 * ROWS) + 0.5) / ROWS - 6  # px from the left end, where it is begun
        assert rows.ends[:, 0] == pytest.approx(np.minimum(at, END))
        assert rows.ends[:, 1] == pytest.approx(np.minimum(60 - at, END))
        assert rows.features[:, 0] == pytest.approx(50 + np.clip(at, 0, 60))
        assert rows.width == pytest.approx(np.full(72 * ROWS, 8.0))
        assert rows.thickness == pytest.approx(np.full(72 * ROWS, 8.0))


def test_strips_are_laid_as_a_hand_pulls_down_before_to_the_right():
    ends = [(100, 0), (-100, 0), (0, 100), (0, -100), (-100, 55), (-100, 65)]
    lines = [np.linspace((150, 150), np.add(150, end), 30) for end in ends]
    offsets = 30 * np.arange(7)
    strokes = Strokes(np.concatenate(lines), np.full(180, 5.0), offsets, np.zeros(6), np.zeros(6))
    rows = stroke_rows(strokes, np.zeros((180, 1)), 2.0)
    assert rows.turned.tolist() == [False, True, False, True, True, False]


def test_a_closed_stroke_has_no_ends():
    t = np.linspace(0, 2 * np.pi, 100)[:, None]
    ring = 150 + 60 * np.concatenate([np.cos(t), np.sin(t)], axis=1)
    ring[-1] = ring[0]
    stroke = Strokes(ring, np.full(100, 6.0), np.array([0, 100]), np.zeros(1), np.ones(1))
    rows = stroke_rows(stroke, np.zeros((100, 1)), 2.0)
    assert (rows.ends == END).all() and rows.closed.tolist() == [True]
    assert len(rows.width) == pytest.approx(2 * np.pi * 60 * ROWS, rel=0.01)


# --------------------------------------------------------------------------------------- robustness


def test_the_same_seed_gives_the_same_texture_and_another_seed_another():
    train, new = lines(6, 0), lines(3, 1)
    drawing = grainy(train)
    bank, again = (
        learn_texture(train, nothing(train), drawing, 3),
        learn_texture(train, nothing(train), drawing, 3),
    )
    assert all(
        np.array_equal(a, b)
        for a, b in zip(asdict(bank).values(), asdict(again).values(), strict=True)
    )
    one, two, other = (synthesise(bank, new, nothing(new), seed)[0].rgba for seed in (1, 1, 2))
    assert np.array_equal(one, two) and not np.array_equal(one, other)


def test_a_bank_survives_being_stored(tmp_path):
    train, new = lines(6, 0), lines(3, 1)
    bank = learn_texture(train, nothing(train), grainy(train))
    write_model(tmp_path / "bank", asdict(bank))
    stored = read_model(tmp_path / "bank")
    arrays = {name: value for name, value in stored.items() if name not in ("margin", "flat")}
    assert all(isinstance(value, np.ndarray) and value.dtype != object for value in arrays.values())
    assert type(stored["margin"]) is float and type(stored["flat"]) is bool
    same = synthesise(TextureBank(**stored), new, nothing(new))[0].rgba
    assert np.array_equal(same, synthesise(bank, new, nothing(new))[0].rgba)


def test_strokes_of_every_size_get_a_finite_texture():
    train = lines(6, 0)
    bank = learn_texture(train, nothing(train), grainy(train))
    odd = [
        ([[50, 50], [51, 50]], [1, 1]),
        ([[50, 60], [50, 60]], [0, 0]),
        ([[20, 80], [250, 90]], [0, 0]),
        ([[20, 120], [60, 122], [250, 130]], [2, 60, 2]),
        ([[-90, 200], [400, 210]], [5, 5]),
    ]
    xy = np.concatenate([np.array(line, float) for line, _ in odd])
    new = Strokes(
        xy,
        np.concatenate([w for _, w in odd]),
        np.cumsum([0, 2, 2, 2, 3, 2]),
        np.zeros(5),
        np.zeros(5),
    )
    made, color = synthesise(bank, new, nothing(new))
    assert len(made.offsets) == 6 and np.isfinite(color).all()
    image = rasterise(Drawing(new, (SIZE, SIZE), color, made))
    assert image[100:140, 100:200, 3].mean() > 40


def test_one_stroke_is_enough_to_learn_from():
    train = lines(1, 0)
    bank = learn_texture(train, nothing(train), grainy(train))
    made, _ = synthesise(bank, lines(3, 1), nothing(lines(3, 1)))
    assert made is not None and core(made, lines(3, 1), 0)[..., 3].std() > 0.1


def test_a_drawing_without_ink_under_its_strokes_is_clear():
    train = lines(3, 0)
    bank = learn_texture(train, nothing(train), exemplar(np.zeros((SIZE, SIZE, 4))))
    made, color = synthesise(bank, train, nothing(train))
    assert color[:, 3].max() < 0.02 and (made is None or made.rgba[..., 3].max() < 5)


def test_what_cannot_be_used_is_named():
    train = lines(3, 0)
    none = Strokes(np.zeros((0, 2)), [], [0], [], [])
    drawing = grainy(train)
    with pytest.raises(ValueError, match="no strokes"):
        learn_texture(none, np.zeros((0, 1)), drawing)
    with pytest.raises(ValueError, match=r"shape \(180, P\)"):
        learn_texture(train, np.zeros((4, 1)), drawing)
    with pytest.raises(ValueError, match="not finite"):
        learn_texture(train, np.full((180, 1), np.nan), drawing)
    bank = learn_texture(train, nothing(train), drawing)
    texture, color = synthesise(bank, none, np.zeros((0, 1)))
    assert texture is None and color.shape == (0, 4)
    with pytest.raises(ValueError, match="learned with 1 feature"):
        synthesise(bank, train, np.zeros((180, 2)))
