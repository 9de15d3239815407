r"""Wrench model of a recording: noise from quiet windows, and the rate of change of the true wrench.

The walk is that whose converged filter predicts the next sample best. With the gain fixed by the corner, the likelihood
of the innovations e, concentrated over r, is \(-\frac{n}{2} \ln \overline{e^2}\) up to a constant. A grid of corners
maximises it, separately for forces and torques.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import FLOOR, Demonstration, noise_figures
from skillframe.demonstration import alive as alive_samples
from skillframe.frames import Float
from skillframe.signals import CHUNK, WrenchModel, chunks, steady_gain


def estimate_model(time: Float, wrench: Float, alive: NDArray[np.bool_] | None = None) -> WrenchModel:
    """Return the wrench model that fits a recording.

    Args:
        time: (T,) [s], even except for jitter.
        wrench: (T, 6) [N, Nm].
        alive: (T,) samples without stalls; None for all.
    """
    dt = float(np.median(np.diff(time)))
    noise = np.maximum(noise_figures(time, wrench, alive).quiet, FLOOR)
    wrench = wrench if alive is None else wrench[alive]
    corners = np.geomspace(min(0.5, 0.05 / dt), 0.4 / dt, 24)
    error = _innovation_variance(corners, wrench / noise, dt)
    best = [corners[np.argmin(np.log(error[:, part] + 1e-300).sum(axis=1))] for part in (slice(0, 3), slice(3, 6))]
    return WrenchModel.from_corner(noise, np.repeat(best, 3), dt)


def _innovation_variance(corners: Float, wrench: Float, dt: float) -> Float:
    """Mean squared one-step prediction error (C, 6) of the converged filters with C corners.

    Chunks of a long recording run in parallel; their settling time is not counted.
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
    """Return the wrench model of a demonstration, with the sensor noise of its metadata if stated.

    Args:
        demonstration: as recorded.
        alive: (T,) samples without stalls; None detects them.
    """
    alive = alive_samples(demonstration) if alive is None else alive
    model = estimate_model(demonstration.time, demonstration.wrench, alive)
    sensor = demonstration.meta.get("sensor")
    if not isinstance(sensor, dict):
        return model
    stated = np.repeat([float(sensor.get("force_noise", 0.0) or 0.0), float(sensor.get("torque_noise", 0.0) or 0.0)], 3)
    return WrenchModel(noise=np.where(stated > 0.0, stated, model.noise), walk=model.walk)
