r"""Bounded motion along a polygon of places, by a convex program.

    min  |X - X_ref|^2 + w |D3 X|^2     such that  |v_k| <= v_max,  |a_k| <= a_max,  X_0 = X_ref,0

v and a are differences of X over 20 ms, X_ref the polygon at constant speed, slower by `SLACK` to catch up after
corners. An inscribed octagon bounds the coordinates along the surface. Millimetres suit OSQP's tolerances.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.frames import Float, norm

STEP_S = 0.02
SLACK = 1.05


class Motion(NamedTuple):
    """Places (T, k) [m] and rates (T, k) [m/s] every 20 ms, rates constant until the next."""

    place: Float
    rate: Float


def walked(places: Float, speed: float, duration: float) -> Float:
    """(T, k) the polygon at constant speed, a place every 20 ms, resting at its end."""
    travelled = np.concatenate([[0.0], np.cumsum(norm(np.diff(places, axis=0)))])
    along = np.arange(round(duration / STEP_S) + 1) * STEP_S * speed
    keep = np.concatenate([[True], np.diff(travelled) > 1e-12])
    return np.stack([np.interp(along, travelled[keep], column[keep]) for column in places.T], axis=1)


def smoothed(places: Float, speed: float, acceleration: float, duration: float) -> Motion:
    """The polygon as a motion within bounds.

    Args:
        places: (n, k) corners [m] from the start; two or more coordinates along the surface come first.
        speed: limit [m/s].
        acceleration: limit [m/s^2].
        duration: [s].

    Raises:
        SkillframeError: the optimisation fails.
    """
    reference = 1e3 * walked(places, speed / SLACK, duration)
    program = _program(*reference.shape, round(1e6 * speed), round(1e6 * acceleration))
    count, k = reference.shape
    lower, upper = program.bounds(reference[0])
    answer = program.solver(
        h=program.hessian, a=program.rows, g=-2.0 * reference.ravel(order="F"), lba=lower, uba=upper,
        x0=reference.ravel(order="F"),
    )  # fmt: skip
    if not program.solver.stats()["success"]:
        raise SkillframeError(f"the search path of {count} points could not be smoothed: {program.solver.stats()}")
    place = 1e-3 * np.array(answer["x"]).reshape(k, count).T
    place[0] = 1e-3 * reference[0]
    return Motion(place, np.concatenate([np.diff(place, axis=0) / STEP_S, np.zeros((1, k))]))


class _Program(NamedTuple):
    solver: Any
    hessian: Any
    rows: Any
    limit: Float
    dimensions: int

    def bounds(self, start: Float) -> tuple[Float, Float]:
        """Bounds of the rows: |v|, |a|, and the first place."""
        return np.concatenate([-self.limit, start]), np.concatenate([self.limit, start])


@lru_cache(maxsize=16)
def _program(count: int, k: int, speed: int, acceleration: int) -> _Program:
    """Program of T = count places in k dimensions, with speed [um/s] and acceleration [um/s^2]."""
    import casadi
    from scipy import sparse

    ones = np.ones(count)
    first = sparse.diags([-ones, ones], [0, 1], shape=(count - 1, count))
    second = sparse.diags([ones, -2.0 * ones, ones], [0, 1, 2], shape=(count - 2, count))
    third = sparse.diags([-ones, 3.0 * ones, -3.0 * ones, ones], [0, 1, 2, 3], shape=(count - 3, count))
    # of the third difference in mm
    hessian = sparse.kron(sparse.eye(k), 2.0 * (sparse.eye(count) + 2.0 * third.T @ third))
    normals, share = _normals(k)
    blocks, limits = [], []
    for difference, limit in ((first, 1e-3 * speed * STEP_S), (second, 1e-3 * acceleration * STEP_S**2)):
        blocks.append(sparse.kron(normals, difference))
        limits.append(np.repeat(0.98 * limit * share, difference.shape[0]))  # of the bounds: OSQP's accuracy
    start = sparse.kron(sparse.eye(k), sparse.csr_matrix(([1.0], ([0], [0])), shape=(1, count)))
    h, a = (_casadi(matrix) for matrix in (hessian, sparse.vstack([*blocks, start])))
    options: dict[str, Any] = {
        "osqp": {"verbose": False, "eps_abs": 1e-5, "eps_rel": 1e-5, "max_iter": 8000},
        "error_on_fail": False,
    }
    solver = casadi.conic("smooth", "osqp", {"h": h.sparsity(), "a": a.sparsity()}, options)
    return _Program(solver, h, a, np.concatenate(limits), k)


def _normals(k: int) -> tuple[Float, Float]:
    """Bounded directions (m, k), and the share of the limit of each (m,)."""
    if k == 1:
        return np.ones((1, 1)), np.ones(1)
    sides = 4  # pairs of parallel sides: an octagon
    angle = np.arange(sides) * np.pi / sides
    plane = np.zeros((sides, k))
    plane[:, :2] = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    others = np.eye(k)[2:]
    inscribed = np.full(sides, np.cos(0.5 * np.pi / sides))
    return np.concatenate([plane, others]), np.concatenate([inscribed, np.ones(k - 2)])


def _casadi(matrix: Any) -> Any:
    import casadi

    columns = matrix.tocsc()
    columns.sort_indices()
    rows, width = columns.shape
    pattern = casadi.Sparsity(rows, width, columns.indptr.tolist(), columns.indices.tolist())
    return casadi.DM(pattern, columns.data)
