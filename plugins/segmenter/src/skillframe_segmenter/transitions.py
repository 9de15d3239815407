r"""What makes a phase give way to the next: the contact wrench, p(j | i, phi_t) = softmax_j(w_ij . phi_t).

The wrench of the new window drives the transition into it (interaction-driven transitions: Hagos, Suomalainen, Kyrki,
IROS 2018; the softmax per pair is the form of Kroemer et al. 2015). A phase keeps itself with logit 0, and

    prior of any other: -ln(20 max(K - 1, 1) s)        a mean stay of s seconds in windows of 50 ms.

Weights are fitted late, after the motion alone has converged: a limit cycle in a contact teaches transitions to switch
with it. Row-wise Newton steps on the expected log-likelihood, ridge 1 on the wrench's weights and 0.3 on the bias
towards the prior, each step within +-3 (all ours).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe_segmenter.settings import WINDOW_S

RIDGE, BIAS_RIDGE, LARGEST_STEP = 1.0, 0.3, 3.0


def prior_weights(phases: int, regressors: int, stay_s: float) -> Float:
    """(K, K, R) weights before anything is learned: the bias, which is the last regressor's, only."""
    weights = np.zeros((phases, phases, regressors))
    others = ~np.eye(phases, dtype=bool)
    weights[others, -1] = -np.log(max(phases - 1, 1) * stay_s / WINDOW_S)
    return weights


def probabilities(weights: Float, regressors: Float) -> Float:
    """(..., K, K) transition probabilities for regressors phi (..., R)."""
    k = len(weights)
    logits = (regressors @ weights.reshape(k * k, -1).T).reshape(*regressors.shape[:-1], k, k)
    return softmax(logits)


def improve(weights: Float, prior: Float, regressors: Float, joint: Float, steps: int = 3) -> Float:
    """Weights after Newton steps, row by row.

    Args:
        weights: (K, K, R) as they are.
        prior: (K, K, R) where the ridge pulls the biases.
        regressors: (W, R) of the windows that are entered.
        joint: (W, K, K) expected transitions into them.
        steps: of Newton's method.
    """
    result = weights.copy()
    k, size = len(weights), regressors.shape[1]
    ridge = np.full(size, RIDGE)
    ridge[-1] = BIAS_RIDGE
    for i in range(k):
        others = np.flatnonzero(np.arange(k) != i)
        used = joint[:, i].sum(axis=-1) > 1e-8
        phi, target = regressors[used], joint[used, i]
        for _ in range(steps if len(others) and len(phi) else 0):
            result[i, others] += _newton(result[i], prior[i], others, phi, target, ridge)
    return result


def _newton(row: Float, prior: Float, others: NDArray[np.intp], phi: Float, target: Float, ridge: Float) -> Float:
    mass = target.sum(axis=-1)
    p = softmax(phi @ row.T)[:, others]
    gradient = (target[:, others] - mass[:, None] * p).T @ phi - ridge * (row[others] - prior[others])
    n, size = len(others), phi.shape[1]
    hessian = np.empty((n, size, n, size))
    for a in range(n):
        for b in range(a, n):
            curvature = mass * p[:, a] * ((a == b) - p[:, b])
            hessian[a, :, b, :] = hessian[b, :, a, :] = phi.T @ (curvature[:, None] * phi)
        hessian[a, :, a, :] += np.diag(ridge)
    step = np.linalg.solve(hessian.reshape(n * size, n * size), gradient.reshape(-1))
    return np.clip(step, -LARGEST_STEP, LARGEST_STEP).reshape(n, size)


def softmax(logits: Float) -> Float:
    """Probabilities (..., K) of logits (..., K)."""
    e = np.exp(logits - logits.max(axis=-1, keepdims=True))
    result: Float = e / e.sum(axis=-1, keepdims=True)
    return result
