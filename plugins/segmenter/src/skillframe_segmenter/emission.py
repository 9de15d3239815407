r"""Motion of a phase: along its desired direction, as far as the contact allows. Equations (4) and (5).

The overview paper models phase rho as linear-Gaussian, driven by the interaction a (the wrench and a 1):

    s_t+1 ~ N(A_rho s_t + B_rho a_t, Sigma_rho)                                                                (4)
    p(rho_t+1 = j | rho_t = i, a_t) = softmax_j(w_ij . a_t)      in `transitions`                              (5)

Here the state is the motion u of a window (A = I), and B acts on n n^T through one desired direction d_k, for
translation and rotation alike:

    n = a - (a.u) u / max(|u|^2, 1/4),      M = I - n n^T,      u ~ N(M d_k, Sigma_k / eta)                   (4')

The contact normal n is the contact direction a without friction, which a free B would let explain a slide. M depends on
u, so (4') tests a direction and does not simulate. Given responsibilities g, with N_k their sum, N the number of
windows and m = 6,

    d_k = (sum g M + 0.01 N_k I)^-1 sum g M u,
    S_k = (sum g e e^T + 2 m s I) / (N_k + 2 m) + s_0 I,   Sigma_k = (N_k S_k + (N/K) S) / (N_k + N/K)          (4'')

with e = u - M d_k and S the mean of all S_k, towards which they shrink so that no wide phase takes all the rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float

DIMENSIONS = 6
FLOOR = 0.02**2
PRIOR = 4.0 * FLOOR


class Phases(NamedTuple):
    """K phases: desired directions (K, 6) and covariances (K, 6, 6) of the motion."""

    direction: Float
    covariance: Float


class Observed(NamedTuple):
    """W windows for (4'), views of arrays with time last in memory.

    Attributes:
        motion: (W, 6) u.
        free: (W, 2, 3, 3) M of translation and rotation.
        projected: (W, 6) M u.
    """

    motion: Float
    free: Float
    projected: Float


def observe(motion: Float, contact: Float) -> Observed:
    """M and M u of windows with motions u (W, 6) and contacts a (W, 6)."""
    moved = np.ascontiguousarray(motion.T)
    u, a = moved.reshape(2, 3, -1), np.ascontiguousarray(contact.T).reshape(2, 3, -1)
    # |u|^2 below which friction is ignored
    normal = a - (a * u).sum(axis=1, keepdims=True) / np.maximum((u * u).sum(axis=1, keepdims=True), 0.25) * u
    free = np.eye(3)[:, :, None] - normal[:, :, None] * normal[:, None, :]
    projected = u - (normal * u).sum(axis=1, keepdims=True) * normal
    return Observed(moved.T, np.moveaxis(free, -1, 0), projected.reshape(6, -1).T)


def _residuals(seen: Observed, direction: Float) -> Float:
    """U - M d of windows for K directions (K, 6): (K, 6, W)."""
    motion, free = seen.motion.T, np.moveaxis(seen.free, 0, -1)
    count = motion.shape[1]
    result = np.empty((len(direction), 2, 3, count))
    for part in range(2):  # M is symmetric, so sum over rows
        flat = direction[:, 3 * part : 3 * part + 3] @ free[part].reshape(3, 3 * count)
        np.subtract(motion[3 * part : 3 * part + 3], flat.reshape(-1, 3, count), out=result[:, part])
    return result.reshape(-1, DIMENSIONS, count)


def log_likelihood(seen: Observed, phases: Phases, residual: Float | None = None) -> Float:
    """Log density (W, K) of (4') with eta = 1, from residuals (K, 6, W) of `fitted` if available."""
    lower = np.linalg.cholesky(phases.covariance)
    white = np.linalg.inv(lower) @ (_residuals(seen, phases.direction) if residual is None else residual)
    log_det = np.log(np.einsum("kii->ki", lower)).sum(-1)
    white *= white
    result: Float = -0.5 * white.sum(axis=1) - (log_det + 0.5 * DIMENSIONS * np.log(2.0 * np.pi))[:, None]
    return result.T


def fit(seen: Observed, weight: Float) -> Phases:
    """Phases by (4'') for responsibilities (W, K)."""
    return fitted(seen, weight)[0]


def fitted(seen: Observed, weight: Float) -> tuple[Phases, Float]:
    """Phases by (4'') for responsibilities (W, K), and residual motions (K, 6, W)."""
    direction = _directions(seen, weight)
    residual = _residuals(seen, direction)
    size = weight.sum(axis=0)
    scatter = (residual * weight.T[:, None]) @ np.swapaxes(residual, -1, -2)
    m, identity = DIMENSIONS, np.eye(DIMENSIONS)
    own = (scatter + 2.0 * m * PRIOR * identity) / (size + 2.0 * m)[:, None, None] + FLOOR * identity
    total, share = float(size.sum()), float(size.sum()) / len(size)
    pooled = np.einsum("k,kij->ij", size, own) / total
    covariance = (size[:, None, None] * own + share * pooled) / (size + share)[:, None, None]
    return Phases(direction, covariance), residual


def _directions(seen: Observed, weight: Float) -> Float:
    count, size = len(seen.motion), weight.sum(axis=0)
    moments = (np.moveaxis(seen.free, 0, -1).reshape(18, count) @ weight).T.reshape(-1, 2, 3, 3)
    moments = moments + 0.01 * np.maximum(size, 1e-9)[:, None, None, None] * np.eye(3)
    sums = (seen.projected.T @ weight).T.reshape(-1, 2, 3, 1)
    return np.asarray(np.linalg.solve(moments, sums), dtype=float).reshape(-1, 6)
