r"""A pump and its line, which feed several actuators: `[supply.NAME]` of robot.toml.

For a line of volume V with oil of bulk modulus B, a pump with the time constant tau, and the actuators' flows q_i,

    V/B p_S' = Q - sum q_i(p_S) - q_R(p_S),     tau Q' = Q_w - Q,     0 <= Q <= min(Q_max, P/p_S),                  (1)
    Q_w = sum q_i + V/(2 tau B) (p_w - p_S),    p_w = p_0, or min(p_L + margin, p_0) of a load-sensing pump,        (2)

with p_L the largest pressure among the chambers that open valves feed, and a relief q_R from 1.1 p_0 on, which passes
Q_max at 1.2 p_0. The gain of (2) gives a damping ratio of 0.7 with shut valves (our choice). For open centres
Q_w = Q_max, and q_R is that of a relief from p_0 to 1.1 p_0 and of the bypass (`skillframe_hydraulics.open_centre`).

Each step H is of second order and linearly implicit, so that it settles for every V: the line's pressure p~ at its end
is predicted with the slopes s = sum dq_i/dp_S, all actuators step at (p + p~)/2, and the prediction is corrected,

    p~ = p + (Q - q - q_R) / (V/(B H) + s + s_R),
    p+ = p~ + r / (1 + (B H/V)(s + s_R)),      r = p + (B H/V) (mean of Q - q - q_R at both ends) - p~,             (3)

where flows at the end are extrapolated from (p + p~)/2 by their slopes. For a flow proportional to the pressure and
z = B H s/V, a deviation is multiplied by 1/(1 + z) - z^2/(2 (1 + z)^2) in a step, between 1 and -1/2 for all z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from skillframe.fmu import Actuators
from skillframe.frames import Float
from skillframe.robot import RobotSpec
from skillframe_hydraulics.compensation import HELD, held_pressures, sensed
from skillframe_hydraulics.declared import supplies_of
from skillframe_hydraulics.lines import Lines, lines_of
from skillframe_hydraulics.open_centre import bypass, conductance, narrowed

NEEDED_IN, NEEDED_OUT = "supply_drop", ("flow_supply", "supply_slope")
"""Input and outputs of an actuator that is fed by a declared supply."""


def needed_by_lines(spec: RobotSpec) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Inputs and outputs of an actuator that a robot's supplies need."""
    if not supplies_of(spec):
        return (), ()
    return (NEEDED_IN, *((HELD,) if lines_of(spec).compensated else ())), NEEDED_OUT


class Supplies:
    """The supplies of N machines with k actuators each.

    Call `begin` before and `end` after each step of the actuators.

    Args:
        lines: figures of L supplies. bank: the started actuators, whose `supply_drop` is written.
        nominal: (N, k) supply pressures p_0 [Pa]. deadband: (N, k) overlap of the valves. dt: step [s].

    Attributes:
        pressure: p_S (N, L) [Pa]; flow: Q (N, L) [m3/s].
        taken: sum of q_i (N, L) [m3/s]; relieved: q_R (N, L) [m3/s].
        full: (N, L) time for which the actuators took all that the pump can give [s], `first` when that began (NaN if
            never), and `lowest` pressure since [Pa]; time: [s].
        given, wasted: (N, L) energies of Q and of q_R since `start` [J].
    """

    def __init__(self, lines: Lines, bank: Actuators, nominal: Float, deadband: Float, dt: float) -> None:
        (count, k), self.lines, self.dt = nominal.shape, lines, dt
        self._bank, self._nominal, self._deadband = bank, nominal, deadband
        self._drop = bank.u[:, bank.inputs.index(NEEDED_IN)].reshape(count, k)  # a view
        columns = (*NEEDED_OUT, "spool", "pressure_a", "pressure_b")
        self._y = [bank.y[:, bank.outputs.index(name)].reshape(count, k) for name in columns]
        self._holds = lines.compensated
        if self._holds:
            self._held = bank.u[:, bank.inputs.index(HELD)].reshape(count, k)
            self._before = np.stack(self._y[2:])
            self._fixed = lines.feeds[np.isfinite(lines.keeps)].any(axis=0)
        self._rated: Float = np.max(nominal[:, None] * lines.feeds, axis=-1)
        self._open = lines.drop > 0.0
        self._opens: Float = np.where(self._open, 1.0, 1.1) * self._rated
        self._relief: Float = lines.flow / (0.1 * self._rated)
        self._centre: Float = np.where(self._open, conductance(lines.flow, np.maximum(lines.drop, 1.0)), 0.0)
        self._share: Float = lines.feeds / lines.feeds.sum(axis=-1, keepdims=True)
        self._line = np.argmax(lines.feeds, axis=0)
        self._is_fed = lines.feeds.any(axis=0)
        self._stiff: Float = dt / lines.softness
        self._lag: Float = -np.expm1(-dt / lines.response)
        borne = np.max(np.maximum(*self._y[3:])[:, None] * lines.feeds, axis=-1)
        lifted = np.minimum(borne + lines.margin, self._rated)
        self.pressure: Float = np.where(self._open, lines.outlet + lines.drop, lifted)
        self.taken, self._slope = np.zeros_like(self.pressure), np.zeros_like(self.pressure)
        self.flow: Float = np.where(self._open, lines.most(self.pressure), 0.0)
        self.relieved: Float = self._returns(self.pressure)[0]
        self.start()

    def start(self) -> None:
        """Reset the time, and how long the pumps were full."""
        self.time, self.full = 0.0, np.zeros_like(self.pressure)
        self.first, self.lowest = np.full_like(self.pressure, np.nan), np.full_like(self.pressure, np.inf)
        self.given, self.wasted = np.zeros_like(self.pressure), np.zeros_like(self.pressure)

    def at_valves(self, pressure: Float, other: Float) -> Float:
        """Pressures (N, L) of the lines at their actuators (N, k), and `other` (N, k) where none is declared."""
        return np.where(self._is_fed, pressure[:, self._line], other)

    def _holding(self, spool: Float, pressure_a: Float, pressure_b: Float) -> Float:
        """p_H (N, k) of compensated valves, for the supply at the valves."""
        at_valves, loads = self._nominal - self._drop, sensed(spool, self._deadband, pressure_a, pressure_b)
        return np.stack(held_pressures(self.lines, [*loads.T], [*at_valves.T]), axis=-1)

    def _sums(self) -> tuple[Float, Float]:
        """Flows taken from the lines at the step's end, and their slopes (N, L), p_H included."""
        fed = self.lines.feeds > 0.0  # an actuator that no line feeds may not tell its flow
        flow, steep = self._y[:2]
        if self._holds:
            governs = self._held > np.where(self._y[2] > 0.0, *self._y[3:])
            flow = flow - np.where(governs, steep * (self._holding(*self._y[2:]) - self._held), 0.0)
            steep = np.where(governs & self._fixed, 0.0, steep)
        taken, slope = (np.where(fed, each[:, None], 0.0).sum(axis=-1) for each in (flow, steep))
        return taken, slope

    def _relieves(self, pressure: Float) -> tuple[Float, Float]:
        """Relief's flow and slope (N, L)."""
        over = pressure - self._opens
        return self._relief * np.maximum(over, 0.0), np.where(over > 0.0, self._relief, 0.0)

    def _returns(self, pressure: Float) -> tuple[Float, Float]:
        """q_R and its slope (N, L) at the spools' present positions."""
        relief, slope = self._relieves(pressure)
        if not self._open.any():
            return relief, slope
        closed = np.where(self.lines.feeds > 0.0, narrowed(self._y[2][:, None], self.lines.shut[:, None]), 0.0)
        through, more = bypass(self._centre, (closed * self._share).sum(axis=-1), pressure - self.lines.outlet)
        return relief + through, slope + more

    def _wanted(self, taken: Float, pressure: Float) -> Float:
        """Q_w (N, L) within the pump's limits."""
        most = self.lines.most(pressure)
        spool, pressure_a, pressure_b = self._y[2:]
        felt = sensed(spool, self._deadband, pressure_a, pressure_b)
        largest: Float = np.max(felt[:, None] * self.lines.feeds, axis=-1)
        target = np.minimum(largest + self.lines.margin, self._rated)
        gain = 0.5 * self.lines.softness / self.lines.response
        return np.where(self._open, most, np.clip(taken + gain * (target - pressure), 0.0, most))

    def begin(self, *, lost: bool = False) -> None:
        """Predict the pressures and set the actuators' inputs, of which `lost` says that they hold a fault's loss."""
        p, (relieved, more) = self.pressure, self._returns(self.pressure)
        self._asked = self._wanted(self.taken, p)
        given = self.flow + 0.5 * self._lag * (self._asked - self.flow)  # mean of the step
        self._there: Float = p + self._stiff * (given - self.taken - relieved) / (
            1.0 + self._stiff * (self._slope + more)
        )
        self._middle: Float = 0.5 * (p + self._there)
        fallen = self._nominal - self.at_valves(self._middle, self._nominal)
        self._drop[...] = self._drop + fallen if lost else fallen
        if self._holds:
            now = np.stack(self._y[2:])
            self._held[...] = self._holding(*(now + 0.5 * (now - self._before)))  # in the middle of the step
            self._before = now

    def end(self) -> None:
        """Correct the pressures by what the actuators took."""
        lines, (taken, slope) = self.lines, self._sums()
        there, middle = self._there, self._middle
        taken_there = taken + slope * (there - middle)
        asked = 0.5 * (self._asked + self._wanted(taken_there, there))
        flow = np.clip(self.flow + self._lag * (asked - self.flow), 0.0, lines.most(there))
        relieved, more = self._returns(there)
        left = 0.5 * (self.flow + flow - self.taken - taken_there - self.relieved - relieved)
        missing = self.pressure + self._stiff * left - there
        self.pressure = there + missing / (1.0 + self._stiff * (slope + more))
        self.taken, self._slope, self.flow = taken + slope * (self.pressure - middle), slope, flow
        self.relieved = self._returns(self.pressure)[0]
        self.time += self.dt
        self.given += self.dt * self.pressure * flow
        self.wasted += self.dt * self.pressure * self.relieved
        full = np.where(self._open, self.taken, flow) >= 0.98 * lines.most(self.pressure)  # counts as full
        self.full += self.dt * full
        self.first = np.where(full & np.isnan(self.first), self.time, self.first)
        self.lowest = np.where(full, np.minimum(self.lowest, self.pressure), self.lowest)

    def said(self, trial: int) -> list[str]:
        """A sentence for each pump of a trial that was full since `start`."""
        return [
            f"supply {name}: its pump gave all it can for {self.full[trial, i]:.2f} s of {self.time:.2f} s, first at"
            f" {self.first[trial, i]:.3f} s, and its line fell to {self.lowest[trial, i] / 1e5:.0f} bar"
            for i, name in enumerate(self.lines.names)
            if self.full[trial, i] > 0.0
        ]

    def waste(self, trial: int) -> list[str]:
        """A sentence for each pump of open centres: what of its energy since `start` moved nothing."""
        return [
            f"supply {name}: {self.wasted[trial, i] / 1e3:.3g} kJ of its pump's {self.given[trial, i] / 1e3:.3g} kJ"
            " went to the return line through open centres and relief"
            for i, name in enumerate(self.lines.names)
            if self._open[i]
        ]


def trial_values(parameters: Sequence[Mapping[str, float]], name: str, known: Float, count: int) -> Float:
    """A parameter (N, k) of the trials' actuators, by default the nominal one (k,)."""
    given = [row.get(name, np.nan) for row in parameters]
    value: Float = np.array(given, dtype=float).reshape(count, -1)
    return np.where(np.isfinite(value), value, known)
