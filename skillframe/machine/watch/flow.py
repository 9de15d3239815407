r"""Balance of oil: what a chamber has taken in, by its piston and its pressure, against what its valve let through.

    V_a = A_a dx + (V/B) dp_a        over `WINDOW_S`, b alike with -A_b                                             (1)
    Q_a = c u_e sqrt(p_S - p_a)  or  c u_e sqrt(p_a - p_R),    u_e from the command across the overlap              (2)

p_S and the overlap are those that the swing has found. Between command and reading lie bus, spool and filters, so (2)
is summed for every lag in `LAGS`. A cylinder that pulls as hard as it can has almost no drop left across its valve, and
there (2) says little: the supply is known to `SPREAD` standard deviations, and below `laminar_pressure` p_l an edge may
be laminar, down to dp / (dp^2 + p_l^2)^(1/4) for the root. So (2) is an interval, from the laminar edge under the lower
supply to the root under the higher one, and V_a must lie between the least and the largest of all these, give or take
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

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from skillframe.either import copysign, maximum, minimum
from skillframe.frames import Float
from skillframe.machine.force.valve import ValveIdentification
from skillframe.machine.law.generated import Batch
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
"""Standard deviations of supply and overlap; of a spool that is elsewhere: way [m], share of the flow, lags."""


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
    spread = SPREAD * np.hypot(valves.overlap_deviation, valves.overlap_oil)
    least, most = np.maximum(valves.overlap - spread, 0.0), np.minimum(valves.overlap + spread, 0.5)
    unsure = np.maximum(np.hypot(valves.supply_deviation, valves.supply_oil), valves.supply_moved)
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
        self._names, self._period, k = names, period, len(names)
        self._area: Float = np.stack([cylinders.area_a, cylinders.area_b])[:, None]
        self._length = WINDOW + max(LAGS) + 1
        self._blur = SURE * np.sqrt(2.0) * noise
        self._told: Float = np.zeros((count, self._length, 10, k))
        """Sums of (2) in all looks so far, into both chambers: sizes of the volumes, their two ends, and both ends for
        the likely overlaps. The latest look is the first row."""
        self._seen: Float = np.zeros((count, self._length, 3, k))
        """Pistons and both pressures, likewise."""
        self._given = [np.zeros((count, k)) for _ in range(12)]
        self._taken, self._squeezed = (np.zeros((count, 2, k)) for _ in range(2))
        self._explained, self._everyone = np.zeros((count, 2)), np.arange(count)
        inputs = [*self._given, self._told, self._seen]
        after = [np.zeros_like(self._told), np.zeros_like(self._seen)]
        self._balance = Batch(
            balance_function(cylinders, period), inputs, [*after, self._taken, self._squeezed, self._explained],
            carried={0: len(inputs) - 2, 1: len(inputs) - 1},
        )  # fmt: skip
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
        blur = self._blur * np.sqrt(np.vecdot(terms.arms, terms.arms))
        given = (valve, *seen[2:4], terms.piston, *knowledge, FLOOR_IN_SWING if swing else FLOOR, SPOOL_FLOOR + blur)
        for own, value in zip(self._given, given, strict=True):
            own[...] = value
        self._balance.run(self._everyone)
        self._looks += 1
        self._vague = np.where(knowledge.unsure > UNSURE, self._length, np.maximum(self._vague - 1, 0))
        self._running = 0 if swing else self._running + 1
        closed, placed = (np.count_nonzero(self._explained[:, i]) == len(self._explained) for i in range(2))
        if self._looks < self._length:
            return []
        found = [] if closed else self._judge()
        return found if placed or self._running < self._length else found + self._judge_spools()

    def _told_at(self, lag: int) -> Float:
        """(10, N, k) volumes that a balance would have, if the readings lagged so, in the order of `_told`."""
        told: Float = self._told[:, lag] - self._told[:, lag + WINDOW]
        return told.swapaxes(0, 1)

    def _judge(self) -> list[Suspicion]:
        """Balances that no lag explains."""
        taken, squeezed = self._taken.swapaxes(0, 1), self._squeezed.swapaxes(0, 1)
        spare = self._area * self._given[_FLOOR] + SHARE * np.abs(squeezed)
        every = np.stack([self._told_at(lag) for lag in LAGS])
        ends, most = every[:, 2:6].reshape(-1, *taken.shape), every[:, :2].max(axis=0)
        low, high = ends.min(axis=0), ends.max(axis=0)
        vague = self._vague > 0  # a supply that may be so much lower, or was taken for higher, may feed nothing
        meant = np.clip(taken, np.where(vague, np.minimum(low, 0.0), low), np.where(vague, np.maximum(high, 0.0), high))
        beyond = np.abs(taken - meant) > spare + SHARE * most
        return [
            self._finding(int(i), int(k), taken[:, i, k], meant[:, i, k], beyond[:, i, k])
            for i, k in np.argwhere(beyond.any(axis=0))
        ]

    def _judge_spools(self) -> list[Suspicion]:
        """Spools that are not where they were told."""
        taken, squeezed = self._taken.swapaxes(0, 1), self._squeezed.swapaxes(0, 1)
        spare = self._area * self._given[_SPOOL_FLOOR] + SHARE * np.abs(squeezed)
        every = np.concatenate([self._told_at(lag)[6:].reshape(2, *taken.shape) for lag in EVERY_LAG])
        low, high = every.min(axis=0), every.max(axis=0)
        meant = np.clip(taken, low, high)
        off = taken - meant
        beyond = np.abs(off) > spare + SPOOL_SHARE * np.maximum(np.abs(low), np.abs(high))
        wrong = beyond.all(axis=0) & (off[0] * off[1] < 0.0) & (self._vague == 0)
        return [
            self._finding(int(i), int(k), taken[:, i, k], meant[:, i, k], beyond[:, i, k], spool=True)
            for i, k in np.argwhere(wrong)
        ]

    def _gone(self, i: int, k: int) -> Float:
        """What a piston has moved by over the window [m]."""
        gone: Float = self._seen[i, 0, 0, k] - self._seen[i, WINDOW, 0, k]
        return gone

    def _finding(
        self, i: int, k: int, taken: Float, meant: Float, beyond: NDArray[np.bool_], spool: bool = False
    ) -> Suspicion:
        """What a balance that does not close looks like: a valve, if both chambers err as one spool makes them."""
        name, span, areas, x = self._names[k], WINDOW * self._period, self._area[:, 0, k], float(self._gone(i, k))
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


_FLOOR, _SPOOL_FLOOR = 10, 11
"""Which of the given arrays these are."""


def balance_function(c: Cylinders, period: float) -> ca.Function:
    """A look at one machine with k cylinders: (1), the sums of (2), and whether the usual lag explains all.

    Inputs, (k,) each: mean command since the last look, pressures a and b, piston; the fields of `Knowledge`; what does
    not count [m] of a balance, and of a spool. Then sums of (2), and readings, at the last looks, rows of k.
    Outputs: these with the new look first; what both chambers have taken in, and what of it went into compression;
    1 where all balances are explained, and 1 where all spools may be where they were told.
    """
    k, length = len(c.area_a), WINDOW + max(LAGS) + 1
    given = [ca.SX.sym(f"given{i}", k) for i in range(12)]
    valve, p_a, p_b, piston, *known, floor, spool_floor = given
    sums, readings = (ca.SX.sym(name, k, length * rows) for name, rows in (("sums", 10), ("readings", 3)))
    passed = ca.horzcat(*_flows(c, period, valve, (p_a, p_b), Knowledge(*known)))
    told, seen = ca.horzcat(passed + sums[:, :10], sums[:, :-10]), ca.horzcat(piston, p_a, p_b, readings[:, :-3])
    gone = seen[:, :3] - seen[:, 3 * WINDOW : 3 * WINDOW + 3]
    lagged, begun = 10 * LAGS[0], 10 * (LAGS[0] + WINDOW)
    usual = told[:, lagged : lagged + 10] - told[:, begun : begun + 10]
    areas = ca.horzcat(c.area_a, c.area_b)
    soft = ca.horzcat(c.area_a / c.bulk_modulus, c.area_b / c.bulk_modulus)
    squeezed = soft * ca.horzcat(c.arm_a + piston, (c.arm_b + c.stroke) - piston) * gone[:, 1:]
    taken = areas * ca.horzcat(gone[:, 0], -gone[:, 0]) + squeezed
    spare, loose = (areas * ca.horzcat(way, way) + SHARE * ca.fabs(squeezed) for way in (floor, spool_floor))
    closed = ca.fabs(taken - usual[:, 4:6]) <= spare + SHARE * usual[:, :2]
    off = ca.fabs(taken - usual[:, 6:8]) > loose
    explained = ca.vertcat(ca.sum1(ca.sum2(closed)) >= 2 * k, ca.sum1(off[:, 0] * off[:, 1]) < 1)
    return ca.Function("balance", [*given, sums, readings], [told, seen, taken, squeezed, explained])


def _flows(c: Cylinders, period: float, valve: ca.SX, pressures: tuple[ca.SX, ca.SX], known: Knowledge) -> list[ca.SX]:
    """(2) over a period into both chambers: sizes, lower and upper ends, and both ends for the likely overlaps."""
    sure = known.unsure <= UNSURE
    supply = ca.if_else(sure, known.supply, maximum(known.supply, c.supply_pressure))
    spread = ca.if_else(sure, SPREAD * known.unsure, 0.0)
    ends = {
        laminar: [
            _edge(c, pressure, fills, supply - spread if laminar else supply + spread, laminar)
            for pressure, fills in zip(pressures, (valve > 0.0, valve <= 0.0), strict=True)
        ]
        for laminar in (True, False)
    }
    volumes = []
    for overlap, ratio, laminar in (
        (known.overlap, 1.0, True), (known.overlap, 1.0, False),
        (known.most, known.ratio, True), (known.least, known.ratio, False),
    ):  # fmt: skip
        opening = minimum(maximum(ca.fabs(valve) - overlap, 0.0) / (1.0 - overlap), 1.0) * ratio
        volumes += [period * c.edge * opening * each for each in ends[laminar]]
    return [*map(ca.fabs, volumes[2:4]), *volumes]


def _edge(c: Cylinders, pressure: ca.SX, fills: ca.SX, supply: ca.SX, laminar: bool) -> ca.SX:
    """Root of the drop into a chamber from the supply, or out of it [sqrt(Pa)], or what a laminar edge has for it."""
    drop = ca.if_else(fills, supply - pressure, c.return_pressure - pressure)
    if laminar:
        return drop / ca.sqrt(ca.sqrt(drop * drop + c.laminar_pressure**2))
    return copysign(ca.sqrt(ca.fabs(drop)), drop)
