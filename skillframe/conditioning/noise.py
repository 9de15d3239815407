r"""Noise figures from the data themselves: how much a quiet wrench scatters, and how fast a true one changes.

The sensor's noise is the scatter about a straight line within windows of 0.25 s; the figure is the median over the
quietest quarter of the windows, so that contact and motion do not count. The walk of the wrench model is the one whose
converged filter predicts the next sample best: with the gain fixed by the corner, the likelihood of the innovations e,
concentrated over r, is \(-\frac{n}{2} \ln \overline{e^2}\) up to a constant, maximised over a grid of corners, the
forces' and the torques' each on its own. Both are our choice.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.faults.find import alive as alive_samples
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.signals.kalman import CHUNK, WrenchModel, chunks, steady_gain

WINDOW, LEAST_SAMPLES = 0.25, 10
FLOOR = np.repeat([1e-4, 1e-6], 3)
"""Least noise assumed [N, Nm]: a channel that a simulation or a filter left clean still needs a positive figure."""


class NoiseFigures(NamedTuple):
    """Scatter of a wrench.

    Attributes:
        quiet: (6,) standard deviation in the quietest quarter of the windows [N, Nm].
        typical: (6,) median over all windows: with motion and vibration [N, Nm].
        quiet_start: start of the quietest window [s].
    """

    quiet: Float
    typical: Float
    quiet_start: float


def noise_figures(time: Float, wrench: Float, alive: NDArray[np.bool_] | None = None) -> NoiseFigures:
    """Noise of a recorded wrench.

    Args:
        time: (T,) [s].
        wrench: (T, 6) [N, Nm].
        alive: (T,) where the sensor did not stall; windows that hold a stall say nothing of noise. All if not given.

    Raises:
        InputError: fewer than ten samples, or no window without a stall.
    """
    width, live, scatter, quietest = _quiet(time, wrench, alive)
    return NoiseFigures(
        np.median(scatter[quietest], axis=0), np.median(scatter, axis=0), float(time[int(live[quietest[0]]) * width])
    )


def window_rows(
    time: Float, wrench: Float, alive: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Rows (K, W) of the windows without a stall, and which are the quietest quarter. As `noise_figures` takes them."""
    width, live, _, quietest = _quiet(time, wrench, alive)
    quiet = np.zeros(len(live), dtype=bool)
    quiet[quietest] = True
    return live[:, None] * width + np.arange(width), quiet


def _quiet(
    time: Float, wrench: Float, alive: NDArray[np.bool_] | None
) -> tuple[int, NDArray[np.intp], Float, NDArray[np.intp]]:
    """Samples in a window, the windows that count, their scatter (K, 6), and which of them are the quietest quarter."""
    if len(time) < LEAST_SAMPLES:
        raise InputError(
            "wrench", f"{len(time)} samples are too few for noise figures", f"give at least {LEAST_SAMPLES}"
        )
    width, live = _windows(time, alive)
    if not len(live):
        raise InputError(
            "wrench", f"repeats one value in every {WINDOW:g} s, so that nothing shows its noise",
            "check the sensor's connection, and record again",
        )  # fmt: skip
    scatter = detrended_std(_cut(np.asarray(wrench, dtype=float), width)[live])
    rank = (scatter / np.maximum(np.median(scatter, axis=0), FLOOR)).sum(axis=1)
    return width, live, scatter, np.argsort(rank, kind="stable")[: max(1, len(live) // 4)]


def _windows(time: Float, alive: NDArray[np.bool_] | None) -> tuple[int, NDArray[np.intp]]:
    """Samples in a window, and the windows that hold no stall."""
    width = int(np.clip(round(WINDOW / float(np.median(np.diff(time)))), LEAST_SAMPLES, len(time)))
    live = np.ones(len(time), dtype=bool) if alive is None else alive
    return width, np.flatnonzero(_cut(live, width).all(axis=1))


def _cut(samples: NDArray[Any], width: int) -> NDArray[Any]:
    """Samples (T, ...) as windows (K, width, ...). What fills no window is left out."""
    count = len(samples) // width
    return samples[: count * width].reshape(count, width, *samples.shape[1:])


def has_window(time: Float, alive: NDArray[np.bool_]) -> bool:
    """Whether a stretch that does not stall is long enough for noise figures."""
    return bool(len(_windows(time, alive)[1]))


def scatter_left(time: Float, force: Float, alive: NDArray[np.bool_] | None = None) -> float:
    """Typical scatter of a force (T, 3) that was averaged over samples: the median length over the windows [N]."""
    width, live = _windows(time, alive)
    return float(np.median(np.linalg.norm(detrended_std(_cut(force, width)[live]), axis=1))) if len(live) else 0.0


def detrended_std(windows: Float) -> Float:
    """Standard deviation (K, C) about the best straight line within windows (K, W, C), unbiased for white noise."""
    width = windows.shape[1]
    ramp = np.linspace(-1.0, 1.0, width)[:, None]
    centred = windows - windows.mean(axis=1, keepdims=True)
    slope = (centred * ramp).sum(axis=1, keepdims=True) / (ramp**2).sum()
    result: Float = np.sqrt(((centred - slope * ramp) ** 2).sum(axis=1) / (width - 2))
    return result


def estimate_model(time: Float, wrench: Float, alive: NDArray[np.bool_] | None = None) -> WrenchModel:
    """The wrench model that fits a recording: noise from its quiet windows, walk by the likelihood of the innovations.

    Args:
        time: (T,) [s], evenly spaced but for jitter.
        wrench: (T, 6) [N, Nm].
        alive: (T,) where the sensor did not stall; all if not given.
    """
    dt = float(np.median(np.diff(time)))
    noise = np.maximum(noise_figures(time, wrench, alive).quiet, FLOOR)
    wrench = wrench if alive is None else wrench[alive]
    corners = np.geomspace(min(0.5, 0.05 / dt), 0.4 / dt, 24)
    error = _innovation_variance(corners, wrench / noise, dt)
    best = [corners[np.argmin(np.log(error[:, part] + 1e-300).sum(axis=1))] for part in (slice(0, 3), slice(3, 6))]
    return WrenchModel.from_corner(noise, np.repeat(best, 3), dt)


def _innovation_variance(corners: Float, wrench: Float, dt: float) -> Float:
    """Mean squared one-step prediction error (C, 6) of the converged filters with these corners, run side by side.

    A long recording is cut into chunks that run side by side too. What a filter needs to settle in is left out of all
    but the first.
    """
    unit = np.ones((len(corners), 1))
    gain = steady_gain(unit, unit * np.sqrt(dt) * (2.0 * np.pi * corners[:, None]) ** 2, dt)
    starts, rows = chunks(len(wrench))
    counted = (rows >= starts[:, None]) & (rows < starts[:, None] + CHUNK)
    value = np.broadcast_to(wrench[rows[:, 0], None], (len(rows), len(corners), 6)).copy()
    slope, total = np.zeros_like(value), np.zeros_like(value)
    error, scratch = np.empty_like(value), np.empty_like(value)
    for i in range(1, rows.shape[1]):  # in place: new arrays cost more than the sums
        value += np.multiply(dt, slope, out=scratch)
        np.subtract(wrench[rows[:, i], None], value, out=error)
        np.square(error, out=scratch)
        if not counted[:, i].all():
            scratch *= counted[:, i, None, None]
        total += scratch
        value += np.multiply(gain.value, error, out=scratch)
        slope += np.multiply(gain.slope, error, out=scratch)
    result: Float = total.sum(axis=0) / max(1, len(wrench) - 1)
    return result


def model_of(demonstration: Demonstration, alive: NDArray[np.bool_] | None = None) -> WrenchModel:
    """The wrench model of one demonstration. Sensor noise stated in its metadata wins over the estimate.

    Args:
        demonstration: as recorded.
        alive: (T,) where the sensor did not stall; found if not given.
    """
    alive = alive_samples(demonstration) if alive is None else alive
    model = estimate_model(demonstration.time, demonstration.wrench, alive)
    sensor = demonstration.meta.get("sensor")
    if not isinstance(sensor, dict):
        return model
    stated = np.repeat([float(sensor.get("force_noise", 0.0) or 0.0), float(sensor.get("torque_noise", 0.0) or 0.0)], 3)
    return WrenchModel(noise=np.where(stated > 0.0, stated, model.noise), walk=model.walk)
