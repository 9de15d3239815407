r"""A filter of wrenches that is quiet where nothing happens and quick where something does.

Two filters run side by side: a *plain* one (Butterworth, second order, at most 10 Hz, forwards or both ways) and a
*wide* one, the Kalman filter or smoother of `signals.kalman` at the identified corner, held within 15 and 25 Hz. The
plain one decides, whatever the colour of the noise. Of the difference d between the two, what noise does not explain
passes:

    y = plain + d max(0, 1 - (k s / d)^2),        |y - wide| <= k s,                                           (1)

s being the scatter of d in the quietest quarter of the recording, so that vibration, which is not white, counts as it
was recorded. (1) is the shrinkage of James and Stein, one sample at a time. The walk with white noise of
`signals.kalman` alone cannot do both: with one gain for all, touch-downs decide the likelihood, and the corner ends at
its upper bound, where next to all noise passes. Run both ways, a plain filter of corner f has the gain
1 / (1 + (w/2 pi f)^4), the Wiener smoother of the same model.

Corner and k are the first of `CORNERS` and `SHARES` with which neither the noise left nor what is lost of the quickest
tenth of the samples exceeds the plain 10 Hz filter's on the recording at hand. The last of them is that filter, so that
there is one. All figures are our choice.
"""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.conditioning.noise import detrended_std, window_rows
from skillframe.frames import Float, norm
from skillframe.signals.kalman import WrenchFilter, WrenchModel

PLAIN, WIDE = 10.0, (15.0, 25.0)  # Hz
HIGHEST = 0.4
"""Highest corner as a share of the rate, so that a filter can be designed for slow recordings."""
CORNERS, SHARES = (0.9, 1.0), (4.0, 6.0, 9.0, 15.0, np.inf)
AVERAGED, QUICKEST, MOST_WINDOWS = 0.02, 0.9, 800


class CoredPart(NamedTuple):
    """What was chosen for forces or torques.

    Attributes:
        corner: of the plain filter [Hz].
        least: (3,) change that passes [N or Nm]; infinite where nothing does.
        opened: share of the samples in which the wide filter has more than half a say.
        filtered: (T, 3).
    """

    corner: float
    least: Float
    opened: float
    filtered: Float


class _Windows(NamedTuple):
    """Where noise is measured: rows (K, W), and which of them hold the quietest quarter of the recording."""

    rows: NDArray[np.intp]
    quiet: NDArray[np.bool_]

    @staticmethod
    def of(time: Float, wrench: Float, alive: NDArray[np.bool_] | None) -> _Windows:
        """All windows of a recording, or `MOST_WINDOWS` spread over it."""
        rows, quiet = window_rows(time, wrench, alive)
        some = np.flatnonzero(quiet)[:: max(1, 4 * quiet.sum() // MOST_WINDOWS)]
        others = np.flatnonzero(~quiet)[:: max(1, len(quiet) // MOST_WINDOWS)]
        chosen = np.concatenate([some, others])
        return _Windows(rows[chosen], quiet[chosen])

    def noise(self, samples: Float) -> Float:
        """Scatter (2, C): in the quietest quarter of the recording, and of the samples' own quietest quarter."""
        scatter = detrended_std(samples[self.rows])
        typical = np.median(scatter, axis=0)
        rank = (scatter / np.where(typical > 0.0, typical, 1.0)).sum(axis=1)
        own = np.argsort(rank, kind="stable")[: max(1, len(rank) // 4)]
        return np.stack([np.median(scatter[self.quiet], axis=0), np.median(scatter[own], axis=0)])


class Cored(NamedTuple):
    """A filtered wrench (T, 6), and what was chosen, for metadata and words."""

    wrench: Float
    said: dict[str, Any]


def cored(
    time: Float, wrench: Float, model: WrenchModel, *, causal: bool, alive: NDArray[np.bool_] | None = None
) -> Cored:
    """The wrench filtered as described above.

    Args:
        time: (T,) [s], ten samples or more.
        wrench: (T, 6) [N, Nm].
        model: as identified (`noise.model_of`).
        causal: without a look ahead. The choice of corner and k still sees the whole recording.
        alive: (T,) where the sensor did not stall.
    """
    dt = float(np.median(np.diff(time)))
    identified = model.corner(dt)
    most = min(WIDE[1], HIGHEST / dt)
    wide = np.clip(identified, min(WIDE[0], most), most)
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
    """Why the wide filter has its corner."""
    if identified > wide:
        return f"{identified:.3g} Hz fits best, and {wide:.3g} Hz is the most that is allowed"
    if identified < wide:
        return f"{identified:.3g} Hz fits best, and touch-downs need {wide:.3g} Hz"
    return f"{wide:.3g} Hz fits best"


def _part(measured: Float, quick: Float, windows: _Windows, rate: float, identified: float, causal: bool) -> CoredPart:
    """Forces or torques, with the first choice that is no worse than the plain filter. The last is that filter."""
    most = min(PLAIN, HIGHEST * rate)
    busy = _quickest(measured, rate)
    corners = _corners(most, identified, causal)
    slow = {corner: plain(measured, corner, rate, causal) for corner in corners}
    bar = _figures(measured, slow[most], busy, windows)
    for share, corner in product(SHARES, corners):
        difference = quick - slow[corner]
        least = np.full(3, np.inf) if np.isinf(share) else share * windows.noise(difference)[0]
        passed = _passed(difference, least)
        part = CoredPart(corner, least, float(np.mean(passed > 0.5)), slow[corner] + passed * difference)
        if np.all(_figures(measured, part.filtered, busy, windows) <= bar):
            break
    return part


def _corners(most: float, identified: float, causal: bool) -> list[float]:
    """Corners [Hz] in order. A smoother tries the recording's own first where it is lower."""
    corners = [share * most for share in CORNERS]
    return [identified, *corners] if not causal and identified < corners[0] else corners


def _passed(difference: Float, least: Float) -> Float:
    """Which share of the difference passes, equation (1)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share: Float = np.maximum(0.0, 1.0 - (least / difference) ** 2)
    return np.where(difference == 0.0, 0.0, share)


def plain(measured: Float, corner: float, rate: float, causal: bool) -> Float:
    """Samples (T, C) through a Butterworth filter of second order: forwards, or both ways, which shifts nothing."""
    from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

    sos = butter(2, corner, fs=rate, output="sos")
    if not causal:
        return np.asarray(sosfiltfilt(sos, measured, axis=0))
    return np.asarray(sosfilt(sos, measured, axis=0, zi=sosfilt_zi(sos)[:, :, None] * measured[0])[0])


def _figures(measured: Float, filtered: Float, busy: NDArray[np.bool_], windows: _Windows) -> Float:
    """Noise left, by two measures, and what is lost where the wrench changes most: rms of three channels (3,)."""
    lost = measured[busy] - filtered[busy]
    return np.sqrt([*np.mean(windows.noise(filtered) ** 2, axis=1), np.mean(lost**2)])


def _quickest(measured: Float, rate: float) -> NDArray[np.bool_]:
    """The tenth of the samples (T,) where the wrench, averaged over 20 ms, changes most."""
    from scipy.ndimage import uniform_filter1d

    change = norm(np.gradient(uniform_filter1d(measured, max(1, round(AVERAGED * rate)) | 1, axis=0), axis=0))
    return np.asarray(change >= np.quantile(change, QUICKEST))
