r"""Gate of execution: the phase that the contact wrench indicates.

The running phase chooses the robot's motion, which is therefore no evidence. The published softmax per pair of phases
has one sample a transition and is too weak alone; every window of a phase is a sample of its wrench:

    a ~ N(m_j, C_j),    C_j = (S_j + S) / 2 + 0.05^2 I,    alpha_t(j) ~ N(a_t; m_j, C_j) sum_i alpha_{t-1}(i) T(i, j)

with a the softly normalised wrench, m_j and S_j its mean and covariance under the posteriors of EM, S the mean of all
S_j by their windows, and T the counted transitions of the most likely paths plus 1e-4. A fitted softmax would use
chance differences of few demonstrations, which the spread within a phase discounts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

DIMENSIONS = 6


class Chain(Protocol):
    """Interface of a gate: evidence for each phase, and its chain."""

    @property
    def memory(self) -> int:
        """Number of windows in its mean."""

    @property
    def share(self) -> Float:
        """(K,) share of each phase in all windows."""

    @property
    def transition(self) -> Float:
        """(K, K) T."""

    def log_evidence(self, regressors: Float) -> Float:
        """(N, K) for regressors (N, R), up to a constant that all phases share."""


@dataclass(frozen=True)
class Gate:
    """Wrenches of K phases and their chain.

    Attributes:
        mean: (K, 6) m.
        covariance: (K, 6, 6) C.
        share: (K,) mean gamma, share of each phase in all windows.
        transition: (K, K) T.
    """

    mean: Float
    covariance: Float
    share: Float
    transition: Float

    @property
    def memory(self) -> int:
        """Number of windows in its mean."""
        return 1

    @cached_property
    def whitening(self) -> tuple[Float, Float]:
        """Inverse Cholesky factors (K, 6, 6) of C, and log det (K, 1) of the factors."""
        lower = np.linalg.cholesky(self.covariance)
        return np.linalg.inv(lower), np.log(np.einsum("kii->ki", lower)).sum(-1)[:, None]

    def log_evidence(self, regressors: Float) -> Float:
        """Log density (N, K) of the soft wrenches that regressors (N, R) begin with."""
        inverse, log_det = self.whitening
        off = regressors[:, :DIMENSIONS] - self.mean[:, None]
        white = inverse @ np.swapaxes(off, -1, -2)
        result: Float = -0.5 * (white * white).sum(axis=1) - log_det
        return result.T


def fit(drive: Sequence[Float], posterior: Float, paths: Sequence[NDArray[np.intp]]) -> Gate:
    """A gate from regressors (W, R), which begin with the soft wrench, and most likely paths.

    Args:
        drive: regressors (W, R) of each demonstration.
        posterior: (W, K) of all windows.
        paths: (W,) of each.
    """
    felt = np.concatenate(drive)[:, :DIMENSIONS]
    size = np.maximum(posterior.sum(axis=0), 1e-9)
    mean = posterior.T @ felt / size[:, None]
    off = felt - mean[:, None]
    own = np.swapaxes(off * posterior.T[..., None], -1, -2) @ off / size[:, None, None]
    share = size / size.sum()
    covariance = 0.5 * (own + np.einsum("k,kij->ij", share, own)) + 0.05**2 * np.eye(DIMENSIONS)
    return Gate(mean, covariance, share, counted(paths, len(size)))


def averaged(regressors: Float, memory: int) -> Float:
    """Causal means over `memory` windows of (W, R)."""
    sums = np.concatenate([np.zeros((1, regressors.shape[1])), np.cumsum(regressors, axis=0)])
    last = np.arange(1, len(regressors) + 1)
    first = np.maximum(last - memory, 0)
    result: Float = (sums[last] - sums[first]) / (last - first)[:, None]
    return result


def counted(paths: Sequence[NDArray[np.intp]], phases: int) -> Float:
    """(K, K) relative counts of transitions, all positive."""
    counts = np.full((phases, phases), 1e-4)  # of transitions that were never shown
    for path in paths:
        np.add.at(counts, (path[:-1], path[1:]), 1.0)
    result: Float = counts / counts.sum(axis=1, keepdims=True)
    return result


def advance(gate: Chain, belief: Float, regressors: Float) -> Float:
    """The belief (N, K) one window later, for regressors (N, R)."""
    log_evidence = gate.log_evidence(regressors)
    evidence = np.exp(log_evidence - log_evidence.max(axis=1, keepdims=True))
    ahead = (belief[:, :, None] * gate.transition).sum(axis=1) * evidence + 1e-300
    result: Float = ahead / ahead.sum(axis=1, keepdims=True)
    return result
