r"""The hydraulic cylinder in numpy: stand-in where there is no compiler, and a second opinion on the C source.

Same interface and equations as the FMU (`equations`). Pressures and spool go by the classical Runge-Kutta rule with
internal steps \(h \lambda \le 1/2\), \(\lambda\) an upper bound of the oil's fastest rate (Gershgorin, from the edges'
slope at the least pressure drop seen); the seals' state by its exact solution (Dahl); impulse and work by the
corrected trapezoidal rule.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from skillframe.actuation import equations as eq
from skillframe.actuation.actuator import DISCARD, OK, OUTPUTS, ActuatorSpec, Capabilities, Float
from skillframe.actuation.table import Table, rows
from skillframe.actuation.wiring import columns
from skillframe.errors import InputError, UnknownName

MOST_SUBSTEPS = 400


class ReferenceBank:
    """A bank of hydraulic cylinders in numpy (see `Actuators`).

    Args:
        specs: the robot's actuators, all of them "hydraulic_cylinder"; table: of fmus/hydraulic_cylinder.
        trials: each trial gets its own cylinders, trial by trial.
    """

    def __init__(self, specs: Sequence[ActuatorSpec], table: Table, trials: int = 1) -> None:
        self.inputs, self.outputs = columns(specs)
        self.count = trials * len(specs)
        self.u = np.zeros((self.count, len(self.inputs)))
        self.y = np.full((self.count, len(self.outputs)), np.nan)
        self.active, self.status = np.ones(self.count, np.uint8), np.zeros(self.count, np.int64)
        self.notes: tuple[str, ...] = (
            "no C compiler: hydraulic_cylinder runs as its Python reference, the same equations in numpy, a hundred"
            " times slower for one trial (pip install ziglang is one way to get a compiler)",
        )
        self._specs = [specs[i % len(specs)] for i in range(self.count)]
        self._defaults = {row.name: row.entry.start for row in rows(table) if row.causality == "parameter"}
        self._input_defaults = {row.name: row.entry.start for row in rows(table) if row.causality == "input"}
        self._known_outputs = {row.name for row in rows(table) if row.causality == "output"}
        self._check_names()
        self._problems: dict[int, str] = {}
        self._p = SimpleNamespace()
        self._state = np.zeros((6, self.count))
        self._command = np.zeros((3, self.count))  # target, demand now, and nothing yet
        self._step_values = np.zeros((2, self.count))  # mean force, work of the last step

    def _check_names(self) -> None:
        for spec in self._specs:
            for name in spec.inputs.values():
                if name not in self._input_defaults:
                    raise UnknownName("input of hydraulic_cylinder", name, self._input_defaults)
            for name in spec.outputs.values():
                if name not in self._known_outputs:
                    raise UnknownName("output of hydraulic_cylinder", name, self._known_outputs)

    def start(self, time: float = 0.0, parameters: Sequence[Mapping[str, Any]] | None = None) -> None:
        """Initialise every cylinder in static equilibrium at `u`; see `Actuators`.

        Raises:
            UnknownName, InputError: a parameter that is not there, or is no number.
        """
        self.active[:] = 1
        self._problems.clear()
        chosen = [{**spec.parameters, **(parameters[i] if parameters else {})} for i, spec in enumerate(self._specs)]
        for i, values in enumerate(chosen):
            self._check_parameters(i, values)
        columns_of = {
            name: np.array([float(values.get(name, default)) for values in chosen])
            for name, default in self._defaults.items()
        }
        self._p = eq.derive(columns_of)
        command = self._input("command")
        self._state = eq.equilibrium(self._p, command)
        self._command = np.stack([np.clip(command, -1, 1)] * 2)
        self._step_values[:] = 0.0
        self._write(self._input("position"), self._input("velocity"))
        self._step_values[0] = self.y[:, self.outputs.index("force")]
        self._write(self._input("position"), self._input("velocity"))

    def _check_parameters(self, index: int, values: Mapping[str, Any]) -> None:
        for name, value in values.items():
            if name not in self._defaults:
                raise UnknownName("parameter of hydraulic_cylinder", name, self._defaults)
            if not isinstance(value, bool | int | float):
                raise InputError(
                    f"{self._specs[index].name}: {name}", f"expected a number, got {value!r}", "correct it"
                )

    def _input(self, theirs: str) -> Float:
        """Present values of one of the cylinder's inputs; what is not mapped keeps its start value."""
        values = np.full(self.count, float(self._input_defaults[theirs]))
        for i, spec in enumerate(self._specs):
            ours = next((o for o, t in spec.inputs.items() if t == theirs), theirs if not spec.inputs else None)
            if ours in self.inputs:
                values[i] = self.u[i, self.inputs.index(ours)]
        return values

    def step(self, time: float, step: float) -> bool:
        """Advance from `time` by `step` [s] with inputs `u`; True if every active cylinder went well."""
        x, v, a = self._input("position"), self._input("velocity"), self._input("acceleration")
        y = self._advance(x, v, a, step)
        bad = ~np.isfinite(y).all(axis=0) & (self.active > 0)
        keep = (self.active > 0) & ~bad
        self._state[:, keep] = y[:, keep]
        self._write(x + step * (v + 0.5 * a * step), v + a * step)
        self.status[:] = np.where(bad, DISCARD, OK)
        for i in np.flatnonzero(bad):
            self._problems[int(i)] = f"{self._specs[i].name}: no finite pressures at {time:.6g} s; check its inputs"
        return not bad.any()

    def _advance(self, x: Float, v: Float, a: Float, step: float) -> Float:
        half = 0.5 * self._p.hysteresis
        u = np.clip(self._input("command"), -1.0, 1.0)
        target, demand = np.clip(self._command[0], u - half, u + half), self._command[1]
        other = self._input("other_flow")

        def followed(t: float) -> Float:
            way = target - demand
            limit = np.where(self._p.spool_slew > 0, self._p.spool_slew * t, np.inf)
            result: Float = demand + np.clip(way, -limit, limit)
            return result

        def motion(t: float) -> eq.Motion:
            return eq.Motion(x + t * (v + 0.5 * a * t), v + a * t, followed(t), other)

        with np.errstate(all="ignore"):
            y = self._integrate(motion, a, step)
        self._command = np.stack([target, followed(step)])
        return y

    def _substeps(self, y: Float, motion: eq.Motion, step: float, rates: Float) -> int:
        """How many internal steps keep every cylinder's h lambda below one half; `rates` now, to see ports open."""
        p, soon = self._p, 2.0 * step * np.abs(rates[2:4])
        drops = [np.abs(y[4] - y[2]), np.abs(y[4] - y[3]), np.abs(y[2] - p.return_pressure)]
        drops.append(np.abs(y[3] - p.return_pressure))
        least = np.minimum.reduce(drops) + p.laminar_pressure
        opening = np.maximum(np.abs(eq.opening(y[0], p.deadband)), np.abs(eq.opening(motion.demand, p.deadband)))
        slope = p.edge * opening / np.sqrt(least) + p.leakage
        slope = slope + np.where((y[2:4] - soon < p.return_pressure).any(0), p.check_conductance, 0.0)
        slope = slope + np.where((y[2:4] + soon > p.relief_pressure).any(0), p.relief_conductance, 0.0)
        smallest = np.minimum(
            p.dead_volume_a + p.area_a * motion.position, p.dead_volume_b + p.area_b * (p.stroke - motion.position)
        )
        rate = p.bulk_modulus / smallest * slope + np.where(p.pump_flow > 0, _supply_rate(p), 0.0)
        worst = float(np.max(np.where((self.active > 0) & np.isfinite(rate), rate, 0.0)))
        return int(min(max(np.ceil(step * 2.0 * max(worst, 500.0)), 1), MOST_SUBSTEPS))

    def _integrate(self, motion: Any, a: Float, step: float) -> Float:
        p, y, totals = self._p, self._state.copy(), np.zeros((2, self.count))
        here = motion(0.0)
        k1 = eq.rates(p, y, here)
        count = self._substeps(y, here, step, k1)
        h = step / count
        push = self._push(y, k1, here, a)
        for j in range(count):
            middle, there = motion((j + 0.5) * h), motion((j + 1) * h)
            k2 = eq.rates(p, y + 0.5 * h * k1, middle)
            k3 = eq.rates(p, y + 0.5 * h * k2, middle)
            k4 = eq.rates(p, y + h * k3, there)
            seals = _slide(p, y[5], here.velocity, a, h)
            y = y + h / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)
            y[5] = seals.z
            totals -= p.stiffness * np.stack([seals.integral, seals.work])
            k1 = eq.rates(p, y, there)
            after = self._push(y, k1, there, a)
            totals += 0.5 * h * (push[0] + after[0]) + h * h / 12.0 * (push[1] - after[1])
            push, here = after, there
        self._step_values = np.stack([totals[0] / step, totals[1]])
        return y

    def _push(self, y: Float, rates: Float, motion: eq.Motion, a: Float) -> tuple[Float, Float]:
        """(force, force x velocity) without the seals' deflection, and their rates, for the quadrature."""
        p, v = self._p, motion.velocity
        force = eq.piston_force(p, y, motion.position, v) + p.stiffness * y[5]
        rate = p.area_a * rates[2] - p.area_b * rates[3] - p.viscous_friction * a
        return np.stack([force, force * v]), np.stack([rate, rate * v + force * a])

    def _write(self, position: Float, velocity: Float) -> None:
        p, y = self._p, self._state
        flows = eq.valve_flows(p, y[0], y[2], y[3], y[4], position)
        values = {
            "force": eq.piston_force(p, y, position, velocity), "force_mean": self._step_values[0],
            "work": self._step_values[1], "pressure_a": y[2], "pressure_b": y[3], "flow_a": flows.a,
            "flow_b": flows.b, "spool": y[0], "pressure_supply": y[4], "flow_supply": flows.supply,
            "friction": eq.friction_force(p, y[5], velocity),
        }  # fmt: skip
        for i, spec in enumerate(self._specs):
            for ours, theirs in (spec.outputs or {n: n for n in OUTPUTS}).items():
                self.y[i, self.outputs.index(ours)] = values[theirs][i]

    def refresh(self) -> bool:
        """Outputs at the present inputs; no time passes."""
        self._write(self._input("position"), self._input("velocity"))
        return True

    def save(self) -> None:
        """Remember every cylinder's state."""
        self._saved = (self._state.copy(), self._command.copy(), self._step_values.copy())

    def restore(self) -> None:
        """Return to the last `save`."""
        self._state, self._command, self._step_values = (part.copy() for part in self._saved)
        self._problems.clear()

    def capabilities(self, index: int) -> Capabilities:
        """Everything."""
        return Capabilities(True, True, True, True, True, True)

    def problem(self, index: int) -> str:
        """Why a cylinder failed, one sentence; empty if it did not."""
        return self._problems.get(index, "")

    def close(self) -> None:
        """Nothing to free."""


def _supply_rate(p: SimpleNamespace) -> Float:
    result: Float = p.bulk_modulus / p.supply_volume * (p.pump_slope + p.edge / np.sqrt(p.laminar_pressure))
    return result


class _Slide(NamedTuple):
    """Deflection of the seals after a step, its integral over time, and over the path."""

    z: Float
    integral: Float
    work: Float


def _slide(p: SimpleNamespace, z: Float, v: Float, a: Float, h: float) -> _Slide:
    """The seals over h, exactly for Coulomb friction, in two parts where the piston reverses."""
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = np.where(v * (v + a * h) < 0, -v / a, h)
    integral, work = np.zeros_like(z), np.zeros_like(z)
    for start, length in ((np.zeros_like(turn), turn), (turn, h - turn)):
        mean = v + a * (start + 0.5 * length)
        limit = eq.sliding_deflection(p, mean)
        goal, way = np.where(mean < 0, -limit, limit), np.abs(mean) * length / limit
        fade = np.expm1(-way)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(way > 1e-6, -fade / way, 1.0 - 0.5 * way)
        after = z - (goal - z) * fade
        integral = integral + length * (goal + (z - goal) * share)
        work = work + goal * (mean * length - (after - z))
        z = after
    return _Slide(z, integral, work)
