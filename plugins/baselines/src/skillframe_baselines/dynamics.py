"""Dynamical system of several linear ones, weighted by a mixture of Gaussians over the state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float

SLOWEST = 0.2  # 1/s, eps: least rate at which every component approaches the goal


class Dynamics(NamedTuple):
    """Priors (K,), means (K, d), covariances (K, d, d) and matrices (K, d, d) of scaled states, the goal at 0."""

    priors: Float
    means: Float
    covariances: Float
    matrices: Float


class Flow:
    """Velocity of dynamics, prepared for the loop."""

    def __init__(self, dynamics: Dynamics) -> None:
        self._means, self._matrices = dynamics.means, dynamics.matrices
        self._whiten = np.linalg.inv(np.linalg.cholesky(dynamics.covariances))
        determinant = np.log(np.einsum("kii->ki", self._whiten)).sum(1)
        self._constant: Float = np.log(dynamics.priors) + determinant

    def __call__(self, states: Float) -> Float:
        """Velocities (N, d) at states (N, d) [1/s]."""
        white = np.einsum("kij,nkj->nki", self._whiten, states[:, None] - self._means)
        logs = self._constant - 0.5 * (white**2).sum(-1)
        shares = np.exp(logs - logs.max(1, keepdims=True))
        shares /= shares.sum(1, keepdims=True)
        result: Float = np.einsum("nk,kij,nj->ni", shares, self._matrices, states)
        return result
