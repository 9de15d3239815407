r"""The controller of `hydraulic` and its model's terms for one trial, as casadi functions.

With kinetic energy T and potential energy U, M_z = d^2T/dzd^2, C_z^T zd = dT/dz and g_z = dU/dz (Lagrange). Inertial
parameters, cylinders, gains, bounds and sample time are inputs; geometry and counterbalance valves are constant. Arrays
are row by row, as in numpy.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from skillframe.frames import Float
from skillframe.robot import ClosedChain, published_inertia
from skillframe.signals import rate_after
from skillframe_hydraulics.counterbalance import counterbalances
from skillframe_hydraulics.law.generated import dense_function, matrix_symbol
from skillframe_hydraulics.law.line_ahead import inverse_ahead, known_lines
from skillframe_hydraulics.law.symbolic_chain import Expression, SymbolicChain, closing_function, constant
from skillframe_hydraulics.law.vdc_actuator import (
    CYLINDER,
    ContactFriction,
    CylinderGains,
    Cylinders,
    bristle_after,
    coulomb_shape,
    flow_demand,
    inverse_valve,
    pressure_force,
    spool_for,
)
from skillframe_hydraulics.law.vdc_adaptation import adapt
from skillframe_hydraulics.law.vdc_body import PARAMETERS, kinetic_energy, needed_forces
from skillframe_hydraulics.law.vdc_reference import required_motion, swung_by
from skillframe_hydraulics.opening import openings
from skillframe_hydraulics.symbolic_or_numeric import clip

_KEPT: dict[tuple[Any, ...], tuple[ca.Function, ca.Function, ca.Function]] = {}
SWEEPS = 2
"""Over passive joints: hinges at right angles hang at rest after the first, but for their distance."""
SCALARS = ("body", "adaptation", "coulomb", "viscous", "joint", "corner", "touch", "sliding", "dt", "fresh")


def functions(chain: ClosedChain, axes: Float) -> tuple[ca.Function, ca.Function, ca.Function]:
    """`law_function`, `terms_function` and `closing_function`, cached, since writing them takes tenths of a second."""
    chosen = (chain.driven, chain.dependent, chain.free, chain.rows, chain.coupling, chain.offsets, axes)
    key = (
        chain.model.saveToString(), chain.robot.tool_frames[0], chain.steered, *(each.tobytes() for each in chosen),
        chain.loops, repr([find(chain.robot.spec.actuation) for find in (counterbalances, openings)]),
        *(each.tobytes() for each in (known_lines(chain.robot.spec) or ((),))[1:]),
        published_inertia(chain.robot.spec).com if chain.robot.spec.payload else None,
    )  # fmt: skip
    if key not in _KEPT:
        while len(_KEPT) >= 4:
            _KEPT.pop(next(iter(_KEPT)))
        _KEPT[key] = law_function(chain, axes), terms_function(chain, axes), closing_function(chain)
    return _KEPT[key]


def terms_function(chain: ClosedChain, axes: Float) -> ca.Function:
    """(q, zd, theta) -> the fields of `Terms`, at a closed configuration q (nq,)."""
    s = SymbolicChain(chain)
    theta, rows = matrix_symbol("theta", chain.model.njoints - 1, PARAMETERS)
    moving = s.bodies(ca.SX(s.zd.shape[0], 1), ca.SX(s.zd.shape[0], 1))
    kinetic = sum(kinetic_energy(body.velocity, rows[b, :].T) for b, body in enumerate(moving))
    mass = ca.jacobian(ca.gradient(kinetic, s.zd), s.zd)
    tip = constant(axes) @ s.frame(chain.robot.tool_frames[0]).origin
    hung = tip if not swung_by(chain) else _hung(s, rows, tip)
    jacobian, driven = s.by_z(tip), s.q[chain.driven.tolist()]
    arms = s.by_z(driven)
    down, potential = ca.SX(np.array(s.model.gravity.linear, dtype=float)), _potential(s, rows)
    load = ca.SX(len(chain.free), 1)
    if chain.robot.spec.payload is not None:
        frame = s.frame(chain.model.getFrameId(chain.robot.spec.payload.link, pin.FrameType.BODY))
        com = ca.SX(np.array(published_inertia(chain.robot.spec).com))
        load = -s.by_z(ca.dot(down, frame.origin + frame.rotation @ com)).T
    fields = (
        mass, s.by_z(kinetic).T, s.by_z(potential).T, jacobian, arms, driven, arms @ s.zd,
        hung, s.by_z(hung) @ s.zd, load,
    )  # fmt: skip
    return dense_function("terms", (s.q, s.zd, theta), fields)


def _potential(s: SymbolicChain, rows: Expression) -> Expression:
    """Potential energy of bodies with inertial parameters (B, 10) [J]."""
    down, total = ca.SX(np.array(s.model.gravity.linear, dtype=float)), ca.SX(1, 1)
    for b in range(s.model.njoints - 1):
        placed = s.joint(b + 1)
        total = total - ca.dot(down, rows[b, 0] * placed.origin + placed.rotation @ rows[b, 1:4].T)
    return total


def _hung(s: SymbolicChain, rows: Expression, tip: Expression) -> Expression:
    """A tool's place with its passive joints, the last of z, where the potential is least.

    Of one joint it is U = a cos p + b sin p + c. Several are set one after the other, `SWEEPS` times.
    """
    angles, potential = s.q[s.chain.free[s.chain.steered :].tolist()], _potential(s, rows)
    hanging, count = ca.SX(angles), angles.shape[0]
    for joint in list(range(count)) * (SWEEPS if count > 1 else 1):
        turned = []
        for angle in (0.0, np.pi / 2, np.pi):
            hanging[joint] = angle
            turned.append(ca.substitute(potential, angles, hanging))
        ahead, aside, behind = turned
        hanging[joint] = ca.atan2(0.5 * (ahead + behind) - aside, 0.5 * (behind - ahead))
    return ca.substitute(tip, angles, hanging)


def law_function(chain: ClosedChain, axes: Float) -> ca.Function:
    """One sample of the controller for one trial.

    Inputs: closed configuration q, zd, pressure_a, pressure_b, force, sigma; position, velocity, stiffness, damping,
    push, joint, joint_rate, acceleration; theta, friction (2, k), memory (3, k), deadband, supply, lower and upper
    bounds of theta and of friction, cylinders (21, k), k_x, k_f, the scalars of `SCALARS`.
    Outputs: valve, required and present force, theta, friction, memory (the required force's filter and the bristles).
    """
    s = SymbolicChain(chain)
    n, k, count = len(chain.independent), len(chain.driven), chain.model.njoints - 1
    m = len(axes)
    sizes = {"p_a": k, "p_b": k, "force": m, "sigma": m}
    p_a, p_b, force, sigma = (ca.SX.sym(name, size) for name, size in sizes.items())
    reference = [ca.SX.sym(f"reference{i}", size) for i, size in enumerate((m, m, m * m, m * m, m, n - m, n - m, n))]
    scalars = ca.SX.sym("scalars", len(SCALARS))
    gain = dict(zip(SCALARS, ca.vertsplit(scalars), strict=True))
    theta, rows = matrix_symbol("theta", count, PARAMETERS)
    rub, friction = matrix_symbol("friction", 2, k)
    memory, kept = matrix_symbol("memory", 3, k)
    bounds = [matrix_symbol(name, count, PARAMETERS) for name in ("lower", "upper")]
    rub_bounds = [matrix_symbol(f"friction_{name}", 2, k) for name in ("lower", "upper")]
    table, cylinder = matrix_symbol("cylinder", len(CYLINDER), k)
    k_x, k_f, deadband, supply = (ca.SX.sym(name, k) for name in ("k_x", "k_f", "deadband", "supply"))
    valves, points = counterbalances(chain.robot.spec.actuation), openings(chain.robot.spec.actuation)
    fields = {name: cylinder[i, :].T for i, name in enumerate(CYLINDER)}
    c = Cylinders(**fields, counterbalance=valves, openings=points)

    tip = constant(axes) @ s.frame(chain.robot.tool_frames[0]).origin
    hung = tip if not swung_by(chain) else _hung(s, rows, tip)
    rate, acceleration = required_motion(s, hung, reference, (force, sigma), gain["joint"])
    swing = ca.SX.sym("swing", n - chain.steered)
    rate[chain.steered :], acceleration[chain.steered :] = s.zd[chain.steered :], swing
    moving = s.bodies(rate, acceleration)
    needed, drive = needed_forces(s, moving, rows, gain["body"], rate)
    needed = needed - s.by_z(tip).T @ force
    if chain.steered < n:  # passive joints accelerate as the model says that they do without a force
        model = ca.substitute(needed[chain.steered :], gain["body"], 0.0)
        by, rest = ca.jacobian(model, swing), ca.substitute(model, swing, ca.SX.zeros(swing.shape[0]))
        needed, *drive = ca.substitute([needed, *drive], [swing], [ca.densify(-ca.solve(by, rest))])
    needed = needed[: chain.steered]
    piston = s.q[chain.driven.tolist()]
    arms = s.by_z(piston)
    passing = arms[:, : chain.steered]
    shared = ca.diag(c.area_a**2) @ passing  # least squared pressure
    speed, speed_r = arms @ s.zd, arms @ rate
    bristle = bristle_after(c, _unless_fresh(kept[2, :].T, ca.SX(k, 1), gain), speed_r, gain["dt"])
    contact = ContactFriction(force=gain["touch"], sliding=gain["sliding"])
    coulomb = coulomb_shape(bristle, speed_r, force, contact)
    shape = ca.horzcat(coulomb, speed_r).T
    f_pr = shared @ ca.solve(passing.T @ shared, needed) + ca.sum1(shape * friction).T
    value, slope = (_unless_fresh(old, new, gain) for old, new in ((kept[0, :].T, f_pr), (kept[1, :].T, 0.0 * f_pr)))
    value, slope = rate_after(value, slope, f_pr, 2.0 * np.pi * gain["corner"], gain["dt"])
    gains = CylinderGains(velocity=k_x, force=k_f)
    demand = flow_demand(c, gains, (piston, speed, speed_r), (f_pr, slope), (p_a, p_b))
    lines = known_lines(chain.robot.spec)
    if lines is None:
        opened = inverse_valve(c, demand, piston, (p_a, p_b), supply)
    else:
        opened = inverse_ahead(lines, c, (demand, piston, speed, speed_r), (p_a, p_b), supply, deadband)
    valve = clip(spool_for(c, deadband, opened), -1.0, 1.0)
    lower, upper = (b[1] for b in bounds)
    learned = adapt(rows, gain["adaptation"] * ca.horzcat(*drive).T, (lower, upper), gain["dt"])
    speeds = ca.vertcat(gain["coulomb"], gain["viscous"])
    drive_f = ca.repmat(speeds, 1, k) * shape * ca.repmat((speed_r - speed).T, 2, 1)
    lower, upper = (b[1] for b in rub_bounds)
    rubbed = adapt(friction, drive_f, (lower, upper), gain["dt"])
    limits = (b[0] for b in (*bounds, *rub_bounds))
    inputs = (
        s.q, s.zd, p_a, p_b, force, sigma, *reference, theta, rub, memory, deadband, supply, *limits, table, k_x, k_f,
        scalars,
    )  # fmt: skip
    return dense_function(
        "law",
        inputs,
        (valve, f_pr, pressure_force(c, p_a, p_b), learned, rubbed, ca.vertcat(value.T, slope.T, bristle.T)),
    )


def _unless_fresh(kept: Expression, new: Expression, gain: dict[str, Expression]) -> Expression:
    return ca.if_else(gain["fresh"] > 0, new, kept)


def cylinder_table(cylinders: Cylinders) -> Float:
    """Table (21, k) in the order of `CYLINDER`."""
    return np.array([getattr(cylinders, name) for name in CYLINDER], dtype=float)
