r"""The gate of execution: which phase the contact wrench asks for, whatever the robot does.

While a policy runs, the robot's motion is chosen by the phase, so motion is no evidence of a phase: the filter of the
demonstrations would confirm whatever runs. Only what the environment says counts. The published softmax per pair of
phases sees one sample a transition and is too weak to decide alone (our finding: 32 of 48 switches within a second);
tied to its destination it sees every window:

    p(j | phi) = softmax_j(w_j . phi),     alpha_t(j) ~ p(j | phi_t) / mean gamma_j  sum_i alpha_{t-1}(i) T(i, j)

phi is the causal mean of two windows, targets are the posteriors of EM, and T counts the transitions of the most
likely paths, plus 1e-4. 25 damped diagonal-block Newton steps, ridge 0.05 (ours: a ridge of 1 makes the gate so timid
that it is a tenth of a second late).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe_segmenter.transitions import softmax

STEPS, DAMPING, RIDGE = 25, 0.7, 0.05
MEMORY = 2  # windows
UNSEEN = 1e-4


class Gate(NamedTuple):
    """The classifier and the chain it drives.

    Attributes:
        weights: (K, R) w.
        share: (K,) mean gamma, what each phase has of all windows.
        transition: (K, K) T.
    """

    weights: Float
    share: Float
    transition: Float


def averaged(regressors: Float) -> Float:
    """Causal means over `MEMORY` windows of (W, R)."""
    sums = np.concatenate([np.zeros((1, regressors.shape[1])), np.cumsum(regressors, axis=0)])
    last = np.arange(1, len(regressors) + 1)
    first = np.maximum(last - MEMORY, 0)
    result: Float = (sums[last] - sums[first]) / (last - first)[:, None]
    return result


def fit(regressors: Sequence[Float], posterior: Float, paths: Sequence[NDArray[np.intp]]) -> Gate:
    """A gate from regressors by demonstration, posteriors (W, K) and most likely paths."""
    phi = np.concatenate([averaged(r) for r in regressors])
    k = posterior.shape[1]
    weights = np.zeros((k, phi.shape[1]))
    ridge = np.diag(np.full(phi.shape[1], RIDGE))
    for _ in range(STEPS if k > 1 else 0):
        p = softmax(phi @ weights.T)
        gradient = (posterior - p).T @ phi - RIDGE * weights
        curvature = (p * (1.0 - p)).T[:, :, None] * phi
        hessian = np.swapaxes(curvature, -1, -2) @ phi + ridge
        weights = weights + DAMPING * np.linalg.solve(hessian, gradient[..., None])[..., 0]
    return Gate(weights, np.maximum(posterior.mean(axis=0), 1e-6), counted(paths, k))


def counted(paths: Sequence[NDArray[np.intp]], phases: int) -> Float:
    """(K, K) relative counts of transitions, none of them impossible."""
    counts = np.full((phases, phases), UNSEEN)
    for path in paths:
        np.add.at(counts, (path[:-1], path[1:]), 1.0)
    result: Float = counts / counts.sum(axis=1, keepdims=True)
    return result


def advance(gate: Gate, belief: Float, phi: Float) -> Float:
    """The belief (N, K) one window later, for averaged regressors (N, R)."""
    evidence = softmax(phi @ gate.weights.T) / gate.share
    ahead = (belief[:, :, None] * gate.transition).sum(axis=1) * evidence
    result: Float = ahead / ahead.sum(axis=1, keepdims=True)
    return result
