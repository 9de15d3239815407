r"""Fault detection of a hydraulic machine every 20 ms: impossible readings, oil balance, and motion of the tool.

**Readings.** An exactly repeated value, a jump of a joint, or a pressure below the return line's. With white noise a
few equal readings mean a stopped sensor; without noise only while the piston moves. A joint moves at most v dt between
readings, at its velocity limit v, plus a multiple of the noise sqrt(2) sigma of two readings. Without a limit v is what
its valve lets through (`valve_speeds`). Check valves hold a chamber at the return line's pressure; far below it, or
below vacuum, hose or transducer has failed.

**Oil.** Volume taken by a chamber against flow through its valve:

    V_a = A_a dx + (V/B) dp_a        over a window, b alike with -A_b                                               (1)
    Q_a = c u_e sqrt(p_S - p_a)  or  c u_e sqrt(p_a - p_R),    u_e from the command across the overlap              (2)

p_S and the overlap are identified in the swing. (2) is summed for every lag, for p_S within its uncertainty, and for a
turbulent or laminar edge: below `laminar_pressure` p_l, the root becomes dp / (dp^2 + p_l^2)^(1/4). V_a must lie
between the least and the largest of these, give or take `floor` A + `share` (int |Q| + (V/B) |dp|). The share covers a
rated flow meant over the whole valve (a factor of 1.41) or air in the oil, the floor the flow within a lag. A misplaced
spool causes opposite errors in both chambers. In a run these are checked with identified flow and overlap, give or take
`spool_floor` A, the encoders' filtered noise, and `spool_share` of the flow.

**Tool.** Speed and path against the controller's required velocity X_r':

    int |X'| dt  <=  s_1 + 2 int |X_r'| dt    over 0.1 s,      |int (X' - X_r') dt|  <=  s_2    over 0.2 s          (3)

X_r' = X_d' + D^{-1} [K (X_d - X) + f + f_ff] includes compliance, so a tool held by a surface follows it. The swing,
with unknown friction and load, is exempt. docs/explanation/crane_control.md has the errors of sound cranes.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, dot, norm
from skillframe.robot import ClosedChain
from skillframe.skill import Broken, Ended
from skillframe_hydraulics.checks.feasibility import LEAST_ARM
from skillframe_hydraulics.checks.figures import relief
from skillframe_hydraulics.declared import MachineNoise
from skillframe_hydraulics.force.valve import ValveIdentification
from skillframe_hydraulics.law.generated import Batch
from skillframe_hydraulics.law.hydraulic import Measured, Reference, Terms
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.line_ahead import known_lines
from skillframe_hydraulics.law.vdc_actuator import Cylinders
from skillframe_hydraulics.lines import Lines
from skillframe_hydraulics.oil_balance import BOUNDS, Knowledge, balance_function
from skillframe_hydraulics.sensors import RECENT, MachineSensors


class Suspicion(NamedTuple):
    """A finding in trial `row`: whether a sensor is at fault, and an explanation."""

    row: int
    sensor: bool
    text: str


def valve_speeds(chain: ClosedChain, cylinders: Cylinders, moved: NDArray[np.int64]) -> Float:
    r"""Largest speed (n,) of every coordinate by its actuators' valves, infinite if nothing limits it [rad/s, m/s].

    The widest edge c passes c sqrt(p - p_R) at the port relief's p, past the smaller area A. A coordinate that an
    actuator turns through a moment arm R >= `LEAST_ARM`, or a sixth of its stroke, moves at v / R.
    """
    c, most = cylinders, np.full(len(chain.independent), np.inf)
    widest: Float = np.max([c.edge_pa, c.edge_pb, c.edge_at, c.edge_bt], axis=0) * c.edge
    opens = np.array([relief(one) for one in chain.robot.spec.actuation])
    rate = widest * np.sqrt(np.maximum(opens, c.supply_pressure) - c.return_pressure) / np.minimum(c.area_a, c.area_b)
    arm = np.minimum(LEAST_ARM, c.stroke / 6.0)
    direct = np.array([name in chain.independent for name in chain.actuated])
    with np.errstate(divide="ignore"):  # a motor in a linkage, whose lever is unknown
        np.minimum.at(most, moved, rate / np.where(direct, 1.0, arm))
    return most


class ReadingWatch:
    """Checks the latest readings of N machines.

    `speed` (n,) are velocity limits of the coordinates, `returns` (k,) pressures of the return line [Pa], `moved` (k,)
    the coordinate that each cylinder moves, `names` those of coordinates and cylinders, `empties` whether valves let
    chambers run empty.
    """

    def __init__(
        self, noise: MachineNoise, speed: Float, returns: Float, moved: NDArray[np.int64],
        names: tuple[tuple[str, ...], tuple[str, ...]], dt: float, empties: bool = False,
    ) -> None:  # fmt: skip
        self._n, n, k = len(speed), len(speed), len(returns)
        self._names = [*names[0], *(f"pressure_{side} of {name}" for side in "ab" for name in names[1])]
        self._jump: Float = speed * dt + BOUNDS.sure * np.sqrt(2.0) * noise.encoder
        sunken = BOUNDS.emptied if empties else BOUNDS.sunken
        self._lowest: Float = np.tile(np.maximum(returns - sunken, BOUNDS.vacuum), 2)
        self._returns: Float = np.tile(returns, 2)
        self._quiet = np.repeat([noise.encoder == 0.0, noise.pressure == 0.0], [n, 2 * k])
        first = np.array([np.argmax(moved == joint) for joint in range(n)])
        self._piston_of = np.concatenate([first, np.tile(np.arange(k), 2)])

    def look(self, raw: Float, pressures: Float, piston_rate: Float) -> list[Suspicion]:
        """Check the last readings (m, N, n + 2k), filtered pressures (N, 2k) and piston rates (N, k)."""
        still = raw[-2] == raw[-1]
        if still.any():
            still = (raw[-BOUNDS.still :] == raw[-1]).all(axis=0)
            still &= ~self._quiet | (np.abs(piston_rate) > BOUNDS.moving)[:, self._piston_of]
        low = pressures < self._lowest
        joints = raw[..., : self._n]
        steps = np.abs(joints[1:] - joints[:-1]).max(axis=0)
        jumped = steps > self._jump
        if not (still.any() or low.any() or jumped.any()):
            return []
        found = []
        for i, j in np.argwhere(jumped):
            text = f"the encoder of {self._names[j]} jumps by {steps[i, j]:.3g} within a tick, more than its speed"
            found.append(Suspicion(int(i), True, f"sensor: {text} limit and noise allow ({self._jump[j]:.3g})"))
        for i, j in np.argwhere(still):
            value = f"{raw[-1, i, j]:.6g}" if j < self._n else f"{raw[-1, i, j] / 1e5:.6g} bar"
            what = f"the encoder of {self._names[j]}" if j < self._n else self._names[j]
            found.append(Suspicion(int(i), True, f"sensor: {what} repeats {value} to the bit"))
        for i, j in np.argwhere(low):
            text = f"{self._names[self._n + j]} reads {pressures[i, j] / 1e5:.1f} bar, below the return line's"
            failed = f"{self._returns[j] / 1e5:g}: the transducer has failed, or the hose has burst"
            found.append(Suspicion(int(i), True, f"sensor: {text} {failed}"))
        return found


def knowledge(law: CompiledLaw, valves: ValveIdentification) -> Knowledge:
    """The controller's values and their uncertainty, from the swing and of measured supply lines."""
    spread = BOUNDS.spread * np.hypot(valves.overlap_deviation, valves.overlap_oil)
    least, most = np.maximum(valves.overlap - spread, 0.0), np.minimum(valves.overlap + spread, 0.5)
    unsure = np.maximum(np.hypot(valves.supply_deviation, valves.supply_oil), valves.supply_moved)
    if valves.line_deviation is not None:
        unsure = np.where(np.isnan(valves.line_deviation), unsure, valves.line_deviation)
    return Knowledge(law.supply, law.deadband, unsure, least, most, valves.ratio)


class FlowWatch:
    """Balances of N machines with k cylinders.

    Args:
        cylinders: nominal cylinders; names: of them. count: N; period: [s] between two checks.
        noise: standard deviation of an encoder's filtered reading [rad or m].
        lines: of open centres or compensated valves, see `balance_function`.
    """

    def __init__(
        self,
        cylinders: Cylinders,
        names: tuple[str, ...],
        count: int,
        period: float,
        noise: float = 0.0,
        lines: Lines | None = None,
    ) -> None:
        self._names, self._period, k = names, period, len(names)
        self._area: Float = np.stack([cylinders.area_a, cylinders.area_b])[:, None]
        self._length, self._blur = BOUNDS.length, BOUNDS.sure * np.sqrt(2.0) * noise
        self._told: Float = np.zeros((count, self._length, 10, k))
        """Cumulative sums of (2) into both chambers, latest first: sizes, both ends, and ends for likely overlaps."""
        self._seen: Float = np.zeros((count, self._length, 3, k))
        """Pistons and both pressures, latest first."""
        self._given = [np.zeros((count, 2 * k if lines is not None and i == 0 else k)) for i in range(12)]
        self._taken, self._squeezed = (np.zeros((count, 2, k)) for _ in range(2))
        self._explained, self._everyone = np.zeros((count, 2)), np.arange(count)
        inputs = [*self._given, self._told, self._seen]
        after = [np.zeros_like(self._told), np.zeros_like(self._seen)]
        outputs = [*after, self._taken, self._squeezed, self._explained]
        carried = {0: len(inputs) - 2, 1: len(inputs) - 1}
        self._balance = Batch(balance_function(cylinders, period, lines), inputs, outputs, carried=carried)
        self._looks, self._running = 0, 0
        self._vague: NDArray[np.int64] = np.zeros((count, len(names)), dtype=np.int64)
        """Checks (N, k) for which the valve flow remains unknown."""

    def look(self, valve: Float, seen: Measured, terms: Terms, knowledge: Knowledge, swing: bool) -> list[Suspicion]:
        """Check the balances, with the mean command `valve` since the last check, as of `balance_function`."""
        blur = self._blur * np.sqrt(dot(terms.arms, terms.arms))
        floor = BOUNDS.floor_in_swing if swing else BOUNDS.floor
        given = (valve, *seen[2:4], terms.piston, *knowledge, floor, BOUNDS.spool_floor + blur)
        for own, value in zip(self._given, given, strict=True):
            own[...] = value
        self._balance.run(self._everyone)
        self._looks += 1
        self._vague = np.where(knowledge.unsure > BOUNDS.unsure, self._length, np.maximum(self._vague - 1, 0))
        self._running = 0 if swing else self._running + 1
        closed, placed = (np.count_nonzero(self._explained[:, i]) == len(self._explained) for i in range(2))
        if self._looks < self._length:
            return []
        found = [] if closed else self._judge()
        return found if placed or self._running < self._length else found + self._judge_spools()

    def _told_at(self, lag: int) -> Float:
        """Volumes (10, N, k) of a balance for a lag, in the order of `_told`."""
        told: Float = self._told[:, lag] - self._told[:, lag + BOUNDS.window]
        return told.swapaxes(0, 1)

    def _judge(self) -> list[Suspicion]:
        taken, squeezed = self._taken.swapaxes(0, 1), self._squeezed.swapaxes(0, 1)
        spare = self._area * self._given[-2] + BOUNDS.share * np.abs(squeezed)
        every = np.stack([self._told_at(lag) for lag in BOUNDS.lags])
        ends, most = every[:, 2:6].reshape(-1, *taken.shape), every[:, :2].max(axis=0)
        low, high = ends.min(axis=0), ends.max(axis=0)
        vague = self._vague > 0  # an overestimated supply may feed nothing
        meant = np.clip(taken, np.where(vague, np.minimum(low, 0.0), low), np.where(vague, np.maximum(high, 0.0), high))
        beyond = np.abs(taken - meant) > spare + BOUNDS.share * most
        return [
            self._finding(int(i), int(k), taken[:, i, k], meant[:, i, k], beyond[:, i, k])
            for i, k in np.argwhere(beyond.any(axis=0))
        ]

    def _judge_spools(self) -> list[Suspicion]:
        taken, squeezed = self._taken.swapaxes(0, 1), self._squeezed.swapaxes(0, 1)
        spare = self._area * self._given[-1] + BOUNDS.share * np.abs(squeezed)
        every = np.concatenate([self._told_at(lag)[6:].reshape(2, *taken.shape) for lag in (0, *BOUNDS.lags)])
        low, high = every.min(axis=0), every.max(axis=0)
        meant = np.clip(taken, low, high)
        off = taken - meant
        beyond = np.abs(off) > spare + BOUNDS.spool_share * np.maximum(np.abs(low), np.abs(high))
        wrong = beyond.all(axis=0) & (off[0] * off[1] < 0.0) & (self._vague == 0)
        return [
            self._finding(int(i), int(k), taken[:, i, k], meant[:, i, k], beyond[:, i, k], spool=True)
            for i, k in np.argwhere(wrong)
        ]

    def _finding(
        self, i: int, k: int, taken: Float, meant: Float, beyond: NDArray[np.bool_], spool: bool = False
    ) -> Suspicion:
        name, span, areas = self._names[k], BOUNDS.window * self._period, self._area[:, 0, k]
        x = float(self._seen[i, 0, 0, k] - self._seen[i, BOUNDS.window, 0, k])
        way = float(meant[0] / areas[0] if abs(meant[0]) > abs(meant[1]) else -meant[1] / areas[1])
        off = taken - meant
        if beyond.all() and off[0] * off[1] < 0.0:
            if abs(x) <= BOUNDS.alike * abs(way):
                text = f"is commanded {1e3 * way:.1f} mm in {span:.2g} s, and the piston does not move"
                return Suspicion(i, False, f"watchdog: the valve of {name} {text}")
            if abs(way) <= BOUNDS.alike * abs(x):
                text = f"moves {1e3 * x:.1f} mm in {span:.2g} s, and its valve is not commanded to"
                return Suspicion(i, False, f"watchdog: the piston of {name} {text}")
        if spool:
            text = f"is commanded {1e3 * way:.1f} mm in {span:.2g} s, and the piston goes {1e3 * x:.1f} mm"
            return Suspicion(i, False, f"watchdog: the valve of {name} {text}")
        sides = [
            f"chamber {side} {1e6 * abs(lost):.0f} cm3 {'more' if lost > 0.0 else 'less'}"
            for side, lost, far in zip("ab", off.tolist(), beyond.tolist(), strict=True) if far
        ]  # fmt: skip
        text = f"in {span:.2g} s {' and '.join(sides)} than its valve let through"
        return Suspicion(i, False, f"watchdog: the oil of {name} does not balance: {text}")


class ToolWatch:
    """Checks of N machines, every `period` [s]."""

    def __init__(self, count: int, period: float, axes: int = 2) -> None:
        self._period, self._looks = period, 0
        self._sums: Float = np.zeros((BOUNDS.slow + 1, count, axes + 2))

    def look(self, rate: Float, error: Float, force: Float, reference: Reference) -> list[Suspicion]:
        """Check the tool's velocity (N, m), with its error X_d - X and the answered force (N, m)."""
        pull = (reference.stiffness @ error[..., None])[..., 0] + force + reference.push
        required = reference.velocity + np.linalg.solve(reference.damping, pull[..., None])[..., 0]
        rows = len(self._sums)
        now, before = self._looks % rows, (self._looks - 1) % rows
        more = np.concatenate([rate - required, norm(rate)[:, None], norm(required)[:, None]], axis=-1)
        self._sums[now] = self._sums[before] + self._period * more
        self._looks += 1
        if self._looks <= BOUNDS.slow:
            return []
        fast, slow = (self._sums[now] - self._sums[(now - span) % rows] for span in (BOUNDS.fast, BOUNDS.slow))
        rushed, missed = fast[:, -2] - 2.0 * fast[:, -1] > BOUNDS.excess, norm(slow[:, :-2]) > BOUNDS.missed
        if not (rushed.any() or missed.any()):
            return []
        found, span, ways = [], BOUNDS.slow * self._period, norm(slow[:, :-2])
        for i in np.flatnonzero(rushed):
            speed, wanted = fast[i, -2:] / (BOUNDS.fast * self._period)
            text = f"watchdog: the tool moves at {speed:.2f} m/s, and the controller commands {wanted:.2f} m/s"
            found.append(Suspicion(int(i), False, text))
        for i in np.flatnonzero(missed):
            text = f"the tool is {1e3 * ways[i]:.0f} mm from where the controller commanded it"
            found.append(Suspicion(int(i), False, f"watchdog: {text} in the last {span:.2g} s"))
        return found


class MachineWatch:
    """The monitor of N machines. `moved` (k,) is the coordinate that each cylinder moves."""

    def __init__(
        self, law: CompiledLaw, valves: ValveIdentification, cylinders: Cylinders, gauges: MachineSensors,
        noise: MachineNoise, moved: NDArray[np.int64], dt: float,
    ) -> None:  # fmt: skip
        chain, period, count = law.chain, RECENT * dt, gauges.raw.shape[1]
        self._law, self._valves, self._gauges, self._tick = law, valves, gauges, 0
        lines = known_lines(chain.robot.spec)
        self._halves = lines is not None
        speed = chain.minimal(chain.model.velocityLimit)
        speed = np.where(np.isfinite(speed), speed, valve_speeds(chain, cylinders, moved))
        names = (tuple(chain.independent), tuple(chain.actuated))
        self._readings = ReadingWatch(noise, speed, cylinders.return_pressure, moved, names, dt, self._halves)
        # white noise behind w^2 / (s + w)^2 has a variance w dt / 4 times as large
        filtered = noise.encoder * float(np.sqrt(0.5 * np.pi * noise.corner_hz * dt))
        self._flow = FlowWatch(cylinders, names[1], count, period, filtered, lines)
        self._tool = ToolWatch(count, period, law.at.tip.shape[1])
        self._told: Float = np.zeros((count, (2 if self._halves else 1) * len(names[1])))
        self._known, self._swinging = knowledge(law, valves), True

    def due(self, valve: Float) -> bool:
        """Add the openings (N, k) that a tick commands. Returns whether a full check is due."""
        self._told += np.hstack([np.maximum(valve, 0.0), np.minimum(valve, 0.0)]) if self._halves else valve
        self._tick += 1
        return self._tick % RECENT == 0

    def look(
        self, seen: Measured, terms: Terms, reference: Reference, active: NDArray[np.int64], *, swing: bool = False,
        alarms: Collection[int] = (),
    ) -> list[Broken]:  # fmt: skip
        """The trials among `active` to end, each with its first finding.

        To be called in ticks that are `due`, and for `alarms`: trials that break a limit in this tick.
        """
        due = self._tick % RECENT == 0
        last, turn = self._gauges.raw, self._gauges.turn
        raw = np.concatenate([last[turn:], last[:turn]])
        found = self._readings.look(raw, self._gauges.chambers, terms.piston_rate)
        if due:
            if swing or self._swinging or self._valves.line_deviation is not None:  # else constant after the swing
                self._known, self._swinging = knowledge(self._law, self._valves), swing
            found += self._flow.look(self._told / RECENT, seen, terms, self._known, swing)
            if not swing:  # oscillation is reported at the end of the swing
                found += self._tool.look(terms.tip_rate, reference.position - terms.tip, seen.force, reference)
            self._told[:] = 0.0
        left, broken = {int(row) for row in (active if due else alarms)}, []
        for one in found:
            if one.row in left:
                left.remove(one.row)
                broken.append(Broken(one.row, Ended.SENSOR if one.sensor else Ended.WATCHDOG, one.text))
        return broken
