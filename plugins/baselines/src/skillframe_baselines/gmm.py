r"""Gaussian mixtures: EM, the number of components by BIC, and regression by conditioning.

    p(x) = sum_k pi_k N(x; mu_k, Sigma_k),    BIC = -2 log L + n_parameters log n

Columns are scaled to unit deviation (with a floor for constant ones), covariances get 1e-4 on their diagonal, and EM
starts deterministically from equal stretches of the samples.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float

REGULARIZATION = 1e-4
ROUNDS = 100  # of EM


class Mixture(NamedTuple):
    """priors (K,), means (K, d), covariances (K, d, d)."""

    priors: Float
    means: Float
    covariances: Float


def log_densities(mixture: Mixture, samples: Float) -> Float:
    """log(pi_k N(x; mu_k, Sigma_k)) of samples (n, d), (n, K)."""
    result = np.empty((len(samples), len(mixture.priors)))
    for k, (prior, mean, covariance) in enumerate(zip(*mixture, strict=True)):
        lower = np.linalg.cholesky(covariance)
        white = np.linalg.solve(lower, (samples - mean).T)
        constant = np.log(prior) - np.log(np.diag(lower)).sum() - 0.5 * len(mean) * np.log(2.0 * np.pi)
        result[:, k] = constant - 0.5 * (white**2).sum(0)
    return result


def log_sum(values: Float) -> Float:
    """Log of the sum of exponentials over the last axis, kept, without overflow."""
    top = values.max(-1, keepdims=True)
    result: Float = top + np.log(np.exp(values - top).sum(-1, keepdims=True))
    return result


def fit(samples: Float, components: int) -> tuple[Mixture, float]:
    """A mixture of scaled samples (n, d) and its log-likelihood."""
    n, d = samples.shape
    shares = np.zeros((n, components))
    shares[np.arange(n), np.arange(n) * components // n] = 1.0
    before, mixture = -np.inf, None
    for _ in range(ROUNDS):
        weight = shares.sum(0) + 1e-9
        means = (shares.T @ samples) / weight[:, None]
        apart = samples[None] - means[:, None]
        spread = np.einsum("nk,kni,knj->kij", shares, apart, apart, optimize=True) / weight[:, None, None]
        mixture = Mixture(weight / weight.sum(), means, spread + REGULARIZATION * np.eye(d))
        logs = log_densities(mixture, samples)
        total = log_sum(logs)
        shares = np.exp(logs - total)
        now = float(total.mean())
        if now - before < 1e-5:  # which stops when the mean log-likelihood grows by less
            break
        before = now
    assert mixture is not None
    return mixture, float(total.sum())


def select(samples: Float, most: int, least: int = 1) -> Mixture:
    """The mixture of scaled samples (n, d) with the least BIC among `least` to `most` components."""
    n, d = samples.shape
    best, lowest = None, np.inf
    for components in range(least, most + 1):
        if components > least and n < 5 * components:
            break
        mixture, likelihood = fit(samples, components)
        parameters = components * (1 + d + d * (d + 1) // 2) - 1
        criterion = -2.0 * likelihood + parameters * np.log(n)
        if criterion < lowest:
            best, lowest = mixture, criterion
    assert best is not None
    return best


def scaled_back(mixture: Mixture, center: Float, scale: Float) -> Mixture:
    """A mixture of (x - center) / scale as one of x."""
    covariances = mixture.covariances * scale[:, None] * scale[None, :]
    return Mixture(mixture.priors, center + scale * mixture.means, covariances)


def conditional_mean(mixture: Mixture, given: Float) -> Float:
    """E[rest | first columns] at rows (n, g) of the first g columns, (n, d - g)."""
    n, g = given.shape
    inputs = Mixture(mixture.priors, mixture.means[:, :g], mixture.covariances[:, :g, :g])
    logs = log_densities(inputs, given)
    shares = np.exp(logs - log_sum(logs))
    result = np.zeros((n, mixture.means.shape[1] - g))
    for k in range(len(mixture.priors)):
        gain = np.linalg.solve(mixture.covariances[k, :g, :g], mixture.covariances[k, :g, g:])
        result += shares[:, k : k + 1] * (mixture.means[k, g:] + (given - mixture.means[k, :g]) @ gain)
    return result
