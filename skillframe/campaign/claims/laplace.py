r"""How well a covariance explains labels: Laplace's approximation of a Gaussian process classifier.

Labels y are 1 and -1, f has covariance K at the n trials, and p(y | f) = Phi(y f). The posterior of f has one mode.
Newton's method finds it, and the curvature there gives the evidence (Rasmussen and Williams 2006, "Gaussian processes
for machine learning", algorithm 3.1, with derivatives from their equation 3.16). Steps that overshoot are halved.

It costs less than `propagation`, and ranks covariances here. Its mode lies far below the mean where labels are sure, so
that nothing else is taken from it.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr

from skillframe.frames import Float

MOST_STEPS = 50
CLOSE = 1e-10
"""Of the objective; Newton's last step is then far smaller than what two rungs of a ladder differ by."""
JITTER = 1e-6
"""Of the variance, so that trials at one place do no harm."""


def evidence(gram: Float, labels: Float) -> float:
    """Logarithm of the labels' probability, approximately.

    Args:
        gram: (n, n) covariance K of f at the trials.
        labels: (n,) of 1 and -1.

    Raises:
        numpy.linalg.LinAlgError: K is no covariance.
    """
    gram = gram + JITTER * gram[0, 0] * np.eye(len(labels))
    _, best, curvature = mode(gram, labels)
    return best - float(np.log(np.diag(factor_of(gram, np.sqrt(curvature)))).sum())


def mode(gram: Float, labels: Float) -> tuple[Float, float, Float]:
    """Mode (n,) of p(y | f) p(f), its logarithm but for a constant, and minus (n,) the curvature of log p(y | f)."""
    weights, hidden = np.zeros(len(labels)), np.zeros(len(labels))
    best = _objective(weights, hidden, labels)
    for _ in range(MOST_STEPS):
        slope, curvature = _slope(hidden, labels)
        root = np.sqrt(curvature)
        factor, target = factor_of(gram, root), curvature * hidden + slope
        step = target - root * solved(factor, root * (gram @ target)) - weights
        along, share = gram @ step, 1.0
        reached = _objective(weights + step, hidden + along, labels)
        while reached < best and share > CLOSE:
            share /= 2.0
            reached = _objective(weights + share * step, hidden + share * along, labels)
        if reached - best <= CLOSE * max(1.0, abs(best)):
            break
        best, weights, hidden = reached, weights + share * step, hidden + share * along
    return hidden, best, _slope(hidden, labels)[1]


def hazard(at: Float) -> Float:
    """(n,) phi / Phi, which stays exact far below 0."""
    result: Float = np.exp(-0.5 * at**2 - log_ndtr(at)) / np.sqrt(2.0 * np.pi)
    return result


def _slope(hidden: Float, labels: Float) -> tuple[Float, Float]:
    """(n,) slope of log p(y | f), and minus its curvature."""
    at = labels * hidden
    ratio = hazard(at)
    curvature: Float = np.maximum(ratio * (ratio + at), 0.0)
    return labels * ratio, curvature


def factor_of(gram: Float, root: Float) -> Float:
    """Lower Cholesky factor (n, n) of I + R K R, R being the diagonal matrix of `root` (n,)."""
    return np.asarray(np.linalg.cholesky(np.eye(len(root)) + root[:, None] * gram * root))


def solved(factor: Float, right: Float) -> Float:
    """(n,) solution of the equations that a lower Cholesky factor (n, n) stands for."""
    half = solve_triangular(factor, right, lower=True, check_finite=False)
    result: Float = solve_triangular(factor, half, lower=True, trans=1, check_finite=False)
    return result


def _objective(weights: Float, hidden: Float, labels: Float) -> float:
    """Log p(y | f) p(f), but for a constant, f being K times the weights."""
    return float(-0.5 * weights @ hidden + log_ndtr(labels * hidden).sum())
