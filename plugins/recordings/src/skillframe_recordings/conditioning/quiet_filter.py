r"""Wrench filter that is quiet at rest and fast during changes.

A *plain* Butterworth filter (second order, at most 10 Hz) and a *wide* Kalman filter or smoother (`signals.kalman`, at
the identified corner within 15 to 25 Hz) run side by side. Of their difference d, only what exceeds noise passes:

    y = plain + d max(0, 1 - (k s / d)^2),        |y - wide| <= k s,                                           (1)

where s is the scatter of d in the quietest quarter of the recording, so coloured vibration counts as recorded. (1) is
the shrinkage of James and Stein. A single Kalman gain cannot do both, since touch-downs dominate its likelihood.

Corner and k are the first of `CORNERS` and of 4, 6, 9, 15 and infinity for which neither the remaining noise nor the
loss in the fastest tenth of the samples exceeds the plain 10 Hz filter's, which is the last choice.
"""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import detrended_std, window_rows
from skillframe.frames import Float, norm
from skillframe.signals import WrenchFilter, WrenchModel

HIGHEST = 0.4
"""Highest corner as a share of the rate, for slow recordings."""
CORNERS = (0.9, 1.0)
"""Corners that are tried, as shares of the plain filter's 10 Hz."""


class CoredPart(NamedTuple):
    """The filter chosen for forces or torques.

    Attributes:
        corner: of the plain filter [Hz].
        least: (3,) smallest change that passes [N or Nm]; infinite if none does.
        opened: share of samples that the wide filter dominates.
        filtered: (T, 3).
    """

    corner: float
    least: Float
    opened: float
    filtered: Float


class _Windows(NamedTuple):
    """Windows for noise: rows (K, W), and which of them are in the quietest quarter."""

    rows: NDArray[np.intp]
    quiet: NDArray[np.bool_]

    @staticmethod
    def of(time: Float, wrench: Float, alive: NDArray[np.bool_] | None) -> _Windows:
        """The windows of a recording, at most about 800."""
        rows, quiet = window_rows(time, wrench, alive)
        some = np.flatnonzero(quiet)[:: max(1, 4 * quiet.sum() // 800)]
        others = np.flatnonzero(~quiet)[:: max(1, len(quiet) // 800)]
        chosen = np.concatenate([some, others])
        return _Windows(rows[chosen], quiet[chosen])

    def noise(self, samples: Float) -> Float:
        """Scatter (2, C) in the recording's quietest quarter, and in the samples' own."""
        scatter = detrended_std(samples[self.rows])
        typical = np.median(scatter, axis=0)
        rank = (scatter / np.where(typical > 0.0, typical, 1.0)).sum(axis=1)
        own = np.argsort(rank, kind="stable")[: max(1, len(rank) // 4)]
        return np.stack([np.median(scatter[self.quiet], axis=0), np.median(scatter[own], axis=0)])


class Cored(NamedTuple):
    """A filtered wrench (T, 6), and the chosen figures for metadata."""

    wrench: Float
    said: dict[str, Any]


def cored(
    time: Float, wrench: Float, model: WrenchModel, *, causal: bool, alive: NDArray[np.bool_] | None = None
) -> Cored:
    """Return the filtered wrench.

    Args:
        time: (T,) [s], at least ten samples.
        wrench: (T, 6) [N, Nm].
        model: as identified (`noise.model_of`).
        causal: filter without look-ahead; the choice of corner and k still uses the whole recording.
        alive: (T,) samples without stalls.
    """
    dt = float(np.median(np.diff(time)))
    identified = model.corner(dt)
    most = min(25.0, HIGHEST / dt)  # [Hz]
    wide = np.clip(identified, min(15.0, most), most)
    design = WrenchFilter(WrenchModel.from_corner(model.noise, wide, dt), dt)
    quick = design.filter(time, wrench) if causal else design.smooth(time, wrench)
    windows = _Windows.of(time, wrench, alive)
    parts = [
        _part(wrench[:, part], quick[:, part], windows, 1.0 / dt, float(identified[part.start]), causal)
        for part in (slice(0, 3), slice(3, 6))
    ]
    said = {
        "corner_hz": wide.tolist(), "identified_corner_hz": identified.tolist(),
        "quiet_corner_hz": [p.corner for p in parts for _ in range(3)],
        "passes": [float(v) if np.isfinite(v) else None for p in parts for v in p.least],
        "opened": [p.opened for p in parts], "because": [_reason(float(identified[i]), float(wide[i])) for i in (0, 3)],
    }  # fmt: skip
    return Cored(np.concatenate([p.filtered for p in parts], axis=1), said)


def _reason(identified: float, wide: float) -> str:
    if identified > wide:
        return f"{identified:.3g} Hz fits best, and {wide:.3g} Hz is the most that is allowed"
    if identified < wide:
        return f"{identified:.3g} Hz fits best, and touch-downs need {wide:.3g} Hz"
    return f"{wide:.3g} Hz fits best"


def _part(measured: Float, quick: Float, windows: _Windows, rate: float, identified: float, causal: bool) -> CoredPart:
    """Filter forces or torques with the first choice that is no worse than the plain filter."""
    from scipy.ndimage import uniform_filter1d

    most = min(10.0, HIGHEST * rate)
    change = norm(np.gradient(uniform_filter1d(measured, max(1, round(0.02 * rate)) | 1, axis=0), axis=0))  # of 20 ms
    busy = np.asarray(change >= np.quantile(change, 0.9))  # the tenth with the fastest change
    corners = [share * most for share in CORNERS]
    corners = [identified, *corners] if not causal and identified < corners[0] else corners  # a lower one first
    slow = {corner: plain(measured, corner, rate, causal) for corner in corners}
    bar = _figures(measured, slow[most], busy, windows)
    for share, corner in product((4.0, 6.0, 9.0, 15.0, np.inf), corners):
        difference = quick - slow[corner]
        least = np.full(3, np.inf) if np.isinf(share) else share * windows.noise(difference)[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            passed: Float = np.maximum(0.0, 1.0 - (least / difference) ** 2)  # equation (1)
        passed = np.where(difference == 0.0, 0.0, passed)
        part = CoredPart(corner, least, float(np.mean(passed > 0.5)), slow[corner] + passed * difference)
        if np.all(_figures(measured, part.filtered, busy, windows) <= bar):
            break
    return part


def plain(measured: Float, corner: float, rate: float, causal: bool) -> Float:
    """Return samples (T, C) after a second-order Butterworth filter, forward or both ways (no lag)."""
    from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

    sos = butter(2, corner, fs=rate, output="sos")
    if not causal:
        return np.asarray(sosfiltfilt(sos, measured, axis=0))
    return np.asarray(sosfilt(sos, measured, axis=0, zi=sosfilt_zi(sos)[:, :, None] * measured[0])[0])


def _figures(measured: Float, filtered: Float, busy: NDArray[np.bool_], windows: _Windows) -> Float:
    """Remaining noise by two measures, and the loss during fast changes: rms over channels, (3,)."""
    lost = measured[busy] - filtered[busy]
    return np.sqrt([*np.mean(windows.noise(filtered) ** 2, axis=1), np.mean(lost**2)])
