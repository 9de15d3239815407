r"""`ForceEstimator` of one trial, as two casadi functions; equations and names in `conditioning.momentum`.

    look:  sensors and terms -> what passed L: residual, J, phi; which pistons slide; the residuals' variances
    weigh: these and theta   -> force, sigma, and the filters behind

Identification comes between the two. Numbers of the settings are written into the code; the memory is a row of numbers.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from skillframe.machine.force.damped import share_of
from skillframe.machine.force.impulse import gains
from skillframe.machine.force.momentum import ForceSettings
from skillframe.machine.law.vdc_actuator import Cylinders
from skillframe.robot.symbolic import Expression
from skillframe.signals.kalman import Gain


class Memory:
    """A row of numbers as named parts: symbols to read, and expressions to write; rows by rows, as numpy has them.

    Args:
        name: of the symbol; parts: name and shape of each part.
    """

    def __init__(self, name: str, **parts: tuple[int, int]) -> None:
        self.size = sum(rows * columns for rows, columns in parts.values())
        self.symbol, self._shapes, at = ca.SX.sym(name, self.size), parts, 0
        self._now: dict[str, Expression] = {}
        self._next: dict[str, Expression] = {}
        for part, (rows, columns) in parts.items():
            self._now[part] = ca.reshape(self.symbol[at : at + rows * columns], columns, rows).T
            at += rows * columns

    def __getitem__(self, part: str) -> Expression:
        return self._now[part]

    def __setitem__(self, part: str, value: Expression) -> None:
        self._next[part] = value

    def after(self) -> Expression:
        """(size,) what is remembered next."""
        parts = [ca.reshape(ca.densify(self._next[part]).T, -1, 1) for part in self._shapes]
        return ca.vertcat(*parts)


def look_function(c: Cylinders, s: ForceSettings, n: int, dt: float) -> ca.Function:
    """From a sample to the residual.

    Inputs: rate, pressure_a, pressure_b, mass, drift, gravity, jacobian, arms, piston_rate, load, memory, fresh.
    Outputs: behind L the residual, J (2, n) and phi; sliding (k,), 1 at once and 2 after the filter's memory, else 0;
    the residual's variance (n,); memory.
    """
    k = len(c.area_a)
    shapes = {
        "rate": (n, 1), "p_a": (k, 1), "p_b": (k, 1), "mass": (n, n), "drift": (n, 1), "gravity": (n, 1),
        "jacobian": (2, n), "arms": (k, n), "piston_rate": (k, 1), "load": (n, 1),
    }  # fmt: skip
    given = {name: _matrix(name, *shape) for name, shape in shapes.items()}
    v = {name: pair[1] for name, pair in given.items()}
    fresh, width = ca.SX.sym("fresh"), 2 * k + 4
    m = Memory("memory", rate=(k, 1), since=(k, 1), momentum=(n, 1), middle=(n, width), value=(n, width))
    before = m["rate"]
    rate = before + float(-np.expm1(-2.0 * np.pi * s.rate_corner * dt)) * (v["piston_rate"] - before)
    shape = ca.tanh(rate / s.sliding_speed)
    push = ca.DM(c.area_a) * v["p_a"] - ca.DM(c.area_b) * v["p_b"]
    push = push - ca.DM(c.coulomb_friction) * shape - ca.DM(c.viscous_friction) * v["piston_rate"]
    momentum = v["mass"] @ v["rate"]
    started = ca.if_else(fresh > 0, momentum, m["momentum"])
    left = (momentum - started) / dt - (v["arms"].T @ push + v["drift"] - v["gravity"])
    spread = v["arms"].T
    columns = ca.horzcat(
        left, v["jacobian"].T, -spread * ca.repmat(shape.T, n, 1), -spread * ca.repmat(v["piston_rate"].T, n, 1),
        -v["load"],
    )  # fmt: skip
    columns = _damped(m, columns, fresh, share_of(s.corner, dt))
    going = ca.logic_and(ca.fabs(rate) > s.least_speed, rate * before > 0.0)
    since = ca.if_else(going, m["since"] + dt, 0.0)
    sliding = since >= s.settle
    m["rate"], m["since"], m["momentum"] = rate, since, momentum
    level, variance = sliding + (since >= s.settle + s.memory), _variance(c, s, v["arms"], rate, sliding)
    outputs = (columns[:, 0], columns[:, 1:3].T, columns[:, 3:], level, variance)
    inputs = [*(pair[0] for pair in given.values()), m.symbol, fresh]
    return _function("look", inputs, [*outputs, m.after()])


def weigh_function(s: ForceSettings, n: int, k: int, feedback: Gain, dt: float) -> ca.Function:
    """From the residual to the force.

    Inputs: residual, jacobian, phi, variance, theta, memory, fresh.
    Outputs: what theta leaves of the residual; raw force, force, sigma, feedback, answered (2,); memory.
    """
    parts = ((n, 1), (2, n), (n, 2 * k + 1), (n, 1), (2 * k + 1, 1))
    given = [_matrix(f"given{i}", *shape) for i, shape in enumerate(parts)]
    residual, jacobian, phi, variance, theta = (pair[1] for pair in given)
    fresh = ca.SX.sym("fresh")
    m = Memory("memory", **dict.fromkeys(("middle", "seen", *_KALMAN, *_FEEDBACK), (2, 1)))
    left = residual - phi @ theta
    weighted = jacobian / ca.repmat(variance.T, 2, 1)
    a, b = weighted @ jacobian.T, weighted @ left
    determinant = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    raw = ca.vertcat(a[1, 1] * b[0] - a[0, 1] * b[1], a[0, 0] * b[1] - a[1, 0] * b[0]) / determinant
    sigma = ca.sqrt(ca.vertcat(a[1, 1], a[0, 0]) / determinant)
    force = _smooth(m, raw, fresh, s, dt)
    late = _steady(m, raw, fresh, feedback, dt)
    power = ca.sumsqr(late / (s.doubted * sigma)) ** 2
    inputs = [*(pair[0] for pair in given), m.symbol, fresh]
    return _function("weigh", inputs, [left, raw, force, sigma, late, late * (power / (1.0 + power)), m.after()])


_KALMAN, _FEEDBACK = ("force", "slope", "once", "twice"), ("late", "late_slope")


def _damped(m: Memory, x: Expression, fresh: Expression, share: float) -> Expression:
    """`CriticallyDamped`."""
    middle, value = (ca.if_else(fresh > 0, x, m[part]) for part in ("middle", "value"))
    middle = middle + share * (x - middle)
    value = value + share * (middle - value)
    m["middle"], m["value"] = middle, value
    return value


def _variance(c: Cylinders, s: ForceSettings, arms: Expression, rate: Expression, sliding: Expression) -> Expression:
    noise = np.square(np.array(s.row_noise))
    if not s.weighted:
        return ca.SX(np.full(len(noise), noise.mean()))
    share = ca.if_else(sliding, ca.exp(-((rate / s.stiction_speed) ** 2)), 1.0)
    return ca.DM(noise) + (arms**2).T @ ((ca.DM(c.coulomb_friction) * share) ** 2)


def _smooth(m: Memory, raw: Expression, fresh: Expression, s: ForceSettings, dt: float) -> Expression:
    """`Undamped`, then `ImpulseFilter.step` and `ahead`."""
    if s.force_corner is None:
        for part in ("middle", "seen", *_KALMAN):
            m[part] = m[part]
        return raw
    middle, seen = (ca.if_else(fresh > 0, raw, m[part]) for part in ("middle", "seen"))
    inverse = 1.0 / share_of(s.corner, dt)
    now = seen + inverse * (raw - seen)
    taken = middle + inverse * (now - middle)
    m["middle"], m["seen"] = now, raw
    before, (slope, once, twice) = (
        ca.if_else(fresh > 0, raw, m["force"]), (ca.if_else(fresh > 0, 0.0, m[part]) for part in _KALMAN[1:])
    )  # fmt: skip
    to_twice, to_once, to_force, to_slope = (float(g) for g in dt * gains(s.force_corner))
    left = taken - before
    error = twice + dt * once + (0.5 * dt * dt) * left
    m["once"], m["twice"] = once + dt * left - to_once * error, error - to_twice * error
    force, m["slope"] = before + dt * slope + to_force * error, slope + to_slope * error
    m["force"] = force
    return force + (slope + to_slope * error) / (np.pi * s.sensor_corner)


def _steady(m: Memory, raw: Expression, fresh: Expression, gain: Gain, dt: float) -> Expression:
    """`SteadyWrenchFilter`."""
    slope = ca.if_else(fresh > 0, 0.0, m["late_slope"])
    value = ca.if_else(fresh > 0, raw, m["late"]) + dt * slope
    error = raw - value
    m["late"], m["late_slope"] = value + ca.DM(gain.value) * error, slope + ca.DM(gain.slope) * error
    return value + ca.DM(gain.value) * error


def _matrix(name: str, rows: int, columns: int) -> tuple[Expression, Expression]:
    symbol = ca.SX.sym(name, columns, rows)
    return symbol, symbol.T


def _function(name: str, inputs: list[Any], outputs: list[Any]) -> ca.Function:
    return ca.Function(name, inputs, ca.cse([ca.densify(x.T) for x in outputs]))
