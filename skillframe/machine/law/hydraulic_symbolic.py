r"""The law of `hydraulic` and its model's terms for one trial, as casadi functions; equations there and in `vdc`.

The terms come another way than in the readable law: with the kinetic energy T and the potential energy U as
expressions, M_z = d^2T/dzd^2, C_z^T zd = dT/dz and g_z = dU/dz (Lagrange). What may change from run to run is an
input: inertial parameters, cylinders, gains, bounds, sample time. Numbers of the geometry are written into the code.
Arrays are row by row, as numpy has them, whatever casadi's order is.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from skillframe.frames import Float
from skillframe.machine.law.doubt import CONTACT, LEAST, SETTING_OUT
from skillframe.machine.law.vdc_actuator import ACROSS, Cylinders
from skillframe.machine.law.vdc_body import PARAMETERS
from skillframe.robot.chain import ClosedChain
from skillframe.robot.symbolic import BodyMotion, Expression, SymbolicChain, Twist

CYLINDER = tuple(Cylinders.__dataclass_fields__)
SCALARS = ("body", "adaptation", "coulomb", "viscous", "joint", "corner", "touch", "sliding", "dt", "fresh")


def terms_function(chain: ClosedChain, axes: tuple[int, int]) -> ca.Function:
    """(z, zd, theta) -> the fields of `Terms`."""
    s = SymbolicChain(chain)
    theta, rows = _rows("theta", chain.model.njoints - 1, PARAMETERS)
    moving = s.bodies(ca.SX(s.zd.shape[0], 1), ca.SX(s.zd.shape[0], 1))
    kinetic = sum(_kinetic(body.velocity, rows[b, :].T) for b, body in enumerate(moving))
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
    c = {name: cylinder[i, :].T for i, name in enumerate(CYLINDER)} | {"supply_pressure": supply, "deadband": deadband}

    tip = s.frame(chain.robot.tool_frames[0]).origin[list(axes)]
    rate, acceleration = _required(s, tip, reference, (force, sigma), gain["joint"])
    moving = s.bodies(rate, acceleration)
    needed, drive = _needed(s, moving, rows, gain["body"], rate)
    needed = needed - ca.jacobian(tip, s.z).T @ force
    piston = s.q[chain.driven.tolist()]
    arms = ca.jacobian(piston, s.z)
    speed, speed_r = arms @ s.zd, arms @ rate
    coulomb, bristle = _slid(c, kept, speed_r, force, gain)
    shape = ca.horzcat(coulomb, speed_r).T
    f_pr = ca.solve(arms.T, needed) + ca.sum1(shape * friction).T
    value, slope = _filtered(f_pr, kept, gain)
    valve = _valve(c, (p_a, p_b), (piston, speed, speed_r), (f_pr, slope), (k_x, k_f))
    learned = _adapted(rows, gain["adaptation"] * ca.horzcat(*drive).T, [b[1] for b in bounds], gain["dt"])
    speeds = ca.vertcat(gain["coulomb"], gain["viscous"])
    drive_f = ca.repmat(speeds, 1, k) * shape * ca.repmat((speed_r - speed).T, 2, 1)
    rubbed = _adapted(friction, drive_f, [b[1] for b in rub_bounds], gain["dt"])
    limits = (b[0] for b in (*bounds, *rub_bounds))
    inputs = (
        s.z, s.zd, p_a, p_b, force, sigma, *reference, theta, rub, memory, deadband, supply, *limits, table, k_x, k_f,
        scalars,
    )  # fmt: skip
    present = c["area_a"] * p_a - c["area_b"] * p_b
    return _function("law", inputs, (valve, f_pr, present, learned, rubbed, ca.vertcat(value.T, slope.T, bristle.T)))


def _rows(name: str, rows: int, columns: int) -> tuple[Expression, Expression]:
    """A symbol in numpy's order, and the matrix (rows, columns) that it holds."""
    symbol = ca.SX.sym(name, columns, rows)
    return symbol, symbol.T


def _function(name: str, inputs: tuple[Any, ...], outputs: tuple[Any, ...]) -> ca.Function:
    dense = ca.cse([ca.densify(x.T) for x in outputs])
    return ca.Function(name, list(inputs), dense)


def _kinetic(v: Twist, theta: Expression) -> Expression:
    """1/2 V^T M V."""
    momentum = _inertia_times(theta, v)
    return 0.5 * (ca.dot(v.linear, momentum.linear) + ca.dot(v.angular, momentum.angular))


def _inertia_times(theta: Expression, v: Twist) -> Twist:
    """M V with M of `vdc_body`."""
    m, mr, inertia = theta[0], theta[1:4], _moment(theta)
    return Twist(m * v.linear - ca.cross(mr, v.angular), ca.cross(mr, v.linear) + inertia @ v.angular)


def _moment(theta: Expression) -> Expression:
    xx, xy, yy, xz, yz, zz = ca.vertsplit(theta[4:10])
    return ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))


def _potential(s: SymbolicChain, rows: Expression) -> Expression:
    gravity, total = ca.SX(np.array(s.model.gravity.linear, dtype=float)), ca.SX(1, 1)
    for b in range(s.model.njoints - 1):
        placed = s.joint(b + 1)
        total = total - ca.dot(gravity, rows[b, 0] * placed.origin + placed.rotation @ rows[b, 1:4].T)
    return total


def _required(
    s: SymbolicChain, tip: Expression, reference: list[Expression], force: tuple[Expression, Expression],
    joint_gain: Expression,
) -> tuple[Expression, Expression]:  # fmt: skip
    """zd_r and zdd_r, equation (1) of `hydraulic`, `doubt.pursued` and `vdc_reference.required_motion`."""
    position, velocity, stiffness, damping, push, joint, joint_rate, given = reference
    n = s.z.shape[0]
    k, d = (ca.reshape(x, 2, 2).T for x in (stiffness, damping))
    inverse = ca.inv(d)
    lead = ca.diagcat(inverse @ k, joint_gain * ca.SX.eye(n - 2))
    at, wanted = ca.vertcat(tip, s.z[2:]), ca.vertcat(position, joint)
    pushing = force[0] + push
    imbalance = d @ velocity + k @ (position - tip) + pushing
    pushing = pushing - _left(imbalance, *force) * imbalance
    ahead, pushed = ca.vertcat(velocity, joint_rate), ca.vertcat(inverse @ pushing, ca.SX(n - 2, 1))
    jacobian = ca.jacobian(at, s.z)
    rate = ca.solve(jacobian, ahead + lead @ (wanted - at) + pushed)
    acceleration = given + lead @ (ahead - jacobian @ s.zd) - s.drift_of(jacobian, rate)
    return rate, ca.solve(jacobian, acceleration)


def _left(imbalance: Expression, force: Expression, sigma: Expression) -> Expression:
    """1 less `doubt.pursued`."""
    certain = ca.fmax(sigma, LEAST)
    touch = ca.sumsqr(force / (CONTACT * certain)) ** 2
    return touch / (1.0 + touch) / (1.0 + ca.sumsqr(imbalance / (SETTING_OUT * certain)) ** 4)


def _needed(
    s: SymbolicChain, moving: list[BodyMotion], rows: Expression, body_gain: Expression, rate: Expression
) -> tuple[Expression, list[Expression]]:
    """Generalised forces (n,) without the tool's, and Y^T (V_r - V) (10,) of every body."""
    damping = s.embedding.T @ (ca.SX(np.array(s.model.damping, dtype=float)) * (s.embedding @ rate))
    total, drive = damping, []
    for b, body in enumerate(moving):
        velocity = ca.vertcat(*body.velocity)
        error = ca.vertcat(*body.required) - velocity
        y = _regressor(body)
        net = y @ rows[b, :].T + body_gain * error
        total = total + ca.jacobian(velocity, s.zd).T @ net
        drive.append(y.T @ error)
    return total, drive


def _regressor(body: BodyMotion) -> Expression:
    """Y (6, 10) of `vdc_body`."""
    w, w_r, turn = body.velocity.angular, body.required.angular, body.rate.angular
    linear = body.rate.linear - body.gravity + ca.cross(w, body.required.linear)
    upper = ca.horzcat(linear, ca.skew(turn) + ca.skew(w) @ ca.skew(w_r), ca.SX(3, 6))
    lower = ca.horzcat(ca.SX(3, 1), -ca.skew(linear), _moments(turn) + ca.skew(w_r) @ _moments(w))
    return ca.vertcat(upper, lower)


def _moments(w: Expression) -> Expression:
    """L (3, 6) of `vdc_body.moment_matrix`."""
    x, y, z = ca.vertsplit(w)
    o = ca.SX(1, 1)
    rows = [[x, y, o, z, o, o], [o, x, y, o, z, o], [o, o, o, x, y, z]]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def _filtered(force: Expression, memory: Expression, gain: dict[str, Expression]) -> tuple[Expression, Expression]:
    """Value and rate of the required force's filter, which starts at the first force it is shown."""
    value = ca.if_else(gain["fresh"] > 0, force, memory[0, :].T)
    slope = ca.if_else(gain["fresh"] > 0, 0.0 * force, memory[1, :].T)
    w = 2.0 * np.pi * gain["corner"]
    slope = slope + gain["dt"] * (w**2 * (force - value) - 2.0 * w * slope)
    return value + gain["dt"] * slope, slope


def _slid(
    c: dict[str, Expression], kept: Expression, speed: Expression, force: Expression, gain: dict[str, Expression]
) -> tuple[Expression, Expression]:
    """Shape y and the bristles of `vdc_actuator`."""
    way, before = ca.sign(speed), ca.if_else(gain["fresh"] > 0, ca.SX(*speed.shape), kept[2, :].T)
    bristle = way + (before - way) * ca.exp(-ca.fabs(speed) * gain["dt"] / c["presliding_length"])
    square = ca.sumsqr(force)
    share = square / (square + gain["touch"] ** 2)
    return bristle + share * (ca.tanh(speed / gain["sliding"]) - bristle), bristle


def _valve(
    c: dict[str, Expression], pressures: tuple[Any, ...], motion: tuple[Any, ...], force: tuple[Any, ...],
    gains: tuple[Any, ...],
) -> Expression:  # fmt: skip
    """Valve commands of `vdc_actuator`, limited."""
    (p_a, p_b), (x, xd, xd_r), (f_pr, slope), (k_x, k_f) = pressures, motion, force, gains
    a, b = 1.0 / (c["arm_a"] + x), 1.0 / (c["arm_b"] + c["stroke"] - x)
    feedback = k_x * (xd_r - xd) + k_f * (f_pr - (c["area_a"] * p_a - c["area_b"] * p_b))
    leak = c["leakage"] * (a + b) * (p_a - p_b)
    flow = feedback + slope / c["bulk_modulus"] + (c["area_a"] * a + c["area_b"] * b) * xd + leak

    def root(drop: Expression) -> Expression:
        return ca.sqrt(ca.fmax(drop, c["laminar_pressure"]))

    high, low = c["supply_pressure"], c["return_pressure"]
    extend = root(high - p_a) * a + root(p_b - low) * b
    retract = root(high - p_b) * b + root(p_a - low) * a
    opening = flow / (c["edge"] * ca.if_else(flow > 0, extend, retract))
    overlap = c["deadband"]
    return ca.fmin(ca.fmax((1.0 - overlap) * opening + overlap * ca.tanh(opening / ACROSS), -1.0), 1.0)


def _adapted(rows: Expression, rate: Expression, bounds: list[Expression], dt: Expression) -> Expression:
    """Parameters after a sample, `vdc_adaptation`: clipping says the same as projecting first."""
    moved = rows + dt * rate
    return ca.fmin(ca.fmax(moved, bounds[0]), bounds[1])


def cylinder_table(cylinders: Cylinders) -> Float:
    """(15, k) in the order of `CYLINDER`."""
    return np.array([getattr(cylinders, name) for name in CYLINDER], dtype=float)
