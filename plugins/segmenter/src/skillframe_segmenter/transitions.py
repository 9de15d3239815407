r"""Transitions driven by the contact wrench: p(j | i, phi_t) = softmax_j(w_ij . phi_t), (5).

The wrench of the new window drives the transition into it (Hagos, Suomalainen, Kyrki, IROS 2018; softmax per pair:
Kroemer et al. 2015). A phase keeps itself with logit 0, and

    prior of any other: -ln(20 max(K - 1, 1) s)        a mean stay of s seconds in windows of 50 ms.

Weights are fitted after the motion, or a limit cycle in a contact would drive them, by row-wise Newton steps within
+-3, ridge 1 on the wrench's weights and 0.3 on the bias towards the prior.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe_segmenter.settings import WINDOW_S

RIDGE, BIAS_RIDGE, LARGEST_STEP = 1.0, 0.3, 3.0


def prior_weights(phases: int, regressors: int, stay_s: float) -> Float:
    """(K, K, R) prior weights: only the bias, the last regressor's."""
    weights = np.zeros((phases, phases, regressors))
    others = ~np.eye(phases, dtype=bool)
    weights[others, -1] = -np.log(max(phases - 1, 1) * stay_s / WINDOW_S)
    return weights


def probabilities(weights: Float, regressors: Float) -> Float:
    """(..., K, K) transition probabilities for regressors phi (..., R), time last in memory."""
    k, size = weights.shape[:2], weights.shape[-1]
    logits = weights.reshape(-1, size) @ regressors.reshape(-1, size).T
    p = np.moveaxis(softmax(logits.reshape(*k, -1), axis=1), -1, 0)
    return p.reshape(*regressors.shape[:-1], *k) if regressors.ndim != 2 else p


def improve(weights: Float, prior: Float, regressors: Float, joint: Float, steps: int = 3) -> Float:
    """Weights after Newton steps, row by row.

    Args:
        weights: (K, K, R) before.
        prior: (K, K, R) of the biases.
        regressors: (W, R) of the windows that are entered.
        joint: (W, K, K) expected transitions into them.
        steps: of Newton's method.
    """
    result = weights.copy()
    k, size = len(weights), regressors.shape[1]
    ridge = np.full(size, RIDGE)
    ridge[-1] = BIAS_RIDGE
    one, two = np.triu_indices(size)
    targets = np.ascontiguousarray(np.moveaxis(joint, 0, -1))
    for i in range(k):
        others = np.flatnonzero(np.arange(k) != i)
        used = targets[i].sum(axis=0) > 1e-8
        if not len(others) or not used.any():
            continue
        phi, target = np.ascontiguousarray(regressors[used].T), targets[i][:, used]
        squares = phi[one] * phi[two]
        for _ in range(steps):
            result[i, others] += _newton(result[i], prior[i], others, phi, squares, target, ridge)
    return result


def _newton(
    row: Float, prior: Float, others: NDArray[np.intp], phi: Float, squares: Float, target: Float, ridge: Float
) -> Float:  # fmt: skip
    """A step (n, R) for weights (K, R) of the others: phi (R, W), its squares (R (R + 1) / 2, W), target (K, W)."""
    mass = target.sum(axis=0)
    p = softmax(row @ phi, axis=0)[others]
    pull = mass * p
    gradient = (target[others] - pull) @ phi.T - ridge * (row[others] - prior[others])
    n, size = len(others), len(phi)
    step = np.linalg.solve(_hessian(p, pull, squares, size) + np.diag(np.tile(ridge, n)), gradient.reshape(-1))
    return np.clip(step, -LARGEST_STEP, LARGEST_STEP).reshape(n, size)


def _hessian(p: Float, pull: Float, squares: Float, size: int) -> Float:
    """(n R, n R) sum pull_a (1[a = b] - p_b) phi phi^T over windows, each half once."""
    n = len(p)
    a, b = np.triu_indices(n)
    blocks = (pull[a] * ((a == b)[:, None] - p[b])) @ squares.T
    whole = np.empty((len(blocks), size, size))
    i, j = np.triu_indices(size)
    whole[:, i, j] = whole[:, j, i] = blocks
    result = np.empty((n, size, n, size))
    result[a, :, b, :] = result[b, :, a, :] = whole
    return result.reshape(n * size, n * size)


def softmax(logits: Float, axis: int = -1) -> Float:
    """Probabilities of logits, which sum to one along an axis."""
    e: Float = np.exp(logits - logits.max(axis=axis, keepdims=True))
    e /= e.sum(axis=axis, keepdims=True)
    return e
