r"""The force estimate of one trial, as two casadi functions. Equations and names are those of `momentum`.

    look:  sensors and terms -> filtered by L: residual, J, phi; sliding pistons; the residuals' variances
    weigh: these and theta   -> force, sigma, and the later filters

Identification is between the two. Settings are constants of the code.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from skillframe.signals import Gain, steady_step
from skillframe_hydraulics.force.damped import damped, share_of, undamped
from skillframe_hydraulics.force.impulse import Impulse, sampled_gains
from skillframe_hydraulics.force.momentum import (
    ForceSettings,
    force_from_residual,
    hidden_friction,
    slid_since,
    sliding_push,
    standing_out,
    unaccounted,
)
from skillframe_hydraulics.law.generated import dense_function, matrix_symbol
from skillframe_hydraulics.law.symbolic_chain import Expression
from skillframe_hydraulics.law.vdc_actuator import CYLINDER, Cylinders

_KALMAN = ("force", "slope", "once", "twice")


class Memory:
    """A vector of named matrices, row by row as in numpy: symbols to read, expressions to write."""

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
        """The next value (size,)."""
        parts = [ca.reshape(ca.densify(self._next[part]).T, -1, 1) for part in self._shapes]
        return ca.vertcat(*parts)


def look_function(c: Cylinders, s: ForceSettings, n: int, components: int, dt: float) -> ca.Function:
    """From a sample to the residual.

    Inputs: rate, pressure_a, pressure_b, mass, drift, gravity, jacobian, arms, piston_rate, load, memory, fresh.
    Outputs: filtered residual, J (m, n) and phi; `Estimate.level` (n,); the residual's variance (n,); memory. m is the
    number of components.
    """
    k = len(c.area_a)
    shapes = {
        "rate": (n, 1), "p_a": (k, 1), "p_b": (k, 1), "mass": (n, n), "drift": (n, 1), "gravity": (n, 1),
        "jacobian": (components, n), "arms": (k, n), "piston_rate": (k, 1), "load": (n, 1),
    }  # fmt: skip
    given = {name: matrix_symbol(name, *shape) for name, shape in shapes.items()}
    v = {name: pair[1] for name, pair in given.items()}
    fresh, width = ca.SX.sym("fresh"), 2 * k + 2 + components
    m = Memory("memory", rate=(k, 1), since=(k, 1), momentum=(n, 1), middle=(n, width), value=(n, width))
    before = m["rate"]
    rate = before + float(-np.expm1(-2.0 * np.pi * s.rate_corner * dt)) * (v["piston_rate"] - before)
    shape = ca.tanh(rate / s.sliding_speed)
    c = Cylinders(**{name: ca.DM(getattr(c, name)) for name in CYLINDER})
    push = sliding_push(c, (v["p_a"], v["p_b"]), shape, v["piston_rate"])
    momentum, known = v["mass"] @ v["rate"], v["arms"].T @ push + v["drift"] - v["gravity"]
    left = unaccounted(momentum, ca.if_else(fresh > 0, momentum, m["momentum"]), known, dt)
    spread = v["arms"].T
    columns = ca.horzcat(
        left, v["jacobian"].T, -spread * ca.repmat(shape.T, n, 1), -spread * ca.repmat(v["piston_rate"].T, n, 1),
        -v["load"],
    )  # fmt: skip
    middle, value = (ca.if_else(fresh > 0, columns, m[part]) for part in ("middle", "value"))
    m["middle"], m["value"] = middle, columns = damped(middle, value, columns, share_of(s.corner, dt))
    since = slid_since(m["since"], rate, before, s, dt)
    sliding = since >= s.settle
    m["rate"], m["since"], m["momentum"] = rate, since, momentum
    level = sum(
        (ca.fabs(v["arms"]).T @ (since < long)) == 0.0 for long in (s.settle, s.settle + s.memory)
    )  # no piston that moves it stands
    noise = np.square(np.array(s.row_noise))
    variance = (
        ca.DM(noise) + (v["arms"] ** 2).T @ hidden_friction(c, rate, sliding, s) ** 2
        if s.weighted
        else ca.SX(np.full(len(noise), noise.mean()))
    )
    outputs = (columns[:, 0], columns[:, 1 : 1 + components].T, columns[:, 1 + components :], level, variance)
    inputs = [*(pair[0] for pair in given.values()), m.symbol, fresh]
    return dense_function("look", inputs, [*outputs, m.after()])


def weigh_function(s: ForceSettings, n: int, k: int, feedback: Gain, dt: float) -> ca.Function:
    """From the residual to the force.

    Inputs: residual, jacobian, phi, variance, theta, memory, fresh.
    Outputs: residual without theta; raw force, force, sigma, feedback, answered (m,); memory.
    """
    components = len(feedback.value)
    parts = ((n, 1), (components, n), (n, 2 * k + 1), (n, 1), (2 * k + 1, 1))
    given = [matrix_symbol(f"given{i}", *shape) for i, shape in enumerate(parts)]
    residual, jacobian, phi, variance, theta = (pair[1] for pair in given)
    fresh = ca.SX.sym("fresh")
    m = Memory("memory", **dict.fromkeys(("middle", "seen", *_KALMAN, "late", "late_slope"), (components, 1)))
    left = residual - phi @ theta
    raw, square = force_from_residual(jacobian, left, variance)
    sigma = ca.sqrt(square)
    if s.force_corner is None:
        force = raw
        for part in ("middle", "seen", *_KALMAN):
            m[part] = m[part]
    else:  # the impulse's filter in place of L, with the sensors' lag compensated
        middle, seen = (ca.if_else(fresh > 0, raw, m[part]) for part in ("middle", "seen"))
        now, taken = undamped(middle, seen, raw, 1.0 / share_of(s.corner, dt))
        m["middle"], m["seen"] = now, raw
        begun = Impulse(raw, *(ca.SX(0.0),) * 3)
        before = Impulse(*(ca.if_else(fresh > 0, new, m[part]) for new, part in zip(begun, _KALMAN, strict=True)))
        after = before.after(taken, dt, sampled_gains(s.force_corner, dt))
        for part, value in zip(_KALMAN, after, strict=True):
            m[part] = value
        force = after.force + after.slope / (np.pi * s.sensor_corner)
    late, slope = ca.if_else(fresh > 0, raw, m["late"]), ca.if_else(fresh > 0, 0.0, m["late_slope"])
    m["late"], m["late_slope"] = late, slope = steady_step(late, slope, raw, Gain(*map(ca.DM, feedback)), dt)
    answered = standing_out(late, sigma, s.doubted)
    inputs = [*(pair[0] for pair in given), m.symbol, fresh]
    return dense_function("weigh", inputs, [left, raw, force, sigma, late, answered, m.after()])
