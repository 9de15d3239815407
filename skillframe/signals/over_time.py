r"""The wrench filter and smoother over a whole recording, with the samples' own spacing, for many chunks at once.

Each channel is a value and a slope (`signals.kalman`), so that its covariance has three numbers, and the textbook's
equations (Anderson and Moore, Optimal Filtering, 1979; Rauch, Tung and Striebel, AIAA J. 3, 1965) are written out.
With P = [[a, b], [b, c]], step h and e = z - w^-:

    a^- = a + h (2 b + h c) + q^2 h^3/3,    b^- = b + h c + q^2 h^2/2,    c^- = c + q^2 h
    k = (a^-, b^-) / (a^- + r^2),           x = x^- + k e,                 P = (1 - k H) P^-

and backwards, with C = P F^T (P^-)^{-1} of the next step, x_s = x + C (x_s' - x'^-). The smoothed state's covariance
is not needed here and is left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skillframe.frames import Float


def run_filter(model: Any, dt: float, steps: Float, wrench: Float) -> Float:
    """Filtered wrenches.

    Args:
        model: a `WrenchModel`.
        dt: sample time of the design [s], which the first covariance goes by.
        steps: (K, L) time before each sample [s].
        wrench: (K, L, 6) as measured.

    Returns:
        (K, L, 6).
    """
    value, _ = _forward(model, dt, steps, wrench, None)
    return np.swapaxes(value, 0, 1)


def run_smoother(model: Any, dt: float, steps: Float, wrench: Float) -> Float:
    """Smoothed wrenches. Takes the arguments of `run_filter`."""
    kept = np.empty((5, steps.shape[1], steps.shape[0], 6))
    value, slope = _forward(model, dt, steps, wrench, kept)
    return np.swapaxes(_backward(model, steps, value, slope, kept), 0, 1)


def _forward(model: Any, dt: float, steps: Float, wrench: Float, kept: Float | None) -> tuple[Float, Float]:
    """Filtered values and slopes (L, K, 6). `kept` takes a, b, c after each sample, and predicted value and slope."""
    count, length = steps.shape
    values, slopes = np.empty((length, count, 6)), np.empty((length, count, 6))
    r2, q2 = model.noise**2, model.walk**2
    w, s = np.array(wrench[:, 0], dtype=float), np.zeros((count, 6))
    a, b, c = np.tile(r2, (count, 1)), np.zeros((count, 6)), np.tile(r2 / dt**2, (count, 1))
    for i in range(length):
        h = steps[:, i, None]
        noise = q2 * h
        half = 0.5 * h * noise
        a = a + h * (2.0 * b + h * c) + h * h * noise / 3.0
        b = b + h * c + half
        c = c + noise
        w = w + h * s
        if kept is not None:
            kept[3, i], kept[4, i] = w, s
        gain = 1.0 / (a + r2)
        error = wrench[:, i] - w
        k1, k2 = a * gain, b * gain
        w, s = w + k1 * error, s + k2 * error
        c = c - k2 * b
        b = r2 * k2
        a = r2 * k1
        values[i], slopes[i] = w, s
        if kept is not None:
            kept[0, i], kept[1, i], kept[2, i] = a, b, c
    return values, slopes


def _backward(model: Any, steps: Float, value: Float, slope: Float, kept: Float) -> Float:
    """Smoothed values (L, K, 6), written over the filtered ones."""
    q2 = model.walk**2
    later_w, later_s = value[-1], slope[-1]
    for i in range(len(value) - 2, -1, -1):
        h = steps[:, i + 1, None]
        a, b, c = kept[0, i], kept[1, i], kept[2, i]
        noise = q2 * h
        up = a + h * b  # P F^T = [[a + h b, b], [b + h c, c]]
        down = b + h * c
        a_next = up + h * down + h * h * noise / 3.0
        b_next = down + 0.5 * h * noise
        c_next = c + noise
        scale = 1.0 / (a_next * c_next - b_next * b_next)
        dw, ds = later_w - kept[3, i + 1], later_s - kept[4, i + 1]
        x = (c_next * dw - b_next * ds) * scale
        y = (a_next * ds - b_next * dw) * scale
        later_w = value[i] + up * x + b * y
        later_s = slope[i] + down * x + c * y
        value[i] = later_w
    return value
