"""The Frechet distance of two sets of features: FID, where the features are Inception's.

Source: Heusel et al., GANs trained by a two time-scale update rule converge to a local Nash
equilibrium, NeurIPS 2017, eq. 6; Dowson & Landau, The Frechet distance between multivariate normal
distributions, J. Multivariate Analysis 12 (1982), for the closed form."""

import numpy as np


def frechet_distance(
    a: np.ndarray,
    b: np.ndarray,
    weights_a: np.ndarray | None = None,
    weights_b: np.ndarray | None = None,
) -> float:
    """Measure the Frechet distance (squared) of two Gaussians, fitted to the rows of a and b.

    a : (n, d); b : (m, d); covariances are by n - 1
    weights_a, weights_b : (n,), (m,), how often each row counts; once by default

    Raises ValueError for fewer than two rows on either side.

    The term of both covariances, tr (Ca Cb)^(1/2), is the sum of the singular values of A B' for
    Ca = A'A and Cb = B'B, that is, of an (n, m) matrix: exact too where n < d, as it is for a few
    drawings with 2048 features each, where the square root of the product is hard to come by.
    """
    mean_a, root_a = _fitted(a, weights_a)
    mean_b, root_b = _fitted(b, weights_b)
    spread = np.square(root_a).sum() + np.square(root_b).sum()
    shared = _sum_of_singular_values(root_a, root_b)
    return float(np.square(mean_a - mean_b).sum() + spread - 2 * shared)


def _fitted(rows: np.ndarray, weights: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """The mean (d,), and A (n, d) with A'A the covariance."""
    weights = np.ones(len(rows)) if weights is None else np.asarray(weights, np.float64)
    held = weights > 0
    rows, weights = np.asarray(rows[held], np.float64), weights[held]
    if weights.sum() < 2:
        raise ValueError("a spread needs at least two rows on either side")
    mean = weights @ rows / weights.sum()
    return mean, (rows - mean) * np.sqrt(weights / (weights.sum() - 1))[:, None]


def _sum_of_singular_values(a: np.ndarray, b: np.ndarray) -> float:
    """Sum those of A B', (n, m); a matrix with more rows than columns gives way to its R of QR."""
    a, b = (np.linalg.qr(x, mode="r") if len(x) > x.shape[1] else x for x in (a, b))
    return float(np.linalg.svd(a @ b.T, compute_uv=False).sum())
