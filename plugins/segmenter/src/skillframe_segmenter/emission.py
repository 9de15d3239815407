r"""How a phase moves: along its desired direction, as far as the contact lets it.

The contact normal is the contact direction a without the part along the motion, which is friction,

    n = a - (a.u) u / max(|u|^2, 1/4),      M = I - n n^T,      u ~ N(M d_k, Sigma_k / eta)                   (1)

for translation and rotation alike. d_k is the desired direction of phase k, close to zero for a phase at rest. It is
the papers' linear-Gaussian form: increments as state (A = I), and B acting on [vech(n n^T); 1] through one shared d_k,
6 parameters instead of 42. A free B lets friction explain a slide, and then one phase explains everything (our
finding); contact normals cannot. M depends on u, so (1) tests a direction, it does not simulate a motion.

Given responsibilities g, with N_k their sum, N the number of windows and m = 6,

    d_k = (sum g M + 0.01 N_k I)^-1 sum g M u,
    S_k = (sum g e e^T + 2 m s I) / (N_k + 2 m) + s_0 I,   Sigma_k = (N_k S_k + (N/K) S) / (N_k + N/K)           (2)

with e = u - M d_k and S the mean of all S_k: shrinking halfway to it leaves no phase so wide that it swallows what the
others do not want.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float

DIMENSIONS = 6
FLOOR = 0.02**2
PRIOR = 4.0 * FLOOR
LEAST_MOTION = 0.25  # |u|^2 below which friction is not looked for


class Phases(NamedTuple):
    """K phases: desired directions (K, 6) and covariances (K, 6, 6) of the motion about them."""

    direction: Float
    covariance: Float


class Observed(NamedTuple):
    """W windows ready for (1).

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
    u, a = motion.reshape(-1, 2, 3), contact.reshape(-1, 2, 3)
    normal = a - (np.vecdot(a, u) / np.maximum(np.vecdot(u, u), LEAST_MOTION))[..., None] * u
    free = np.eye(3) - normal[..., :, None] * normal[..., None, :]
    projected = u - np.vecdot(normal, u)[..., None] * normal
    return Observed(motion, free, projected.reshape(-1, 6))


def expected(seen: Observed, direction: Float) -> Float:
    """M d of W windows for K directions (K, 6): (K, W, 6)."""
    count = len(seen.motion)
    result = np.empty((len(direction), count, 6))
    for part in range(2):
        columns = slice(3 * part, 3 * part + 3)
        flat = seen.free[:, part].reshape(3 * count, 3) @ direction[:, columns].T
        result[:, :, columns] = flat.T.reshape(len(direction), count, 3)
    return result


def log_likelihood(seen: Observed, phases: Phases) -> Float:
    """Log density (W, K) of (1) with eta = 1."""
    residual = seen.motion - expected(seen, phases.direction)
    lower = np.linalg.cholesky(phases.covariance)
    white = residual @ np.swapaxes(np.linalg.inv(lower), -1, -2)
    log_det = np.log(np.einsum("kii->ki", lower)).sum(-1)
    result: Float = -0.5 * np.vecdot(white, white) - (log_det + 0.5 * DIMENSIONS * np.log(2.0 * np.pi))[:, None]
    return result.T


def fit(seen: Observed, weight: Float) -> Phases:
    """Phases that (2) gives for responsibilities (W, K)."""
    direction = _directions(seen, weight)
    residual = seen.motion - expected(seen, direction)
    size = weight.sum(axis=0)
    scatter = np.swapaxes(residual * weight.T[..., None], -1, -2) @ residual
    m, identity = DIMENSIONS, np.eye(DIMENSIONS)
    own = (scatter + 2.0 * m * PRIOR * identity) / (size + 2.0 * m)[:, None, None] + FLOOR * identity
    total, share = float(size.sum()), float(size.sum()) / len(size)
    pooled = np.einsum("k,kij->ij", size, own) / total
    return Phases(direction, (size[:, None, None] * own + share * pooled) / (size + share)[:, None, None])


def _directions(seen: Observed, weight: Float) -> Float:
    count, size = len(seen.motion), weight.sum(axis=0)
    moments = (weight.T @ seen.free.reshape(count, 18)).reshape(-1, 2, 3, 3)
    moments += 0.01 * np.maximum(size, 1e-9)[:, None, None, None] * np.eye(3)
    sums = (weight.T @ seen.projected).reshape(-1, 2, 3, 1)
    return np.asarray(np.linalg.solve(moments, sums), dtype=float).reshape(-1, 6)
