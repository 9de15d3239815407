r"""The force estimate of one trial, as two casadi functions. Equations and names in `momentum`.

    look:  sensors and terms -> what passed L: residual, J, phi; which pistons slide; the residuals' variances
    weigh: these and theta   -> force, sigma, and the filters behind

Identification comes between the two. Numbers of the settings are written into the code; the memory is a row of numbers.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from skillframe.machine.force.damped import damped, share_of, undamped
from skillframe.machine.force.impulse import Impulse, sampled_gains
from skillframe.machine.force.momentum import (
    ForceSettings,
    force_from_residual,
    hidden_friction,
    slid_since,
    sliding_push,
    standing_out,
    unaccounted,
)
from skillframe.machine.law.vdc_actuator import Cylinders
from skillframe.robot.symbolic import Expression
from skillframe.signals.kalman import Gain, steady_step


class Memory:
    """A row of numbers as named parts: symbols to read, and expressions to write. Rows by rows, as numpy has them.

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
    c = Cylinders(**{name: ca.DM(getattr(c, name)) for name in Cylinders.__dataclass_fields__})
    push = sliding_push(c, (v["p_a"], v["p_b"]), shape, v["piston_rate"])
    momentum, known = v["mass"] @ v["rate"], v["arms"].T @ push + v["drift"] - v["gravity"]
    left = unaccounted(momentum, ca.if_else(fresh > 0, momentum, m["momentum"]), known, dt)
    spread = v["arms"].T
    columns = ca.horzcat(
        left, v["jacobian"].T, -spread * ca.repmat(shape.T, n, 1), -spread * ca.repmat(v["piston_rate"].T, n, 1),
        -v["load"],
    )  # fmt: skip
    columns = _damped(m, columns, fresh, share_of(s.corner, dt))
    since = slid_since(m["since"], rate, before, s, dt)
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
    explained = force_from_residual(jacobian[0, :].T, jacobian[1, :].T, left, variance)
    raw, sigma = ca.vertcat(*explained[:2]), ca.sqrt(ca.vertcat(*explained[2:]))
    force = _smooth(m, raw, fresh, s, dt)
    late = _steady(m, raw, fresh, feedback, dt)
    answered = standing_out(late, sigma, s.doubted)
    inputs = [*(pair[0] for pair in given), m.symbol, fresh]
    return _function("weigh", inputs, [left, raw, force, sigma, late, answered, m.after()])


_KALMAN, _FEEDBACK = ("force", "slope", "once", "twice"), ("late", "late_slope")


def _damped(m: Memory, x: Expression, fresh: Expression, share: float) -> Expression:
    """L, a column for each of what passes it."""
    middle, value = (ca.if_else(fresh > 0, x, m[part]) for part in ("middle", "value"))
    m["middle"], m["value"] = middle, value = damped(middle, value, x, share)
    return value


def _variance(c: Cylinders, s: ForceSettings, arms: Expression, rate: Expression, sliding: Expression) -> Expression:
    noise = np.square(np.array(s.row_noise))
    if not s.weighted:
        return ca.SX(np.full(len(noise), noise.mean()))
    return ca.DM(noise) + (arms**2).T @ hidden_friction(c, rate, sliding, s) ** 2


def _smooth(m: Memory, raw: Expression, fresh: Expression, s: ForceSettings, dt: float) -> Expression:
    """The force now: L's place is taken by the impulse's filter, and the sensors' lag made up for."""
    if s.force_corner is None:
        for part in ("middle", "seen", *_KALMAN):
            m[part] = m[part]
        return raw
    middle, seen = (ca.if_else(fresh > 0, raw, m[part]) for part in ("middle", "seen"))
    now, taken = undamped(middle, seen, raw, 1.0 / share_of(s.corner, dt))
    m["middle"], m["seen"] = now, raw
    begun = Impulse(raw, *(ca.SX(0.0),) * 3)
    before = Impulse(*(ca.if_else(fresh > 0, new, m[part]) for new, part in zip(begun, _KALMAN, strict=True)))
    after = before.after(taken, dt, sampled_gains(s.force_corner, dt))
    for part, value in zip(_KALMAN, after, strict=True):
        m[part] = value
    return after.force + after.slope / (np.pi * s.sensor_corner)


def _steady(m: Memory, raw: Expression, fresh: Expression, gain: Gain, dt: float) -> Expression:
    """The feedback: the converged Kalman filter of `kalman`."""
    value, slope = ca.if_else(fresh > 0, raw, m["late"]), ca.if_else(fresh > 0, 0.0, m["late_slope"])
    m["late"], m["late_slope"] = value, slope = steady_step(value, slope, raw, Gain(*map(ca.DM, gain)), dt)
    return value


def _matrix(name: str, rows: int, columns: int) -> tuple[Expression, Expression]:
    symbol = ca.SX.sym(name, columns, rows)
    return symbol, symbol.T


def _function(name: str, inputs: list[Any], outputs: list[Any]) -> ca.Function:
    return ca.Function(name, inputs, ca.cse([ca.densify(x.T) for x in outputs]))
