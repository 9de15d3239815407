r"""Force model: the wrench expected at a velocity.

A Gaussian mixture over (rates of the searched coordinates, wrench), without position and hence state-invariant ([5],
whose model class is unpublished). Regression gives

    E[w | v] = sum_k h_k(v) (m_w,k + S_wv,k S_vv,k^-1 (v - m_v,k)),   h_k ~ pi_k N(v; m_v,k, S_vv,k)

BIC chooses 1 to 8 components on samples of 25 Hz; the limit is needed because samples of one motion are correlated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skillframe.frames import Float


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceModel:
    """A mixture over (v, w), v first.

    Attributes:
        weights: (K,); means: (K, k + 6); covariances: (K, k + 6, k + 6).
    """

    weights: tuple[float, ...]
    means: tuple[tuple[float, ...], ...]
    covariances: tuple[tuple[tuple[float, ...], ...], ...]

    def wrench(self, rate: Float) -> Float:
        """(n, 6) wrench of the environment expected at rates (n, k)."""
        k = rate.shape[1]
        means, covariances = np.array(self.means), np.array(self.covariances)
        share = np.log(np.array(self.weights)) + _log_density(rate, means[:, :k], covariances[:, :k, :k])
        share = np.exp(share - share.max(axis=1, keepdims=True))
        share /= share.sum(axis=1, keepdims=True)
        slope = covariances[:, k:, :k] @ np.linalg.inv(covariances[:, :k, :k])  # (K, 6, k)
        away = rate[:, None] - means[:, :k]
        expected = means[:, k:] + (slope @ away[..., None])[..., 0]
        result: Float = (share[..., None] * expected).sum(axis=1)
        return result


def fit(rate: Float, wrench: Float, seed: int = 0) -> tuple[ForceModel, list[float]]:
    """The model of rates (n, k) and wrenches (n, 6), and BIC by number of components (lower is better)."""
    data = np.concatenate([rate, wrench], axis=1)
    middle, scale = data.mean(axis=0), np.maximum(data.std(axis=0), 1e-9)
    rng = np.random.default_rng(seed)
    most = min(8, max(len(data) // 50, 1))
    fits = [_expectation_maximisation((data - middle) / scale, count, rng) for count in range(1, most + 1)]
    criterion = [_bic(log_likelihood, len(data), data.shape[1], len(w)) for w, _, _, log_likelihood in fits]
    weights, means, covariances, _ = fits[int(np.argmin(criterion))]
    means, covariances = means * scale + middle, covariances * np.outer(scale, scale)
    return ForceModel(
        weights=tuple(weights.tolist()),
        means=tuple(tuple(m) for m in means.tolist()),
        covariances=tuple(tuple(tuple(row) for row in c) for c in covariances.tolist()),
    ), criterion


def _bic(log_likelihood: float, samples: int, dimensions: int, components: int) -> float:
    parameters = components * (1 + dimensions + dimensions * (dimensions + 1) / 2) - 1
    return float(-2.0 * log_likelihood + parameters * np.log(samples))


def _log_density(values: Float, means: Float, covariances: Float) -> Float:
    factor = np.linalg.cholesky(covariances)
    away = values[:, None] - means  # (n, K, d)
    white = np.linalg.solve(factor, np.moveaxis(away, 0, -1))  # (K, d, n)
    determinant = 2.0 * np.log(np.einsum("kii->ki", factor)).sum(axis=1)
    result: Float = -0.5 * ((white**2).sum(axis=1).T + determinant + values.shape[1] * np.log(2.0 * np.pi))
    return result


def _expectation_maximisation(
    data: Float, components: int, rng: np.random.Generator
) -> tuple[Float, Float, Float, float]:
    n, d = data.shape
    means = _far_apart(data, components, rng)
    weights, covariances = np.full(components, 1.0 / components), np.tile(np.eye(d), (components, 1, 1))
    likelihood = -np.inf
    for _ in range(60):
        joint = np.log(weights) + _log_density(data, means, covariances)
        highest = joint.max(axis=1, keepdims=True)
        total = highest[:, 0] + np.log(np.exp(joint - highest).sum(axis=1))
        before, likelihood = likelihood, float(total.sum())
        if likelihood - before < 1e-4 * n:
            break
        share = np.exp(joint - total[:, None])
        mass = share.sum(axis=0) + 1e-12
        weights, means = mass / mass.sum(), (share.T @ data) / mass[:, None]
        away = data[:, None] - means
        covariances = np.einsum("nk,nki,nkj->kij", share, away, away, optimize=True) / mass[:, None, None]
        covariances = covariances + 1e-3 * np.eye(d)  # against collapse, of standardised variances
    return weights, means, covariances, likelihood


def _far_apart(data: Float, count: int, rng: np.random.Generator) -> Float:
    """(count, d) samples chosen by k-means++."""
    chosen = [data[rng.integers(len(data))]]
    while len(chosen) < count:
        distance = ((data[:, None] - np.array(chosen)) ** 2).sum(axis=2).min(axis=1)
        chosen.append(data[rng.choice(len(data), p=distance / distance.sum())])
    return np.array(chosen)
