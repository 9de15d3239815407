r"""How a phase feels, and the gate of execution: which phase the contact wrench asks for, whatever the robot does.

While a policy runs, the robot's motion is chosen by the phase, so motion is no evidence of a phase: the filter of the
demonstrations would confirm whatever runs. Only what the environment says counts. The published softmax per pair of
phases sees one sample a transition and is too weak to decide alone (our finding: 32 of 48 switches within a second).
Every window of a phase is a sample of how it feels:

    a ~ N(m_j, C_j),    C_j = (S_j + S) / 2 + 0.05^2 I,    alpha_t(j) ~ N(a_t; m_j, C_j) sum_i alpha_{t-1}(i) T(i, j)

with a the softly normalised wrench, m_j and S_j its mean and covariance under the posteriors of EM, S the mean of all
S_j by their windows, and T the transitions of the most likely paths, counted, plus 1e-4 (constants ours). Where the
covariances are equal this is a softmax of a. A softmax that is fitted instead needs the margin, and finds it in
whatever differs between three demonstrations, such as the side that a tool leans on; the spread within a phase says
that this differs anyway, and leaves the sign of friction, which turns with the motion within 0.1 s.
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
FLOOR = 0.05**2
UNSEEN = 1e-4


class Chain(Protocol):
    """A gate of whatever kind: evidence for each phase, and the chain it drives."""

    @property
    def memory(self) -> int:
        """Of how many windows it looks at the mean."""

    @property
    def share(self) -> Float:
        """(K,) what each phase has of all windows."""

    @property
    def transition(self) -> Float:
        """(K, K) T."""

    def log_evidence(self, regressors: Float) -> Float:
        """(N, K) for regressors (N, R), up to a constant that all phases share."""


@dataclass(frozen=True)
class Gate:
    """How K phases feel and the chain that this drives.

    Attributes:
        mean: (K, 6) m.
        covariance: (K, 6, 6) C.
        share: (K,) mean gamma, what each phase has of all windows.
        transition: (K, K) T.
    """

    mean: Float
    covariance: Float
    share: Float
    transition: Float

    @property
    def memory(self) -> int:
        """Each window is looked at as it is."""
        return 1

    @cached_property
    def whitening(self) -> tuple[Float, Float]:
        """Inverse Cholesky factors (K, 6, 6) of C and log det (K, 1) of the factors, the same in every window."""
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
    """A gate from regressors (W, R), which begin with the soft wrench, and most likely paths by demonstration.

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
    covariance = 0.5 * (own + np.einsum("k,kij->ij", share, own)) + FLOOR * np.eye(DIMENSIONS)
    return Gate(mean, covariance, share, counted(paths, len(size)))


def averaged(regressors: Float, memory: int) -> Float:
    """Causal means over `memory` windows of (W, R)."""
    sums = np.concatenate([np.zeros((1, regressors.shape[1])), np.cumsum(regressors, axis=0)])
    last = np.arange(1, len(regressors) + 1)
    first = np.maximum(last - memory, 0)
    result: Float = (sums[last] - sums[first]) / (last - first)[:, None]
    return result


def counted(paths: Sequence[NDArray[np.intp]], phases: int) -> Float:
    """(K, K) relative counts of transitions, none of them impossible."""
    counts = np.full((phases, phases), UNSEEN)
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
