r"""The law of `hydraulic` and its model's terms for one trial, as casadi functions. Equations there and in `vdc`.

The terms come another way than in the readable law: with the kinetic energy T and the potential energy U as
expressions, M_z = d^2T/dzd^2, C_z^T zd = dT/dz and g_z = dU/dz (Lagrange). What may change from run to run is an
input: inertial parameters, cylinders, gains, bounds, sample time. Numbers of the geometry are written into the code.
Arrays are row by row, as numpy has them, whatever casadi's order is.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from skillframe.either import clip
from skillframe.frames import Float
from skillframe.machine.law.vdc import needed_forces
from skillframe.machine.law.vdc_actuator import (
    ContactFriction,
    CylinderGains,
    Cylinders,
    across_deadband,
    bristle_after,
    coulomb_shape,
    flow_demand,
    inverse_valve,
    pressure_force,
)
from skillframe.machine.law.vdc_adaptation import adapt
from skillframe.machine.law.vdc_body import PARAMETERS, kinetic_energy
from skillframe.machine.law.vdc_reference import required_motion
from skillframe.robot.chain import ClosedChain
from skillframe.robot.symbolic import Expression, SymbolicChain
from skillframe.signals.rates import rate_after

CYLINDER = tuple(Cylinders.__dataclass_fields__)
_KEPT: dict[tuple[Any, ...], tuple[ca.Function, ca.Function]] = {}
KEPT_AT_MOST = 4
SCALARS = ("body", "adaptation", "coulomb", "viscous", "joint", "corner", "touch", "sliding", "dt", "fresh")


def functions(chain: ClosedChain, axes: tuple[int, int]) -> tuple[ca.Function, ca.Function]:
    """`law_function` and `terms_function`: the same again for a machine of the same model, as a campaign's chunks have.

    Writing the expressions takes a tenth of a second, half of what a run takes to begin.
    """
    key = chain.model.saveToString(), chain.robot.tool_frames[0], chain.driven.tobytes(), repr(chain.cylinders), axes
    if key not in _KEPT:
        while len(_KEPT) >= KEPT_AT_MOST:
            _KEPT.pop(next(iter(_KEPT)))
        _KEPT[key] = law_function(chain, axes), terms_function(chain, axes)
    return _KEPT[key]


def terms_function(chain: ClosedChain, axes: tuple[int, int]) -> ca.Function:
    """(z, zd, theta) -> the fields of `Terms`."""
    s = SymbolicChain(chain)
    theta, rows = _rows("theta", chain.model.njoints - 1, PARAMETERS)
    moving = s.bodies(ca.SX(s.zd.shape[0], 1), ca.SX(s.zd.shape[0], 1))
    kinetic = sum(kinetic_energy(body.velocity, rows[b, :].T) for b, body in enumerate(moving))
    mass = ca.jacobian(ca.gradient(kinetic, s.zd), s.zd)
    tip = s.frame(chain.robot.tool_frames[0]).origin[list(axes)]
    jacobian, driven = ca.jacobian(tip, s.z), s.q[chain.driven.tolist()]
    arms = ca.jacobian(driven, s.z)
    gravity = ca.gradient(_potential(s, rows), s.z)
    fields = (
        mass, ca.gradient(kinetic, s.z), gravity, jacobian, arms, driven, arms @ s.zd, tip, jacobian @ s.zd
    )  # fmt: skip
    return _function("terms", (s.z, s.zd, theta), fields)


def law_function(chain: ClosedChain, axes: tuple[int, int]) -> ca.Function:
    """One sample of the law for one trial.

    Inputs: z, zd, pressure_a, pressure_b, force, sigma; position, velocity, stiffness, damping, push, joint,
    joint_rate, acceleration; theta, friction (2, k), memory (3, k), deadband, supply, lower and upper bounds of theta
    and of friction, cylinders (15, k), k_x, k_f, the scalars of `SCALARS`.
    Outputs: valve, required and present force, theta, friction, memory: the required force's filter and the bristles.
    """
    s = SymbolicChain(chain)
    n, k, count = len(chain.independent), len(chain.driven), chain.model.njoints - 1
    sizes = {"p_a": k, "p_b": k, "force": 2, "sigma": 2}
    p_a, p_b, force, sigma = (ca.SX.sym(name, size) for name, size in sizes.items())
    reference = [ca.SX.sym(f"reference{i}", size) for i, size in enumerate((2, 2, 4, 4, 2, n - 2, n - 2, n))]
    scalars = ca.SX.sym("scalars", len(SCALARS))
    gain = dict(zip(SCALARS, ca.vertsplit(scalars), strict=True))
    theta, rows = _rows("theta", count, PARAMETERS)
    rub, friction = _rows("friction", 2, k)
    memory, kept = _rows("memory", 3, k)
    bounds = [_rows(name, count, PARAMETERS) for name in ("lower", "upper")]
    rub_bounds = [_rows(f"friction_{name}", 2, k) for name in ("lower", "upper")]
    table, cylinder = _rows("cylinder", len(CYLINDER), k)
    k_x, k_f, deadband, supply = (ca.SX.sym(name, k) for name in ("k_x", "k_f", "deadband", "supply"))
    c = Cylinders(**{name: cylinder[i, :].T for i, name in enumerate(CYLINDER)})

    tip = s.frame(chain.robot.tool_frames[0]).origin[list(axes)]
    rate, acceleration = required_motion(s, tip, reference, (force, sigma), gain["joint"])
    moving = s.bodies(rate, acceleration)
    needed, drive = needed_forces(s, moving, rows, gain["body"], rate)
    needed = needed - ca.jacobian(tip, s.z).T @ force
    piston = s.q[chain.driven.tolist()]
    arms = ca.jacobian(piston, s.z)
    speed, speed_r = arms @ s.zd, arms @ rate
    bristle = bristle_after(c, _unless_fresh(kept[2, :].T, ca.SX(k, 1), gain), speed_r, gain["dt"])
    contact = ContactFriction(force=gain["touch"], sliding=gain["sliding"])
    coulomb = coulomb_shape(bristle, speed_r, force, contact)
    shape = ca.horzcat(coulomb, speed_r).T
    f_pr = ca.solve(arms.T, needed) + ca.sum1(shape * friction).T
    value, slope = (_unless_fresh(old, new, gain) for old, new in ((kept[0, :].T, f_pr), (kept[1, :].T, 0.0 * f_pr)))
    value, slope = rate_after(value, slope, f_pr, 2.0 * np.pi * gain["corner"], gain["dt"])
    gains = CylinderGains(velocity=k_x, force=k_f)
    demand = flow_demand(c, gains, (piston, speed, speed_r), (f_pr, slope), (p_a, p_b))
    opened = inverse_valve(c, demand, piston, (p_a, p_b), supply)
    valve = clip(across_deadband(deadband, opened), -1.0, 1.0)
    lower, upper = (b[1] for b in bounds)
    learned = adapt(rows, gain["adaptation"] * ca.horzcat(*drive).T, (lower, upper), gain["dt"])
    speeds = ca.vertcat(gain["coulomb"], gain["viscous"])
    drive_f = ca.repmat(speeds, 1, k) * shape * ca.repmat((speed_r - speed).T, 2, 1)
    lower, upper = (b[1] for b in rub_bounds)
    rubbed = adapt(friction, drive_f, (lower, upper), gain["dt"])
    limits = (b[0] for b in (*bounds, *rub_bounds))
    inputs = (
        s.z, s.zd, p_a, p_b, force, sigma, *reference, theta, rub, memory, deadband, supply, *limits, table, k_x, k_f,
        scalars,
    )  # fmt: skip
    return _function(
        "law",
        inputs,
        (valve, f_pr, pressure_force(c, p_a, p_b), learned, rubbed, ca.vertcat(value.T, slope.T, bristle.T)),
    )


def _rows(name: str, rows: int, columns: int) -> tuple[Expression, Expression]:
    """A symbol in numpy's order, and the matrix (rows, columns) that it holds."""
    symbol = ca.SX.sym(name, columns, rows)
    return symbol, symbol.T


def _function(name: str, inputs: tuple[Any, ...], outputs: tuple[Any, ...]) -> ca.Function:
    dense = ca.cse([ca.densify(x.T) for x in outputs])
    return ca.Function(name, list(inputs), dense)


def _potential(s: SymbolicChain, rows: Expression) -> Expression:
    gravity, total = ca.SX(np.array(s.model.gravity.linear, dtype=float)), ca.SX(1, 1)
    for b in range(s.model.njoints - 1):
        placed = s.joint(b + 1)
        total = total - ca.dot(gravity, rows[b, 0] * placed.origin + placed.rotation @ rows[b, 1:4].T)
    return total


def _unless_fresh(kept: Expression, new: Expression, gain: dict[str, Expression]) -> Expression:
    """What was kept. At the first sample after a start, something new."""
    return ca.if_else(gain["fresh"] > 0, new, kept)


def cylinder_table(cylinders: Cylinders) -> Float:
    """(15, k) in the order of `CYLINDER`."""
    return np.array([getattr(cylinders, name) for name in CYLINDER], dtype=float)
