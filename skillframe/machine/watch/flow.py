r"""Balance of oil: what a chamber has taken in, by its piston and its pressure, against what its valve let through.

    V_a = A_a dx + (V/B) dp_a        over `WINDOW_S`, b alike with -A_b                                             (1)
    Q_a = c u_e sqrt(p_S - p_a)  or  c u_e sqrt(p_a - p_R),    u_e from the command across the overlap              (2)

p_S and the overlap are those that the swing has found. Between command and reading lie bus, spool and filters, so (2)
is summed for every lag in `LAGS`, and V_a must lie between the least and the largest of these, give or take
`FLOOR` A + `SHARE` (int |Q| + (V/B) |dp|). A half covers a rated flow that is meant over the whole valve (a factor of
1.41) or a bulk modulus with some air in it; the floor covers what a valve moves within a lag that is none of these, and
is wider in the swing, where supply and overlap are only being found.

A spool that is not where it was told errs in both chambers at once, in opposite senses. In a run, where the swing has
found flow, supply and overlap of every valve, such errors are judged by what is known: (2) with the rated flow that was
found, for overlaps of `SPREAD` standard deviations about the one that was found, give or take `SPOOL_FLOOR` A and
`SURE` of the encoders' noise behind their filters, and `SPOOL_SHARE` of the flow.

All figures are our choice; docs/explanation/crane_control.md has what sound cranes leave.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.machine.force.valve import ValveIdentification
from skillframe.machine.law.hydraulic import Measured, Terms
from skillframe.machine.law.hydraulic_compiled import CompiledLaw
from skillframe.machine.law.vdc_actuator import Cylinders
from skillframe.machine.watch.readings import SURE, Suspicion

WINDOW, LAGS = 5, (1, 2, 3)
"""Looks that a balance spans; lags in looks, 20 to 60 ms, of which spool and filters of the shipped crane take 20."""
FLOOR, FLOOR_IN_SWING, SHARE = 5e-4, 1e-3, 0.5
"""Way of the piston [m], and share of the flow, that do not count."""
UNSURE = 1e6
"""Standard deviation of a supply pressure, and its change from fit to fit [Pa], above which a valve may let through
anything from nothing to (2) under the nominal supply. A fit to the first half second was out by 16 bar, and sure of it.
"""
ALIKE = 0.25
"""Below this share of the other one, a way is none."""
SPREAD, SPOOL_FLOOR, SPOOL_SHARE, EVERY_LAG = 2.0, 1e-4, 0.1, (0, *LAGS)
"""Of a spool that is not where it was told: standard deviations of the overlap, way [m], share of the flow, lags."""


class Knowledge(NamedTuple):
    """Of the valves (N, k).

    Attributes:
        supply, unsure: pressure, and how unsure it is [Pa]. overlap: that the law goes by, share of the travel.
        least, most: overlaps that are likely; ratio: flow over the rated one.
    """

    supply: Float
    overlap: Float
    unsure: Float
    least: Float
    most: Float
    ratio: Float


def knowledge(law: CompiledLaw, valves: ValveIdentification) -> Knowledge:
    """What the law goes by, and how sure the swing was of it."""
    spread = SPREAD * valves.overlap_deviation
    least, most = np.maximum(valves.overlap - spread, 0.0), np.minimum(valves.overlap + spread, 0.5)
    unsure = np.maximum(valves.supply_deviation, valves.supply_moved)
    return Knowledge(law.supply, law.deadband, unsure, least, most, valves.ratio)


class FlowWatch:
    """Balances of N machines with k cylinders.

    Args:
        cylinders: as the controller knows them; names: of them. count: N; period: [s] between two looks.
        noise: standard deviation of an encoder's filtered reading [rad or m].
    """

    def __init__(
        self, cylinders: Cylinders, names: tuple[str, ...], count: int, period: float, noise: float = 0.0
    ) -> None:
        self._c, self._names, self._period = cylinders, names, period
        self._area: Float = np.stack([cylinders.area_a, cylinders.area_b])[:, None]
        self._signed: Float = self._area * np.array([1.0, -1.0])[:, None, None]
        self._soft: Float = self._area / cylinders.bulk_modulus
        self._reach_b: Float = cylinders.arm_b + cylinders.stroke
        self._length = WINDOW + max(LAGS) + 1
        self._blur = SURE * np.sqrt(2.0) * noise
        self._told: Float = np.zeros((self._length, 8, count, len(names)))
        self._seen: Float = np.zeros((self._length, 3, count, len(names)))
        self._looks, self._running = 0, 0
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
        self._flows(valve, pressures, knowledge, out=self._told[now])
        self._told[now] += self._told[before]
        self._seen[now, 0], self._seen[now, 1:] = terms.piston, pressures
        self._looks += 1
        self._vague = np.where(knowledge.unsure > UNSURE, self._length, np.maximum(self._vague - 1, 0))
        self._running = 0 if swing else self._running + 1
        if self._looks < self._length:
            return []
        taken, squeezed = self._taken(terms.piston)
        found = self._judge(taken, squeezed, swing)
        if self._running < self._length:
            return found
        blur = self._blur * np.sqrt(np.vecdot(terms.arms, terms.arms))
        return found + self._judge_spools(taken, squeezed, SPOOL_FLOOR + blur)

    def _flows(self, valve: Float, pressures: Float, known: Knowledge, out: Float) -> None:
        """(2) over a period into both chambers: volumes, their sizes, and volumes for the least and largest overlap."""
        c, extends = self._c, valve > 0.0
        overlap = np.stack([known.overlap, known.least, known.most])
        opening = np.minimum(np.maximum(np.abs(valve) - overlap, 0.0) / (1.0 - overlap), 1.0)
        opening[1:] *= known.ratio
        drains = pressures - c.return_pressure
        supply = np.where(known.unsure > UNSURE, np.maximum(known.supply, c.supply_pressure), known.supply)
        drop = np.where(np.stack([extends, ~extends]), pressures - supply, drains)
        flows = (-self._period * c.edge * opening)[:, None] * np.copysign(np.sqrt(np.abs(drop)), drop)
        out[:2], out[4:6], out[6:] = flows
        np.abs(out[:2], out=out[2:4])

    def _back(self, looks: int) -> int:
        return (self._looks - 1 - looks) % self._length

    def _told_at(self, lag: int) -> Float:
        """(8, N, k) volumes that a balance would have, if the readings lagged so, in the order of `_flows`."""
        told: Float = self._told[self._back(lag)] - self._told[self._back(lag + WINDOW)]
        return told

    def _taken(self, piston: Float) -> tuple[Float, Float]:
        """(2, N, k) what the chambers have taken in over the window by (1), and what of it went into compression."""
        gone, c = self._seen[self._back(0)] - self._seen[self._back(WINDOW)], self._c
        self._gone: Float = gone[0]
        squeezed: Float = self._soft * np.stack([c.arm_a + piston, self._reach_b - piston]) * gone[1:]
        return self._signed * gone[0] + squeezed, squeezed

    def _judge(self, taken: Float, squeezed: Float, swing: bool) -> list[Suspicion]:
        spare = self._area * (FLOOR_IN_SWING if swing else FLOOR) + SHARE * np.abs(squeezed)
        told = self._told_at(LAGS[0])
        if (np.abs(taken - told[:2]) <= spare + SHARE * told[2:4]).all():  # the usual lag explains all, so more lags do
            return []
        every = np.stack([self._told_at(lag) for lag in LAGS])
        low, high, most = every[:, :2].min(axis=0), every[:, :2].max(axis=0), every[:, 2:4].max(axis=0)
        vague = self._vague > 0  # a supply that may be so much lower, or was taken for higher, may feed nothing
        meant = np.clip(taken, np.where(vague, np.minimum(low, 0.0), low), np.where(vague, np.maximum(high, 0.0), high))
        beyond = np.abs(taken - meant) > spare + SHARE * most
        return [
            self._finding(int(i), int(k), taken[:, i, k], meant[:, i, k], beyond[:, i, k])
            for i, k in np.argwhere(beyond.any(axis=0))
        ]

    def _judge_spools(self, taken: Float, squeezed: Float, floor: Float) -> list[Suspicion]:
        """Spools that are not where they were told. The floor is (N, k) [m]."""
        spare = self._area * floor + SHARE * np.abs(squeezed)
        off = np.abs(taken - self._told_at(LAGS[0])[4:6])
        if not (off > spare).all(axis=0).any():  # one lag and one overlap explain a chamber, so more of them do
            return []
        every = np.concatenate([self._told_at(lag)[4:].reshape(2, *taken.shape) for lag in EVERY_LAG])
        low, high = every.min(axis=0), every.max(axis=0)
        meant = np.clip(taken, low, high)
        off = taken - meant
        beyond = np.abs(off) > spare + SPOOL_SHARE * np.maximum(np.abs(low), np.abs(high))
        wrong = beyond.all(axis=0) & (off[0] * off[1] < 0.0) & (self._vague == 0)
        return [
            self._finding(int(i), int(k), taken[:, i, k], meant[:, i, k], beyond[:, i, k], spool=True)
            for i, k in np.argwhere(wrong)
        ]

    def _finding(
        self, i: int, k: int, taken: Float, meant: Float, beyond: NDArray[np.bool_], spool: bool = False
    ) -> Suspicion:
        """What a balance that does not close looks like: a valve, if both chambers err as one spool makes them."""
        name, span, areas, x = self._names[k], WINDOW * self._period, self._area[:, 0, k], float(self._gone[i, k])
        way = float(meant[0] / areas[0] if abs(meant[0]) > abs(meant[1]) else -meant[1] / areas[1])
        off = taken - meant
        if beyond.all() and off[0] * off[1] < 0.0:
            if abs(x) <= ALIKE * abs(way):
                text = f"is told {1e3 * way:.1f} mm in {span:.2g} s, and the piston does not move"
                return Suspicion(i, False, f"watchdog: the valve of {name} {text}")
            if abs(way) <= ALIKE * abs(x):
                text = f"moves {1e3 * x:.1f} mm in {span:.2g} s, and its valve is not told to"
                return Suspicion(i, False, f"watchdog: the piston of {name} {text}")
        if spool:
            text = f"is told {1e3 * way:.1f} mm in {span:.2g} s, and the piston goes {1e3 * x:.1f} mm"
            return Suspicion(i, False, f"watchdog: the valve of {name} {text}")
        sides = [
            f"chamber {side} {1e6 * abs(lost):.0f} cm3 {'more' if lost > 0.0 else 'less'}"
            for side, lost, far in zip("ab", off.tolist(), beyond.tolist(), strict=True) if far
        ]  # fmt: skip
        text = f"in {span:.2g} s {' and '.join(sides)} than its valve let through"
        return Suspicion(i, False, f"watchdog: the oil of {name} does not balance: {text}")
