"""Learning displacement, thickness and residuals from observations whose law is known."""

from dataclasses import replace

import numpy as np
import pytest
from known_law import SPACING, jitter, level, planned
from scipy import ndimage

from strokestyle.fit.learn import (
    learn_displacement,
    learn_residuals,
    measure_scaling,
)
from strokestyle.fit.observe import Observation
from strokestyle.fit.thickness import ThicknessLoss, learn_thickness
from strokestyle.fit.train import PRESETS
from strokestyle.render.config import HAIR
from strokestyle.render.style import SumOfCurves

COUNT, DEFORMATIONS = 600, 4


def observation(offset=None, thickness=None, confidence=None):
    zero = np.zeros(COUNT)
    return Observation(
        zero if offset is None else offset,
        zero + 3 if thickness is None else thickness,
        zero + 1 if confidence is None else confidence,
    )


# --------------------------------------------------------------------------------- displacement


@pytest.fixture
def basis():
    """Deformations of very different size, px."""
    return np.random.default_rng(0).normal(size=(COUNT, DEFORMATIONS)) * [1.0, 4.0, 0.5, 2.0]


WEIGHTS = np.array([0.8, -0.4, 0.0, 1.5])


def test_the_weights_of_a_displacement_are_found_with_their_sign(basis):
    assert learn_displacement(basis, observation(basis @ WEIGHTS), 1e-9) == pytest.approx(
        WEIGHTS, abs=1e-6
    )
    assert learn_displacement(basis, observation(basis @ -WEIGHTS)) == pytest.approx(
        -WEIGHTS, abs=0.03
    )
    assert learn_displacement(basis, observation()).tolist() == [0, 0, 0, 0]


def test_outliers_count_by_their_distance(basis):
    rng = np.random.default_rng(1)
    offset = basis @ WEIGHTS + rng.normal(0, 0.1, COUNT)
    wrong = rng.random(COUNT) < 0.2
    spoilt = np.where(wrong, 14.0, offset)  # all to one side: another line's ink
    basis = np.concatenate([basis, np.ones((COUNT, 1))], axis=1)  # which a shift would explain
    found = learn_displacement(basis, observation(spoilt))
    assert found == pytest.approx([*WEIGHTS, 0.0], abs=0.15)
    squares = np.linalg.lstsq(basis, spoilt, rcond=None)[0]
    assert squares[-1] > 2.0  # what plain least squares would have made of it


def test_what_is_not_believed_does_not_count(basis):
    wrong = np.arange(COUNT) % 2 == 0
    offset = np.where(wrong, 9.0, basis @ WEIGHTS)
    found = learn_displacement(basis, observation(offset, confidence=1.0 - wrong))
    assert found == pytest.approx(WEIGHTS, abs=0.03)


def test_the_ridge_holds_what_nothing_is_known_of():
    basis = np.random.default_rng(0).normal(size=(COUNT, 2))
    twice = np.stack([basis[:, 0], basis[:, 0], basis[:, 1] * 1e-3], axis=1)
    found = learn_displacement(twice, observation(basis[:, 0]))
    assert found[:2] == pytest.approx([0.5, 0.5], abs=0.01)  # shared by two of the same
    # a deformation of a thousandth of a pixel is not blown up to explain what it happens to go with
    noise = basis[:, 0] + 0.3 * basis[:, 1]
    assert abs(learn_displacement(twice, observation(noise))[2]) < 30.0  # 300 would explain it
    nothing = observation(basis[:, 0], confidence=np.zeros(COUNT))
    assert learn_displacement(twice, nothing).tolist() == [0, 0, 0]
    strong = learn_displacement(basis, observation(basis[:, 0]), ridge=2.0)
    # closed form: misfits below OUTLIER weigh 2 each, so that w G = 2 G against 2.0 G
    assert 0.3 < strong[0] < 0.7


# ------------------------------------------------------------------------------------ thickness

CONFIG = replace(PRESETS["quick"], steps=300)
FEATURES = np.random.default_rng(2).standard_normal((COUNT, 6), np.float32)


def law(features):
    """px, of the second feature alone, from about 2 to 8."""
    return np.exp(1.4 + 0.6 * np.tanh(features[:, 1])) - HAIR


def told(*_):
    pass


def thickness_of(network, features=FEATURES):
    return np.exp(network(features)) - HAIR


def sizes(network):
    """How much each feature's curve moves the log width: its standard deviation (P,)."""
    rows = np.zeros((6, COUNT, 6), np.float32)
    for k in range(6):
        rows[k, :, k] = FEATURES[:, k]
    return np.array([network(one).std() for one in rows])


def test_a_law_of_one_feature_is_learned_and_only_that_feature_used():
    thickness = law(FEATURES)
    network = learn_thickness(FEATURES, observation(thickness=thickness), CONFIG, 8, 0, told)
    fresh = np.random.default_rng(3).standard_normal((COUNT, 6), np.float32)
    got, want = thickness_of(network, fresh), law(fresh)
    assert np.corrcoef(got, want)[0, 1] > 0.99
    assert np.abs(got - want).mean() < 0.4
    used = sizes(network)
    assert used[1] > 0.3 and np.delete(used, 1).max() < 0.01 * used[1]


def test_the_group_lasso_leaves_out_what_does_not_pay():
    """Noise is explained by every feature where that costs nothing, and by none where it does."""
    rng = np.random.default_rng(4)
    noisy = law(FEATURES) * np.exp(rng.normal(0, 0.3, COUNT))
    used = {}
    for sparsity in (0.0, 0.04, 1.0):
        config = replace(CONFIG, sparsity=sparsity)
        network = learn_thickness(FEATURES, observation(thickness=noisy), config, 8, 0, told)
        used[sparsity] = sizes(network)
    others = {sparsity: np.delete(size, 1).max() for sparsity, size in used.items()}
    assert others[0.0] > 0.03 and others[0.04] < 0.5 * others[0.0]
    assert used[0.0][1] > used[0.04][1] > used[1.0][1] and others[1.0] < 0.001


def test_thickness_that_is_not_believed_does_not_count():
    wrong = np.arange(COUNT) % 2 == 0
    thickness = np.where(wrong, 40.0, law(FEATURES))
    seen = observation(thickness=thickness, confidence=1.0 - wrong)
    short = replace(CONFIG, steps=60)  # where they counted for the base only, it would show
    network = learn_thickness(FEATURES, seen, short, 8, 0, told)
    assert np.abs(thickness_of(network) - law(FEATURES)).mean() < 0.6
    before = learn_thickness(FEATURES, seen, replace(CONFIG, steps=1, rate=1e-9), 8, 0, told)
    mean = np.log(law(FEATURES)[~wrong] + HAIR).mean()
    assert float(before.base) == pytest.approx(mean, abs=1e-4)


def test_outliers_of_thickness_count_by_their_distance():
    rng = np.random.default_rng(5)
    even = np.where(rng.random(COUNT) < 0.15, 60.0, 4.0)
    network = learn_thickness(FEATURES, observation(thickness=even), CONFIG, 8, 0, told)
    assert np.median(thickness_of(network)) == pytest.approx(4.0, abs=0.5)  # the mean is 6.2


def test_where_nothing_is_known_strokes_are_of_some_thickness_and_the_seed_decides():
    blind = observation(confidence=np.zeros(COUNT))
    network = learn_thickness(FEATURES, blind, replace(CONFIG, steps=10), 8, 0, told)
    assert thickness_of(network) == pytest.approx(3.0 - HAIR, abs=0.1)
    made = [
        learn_thickness(FEATURES, observation(), replace(CONFIG, steps=10), 8, seed, told).slope
        for seed in (1, 1, 2)
    ]
    assert np.array_equal(made[0], made[1]) and not np.array_equal(made[0], made[2])


def test_the_derivatives_of_the_thickness_are_differences_of_its_loss():
    """The group lasso and the decay are not in the error that is told: they are added here."""
    random = np.random.default_rng(6)
    shapes = [(6, 3)] * 3 + [(6,), ()]
    arrays = [random.normal(size=shape) for shape in shapes]
    seen = observation(thickness=law(FEATURES), confidence=random.random(COUNT))
    measure = ThicknessLoss.of(FEATURES.astype(float), seen, 0.04)

    def whole():
        curves = SumOfCurves(*arrays)
        size = np.sqrt((curves.weight**2).sum(axis=1) + curves.line**2)
        return measure(curves)[0] + 0.04 * size.sum() + 1e-3 * (curves.weight**2).sum()

    got = measure(SumOfCurves(*arrays))[1]
    for array, slopes in zip(arrays, got, strict=True):
        for place in list(np.ndindex(array.shape))[::4]:
            before, sums = array[place], []
            for step in (1e-4, -1e-4):
                array[place] = before + step
                sums.append(whole())
            array[place] = before
            assert np.asarray(slopes)[place] == pytest.approx(
                (sums[0] - sums[1]) / 2e-4, rel=2e-3, abs=2e-5
            )


# ------------------------------------------------------------------------------------- features


def test_features_are_cut_to_their_range_centred_and_scaled():
    raw = np.random.default_rng(0).normal(5.0, 2.0, (4000, 2)) * [1.0, 0.0]
    raw[0, 0] = 1e6
    scaling = measure_scaling(raw)
    out = scaling(raw)
    assert out[:, 0].mean() == pytest.approx(0, abs=1e-9)
    assert out[:, 0].std() == pytest.approx(1, abs=1e-9) and np.abs(out[:, 0]).max() < 3
    assert not out[:, 1].any()  # what does not vary is nothing, not infinite
    assert scaling(np.array([[-1e9, 3.0]]))[0, 0] == out[:, 0].min()


# ------------------------------------------------------------------------------------ residuals


def residual_strokes():
    """Two strokes of 400 points and one of three, with jitter across and in width."""
    strokes = planned(level(20, 0, 1200), level(60, 0, 1200), level(90, 0, 9), past=0)
    rng = np.random.default_rng(6)
    count = len(strokes.xy)
    off = np.stack([jitter(count, 0.5, rng), 0.1 * jitter(count, 1.0, rng)], axis=1)
    return strokes, off, np.ones(count, bool)


def test_residuals_keep_what_is_fast_and_lose_what_is_slow():
    strokes, off, agrees = residual_strokes()
    slow = np.stack([np.sin(strokes.xy[:, 0] / 40) * 3, np.cos(strokes.xy[:, 0] / 80)], axis=1)
    found = learn_residuals(off + slow, strokes, agrees, SPACING)
    assert found.offsets.tolist() == [0, 400, 800]  # of three points nothing can be told
    for k, sigma in ((0, 7.0), (1, 14.0)):
        fast = off[:400, k] - ndimage.gaussian_filter1d(off[:400, k], sigma / SPACING)
        assert found.values[20:380, k].std() == pytest.approx(fast.std(), rel=0.05)
        assert np.corrcoef(found.values[20:380, k], fast[20:380])[0, 1] > 0.98


def test_residuals_are_bridged_where_they_are_not_sure():
    strokes, off, agrees = residual_strokes()
    off[100:110] = 50.0
    agrees[100:110] = agrees[:7] = agrees[395:400] = False
    found = learn_residuals(off, strokes, agrees, SPACING)
    assert found.offsets.tolist() == [0, 388, 788]  # from the first to the last that is sure
    assert np.abs(found.values[:388]).max() < 2.0
    agrees[:400] = np.arange(400) % 3 == 0  # a third sure: too little is known
    assert learn_residuals(off, strokes, agrees, SPACING).offsets.tolist() == [0, 400]
    assert learn_residuals(off, strokes, np.zeros(len(off), bool), SPACING) is None


def test_residuals_past_the_ends_are_left_out():
    strokes = planned(level(20, 0, 1200), past=8)
    off = np.where(strokes.overshoot[:, None] > 0, 30.0, np.zeros((len(strokes.xy), 2)))
    found = learn_residuals(off, strokes, np.ones(len(off), bool), SPACING)
    assert found.offsets.tolist() == [0, 384] and not found.values.any()
