r"""What labels say of a smooth hidden function: expectation propagation for a Gaussian process classifier.

Labels y are 1 and -1, f has covariance K at the n trials, and p(y | f) = Phi(y f). Each label is replaced by a normal
distribution of f at its trial, of precision tau_i and centre nu_i / tau_i, chosen so that mean and variance of f there
are those with the label itself in its place (Minka 2001; Rasmussen and Williams 2006, "Gaussian processes for machine
learning", section 3.6). Means and variances come out nearly exact, also where labels are sure (Kuss and Rasmussen 2005,
"Assessing approximate inference for binary Gaussian process classification", JMLR 6). All labels are replaced at once
and by a share alone, since whole steps swing (ours: a sweep is then one factorisation). The share shrinks where a sweep
moved more than the one before, and grows slowly else: a fixed one ends in a cycle where labels are much alike.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from skillframe.campaign.claims.laplace import JITTER, factor_of, hazard, solved
from skillframe.frames import Float

SHARE, LEAST, SHRUNK, GROWN = 0.6, 0.1, 0.8, 1.02
"""Of the way to go in a sweep: at first and at most, at least, and its factors (ours, from 40 sets of labels in 1 to 4
dimensions; 60 others settled, in 65 sweeps at most)."""
CLOSE, MOST_SWEEPS = 1e-5, 200
"""Sweeps end once no label would move a mean by more than this, of its deviation; some thirty."""


class Posterior(NamedTuple):
    """What labels say of f at their trials.

    Attributes:
        weights: (n,) of the trials' covariances in the mean of f elsewhere.
        root: (n,) square roots of the precisions tau.
        factor: (n, n) lower Cholesky factor of I + tau^1/2 K tau^1/2.
        settled: whether the sweeps came to their end. Where they did not, all of this is a worse guess.
    """

    weights: Float
    root: Float
    factor: Float
    settled: bool


def posterior(gram: Float, labels: Float) -> Posterior:
    """The posterior.

    Args:
        gram: (n, n) covariance K of f at the trials.
        labels: (n,) of 1 and -1.

    Raises:
        numpy.linalg.LinAlgError: K is no covariance.
    """
    count = len(labels)
    gram = gram + JITTER * gram[0, 0] * np.eye(count)
    precision, pull, settled = np.zeros(count), np.zeros(count), False
    share, before = SHARE, np.inf
    for _ in range(MOST_SWEEPS):
        root = np.sqrt(precision)
        factor = factor_of(gram, root)
        half = solve_triangular(factor, root[:, None] * gram, lower=True, check_finite=False)
        variance, mean = np.diag(gram) - np.sum(half**2, axis=0), gram @ pull - half.T @ (half @ pull)
        wanted, drawn, moved = _replaced(variance, mean, precision, pull, labels)
        if settled := moved < CLOSE:
            break
        share = max(LEAST, SHRUNK * share) if moved > before else min(SHARE, GROWN * share)
        precision, pull, before = precision + share * (wanted - precision), pull + share * (drawn - pull), moved
    return Posterior(pull - root * solved(factor, root * (gram @ pull)), root, factor, settled)


def _replaced(variance: Float, mean: Float, precision: Float, pull: Float, labels: Float) -> tuple[Float, Float, float]:
    """(n,) tau and nu with each label itself in its place, and by how many deviations that moves a mean at most."""
    without = 1.0 / variance - precision
    spread, centre = 1.0 / without, (mean / variance - pull) / without
    scale = np.sqrt(1.0 + spread)
    at = labels * centre / scale
    ratio = hazard(at)
    exact = centre + labels * spread * ratio / scale
    left = spread - spread**2 * ratio * (at + ratio) / (1.0 + spread)
    moved = float(np.max(np.abs(exact - mean) / np.sqrt(variance)))
    return np.maximum(1.0 / left - without, 0.0), exact / left - centre * without, moved
