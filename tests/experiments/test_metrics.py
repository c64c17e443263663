"""Metrics: closed forms, two roads to one number, and values that others have published."""

import importlib.util
import os
from pathlib import Path

import fid_bias
import numpy as np
import pytest
from metrics import kid as kids
from metrics.bootstrap import interval, resampled
from metrics.frechet import frechet_distance
from metrics.inception import Inception, resized
from metrics.kid import PairedKid, kid
from metrics.lpips import SCALE, SHIFT, Lpips
from metrics.marks import marks_distance, marks_of
from metrics.patches import inked_patches
from metrics.weights import NoWeights, load_convolutions, load_heads
from scipy.linalg import sqrtm

torch = pytest.importorskip("torch")


def network(make, *names):
    """A network, where its weights were fetched."""
    try:
        return make(*names)
    except NoWeights as missing:
        pytest.skip(f"no weights: {missing}")


def test_frechet_of_known_gaussians():
    """Along axes: squared distance of means, and squared differences of deviations."""
    rng = np.random.default_rng(0)
    a = rng.standard_normal((60, 3))
    a = (a - a.mean(0)) @ np.linalg.inv(np.linalg.cholesky(np.cov(a.T)).T)  # exactly unit
    b = a * [2.0, 1.0, 0.5] + [3.0, 0.0, 0.0]
    assert frechet_distance(a, b) == pytest.approx(9 + 1 + 0 + 0.25)
    assert frechet_distance(a, a) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("rows", [4, 40])  # fewer and more than features
def test_frechet_is_that_of_a_matrix_root(rows):
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((rows, 8)), 1.5 * rng.standard_normal((rows + 1, 8)) + 0.3
    ca, cb = np.cov(a.T), np.cov(b.T)
    both = np.trace(sqrtm(ca @ cb).real)
    want = np.square(a.mean(0) - b.mean(0)).sum() + np.trace(ca) + np.trace(cb) - 2 * both
    assert frechet_distance(a, b) == pytest.approx(want, rel=1e-5)


def test_frechet_counts_rows():
    """A weight of 2 is a row that stands there twice, of 0 one that does not."""
    rng = np.random.default_rng(2)
    a, b = rng.standard_normal((2, 6, 4))
    weights = np.array([2, 0, 1, 1, 3, 1])
    want = frechet_distance(np.repeat(a, weights, 0), b)
    assert frechet_distance(a, b, weights) == pytest.approx(want)
    with pytest.raises(ValueError, match="two rows"):
        frechet_distance(a[:1], b)


def test_kid_is_the_double_sum():
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((4, 5)), rng.standard_normal((3, 5))

    def k(x, y):
        return (x @ y / 5 + 1) ** 3

    want = np.mean([k(a[i], a[j]) for i in range(4) for j in range(4) if i != j])
    want += np.mean([k(b[i], b[j]) for i in range(3) for j in range(3) if i != j])
    want -= 2 * np.mean([k(x, y) for x in a for y in b])
    assert kid(a, b) == pytest.approx(want)


def test_kid_of_one_distribution_is_zero_on_average_and_fid_is_not():
    rng = np.random.default_rng(4)
    draws = [rng.standard_normal((2, 6, 16)) for _ in range(400)]
    found = np.array([kid(a, b) for a, b in draws])
    assert abs(found.mean()) < 3 * found.std() / np.sqrt(len(found))
    assert np.mean([frechet_distance(a, b) for a, b in draws]) > 5


def test_paired_kid_forgives_pairs_that_are_alike():
    """Each b repeats its a: compared with one another they would seem closer than chance."""
    rng = np.random.default_rng(5)
    draws = [rng.standard_normal((6, 16)) for _ in range(200)]
    assert all(abs(PairedKid(a[:, None], a[:, None]).distance()) < 1e-12 for a in draws)
    assert np.mean([kid(a, a) for a in draws]) < -0.1


def test_paired_kid_compares_rows_of_different_drawings_only():
    rng = np.random.default_rng(6)
    a = [rng.standard_normal((n, 5)) for n in (2, 0, 3)]
    b = [rng.standard_normal((n, 5)) for n in (1, 4, 2)]
    weights = np.array([1, 2, 1])

    def mean(x, y):
        total = count = 0.0
        for i in range(3):
            for j in range(3):
                if i != j:
                    total += weights[i] * weights[j] * kids.kernel(x[i], y[j]).sum()
                    count += weights[i] * weights[j] * len(x[i]) * len(y[j])
        return total / count

    want = mean(a, a) + mean(b, b) - 2 * mean(a, b)
    assert PairedKid(a, b).distance(weights) == pytest.approx(want)
    assert np.isnan(PairedKid(a, b).distance([3, 0, 0]))
    with pytest.raises(ValueError, match="pairs"):
        PairedKid(a, b[:2])


def test_an_interval_is_that_of_the_mean():
    """Of a normal sample's mean: +- 1.96 standard errors; a shift keeps its width."""
    values = np.random.default_rng(7).standard_normal(400)

    def mean(weights):
        return float(np.average(values, weights=weights))

    found = interval(mean, 400, 1000, 0)
    assert found.half == pytest.approx(1.96 * values.std() / 20, rel=0.1)
    assert found.low < found.value < found.high
    raised = interval(lambda w: mean(w) + (w.max() > 1), 400, 1000, 0, shifted=True)
    assert raised.half == pytest.approx(found.half)
    assert raised.low < raised.value < raised.high
    assert (resampled(5, 9, 1) == resampled(5, 9, 1)).all()
    assert (resampled(5, 9, 1).sum(1) == 5).all()


def test_patches_hold_ink():
    """A drawing of 64 px has 7 x 7 patches of 16 px, 8 px apart; four of them see a dot."""
    image = np.ones((64, 64, 3), np.float32)
    assert inked_patches(image).shape == (0, 16, 16, 3)
    image[20:24, 20:24] = [1, 0, 0]
    found = inked_patches(image)
    assert found.shape == (4, 16, 16, 3)
    assert sorted(float((1 - p.min(2)).sum()) for p in found) == [16.0] * 4
    assert (found[0][12:, 12:, 0] == 1).all() and found[0][12:, 12:, 1].max() == 0


def test_resized_as_tensorflow_1():
    """Pixel i is at i * in / out, which is not the middle of anything; the edge is held."""
    found = resized(torch.tensor([[[[0.0, 4.0], [8.0, 12.0]]]]), 4)[0, 0]
    assert found[0].tolist() == [0, 2, 4, 4]
    assert found[:, 0].tolist() == [0, 4, 8, 8]


def test_lpips_of_an_image_with_itself():
    net = network(Lpips, "alexnet")
    a, b = np.random.default_rng(8).random((2, 40, 48, 3)).astype(np.float32)
    assert net.distance(a, a) == 0
    assert net.distance(a, b) == pytest.approx(net.distance(b, a)) and net.distance(a, b) > 0.01
    with pytest.raises(ValueError, match="one size"):
        net.distance(a, b[:20])


def test_lpips_as_published():
    """torchmetrics 0.10 documents 0.3493 for this noise (check_metrics.py has more of them)."""
    from check_metrics import lpips_of_noise

    assert network(lpips_of_noise, True) == pytest.approx(0.3493, abs=5e-5)


def test_inception_as_the_package_runs_it():
    """Values of the TorchScript module that the weights are from, for this image."""
    y, x = np.mgrid[:60, :80] / 80
    image = np.stack([x, y, (np.sin(20 * x) * np.cos(30 * y) + 1) / 2], -1)[None]
    found = network(Inception).features(image.astype(np.float32))[0]
    want = [0.5509995, 0.0649235, 0.0590157, 0.0882150, 0.1582917]
    assert found[[0, 500, 1000, 1500, 2047]] == pytest.approx(want, abs=1e-4)
    assert found.sum() == pytest.approx(509.684, abs=0.01)


def test_marks_tell_a_thick_line_from_a_thin_one():
    net = network(Lpips, "alexnet")

    def drawn(thickness):
        image = np.ones((128, 128, 3), np.float32)
        for at in (20, 60, 100):
            image[at : at + thickness, 10:118] = 0.1
        return image

    thin, again, thick = (marks_of(net, drawn(t)) for t in (1, 1, 6))
    assert thin.shape[1] == 640 and 100 < len(thin) < 47**2
    assert marks_distance(thin, again) == pytest.approx(0, abs=1e-9)
    assert marks_distance(thin, thick) > 0.3
    assert np.isnan(marks_distance(thin[:1], thick))


def test_fid_without_end():
    """A line in 1 / N is followed to its end."""
    sizes = [3, 10, 20]
    assert fid_bias.extrapolated(sizes, [99, 10, 8.5]) == pytest.approx(7)  # 7 + 30 / N; not of 3
    assert np.isnan(fid_bias.extrapolated([3], [1.0]))


@pytest.mark.skipif("STROKESTYLE_SHARED" not in os.environ, reason="STROKESTYLE_SHARED is not set")
def test_marks_and_lpips_are_those_of_the_shared_score():
    path = Path(os.environ["STROKESTYLE_SHARED"]) / "tools" / "score.py"
    spec = importlib.util.spec_from_file_location("shared_score", path)
    score = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(score)
    net, theirs = network(Lpips, "alexnet"), object.__new__(score.AlexLPIPS)
    theirs.conv, theirs.head = load_convolutions("alexnet"), load_heads("alexnet")
    theirs.shift, theirs.scale = (torch.tensor(v).view(1, 3, 1, 1) for v in (SHIFT, SCALE))
    images = np.ones((2, 768, 768, 3), np.float32)
    images[0, 100:110, 50:700], images[1, 300:700, 200:204] = [0.2, 0.1, 0.4], 0.3
    tensors = [torch.tensor(image).permute(2, 0, 1) for image in images]
    with torch.no_grad():
        want = [theirs.marks(tensor) for tensor in tensors]
        assert net.distance(*images) == pytest.approx(theirs.distance(*tensors), rel=1e-5)
    found = [marks_of(net, image) for image in images]
    assert [x.shape for x in found] == [x.shape for x in want]
    assert np.abs(found[0] - want[0]).max() < 1e-4
    assert marks_distance(*found) == pytest.approx(score.frechet(*want), rel=1e-3)
