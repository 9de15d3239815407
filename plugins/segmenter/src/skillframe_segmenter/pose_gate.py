r"""Gate of the pose-driven baseline: a softmax of the pose, as transitions in Kroemer et al. (ICRA 2015).

    alpha_t(j) ~ p(j | x_t) / mean gamma_j  sum_i alpha_{t-1}(i) T(i, j),      p(j | x) = softmax_j(w_j . x)

with x the mean over two windows of the pose relative to the mean one, and weights by entered phase, since pairs of
phases, as published, have one sample a transition. Targets are the posteriors of EM; 25 damped diagonal-block Newton
steps, ridge 0.05.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe_segmenter.gate import averaged, counted
from skillframe_segmenter.transitions import softmax

RIDGE = 0.05
MEMORY = 2  # windows


@dataclass(frozen=True)
class PoseGate:
    """Classifier of K phases and its chain.

    Attributes:
        weights: (K, R) w.
        share: (K,) mean gamma, share of each phase in all windows.
        transition: (K, K) T.
    """

    weights: Float
    share: Float
    transition: Float

    @property
    def memory(self) -> int:
        """Number of windows in its mean."""
        return MEMORY

    def log_evidence(self, regressors: Float) -> Float:
        """Log odds (N, K) of poses (N, R), up to a constant that all phases share."""
        result: Float = np.log(np.maximum(softmax(regressors @ self.weights.T), 1e-300) / self.share)
        return result


def fit(drive: Sequence[Float], posterior: Float, paths: Sequence[NDArray[np.intp]]) -> PoseGate:
    """A gate from regressors (W, R) and most likely paths by demonstration, and posteriors (W, K)."""
    regressors = np.concatenate([averaged(phi, MEMORY) for phi in drive])
    k = posterior.shape[1]
    weights = np.zeros((k, regressors.shape[1]))
    ridge = np.diag(np.full(regressors.shape[1], RIDGE))
    for _ in range(25 if k > 1 else 0):
        p = softmax(regressors @ weights.T)
        gradient = (posterior - p).T @ regressors - RIDGE * weights
        curvature = (p * (1.0 - p)).T[:, :, None] * regressors
        hessian = np.swapaxes(curvature, -1, -2) @ regressors + ridge
        weights = weights + 0.7 * np.linalg.solve(hessian, gradient[..., None])[..., 0]
    return PoseGate(weights, np.maximum(posterior.mean(axis=0), 1e-6), counted(paths, k))
