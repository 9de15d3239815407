r"""SEDS: fit of a dynamical system of several linear ones that is globally stable.

    x' = sum_k h_k(x) A_k (x - x*),    h_k ~ pi_k N(x; mu_k, Sigma_k),    A_k + A_k^T < 0             (1)

Khansari-Zadeh and Billard (2011), Theorem 2: V = |x - x*|^2 / 2 decreases everywhere but at x*. A_k = -(L_k L_k^T + eps
I) + S_k with L_k lower triangular and S_k skew meets the constraint exactly; casadi and IPOPT minimise the mean squared
error of the velocity (SEDS-MSE). BIC on positions and velocities (`gmm`) gives the number of components. They start
from the best linear system, which stays if none is better, because the error has many local minima.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe_baselines import gmm
from skillframe_baselines.dynamics import SLOWEST, Dynamics, Flow

ITERATIONS = 150
REACH = 8.0  # largest change of a parameter, against overflow


class _Symbols(NamedTuple):
    """Free parameters of one component: log prior, mean, factor of the inverse covariance, L and S."""

    log_prior: ca.MX
    mean: ca.MX
    factor: ca.MX
    lower: ca.MX
    skew: ca.MX


def fit(states: Float, velocities: Float, most_components: int) -> Dynamics:
    """Stable dynamics of scaled states (n, d) with the goal at 0.

    Args:
        states: (n, d) in comparable units.
        velocities: (n, d) their rates [1/s].
        most_components: BIC chooses among 1 to this many.

    Raises:
        InputError: the fit does not end in finite numbers.
    """
    scale = np.maximum(velocities.std(0), 1e-2)
    joint = np.column_stack([states, velocities / scale])
    mixture = gmm.select(joint, most_components)
    found = _optimised(states, velocities, _linear(states, velocities))
    d, count = len(scale), len(mixture.priors)
    if count > 1:
        shares = (mixture.priors, mixture.means[:, :d], mixture.covariances[:, :d, :d])
        several = _optimised(states, velocities, Dynamics(*shares, np.repeat(found.matrices, count, axis=0)))
        found = min(found, several, key=lambda each: _error(each, states, velocities))
    if not _finite(found):
        raise InputError("seds", "the fit ends in numbers that are not finite", "give smoother demonstrations")
    return found


def _finite(dynamics: Dynamics) -> bool:
    return all(bool(np.all(np.isfinite(part))) for part in dynamics)


def _error(dynamics: Dynamics, states: Float, velocities: Float) -> float:
    return float(np.mean((Flow(dynamics)(states) - velocities) ** 2)) if _finite(dynamics) else np.inf


def _linear(states: Float, velocities: Float) -> Dynamics:
    spread: Float = states.T @ states / len(states) + gmm.REGULARIZATION * np.eye(states.shape[1])
    slope = np.linalg.solve(spread, states.T @ velocities / len(states)).T.astype(np.float64)
    return Dynamics(np.ones(1), np.zeros((1, len(slope))), spread[None], _stable(slope)[None])


def _stable(matrix: Float) -> Float:
    """The same skew part, and a symmetric part with no eigenvalue above -2 `SLOWEST`."""
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    symmetric = (vectors * np.minimum(values, -2.0 * SLOWEST)) @ vectors.T
    result: Float = symmetric + 0.5 * (matrix - matrix.T)
    return result


def _optimised(states: Float, velocities: Float, start: Dynamics) -> Dynamics:
    count, d = start.means.shape
    size = 1 + d + d * (d + 1) + d * (d - 1) // 2
    vector = ca.MX.sym("parameters", size * count)
    parts = [_unpacked(vector[size * k : size * (k + 1)], d) for k in range(count)]
    predicted = _velocity(parts, ca.DM(states.T))
    initial = np.concatenate([_packed(start, k) for k in range(count)])
    error = ca.sumsqr(predicted - ca.DM(velocities.T)) / velocities.size / float(np.mean(velocities**2))
    # regularisation of parameters that the data leave open
    problem = {"x": vector, "f": error + 1e-5 * ca.sumsqr(vector - ca.DM(initial))}
    options: dict[str, Any] = {
        "print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": ITERATIONS,
        "ipopt.hessian_approximation": "limited-memory", "ipopt.tol": 1e-6,
    }  # fmt: skip
    solution = ca.nlpsol("seds", "ipopt", problem, options)(x0=initial, lbx=initial - REACH, ubx=initial + REACH)
    values = ca.DM(solution["x"])
    return _dynamics([_unpacked(values[size * k : size * (k + 1)], d) for k in range(count)])


def _unpacked(vector: Any, d: int) -> _Symbols:
    triangle, strict = d * (d + 1) // 2, d * (d - 1) // 2
    ends = np.cumsum([1, d, triangle, triangle, strict]).tolist()
    log_prior, mean, factor, lower, skew = ca.vertsplit(vector, [0, *ends])
    return _Symbols(log_prior, mean, _triangle(factor, d), _triangle(lower, d), _skew(skew, d))


def _triangle(values: Any, d: int) -> Any:
    matrix = ca.MX.zeros(d, d) if isinstance(values, ca.MX) else ca.DM.zeros(d, d)
    i = 0
    for column in range(d):
        for line in range(column, d):
            matrix[line, column] = ca.exp(values[i]) if line == column else values[i]
            i += 1
    return matrix


def _skew(values: Any, d: int) -> Any:
    matrix = ca.MX.zeros(d, d) if isinstance(values, ca.MX) else ca.DM.zeros(d, d)
    i = 0
    for column in range(d):
        for line in range(column + 1, d):
            matrix[line, column], matrix[column, line] = values[i], -values[i]
            i += 1
    return matrix


def _packed(dynamics: Dynamics, k: int) -> Float:
    d = dynamics.means.shape[1]
    factor = np.linalg.cholesky(np.linalg.inv(dynamics.covariances[k]))
    matrix = dynamics.matrices[k]
    lower = np.linalg.cholesky(-0.5 * (matrix + matrix.T) - SLOWEST * np.eye(d))
    skew = 0.5 * (matrix - matrix.T)
    columns = [_column(factor, c) for c in range(d)] + [_column(lower, c) for c in range(d)]
    below = [skew[c + 1 :, c] for c in range(d)]
    return np.concatenate([[np.log(dynamics.priors[k])], dynamics.means[k], *columns, *below])


def _column(lower: Float, c: int) -> Float:
    return np.concatenate([[np.log(lower[c, c])], lower[c + 1 :, c]])


def _matrix(part: _Symbols) -> Any:
    d = part.lower.shape[0]
    return part.skew - part.lower @ part.lower.T - SLOWEST * ca.DM.eye(d)


def _velocity(parts: list[_Symbols], states: ca.DM) -> ca.MX:
    logs = []
    for part in parts:
        white = part.factor.T @ (states - part.mean)
        logs.append(part.log_prior + ca.sum1(ca.log(ca.diag(part.factor))) - 0.5 * ca.sum1(white**2))
    top = logs[0]
    for log in logs[1:]:
        top = ca.fmax(top, log)
    weights = [ca.exp(log - top) for log in logs]
    total = sum(weights[1:], weights[0])
    flows = [
        ca.repmat(w / total, states.shape[0], 1) * (_matrix(p) @ states) for w, p in zip(weights, parts, strict=True)
    ]
    return sum(flows[1:], flows[0])


def _dynamics(parts: list[_Symbols]) -> Dynamics:
    factors = [np.array(part.factor) for part in parts]
    logs = np.array([float(part.log_prior) for part in parts])
    priors = np.exp(logs - logs.max())
    return Dynamics(
        priors / priors.sum(),
        np.stack([np.array(part.mean).ravel() for part in parts]),
        np.stack([np.linalg.inv(factor @ factor.T) for factor in factors]),
        np.stack([np.array(_matrix(part)) for part in parts]),
    )
