r"""Balance of oil: what a chamber has taken in, by its piston and its pressure, against what its valve let through.

    V_a = A_a dx + (V/B) dp_a        over `WINDOW_S`, b alike with -A_b                                             (1)
    Q_a = c u_e sqrt(p_S - p_a)  or  c u_e sqrt(p_a - p_R),    u_e from the command across the overlap              (2)

p_S and the overlap are those that the swing has found. Between command and reading lie bus, spool and filters, so (2)
is summed for every lag in `LAGS`, and V_a must lie between the least and the largest of these, give or take
`FLOOR` A + `SHARE` (int |Q| + (V/B) |dp|). A half covers a rated flow that is meant over the whole valve (a factor of
1.41) or a bulk modulus with some air in it; the floor covers what a valve moves within a lag that is none of these, and
is wider in the swing, where supply and overlap are only being found. Our choice; docs/explanation/crane_control.md has
what sound cranes leave.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.machine.law.hydraulic import Measured, Terms
from skillframe.machine.law.vdc_actuator import Cylinders
from skillframe.machine.watch.readings import Suspicion

WINDOW, LAGS = 5, (1, 2, 3)
"""Looks that a balance spans; lags in looks, 20 to 60 ms, of which spool and filters of the shipped crane take 20."""
FLOOR, FLOOR_IN_SWING, SHARE = 5e-4, 1e-3, 0.5
"""Way of the piston [m], and share of the flow, that do not count."""
UNSURE = 1e6
"""Standard deviation of a supply pressure [Pa] above which a valve may let through anything from nothing to (2)."""
ALIKE = 0.25
"""Below this share of the other one, a way is none."""


class Knowledge(NamedTuple):
    """Of the valves (N, k): supply pressure and its standard deviation `unsure` [Pa], overlap."""

    supply: Float
    overlap: Float
    unsure: Float


class FlowWatch:
    """Balances of N machines with k cylinders.

    Args:
        cylinders: as the controller knows them; names: of them. count: N; period: [s] between two looks.
    """

    def __init__(self, cylinders: Cylinders, names: tuple[str, ...], count: int, period: float) -> None:
        self._c, self._names, self._period = cylinders, names, period
        self._area: Float = np.stack([cylinders.area_a, cylinders.area_b])[:, None]
        self._signed: Float = self._area * np.array([1.0, -1.0])[:, None, None]
        self._soft: Float = self._area / cylinders.bulk_modulus
        self._reach_b: Float = cylinders.arm_b + cylinders.stroke
        self._length = WINDOW + max(LAGS) + 1
        self._told: Float = np.zeros((self._length, 4, count, len(names)))
        self._seen: Float = np.zeros((self._length, 3, count, len(names)))
        self._looks = 0
        self._vague: NDArray[np.int64] = np.zeros((count, len(names)), dtype=np.int64)
        """Looks for which what the valves let through is not known from below, (N, k)."""

    def look(self, valve: Float, seen: Measured, terms: Terms, knowledge: Knowledge, swing: bool) -> list[Suspicion]:
        """Judge the balances.

        Args:
            valve: (N, k) mean command since the last look.
            seen: readings.
            terms: where the pistons are.
            knowledge: of the valves.
            swing: before the skill starts.
        """
        pressures = np.stack([seen.pressure_a, seen.pressure_b])
        now, before = self._looks % self._length, (self._looks - 1) % self._length
        self._flows(valve, pressures, knowledge.supply, knowledge.overlap, out=self._told[now])
        self._told[now] += self._told[before]
        self._seen[now, 0], self._seen[now, 1:] = terms.piston, pressures
        self._looks += 1
        self._vague = np.where(knowledge.unsure > UNSURE, self._length, np.maximum(self._vague - 1, 0))
        return self._judge(terms.piston, swing) if self._looks >= self._length else []

    def _flows(self, valve: Float, pressures: Float, supply: Float, overlap: Float, out: Float) -> None:
        """(2) over a period: volumes (2, N, k) into both chambers, and their sizes."""
        c, extends = self._c, valve > 0.0
        size = np.abs(valve)
        opening = np.minimum(np.maximum(size - overlap, 0.0) / (1.0 - overlap), 1.0)
        drains = pressures - c.return_pressure
        drop = np.where(np.stack([extends, ~extends]), pressures - supply, drains)
        np.multiply(-self._period * c.edge * opening, np.copysign(np.sqrt(np.abs(drop)), drop), out=out[:2])
        np.abs(out[:2], out=out[2:])

    def _back(self, looks: int) -> int:
        return (self._looks - 1 - looks) % self._length

    def _told_at(self, lag: int) -> Float:
        """(4, N, k) volumes that a balance would have, if the readings lagged so: into both chambers, and sizes."""
        told: Float = self._told[self._back(lag)] - self._told[self._back(lag + WINDOW)]
        return told

    def _judge(self, piston: Float, swing: bool) -> list[Suspicion]:
        gone, c = self._seen[self._back(0)] - self._seen[self._back(WINDOW)], self._c
        soft = self._soft * np.stack([c.arm_a + piston, self._reach_b - piston])
        squeezed = soft * gone[1:]
        taken = self._signed * gone[0] + squeezed
        spare = self._area * (FLOOR_IN_SWING if swing else FLOOR) + SHARE * np.abs(squeezed)
        told = self._told_at(LAGS[0])
        if (np.abs(taken - told[:2]) <= spare + SHARE * told[2:]).all():  # the usual lag explains all, so more lags do
            return []
        every = np.stack([self._told_at(lag) for lag in LAGS])
        low, high, most = every[:, :2].min(axis=0), every[:, :2].max(axis=0), every[:, 2:].max(axis=0)
        vague = self._vague > 0  # a supply that may be so much lower, or was taken for higher, may feed nothing
        meant = np.clip(taken, np.where(vague, np.minimum(low, 0.0), low), np.where(vague, np.maximum(high, 0.0), high))
        beyond = np.abs(taken - meant) > spare + SHARE * most
        return [
            self._finding(int(i), int(k), gone[0, i, k], taken[:, i, k], meant[:, i, k], beyond[:, i, k])
            for i, k in np.argwhere(beyond.any(axis=0))
        ]

    def _finding(self, i: int, k: int, x: float, taken: Float, meant: Float, beyond: NDArray[np.bool_]) -> Suspicion:
        """What a balance that does not close looks like: a valve, if both chambers err as one spool makes them."""
        name, span, areas = self._names[k], WINDOW * self._period, self._area[:, 0, k]
        way = float(meant[0] / areas[0] if abs(meant[0]) > abs(meant[1]) else -meant[1] / areas[1])
        off = taken - meant
        if beyond.all() and off[0] * off[1] < 0.0:
            if abs(x) <= ALIKE * abs(way):
                text = f"is told {1e3 * way:.1f} mm in {span:.2g} s, and the piston does not move"
                return Suspicion(i, False, f"watchdog: the valve of {name} {text}")
            if abs(way) <= ALIKE * abs(x):
                text = f"moves {1e3 * x:.1f} mm in {span:.2g} s, and its valve is not told to"
                return Suspicion(i, False, f"watchdog: the piston of {name} {text}")
        sides = [
            f"chamber {side} {1e6 * abs(lost):.0f} cm3 {'more' if lost > 0.0 else 'less'}"
            for side, lost, far in zip("ab", off.tolist(), beyond.tolist(), strict=True) if far
        ]  # fmt: skip
        text = f"in {span:.2g} s {' and '.join(sides)} than its valve let through"
        return Suspicion(i, False, f"watchdog: the oil of {name} does not balance: {text}")
