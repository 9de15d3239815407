r"""Overlap and supply pressure of a machine's valves, identified in air from flows.

A spool with overlap b opens by u_e = sign(u) (|u| - b) / (1 - b), so where it is open

    |u_e| = alpha |u| - beta,   b = beta / alpha,     u_e = Q_out / (c_out sqrt(p_out - p_R)),                      (1)
    p_S = p_in + (c_out Q_in / (c_in Q_out))^2 (p_out - p_R),      Q = A v +- (V / B) p'                            (2)

for the filling and the draining chamber and their edges. Both edges open alike, so (2) needs no command. alpha, about
1 / (1 - b), absorbs an error of the rated flow. (1) is fitted for several lags of the measurement, and the best one
counts. Both are least squares with priors, as in `identification`. Too large an overlap makes a loop hunt, too small a
one only slows it (G. Tao and P. Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, Wiley
1996), so the compensated overlap is a standard deviation less. The fits are repeated with softer oil, for the error due
to the bulk modulus.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.frames import Float
from skillframe_hydraulics.force.damped import CriticallyDamped
from skillframe_hydraulics.law.vdc_actuator import chamber_lengths

if TYPE_CHECKING:
    from skillframe_hydraulics.law.hydraulic import Measured, Terms
    from skillframe_hydraulics.law.vdc_actuator import Cylinders


@dataclass(frozen=True, slots=True, kw_only=True)
class ValveSettings:
    """Settings of the identification, tuned for the crane.

    Attributes:
        period: of rows [s]; slice: lags are multiples of it [s]; lags: how many.
        corner: of the command's filter, that of the sensors [Hz].
        least: smallest opening and command of a row.
        drop: smallest pressure drop over the draining edge [Pa].
        squeezed: largest share of the piston's rate that compresses oil.
        share: prior standard deviation of alpha; overlap: of beta; supply: of p_S [Pa].
        alike: number of rows that are correlated by the filters.
        noise: prior root mean square residual of (1), share of the travel, which counts as one uncorrelated row: a few
            rows lie on a line by chance.
        largest: bound on b; reach: bound on p_S, +- of the nominal one.
        oil: standard deviation of the bulk modulus, relative.
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
    noise: float = 0.005
    largest: float = 0.2
    reach: float = 0.5
    oil: float = 0.2

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise SkillframeError(f"valves: {name} must be positive, got {getattr(self, name)}")


class ValveIdentification:
    """The fit for N machines with k valves.

    Attributes:
        overlap, overlap_deviation: (N, k) share of the travel. lag: (N, k) [s].
        ratio: (N, k) identified over rated flow.
        supply, supply_deviation: (N, k) [Pa], within `reach`; supply_found: (N, k) without bounds.
        overlap_oil, supply_oil: (N, k) standard deviations due to the oil.
        supply_moved: (N, k) change in the last fit [Pa].
        line_deviation: (N, k) standard deviation of a supply pressure that is measured [Pa], NaN where it is not; None
            where none is. Written by the caller.
    """

    def __init__(self, cylinders: Cylinders, count: int, dt: float, settings: ValveSettings | None = None) -> None:
        self.settings, self._cylinders, self._dt = settings or ValveSettings(), cylinders, dt
        s, self._shape = self.settings, (count, len(cylinders.area_a))
        self._slice, self._row = max(1, round(s.slice / dt)), max(1, round(s.period / dt))
        self._filter = CriticallyDamped(s.corner, self._slice * dt)
        self.start()

    def start(self) -> None:
        """Reset to nominal values."""
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
        self.line_deviation: Float | None = None
        self.lag: Float = np.zeros(self._shape)
        self.ratio: Float = np.ones(self._shape)

    @property
    def compensated(self) -> Float:
        """Overlap to be compensated (N, k)."""
        return np.clip(self.overlap - self.overlap_deviation, 0.0, self.settings.largest)

    def step(self, valve: Float, measured: Measured, terms: Terms) -> None:
        """Add a sample: the openings (N, k) that were last commanded, and the measurement."""
        self._told += valve
        self._tick += 1
        if self._tick % self._slice == 0:
            self._line[1:] = self._line[:-1]
            self._line[0] = self._filter.step(self._told / self._slice)
            self._told[:] = 0.0
        if self._tick % self._row == 0:
            now = (measured.pressure_a.copy(), measured.pressure_b.copy())
            if self._before is not None:
                self._take_in(now, self._before, terms)
            self._before = now

    def _take_in(self, now: tuple[Float, Float], before: tuple[Float, Float], terms: Terms) -> None:
        """Add a row from the pressures of both chambers and the previous ones, for an extending and a retracting spool.

        Openings u_e, supplies p_S and their increase with softer oil are (2, N, k).
        """
        s, c, x, v = self.settings, self._cylinders, terms.piston, terms.piston_rate
        rate_a, rate_b = ((p - q) / (self._row * self._dt * c.bulk_modulus) for p, q in zip(now, before, strict=True))
        length_a, length_b = chamber_lengths(c, x)
        squeezed = np.stack([length_a * rate_a, length_b * rate_b])
        filled, drained = np.stack(now), np.stack(now[::-1]) - c.return_pressure
        drop, fits = np.maximum(drained, s.drop), []
        wide_in, wide_out = np.stack([c.edge_pa, c.edge_pb])[:, None], np.stack([c.edge_bt, c.edge_at])[:, None]
        for compressed in (squeezed, squeezed / (1.0 - s.oil)):
            flow_a, flow_b = c.area_a * (v + compressed[0]), c.area_b * (v - compressed[1])
            into, out = np.stack([flow_a, -flow_b]), np.stack([flow_b, -flow_a])
            ratio = into / np.maximum(out, 1e-9) * (wide_out / wide_in)
            fits.append((out / (c.edge * wide_out * np.sqrt(drop)), filled + ratio * ratio * drop))
        (opening, supply), (wider, higher) = fits
        if valves := c.counterbalance:  # what drains through one is no measure of the spool
            drained = drained * (1.0 - np.stack([valves.holds_b, valves.holds_a])[:, None])
        clear = (drained > s.drop) & (np.abs(squeezed).max(axis=0) < s.squeezed * np.abs(v))

        told = self._line
        way = (told <= 0.0).astype(np.int64)
        seen, softer, counted = (np.take_along_axis(each, way, axis=0) for each in (opening, wider - opening, clear))
        size = np.abs(told)
        counts = (size > s.least) & (seen > s.least) & counted
        u, y, dy = np.where(counts, size, 0.0), np.where(counts, seen, 0.0), np.where(counts, softer, 0.0)
        self._sums += (counts, u, y, u * u, u * y, y * y, dy, u * dy)
        sure = (opening > 2.0 * s.least) & clear
        off = np.where(sure, supply - c.supply_pressure, 0.0).sum(axis=0)
        self._pressed += (sure.any(axis=0), off, off * off, np.where(sure, higher - supply, 0.0).sum(axis=0))

    def solve(self) -> None:
        """Fit (1) and (2) to the rows so far."""
        s, deadband = self.settings, self._cylinders.deadband
        n, su, sy, suu, suy, syy = self._sums[:6]
        rows = np.maximum(n, 1.0)
        spread, along = np.maximum(suu - su * su / rows, 1e-12), suy - su * sy / rows
        residual = np.maximum(syy - sy * sy / rows - along * along / spread, 0.0) + s.alike * s.noise**2
        left: Float = residual / (rows + s.alike)
        left = np.where(n > s.alike, left, 1e30)  # mean square error of the line (lags, N, k)
        best = np.argmin(left, axis=0)[None]
        chosen = (np.take_along_axis(v, best, axis=0)[0] for v in (*self._sums[:5], *self._sums[6:], left))
        n, su, sy, suu, suy, dsy, dsuy, left = chosen
        weight = np.where(n > s.alike, 1.0 / (s.alike * left), 0.0)
        share, overlap = 1.0 / s.share**2, 1.0 / s.overlap**2
        h11, h12, h22 = weight * suu + share, -weight * su, weight * n + overlap
        g1, g2 = weight * suy + share / (1.0 - deadband), overlap * deadband / (1.0 - deadband) - weight * sy
        determinant = h11 * h22 - h12 * h12
        alpha, beta = (h22 * g1 - h12 * g2) / determinant, (h11 * g2 - h12 * g1) / determinant
        self.overlap, self.overlap_deviation = beta / alpha, np.sqrt(h11 / determinant)
        self.ratio = alpha - beta
        more, wider = weight * (h22 * dsuy + h12 * dsy) / determinant, -weight * (h11 * dsy + h12 * dsuy) / determinant
        self.overlap_oil = np.abs(wider * alpha - beta * more) / alpha**2
        self.lag = best[0] * self._slice * self._dt

        nominal, (n, off, square, higher) = self._cylinders.supply_pressure, self._pressed
        rows = np.maximum(n, 1.0)
        spread = np.maximum(square / rows - (off / rows) ** 2, 1e8)
        weight = n / (s.alike * spread)
        mean = weight * off / rows / (weight + 1.0 / s.supply**2)
        self.supply_found = nominal + mean
        before, self.supply = self.supply, nominal * np.clip(1.0 + mean / nominal, 1.0 - s.reach, 1.0 + s.reach)
        self.supply_moved = np.abs(self.supply - before)
        self.supply_deviation = 1.0 / np.sqrt(weight + 1.0 / s.supply**2)
        self.supply_oil = np.abs(weight * higher / rows / (weight + 1.0 / s.supply**2))
