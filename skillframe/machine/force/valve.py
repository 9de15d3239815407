r"""Overlap and supply pressure of a machine's valves, found in air from what flows. Afterwards they are held.

A spool with overlap b opens by u_e = sign(u) (|u| - b) / (1 - b), so where it is open

    |u_e| = alpha |u| - beta,   b = beta / alpha,     u_e = Q_out / (c sqrt(p_out - p_R)),                          (1)
    p_S = p_in + (Q_in / Q_out)^2 (p_out - p_R),      Q = A v +- (V / B) p'                                         (2)

with the chamber that fills and the one that drains; both edges open alike, so (2) needs no command. Piston velocity and
pressures are as measured. alpha, some 1 / (1 - b), takes up a rated flow that is known wrongly. What is measured lags
behind the command, by spool, bus and filters: (1) is fitted for several lags at once, and the one that leaves least
counts; with 20 ms unaccounted for an overlap of 2 % came out as 1.3 %. Least squares with priors, as in
`identification`; (2), the draining edge in (1) and the choice of a lag are ours. An overlap believed too large makes a
loop hunt, one too small only makes it slow (G. Tao and P. Kokotovic, Adaptive Control of Systems with Actuator and
Sensor Nonlinearities, Wiley 1996), so what is to be compensated is a standard deviation less than what was found.

Scatter does not show that the oil is softer than believed, which shifts all rows alike. So what both fits find is also
found for a bulk modulus a standard deviation lower, and how far that is off is kept beside their deviations (ours).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float
from skillframe.machine.force.damped import CriticallyDamped

if TYPE_CHECKING:
    from skillframe.machine.law.hydraulic import Measured, Terms
    from skillframe.machine.law.vdc_actuator import Cylinders


@dataclass(frozen=True, slots=True, kw_only=True)
class ValveSettings:
    """How to find them. Our choice, from swings of the crane.

    Attributes:
        period: of rows [s]; slice: lags are multiples of it [s]; lags: how many.
        corner: of the command's filter, that of the sensors [Hz].
        least: opening, and command, below which a row does not count.
        drop: of pressure over the draining edge, likewise [Pa].
        squeezed: share of the piston's rate that may go into the oil's compression.
        share: prior standard deviation of alpha; overlap: of beta; supply: of p_S [Pa].
        alike: rows that say the same, because filters remember longer than a period.
        largest: what b is kept below; reach: and p_S within, +- of the nominal one.
        oil: standard deviation of the bulk modulus that is believed, share of it.
    """

    period: float = 0.01
    slice: float = 0.005
    lags: int = 10
    corner: float = 24.0
    least: float = 0.02
    drop: float = 5e5
    squeezed: float = 0.5
    share: float = 0.1
    overlap: float = 0.02
    supply: float = 3e6
    alike: float = 3.0
    largest: float = 0.2
    reach: float = 0.5
    oil: float = 0.2

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise SkillframeError(f"valves: {name} must be positive, got {getattr(self, name)}")


class _Flow(NamedTuple):
    """Of N x k valves, for a spool that extends and for one that retracts (2, N, k).

    Attributes:
        opening: u_e if it does; supply: p_S; softer, higher: how much larger these are with softer oil.
        clear: is it a row to go by?
    """

    opening: Float
    supply: Float
    softer: Float
    higher: Float
    clear: NDArray[np.bool_]


class ValveIdentification:
    """The fit for N machines with k valves in lock-step.

    Args:
        cylinders: as the controller knows them, nominal overlap and supply included.
        count: number of trials N.
        dt: sample time [s].
        settings: see `ValveSettings`.

    Attributes:
        overlap, overlap_deviation: (N, k) found, share of the travel. lag: (N, k) [s].
        ratio: (N, k) flow that was found over the rated one.
        supply, supply_deviation: (N, k) found [Pa], within `reach`; supply_found: (N, k) wherever it is.
        overlap_oil, supply_oil: (N, k) standard deviations from what is not known of the oil, beside these.
        supply_moved: (N, k) how far the last fit went from the one before [Pa].
    """

    def __init__(self, cylinders: Cylinders, count: int, dt: float, settings: ValveSettings | None = None) -> None:
        self.settings, self._cylinders, self._dt = settings or ValveSettings(), cylinders, dt
        s, self._shape = self.settings, (count, len(cylinders.area_a))
        self._slice, self._row = max(1, round(s.slice / dt)), max(1, round(s.period / dt))
        self._filter = CriticallyDamped(s.corner, self._slice * dt)
        self.start()

    def start(self) -> None:
        """Know nothing but what is nominal."""
        s, c = self.settings, self._cylinders
        self._filter.start()
        self._tick, self._told = 0, np.zeros(self._shape)
        self._line: Float = np.zeros((s.lags, *self._shape))
        self._sums: Float = np.zeros((8, s.lags, *self._shape))
        self._pressed: Float = np.zeros((4, *self._shape))
        self._before: tuple[Float, Float] | None = None
        self.overlap, self.supply = (np.tile(x, (self._shape[0], 1)) for x in (c.deadband, c.supply_pressure))
        self.supply_found: Float = self.supply
        self.supply_moved: Float = np.zeros(self._shape)
        self.overlap_deviation: Float = np.full(self._shape, s.overlap)
        self.supply_deviation: Float = np.full(self._shape, s.supply)
        self.overlap_oil: Float = np.zeros(self._shape)
        self.supply_oil: Float = np.zeros(self._shape)
        self.lag: Float = np.zeros(self._shape)
        self.ratio: Float = np.ones(self._shape)

    @property
    def compensated(self) -> Float:
        """(N, k) overlap to be compensated."""
        return np.clip(self.overlap - self.overlap_deviation, 0.0, self.settings.largest)

    def step(self, valve: Float, measured: Measured, terms: Terms) -> None:
        """Take in a sample: what the valves (N, k) were told before it, and what was measured."""
        self._told += valve
        self._tick += 1
        if self._tick % self._slice == 0:
            self._line[1:] = self._line[:-1]
            self._line[0] = self._filter.step(self._told / self._slice)
            self._told[:] = 0.0
        if self._tick % self._row == 0:
            now = (measured.pressure_a.copy(), measured.pressure_b.copy())
            if self._before is not None:
                self._take_in(self._flow(now, self._before, terms))
            self._before = now

    def _flow(self, now: tuple[Float, Float], before: tuple[Float, Float], terms: Terms) -> _Flow:
        c, least, x, v = self._cylinders, self.settings.drop, terms.piston, terms.piston_rate
        rate_a, rate_b = ((p - q) / (self._row * self._dt * c.bulk_modulus) for p, q in zip(now, before, strict=True))
        squeezed = np.stack([(c.arm_a + x) * rate_a, (c.arm_b + c.stroke - x) * rate_b])
        filled, drained = np.stack(now), np.stack(now[::-1]) - c.return_pressure
        drop = np.maximum(drained, least)

        def found(compressed: Float) -> tuple[Float, Float]:
            flow_a, flow_b = c.area_a * (v + compressed[0]), c.area_b * (v - compressed[1])
            into, out = np.stack([flow_a, -flow_b]), np.stack([flow_b, -flow_a])
            ratio = into / np.maximum(out, 1e-9)
            return out / (c.edge * np.sqrt(drop)), filled + ratio * ratio * drop

        clear = (drained > least) & (np.abs(squeezed).max(axis=0) < self.settings.squeezed * np.abs(v))
        (opening, supply), (wider, higher) = found(squeezed), found(squeezed / (1.0 - self.settings.oil))
        return _Flow(opening, supply, wider - opening, higher - supply, clear)

    def _take_in(self, flow: _Flow) -> None:
        least, told = self.settings.least, self._line
        way = (told <= 0.0).astype(np.int64)
        seen, softer = (np.take_along_axis(v, way, axis=0) for v in (flow.opening, flow.softer))
        clear = np.take_along_axis(flow.clear, way, axis=0)
        size = np.abs(told)
        counts = (size > least) & (seen > least) & clear
        u, y, dy = np.where(counts, size, 0.0), np.where(counts, seen, 0.0), np.where(counts, softer, 0.0)
        self._sums += (counts, u, y, u * u, u * y, y * y, dy, u * dy)
        sure = (flow.opening > 2.0 * least) & flow.clear
        off = np.where(sure, flow.supply - self._cylinders.supply_pressure, 0.0).sum(axis=0)
        higher = np.where(sure, flow.higher, 0.0).sum(axis=0)
        self._pressed += (sure.any(axis=0), off, off * off, higher)

    def solve(self) -> None:
        """Fit (1) and (2) to the rows so far."""
        self._solve_overlap()
        s, nominal, (n, off, square, higher) = self.settings, self._cylinders.supply_pressure, self._pressed
        rows = np.maximum(n, 1.0)
        spread = np.maximum(square / rows - (off / rows) ** 2, 1e8)
        weight = n / (s.alike * spread)
        mean = weight * off / rows / (weight + 1.0 / s.supply**2)
        self.supply_found = nominal + mean
        before, self.supply = self.supply, nominal * np.clip(1.0 + mean / nominal, 1.0 - s.reach, 1.0 + s.reach)
        self.supply_moved = np.abs(self.supply - before)
        self.supply_deviation = 1.0 / np.sqrt(weight + 1.0 / s.supply**2)
        self.supply_oil = np.abs(weight * higher / rows / (weight + 1.0 / s.supply**2))

    def _solve_overlap(self) -> None:
        s, nominal = self.settings, self._cylinders.deadband
        left = self._left()
        best = np.argmin(left, axis=0)[None]
        chosen = (np.take_along_axis(v, best, axis=0)[0] for v in (*self._sums[:5], *self._sums[6:], left))
        n, su, sy, suu, suy, dsy, dsuy, left = chosen
        weight = np.where(n > s.alike, 1.0 / (s.alike * left), 0.0)
        share, overlap = 1.0 / s.share**2, 1.0 / s.overlap**2
        h11, h12, h22 = weight * suu + share, -weight * su, weight * n + overlap
        g1, g2 = weight * suy + share / (1.0 - nominal), overlap * nominal / (1.0 - nominal) - weight * sy
        determinant = h11 * h22 - h12 * h12
        alpha, beta = (h22 * g1 - h12 * g2) / determinant, (h11 * g2 - h12 * g1) / determinant
        self.overlap, self.overlap_deviation = beta / alpha, np.sqrt(h11 / determinant)
        self.ratio = alpha - beta
        more, wider = weight * (h22 * dsuy + h12 * dsy) / determinant, -weight * (h11 * dsy + h12 * dsuy) / determinant
        self.overlap_oil = np.abs(wider * alpha - beta * more) / alpha**2
        self.lag = best[0] * self._slice * self._dt

    def _left(self) -> Float:
        """(lags, N, k) mean square that a straight line leaves of the openings."""
        n, su, sy, suu, suy, syy = self._sums[:6]
        rows = np.maximum(n, 1.0)
        spread, along = np.maximum(suu - su * su / rows, 1e-12), suy - su * sy / rows
        left: Float = np.maximum((syy - sy * sy / rows - along * along / spread) / rows, 1e-8)
        return np.where(n > self.settings.alike, left, 1e30)
