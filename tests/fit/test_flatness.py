"""Flat ink told from a medium, on lines whose ink is known."""

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from strokestyle.drawing.strokes import Strokes
from strokestyle.fit.exemplar import Exemplar
from strokestyle.fit.own_ink import nearest_strokes
from strokestyle.fit.texture import learn_texture

SIZE = 240


def drawn(thickness, beside=0.0, wobble=0.0):
    """Traced strokes, lying `beside` px from their lines, and the lines' opacity at 8 times."""
    along = np.linspace(15, SIZE - 15, 120)
    lines = [
        np.stack([along, y + wobble * np.sin(along / 9.0 + y)], axis=1)
        for y in np.arange(20, SIZE - 10, 24)
    ]
    width = np.interp(along, [15, 60, SIZE - 15], [0.5, 1.0, 0.7])
    count = len(lines)
    strokes = Strokes(
        np.concatenate(lines),
        np.tile(thickness * width, count),
        120 * np.arange(count + 1),
        np.zeros(count),
        np.zeros(count, bool),
    )
    near = nearest_strokes(strokes, (SIZE, SIZE))
    moved = Strokes(
        strokes.xy + [0, beside],
        strokes.thickness,
        strokes.offsets,
        np.zeros(count),
        strokes.closed,
    )
    return moved, np.clip(0.5 - near.distance, 0, 1)


def says_flat(strokes, alpha, ink=None):
    ink = np.zeros((SIZE, SIZE, 3)) if ink is None else ink
    mask = np.clip(alpha / 0.9, 0, 1)
    drawing = Exemplar(alpha[..., None] * ink + 1 - alpha[..., None], alpha, ink, mask, np.ones(3))
    return learn_texture(strokes, np.zeros((len(strokes.xy), 1)), drawing).flat


def reduced(alpha, times):
    """An image as a file of fewer pixels would hold it, enlarged again."""
    image = Image.fromarray(alpha.astype(np.float32))
    for size in (SIZE // times, SIZE):
        image = image.resize((size, size), Image.Resampling.LANCZOS)
    return np.clip(np.asarray(image), 0, 1)


@pytest.mark.parametrize("thickness", [6.0, 10.0])
@pytest.mark.parametrize("times", [1, 2, 3])
def test_flat_ink_stays_flat_at_any_resolution(thickness, times):
    strokes, alpha = drawn(thickness, wobble=1.0)
    assert says_flat(strokes, reduced(alpha, times))


def test_a_trace_beside_its_line_is_no_texture():
    strokes, alpha = drawn(8.0, beside=1.5)
    assert says_flat(strokes, alpha)


def test_blur_and_the_noise_of_a_scan_are_no_texture():
    strokes, alpha = drawn(8.0)
    noise = np.random.default_rng(0).normal(0, 0.02, alpha.shape)
    assert says_flat(strokes, np.clip(ndimage.gaussian_filter(alpha, 1.2) + noise, 0, 1))


def grain(seed=0):
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(SIZE, SIZE)), 1.0)
    return noise / noise.std()


MEDIA = {
    "grain": lambda alpha: alpha * np.clip(0.75 + 0.35 * grain(), 0, 1),
    "grain of a thin line": lambda alpha: alpha * np.clip(0.7 + 0.4 * grain(), 0, 1),
    "pale inside, dark at the edge": lambda alpha: (
        alpha * (1 - 0.4 * np.clip(ndimage.gaussian_filter(alpha, 1.5) - 0.5, 0, 0.5) / 0.5)
    ),
    "soft edge": lambda alpha: ndimage.gaussian_filter(alpha, 2.0),
    "fading along": lambda alpha: alpha * np.linspace(0.5, 1.0, SIZE),
}


@pytest.mark.parametrize("name", MEDIA)
def test_media_are_not_flat(name):
    strokes, alpha = drawn(2.5 if "thin" in name else 14.0 if "soft" in name else 8.0)
    assert not says_flat(strokes, MEDIA[name](alpha))


def test_thin_lines_that_pale_in_places_are_not_flat():
    strokes, alpha = drawn(4.0)
    come_and_go = np.clip(0.8 + 0.5 * np.sin(np.arange(SIZE) / 30.0), 0.4, 1.0)
    assert says_flat(strokes, ndimage.gaussian_filter(alpha, 0.7))
    assert not says_flat(strokes, ndimage.gaussian_filter(alpha * come_and_go, 0.7))


def test_ink_that_differs_in_tone_along_a_stroke_is_not_flat():
    strokes, alpha = drawn(8.0)
    ink = np.linspace(0.0, 0.6, SIZE)[None, :, None] * np.ones((SIZE, SIZE, 3))
    assert not says_flat(strokes, alpha, ink)
