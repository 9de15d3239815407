"""Oil balance of a hydraulic machine's cylinders, compiled: equations (1) and (2) of `skillframe_hydraulics.watch`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi as ca
import numpy as np

from skillframe.frames import Float
from skillframe_hydraulics.compensation import held_range
from skillframe_hydraulics.counterbalance import conductances, narrowing
from skillframe_hydraulics.law.vdc_actuator import Cylinders, chamber_lengths
from skillframe_hydraulics.lines import Lines
from skillframe_hydraulics.symbolic_or_numeric import copysign, maximum, minimum


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What a sound machine keeps to, chosen for the shipped crane with at least twice what it needs.

    Attributes:
        still: number of equal readings that mean a stopped sensor.
        sure: standard deviations of noise, exceeded once in 1e15.
        sunken: pressure below the return line's, whose check valve passes 1e-3 m3/s at 1e5 [Pa]; vacuum: gauge [Pa].
        emptied: as sunken, of chambers that open centres or compensated valves let run empty [Pa].
        filling: of a check valve [m3/(s Pa)].
        moving: speed of a moving piston for noiseless sensors [m/s].
        window: checks per balance; lags: in checks, 20 to 60 ms, of which the shipped crane needs 20.
        floor, floor_in_swing: tolerated motion of the piston [m]; share: of the flow.
        unsure: standard deviation or last change of a supply pressure above which a valve may pass from zero up to (2),
            at the highest likely pressure, because early fits can be wrong by 16 bar with a small deviation [Pa].
        alike: share of another motion below which one is negligible.
        spread: standard deviations of supply and overlap.
        loaded: opening of a valve whose load is surely sensed, share of its travel.
        setting: by which a counterbalance valve may open late or early [Pa].
        spool_floor, spool_share: for misplaced spools, motion [m] and share of the flow.
        excess, missed: s_1 and s_2 [m]; fast, slow: checks per sum of (3).
    """

    still: int = 5
    sure: float = 8.0
    sunken: float = 2e5
    vacuum: float = -1e5
    emptied: float = 4e5
    filling: float = 1e-8
    moving: float = 5e-3
    window: int = 5
    lags: tuple[int, ...] = (1, 2, 3)
    floor: float = 5e-4
    floor_in_swing: float = 1e-3
    share: float = 0.5
    unsure: float = 1e6
    alike: float = 0.25
    spread: float = 2.0
    loaded: float = 0.05
    setting: float = 1e6
    spool_floor: float = 1e-4
    spool_share: float = 0.1
    excess: float = 0.05
    missed: float = 0.06
    fast: int = 5
    slow: int = 10

    @property
    def length(self) -> int:
        """Checks to be stored for a balance at the largest lag."""
        return self.window + max(self.lags) + 1


BOUNDS = Bounds()


class Knowledge(NamedTuple):
    """State of the valves (N, k).

    Attributes:
        supply, unsure: pressure and its uncertainty [Pa]. overlap: used by the controller, share of the travel.
        least, most: likely range of the overlap; ratio: flow over the rated one.
    """

    supply: Float
    overlap: Float
    unsure: Float
    least: Float
    most: Float
    ratio: Float


def balance_function(c: Cylinders, period: float, lines: Lines | None = None) -> ca.Function:
    """A check of one machine with k cylinders: (1), the sums of (2), and whether the usual lag explains all.

    Inputs, (k,) each: mean command since the last check, pressures a and b, piston; the fields of `Knowledge`;
    tolerance [m] of a balance, and of a spool. Then sums of (2), and readings, at the last checks, rows of k.
    Outputs: these with the new check first; volumes of both chambers, and their compressed part; 1 if all balances are
    explained; 1 if all spools may be in place.

    With `lines`, of open centres or compensated valves, the command comes in two halves (2k,), means of its positive
    and of its negative part, as spools change over within a period; and a chamber below the return line's pressure may
    fill through its check valve. The load that post-compensated valves hold is that of another valve which may be open,
    for the ends of least flow, or which is open by `loaded` at least.
    """
    k, length = len(c.area_a), BOUNDS.length
    given = [ca.SX.sym(f"given{i}", 2 * k if lines is not None and i == 0 else k) for i in range(12)]
    valve, p_a, p_b, piston, *known, floor, spool_floor = given
    sums, readings = (ca.SX.sym(name, k, length * rows) for name, rows in (("sums", 10), ("readings", 3)))
    swung = Knowledge(*known)
    sure = swung.unsure <= BOUNDS.unsure
    supply = ca.if_else(sure, swung.supply, maximum(swung.supply, c.supply_pressure))
    above = BOUNDS.spread * swung.unsure  # a supply above the declared one, until the swing has found it
    below = ca.if_else(sure, above, 0.0)
    check_a = check_b = c.feed_check
    if own := c.counterbalance:
        check_a, check_b = np.maximum(check_a, own.holds_a), np.maximum(check_b, own.holds_b)
    checks = check_a, check_b
    ends = supply - below, supply + above
    halves = ca.vertsplit(valve, k)
    held: tuple[ca.SX | None, ca.SX | None] = (None, None)
    if lines is not None and lines.compensated:
        held = held_range(lines, halves, (p_a, p_b), ends, swung.most + BOUNDS.loaded)
    parts = [_volumes(c, period, part, (p_a, p_b), ends, held, swung, checks) for part in halves]
    volumes = parts[0] if lines is None else [one + other for one, other in zip(*parts, strict=True)]
    if lines is not None:
        for i, pressure in ((2, p_a), (3, p_b), (6, p_a), (7, p_b)):  # the upper ends
            volumes[i] += period * BOUNDS.filling * maximum(c.return_pressure - pressure, 0.0)
    sizes = ca.horzcat(*map(ca.fabs, volumes[2:4]), *volumes)
    told, seen = ca.horzcat(sizes + sums[:, :10], sums[:, :-10]), ca.horzcat(piston, p_a, p_b, readings[:, :-3])
    gone = seen[:, :3] - seen[:, 3 * BOUNDS.window : 3 * BOUNDS.window + 3]
    lagged, begun = 10 * BOUNDS.lags[0], 10 * (BOUNDS.lags[0] + BOUNDS.window)
    usual = told[:, lagged : lagged + 10] - told[:, begun : begun + 10]
    areas = ca.horzcat(c.area_a, c.area_b)
    soft = ca.horzcat(c.area_a / c.bulk_modulus, c.area_b / c.bulk_modulus)
    squeezed = soft * ca.horzcat(*chamber_lengths(c, piston)) * gone[:, 1:]
    taken = areas * ca.horzcat(gone[:, 0], -gone[:, 0]) + squeezed
    spare, loose = (areas * ca.horzcat(way, way) + BOUNDS.share * ca.fabs(squeezed) for way in (floor, spool_floor))
    closed = ca.fabs(taken - usual[:, 4:6]) <= spare + BOUNDS.share * usual[:, :2]
    off = ca.fabs(taken - usual[:, 6:8]) > loose
    explained = ca.vertcat(ca.sum1(ca.sum2(closed)) >= 2 * k, ca.sum1(off[:, 0] * off[:, 1]) < 1)
    return ca.Function("balance", [*given, sums, readings], [told, seen, taken, squeezed, explained])


def _volumes(
    c: Cylinders, period: float, valve: ca.SX, pressures: tuple[ca.SX, ca.SX], lines: tuple[ca.SX, ca.SX],
    held: tuple[ca.SX | None, ca.SX | None], swung: Knowledge, checks: tuple[Float, Float],
) -> list[ca.SX]:  # fmt: skip
    """Lower and upper ends of (2) into both chambers, and both ends for the likely overlaps.

    `lines` are the lowest and the highest likely pressure of the supply [Pa], `held` p_H with either.
    """
    p_a, p_b = pressures
    ends = {
        laminar: [
            _edge(c, pressure, fills, lines[0 if laminar else 1], laminar, shares, held[0 if laminar else 1])
            for pressure, fills, shares in (
                (p_a, valve > 0.0, (c.edge_pa, c.edge_at, checks[0])),
                (p_b, valve <= 0.0, (c.edge_pb, c.edge_bt, checks[1])),
            )
        ]
        for laminar in (True, False)
    }
    volumes = []
    for overlap, ratio, laminar in (
        (swung.overlap, 1.0, True), (swung.overlap, 1.0, False),
        (swung.most, swung.ratio, True), (swung.least, swung.ratio, False),
    ):  # fmt: skip
        opening = minimum(maximum(ca.fabs(valve) - overlap, 0.0) / (1.0 - overlap), 1.0) * ratio
        passed = [period * c.edge * opening * each for each in ends[laminar]]
        if own := c.counterbalance:  # that opens late, or early
            off = BOUNDS.setting if laminar else -BOUNDS.setting
            late = replace(own, **{at: getattr(own, at) + off for at in ("counterbalance_a", "counterbalance_b")})
            passed = [
                volume * ca.if_else(volume < 0.0, narrowing(c.edge * opening * wide, held), 1.0)
                for volume, wide, held in zip(passed, (c.edge_at, c.edge_bt), conductances(late, p_a, p_b), strict=True)
            ]
        volumes += passed
    return volumes


def _edge(
    c: Cylinders, pressure: ca.SX, fills: ca.SX, supply: ca.SX, laminar: bool, shares: tuple[Float, Float, Float],
    held: ca.SX | None = None,
) -> ca.SX:  # fmt: skip
    """Root of the pressure drop into a chamber from the supply, or out of it [sqrt(Pa)], optionally laminar.

    It is times the edge's share of the rated conductance, of `shares` for flow in and flow out. The third is 1 with a
    check valve.
    """
    behind, check = pressure, shares[2]
    if held is not None:
        behind, check = maximum(pressure, held), maximum(check, held > pressure)
    drop = ca.if_else(fills, supply - behind, c.return_pressure - pressure)
    shut = check * (behind - supply) > 0.0
    share = ca.if_else(fills, ca.if_else(shut, 0.0, shares[0]), shares[1])
    if laminar:
        return share * (drop / ca.sqrt(ca.sqrt(drop * drop + c.laminar_pressure**2)))
    return share * copysign(ca.sqrt(ca.fabs(drop)), drop)
