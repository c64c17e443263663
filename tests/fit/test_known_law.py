"""A drawing made by a known law is learned, and the law comes back on another view.

The learned style draws a view that it has not seen; the law, which shares no code with the style
but the plan of the strokes, draws it too.
"""

from dataclasses import replace

import numpy as np
import pytest
from known_law import (
    Law,
    blobs,
    compare,
    deeper_is_wider,
    exemplar_of,
    jitter,
    overshoots,
    taper,
    without_residuals,
)
from scipy import ndimage

from strokestyle.fit.learn import RESIDUAL_SIGMAS, fit_quick
from strokestyle.fit.train import PRESETS, fit_style

SETTINGS = without_residuals(PRESETS["quick"], steps=150, trace_steps=60)
DRAWN, UNSEEN = blobs(1), blobs(2)


def learned(law, config=SETTINGS):
    return fit_style(DRAWN, law.exemplar(DRAWN), config, device="cpu")


@pytest.mark.parametrize(
    "law, outside",
    [
        (Law(inflate=3.0, thickness=taper), 3.0),
        (Law(inflate=-2.0, thickness=deeper_is_wider), -2.0),
        (Law(smooth=12.0), None),
        (Law(cut=6.0), None),
        (Law(), 0.0),
    ],
    ids=["inflate", "deflate", "smooth", "cut", "none"],
)
def test_displacement_and_thickness_come_back_on_another_view(law, outside):
    style = learned(law)
    drawn = style.draw(UNSEEN).strokes
    by_law = compare(drawn, law.strokes(UNSEEN))
    from_curves = compare(drawn, Law().strokes(UNSEEN))
    if outside is not None:
        assert from_curves.outside.mean() == pytest.approx(outside, abs=0.3)
    # the line is the law's, and not only on average; a cut has corners that smoothings round off
    assert by_law.apart.mean() < (0.6 if law.cut else 0.15)
    assert by_law.apart.mean() < 0.5 * from_curves.apart.mean() or law == Law()
    # full width along the line: coverage's soft edge leaves a tenth of a pixel
    assert np.abs(by_law.thickness - by_law.wanted).mean() < 0.35
    if callable(law.thickness):
        assert np.corrcoef(by_law.thickness, by_law.wanted)[0, 1] > 0.96
        assert by_law.thickness.std() == pytest.approx(by_law.wanted.std(), rel=0.25)


@pytest.mark.parametrize("angle", [35.0, 100.0])
def test_a_nib_comes_back_and_how_it_is_held(angle):
    """Whatever the heading, to 5 degrees, though no stroke of the drawing runs straight."""
    nib = np.radians(angle)

    def law(s, length, xy):
        t = np.gradient(xy, axis=0)
        return 1.5 + 7.0 * np.abs(np.sin(np.arctan2(t[:, 1], t[:, 0]) - nib))

    drawn = learned(Law(thickness=law)).draw(UNSEEN).strokes
    by_law = compare(drawn, Law(thickness=law).strokes(UNSEEN))
    assert np.corrcoef(by_law.thickness, by_law.wanted)[0, 1] > 0.97
    assert np.abs(by_law.thickness - by_law.wanted).mean() < 0.5
    step = np.diff(drawn.xy, axis=0)
    double = 2 * np.arctan2(step[:, 1], step[:, 0])
    basis = np.stack([0 * double + 1, np.cos(double), np.sin(double)], axis=1)
    _, x, y = np.linalg.lstsq(basis, drawn.thickness[1:], rcond=None)[0]
    found = np.degrees(np.arctan2(-y, -x)) / 2  # thinnest where the stroke runs along the nib
    assert abs((found - angle + 90) % 180 - 90) < 5


def test_no_law_is_no_displacement():
    style = learned(Law())
    assert np.abs(style.displacement).max() < 0.1
    # the next point past an end, 3 px on, has no thickness: half of it is left in the middle
    assert np.abs(overshoots(style.draw(UNSEEN).strokes, UNSEEN)).max() < 1.6


@pytest.mark.parametrize("past", [10.0, (8.0, 30.0)])
def test_overshoot_comes_back_on_another_view(past):
    """As long on average, and as unlike from end to end."""
    style, contours = learned(Law(past=past)), slice(0, None, 2)  # creases are short
    found = [overshoots(style.draw(UNSEEN, seed).strokes, UNSEEN)[contours] for seed in range(4)]
    wanted = np.broadcast_to(past, 2)
    assert np.mean(found) == pytest.approx(wanted.mean(), rel=0.15)
    middle_half = np.subtract(*np.percentile(found, [75, 25]))
    assert middle_half == pytest.approx(np.ptp(wanted) / 2, abs=4.0)


@pytest.mark.parametrize("rms", [0.4, 1.0])
def test_residuals_have_the_spread_of_the_hand(rms):
    """What is slow is taken out of them, on both sides of the comparison."""
    config = without_residuals(PRESETS["quick"], steps=60, trace_steps=80)
    config = replace(config, residuals=1.0)
    style = fit_quick(DRAWN, Law(jitter=rms).exemplar(DRAWN), config).style
    noise = jitter(20000, rms, np.random.default_rng(1))
    fast = noise - ndimage.gaussian_filter1d(noise, RESIDUAL_SIGMAS[0] / 3.0)
    across, log_width = style.residuals.values.T
    assert across.std() == pytest.approx(fast.std(), rel=0.12)
    assert log_width.std() < 0.05
    slow = ndimage.gaussian_filter1d(across, 8.0)
    assert slow.std() < 0.1 * across.std()
    # and the style draws with them: about the law's line, as far off as the drawing's strokes
    drawn = compare(style.draw(UNSEEN, seed=3).strokes, Law().strokes(UNSEEN))
    # where runs fade into each other, and where the law is a little off, adds to it
    assert 0.8 * fast.std() < drawn.outside.std() < fast.std() + 0.15


def test_half_the_residuals_are_half_as_large_and_none_are_none():
    exemplar, found = Law(jitter=0.8).exemplar(DRAWN), {}
    config = without_residuals(PRESETS["quick"], steps=20, trace_steps=30)
    for amount in (1.0, 0.5, 0.0):
        changed = replace(config, residuals=amount)
        found[amount] = fit_quick(DRAWN, exemplar, changed).style.residuals
    assert found[0.0] is None
    assert found[0.5].values == pytest.approx(0.5 * found[1.0].values, abs=1e-6)


def test_flat_ink_is_the_drawings():
    ink = (0.6, 0.2, 0.1, 1.0)
    style = fit_style(
        DRAWN,
        exemplar_of(Law().strokes(DRAWN), ink),
        without_residuals(SETTINGS, steps=10, trace_steps=20),
        device="cpu",
    )
    assert style.color[:3] == pytest.approx(ink[:3], abs=0.03)
    assert 0.85 < style.color[3] <= 1.0  # soft edges count as well


def unsteady(s, length, xy):
    """5 px, and a factor of about 1.2 more or less with no memory longer than a few points."""
    return 5.0 * np.exp(jitter(len(s), 0.2, np.random.default_rng(len(s) + int(100 * xy[0, 0]))))


def test_residuals_of_thickness_have_the_spread_of_the_hand_too():
    config = without_residuals(PRESETS["quick"], steps=60, trace_steps=80)
    config = replace(config, residuals=1.0)
    style = fit_quick(DRAWN, Law(thickness=unsteady).exemplar(DRAWN), config).style
    noise = jitter(20000, 0.2, np.random.default_rng(1))
    fast = noise - ndimage.gaussian_filter1d(noise, RESIDUAL_SIGMAS[1] / 3.0)
    across, log_width = style.residuals.values.T
    assert log_width.std() == pytest.approx(fast.std(), rel=0.3)
    assert across.std() < 0.12
