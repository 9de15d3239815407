r"""Delay of commands, filtered rates, and the Kalman filter of a wrench.

In the Kalman filter every channel is a value with a random-walk slope in white noise.

With the state \(x = (w, \dot w)\) of a channel and sample time h,

    x' = [[1, h], [0, 1]] x + noise of covariance q^2 [[h^3/3, h^2/2], [h^2/2, h]],     z = w + noise of variance r^2.

With the converged gain (Anderson and Moore, Optimal Filtering, 1979), a sample gives

    w- = w + h s,     e = z - w-,     w = w- + k_1 e,     s = s + k_2 e                                   (1)

It depends on \(q^2 h^3 / r^2\), so on the corner frequency \(f = (q^2 / (r^2 h))^{1/4} / 2\pi\), and follows ramps
without lag. (1) runs in the loop.

Over recordings, the gain varies with time and the equations are written out for many chunks (Anderson and Moore; Rauch,
Tung and Striebel, AIAA J. 3, 1965). With P = [[a, b], [b, c]], step h and e = z - w^-:

    a^- = a + h (2 b + h c) + q^2 h^3/3,    b^- = b + h c + q^2 h^2/2,    c^- = c + q^2 h
    k = (a^-, b^-) / (a^- + r^2),           x = x^- + k e,                 P = (1 - k H) P^-

and backwards, with C = P F^T (P^-)^{-1} of the next step, x_s = x + C (x_s' - x'^-).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, SkillframeError
from skillframe.frames import Float

CORNER = 25.0
"""Noise of a wrist sensor [N, Nm] and corner [Hz] at 1 kHz."""
CHUNK, OVERLAP = 4_000, 2_000  #: samples of a chunk, and of its overlap with the next


@dataclass(frozen=True, slots=True, kw_only=True)
class WrenchModel:
    """Noise of the six channels, force then torque.

    Attributes:
        noise: (6,) standard deviation of the sensor's noise per sample, r [N, Nm].
        walk: (6,) walk of the slope, q [N/s^1.5, Nm/s^1.5].
    """

    noise: Float
    walk: Float

    def __post_init__(self) -> None:
        for name in ("noise", "walk"):
            value = getattr(self, name)
            if value.shape != (6,) or not np.all(np.isfinite(value) & (value > 0.0)):
                raise SkillframeError(f"wrench filter: {name} must be six positive numbers, got {value}")

    @staticmethod
    def from_corner(noise: Float, corner: float | Float, dt: float) -> WrenchModel:
        """Model whose converged filter has this corner [Hz], a number or (6,), at sample time `dt` [s]."""
        noise = np.asarray(noise, dtype=float)
        return WrenchModel(noise=noise, walk=noise * np.sqrt(dt) * (2.0 * np.pi * np.asarray(corner)) ** 2)

    @staticmethod
    def default(dt: float = 1e-3) -> WrenchModel:
        """Default of the loop: 0.3 N, 0.02 Nm, 25 Hz."""
        return WrenchModel.from_corner(np.repeat([0.3, 0.02], 3), CORNER, dt)  # N, Nm

    def corner(self, dt: float) -> Float:
        """Corner frequencies (6,) [Hz] of the converged filter at sample time `dt` [s]."""
        result: Float = np.sqrt(self.walk / (self.noise * np.sqrt(dt))) / (2.0 * np.pi)
        return result


class Gain(NamedTuple):
    """Converged gain per channel.

    Attributes:
        value: (...,) k_1 [-].
        slope: (...,) k_2 [1/s].
        innovation: (...,) variance of e over r^2.
    """

    value: Float
    slope: Float
    innovation: Float


def transition(dt: float) -> Float:
    """(2, 2) transition matrix of one channel."""
    return np.array([[1.0, dt], [0.0, 1.0]])


def process_noise(walk: float, dt: float) -> Float:
    """(2, 2) process noise covariance of one channel over `dt`."""
    return walk**2 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])


def steady_gain(noise: Float, walk: Float, dt: float) -> Gain:
    """Converged gain of the Kalman filter, by doubling of the Riccati recursion.

    For P = F (P^-1 + H^T H / r^2)^-1 F^T + Q, with A = F^T and G = H^T H / r^2, each round (Anderson, Second-order
    convergent algorithms for the steady-state Riccati equation, 1978) doubles the recursions:

        A' = A W A,  G' = G + A W G A^T,  P' = P + A^T P W A,   W = (1 + G P)^-1.
    """
    ratio = np.asarray(walk, dtype=float) / np.asarray(noise, dtype=float)
    shape = (*ratio.shape, 2, 2)
    # time in samples, values in r: keeps every matrix near 1
    index = (ratio**2 * dt**3)[..., None, None]
    a = np.broadcast_to(transition(1.0).T, shape)
    g = np.broadcast_to(np.array([[1.0, 0.0], [0.0, 0.0]]), shape)
    p = index * process_noise(1.0, 1.0)
    for _ in range(24):
        inverse = np.linalg.inv(np.eye(2) + g @ p)
        turned = np.swapaxes(a, -1, -2)
        a, g, p = a @ inverse @ a, g + a @ inverse @ g @ turned, p + turned @ p @ inverse @ a
    innovation = p[..., 0, 0] + 1.0
    return Gain(p[..., 0, 0] / innovation, p[..., 1, 0] / innovation / dt, innovation)


def steady_step(value: Any, slope: Any, measured: Any, gain: Gain, dt: float) -> tuple[Any, Any]:
    """Value and slope after a measurement, equation (1), as arrays (..., n) or CasADi expressions."""
    value = value + dt * slope
    error = measured - value
    return value + gain.value * error, slope + gain.slope * error


class SteadyWrenchFilter:
    """Converged filter of N independent wrenches, equation (1), at sample time `dt` [s]."""

    def __init__(self, gain: Gain, dt: float) -> None:
        self.gain, self.dt = gain, dt
        self._value = np.zeros((0, 6))
        self._slope = np.zeros((0, 6))

    def start(self, wrench: Float) -> None:
        """Start at a wrench (N, 6) with zero slope."""
        self._value = np.array(wrench, dtype=float)
        self._slope = np.zeros_like(self._value)

    def step(self, wrench: Float) -> Float:
        """Filter a measurement (N, 6), returning a new array."""
        self._value, self._slope = steady_step(self._value, self._slope, wrench, self.gain, self.dt)
        return self._value.copy()


def chunks(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First samples (K,) of a recording's chunks, and their rows with overlaps (K, L)."""
    starts = np.arange(0, count, CHUNK)
    length = min(count, CHUNK + 2 * OVERLAP)
    return starts, np.clip(starts - OVERLAP, 0, count - length)[:, None] + np.arange(length)


class WrenchFilter:
    """Wrench filter of a model and sample time `dt` [s]."""

    def __init__(self, model: WrenchModel | None = None, dt: float = 1e-3) -> None:
        if not 0.0 < dt < float("inf"):
            raise SkillframeError(f"wrench filter: the sample time must be positive, got {dt} s")
        self.model, self.dt = model or WrenchModel.default(dt), dt

    def steady(self) -> SteadyWrenchFilter:
        """Filter for the loop."""
        return SteadyWrenchFilter(steady_gain(self.model.noise, self.model.walk, self.dt), self.dt)

    def kalman(self) -> Any:
        """Filter of all channels as filterpy's `KalmanFilter`: state (12,), value and slope by channel."""
        from filterpy.kalman import KalmanFilter

        kalman = KalmanFilter(dim_x=12, dim_z=6)
        noise: Float = np.zeros((12, 12))
        for i, walk in enumerate(self.model.walk):
            noise[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = process_noise(float(walk), self.dt)
        kalman.F, kalman.Q = np.kron(np.eye(6), transition(self.dt)).astype(np.float64), noise
        kalman.H = np.kron(np.eye(6), [[1.0, 0.0]])
        kalman.R = np.diag(self.model.noise**2)
        kalman.P = np.kron(np.diag(self.model.noise**2), np.diag([1.0, self.dt**-2]))
        return kalman

    def filter(self, time: Float, wrench: Float) -> Float:
        """Causally filtered wrench (T, 6), with time-varying gain and the samples' spacing."""
        return self._over(time, wrench, smooth=False)

    def smooth(self, time: Float, wrench: Float) -> Float:
        """Smoothed wrench (T, 6) without lag, by Rauch-Tung-Striebel."""
        return self._over(time, wrench, smooth=True)

    def _over(self, time: Float, wrench: Float, smooth: bool) -> Float:
        """Process chunks in parallel. Overlaps far exceed the filter's memory."""
        starts, rows = chunks(len(time))
        first = rows[:, 0]
        run = run_smoother if smooth else run_filter
        result = np.empty_like(wrench, dtype=float)
        for some in np.array_split(np.arange(len(starts)), -(-len(starts) // 64)):  # chunks at once, to bound memory
            steps = np.concatenate([np.full((len(some), 1), self.dt), np.diff(time[rows[some]], axis=1)], axis=1)
            parts = run(self.model, self.dt, steps, wrench[rows[some]])
            for k, part in zip(some.tolist(), parts, strict=True):
                stop = min(len(time), int(starts[k]) + CHUNK)
                result[starts[k] : stop] = part[starts[k] - first[k] : stop - first[k]]
        return result


def run_filter(model: Any, dt: float, steps: Float, wrench: Float) -> Float:
    """Filtered wrenches (K, L, 6), for times before each sample (K, L) [s]. `dt` scales the first covariance."""
    value, _ = _forward(model, dt, steps, wrench, None)
    return np.swapaxes(value, 0, 1)


def run_smoother(model: Any, dt: float, steps: Float, wrench: Float) -> Float:
    """Smoothed wrenches, for the arguments of `run_filter`."""
    kept = np.empty((5, steps.shape[1], steps.shape[0], 6))
    value, slope = _forward(model, dt, steps, wrench, kept)
    return np.swapaxes(_backward(model, steps, value, slope, kept), 0, 1)


def _forward(model: Any, dt: float, steps: Float, wrench: Float, kept: Float | None) -> tuple[Float, Float]:
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


LONGEST_DELAY = 1.0
"""Longest delay of a channel or actuator [s]."""


def require_delay(seconds: float, where: object) -> None:
    """Refuse an implausible delay [s].

    Raises:
        InputError: negative, above a second, or NaN.
    """
    if not 0.0 <= seconds <= LONGEST_DELAY:
        text = f"cannot be {seconds:g} s, a delay lies between 0 and {LONGEST_DELAY:g} s"
        hint = f": {seconds:g} ms is {1e-3 * seconds:g}" if LONGEST_DELAY < seconds <= 1e3 * LONGEST_DELAY else ""
        raise InputError(where, text, f"give it in seconds{hint}")


class CommandDelay:
    """Delay of commands (N, k) by whole samples (N,). With `held`, the first command also holds before it arrives."""

    def __init__(self, ticks: NDArray[np.int64], k: int, held: bool = False) -> None:
        self._held = held
        self._ticks, self._now, self._rows, self._at_once = ticks, 0, np.arange(len(ticks)), not ticks.any()
        self._line: Float = np.zeros((int(ticks.max(initial=0)) + 1, len(ticks), k))

    def start(self, command: Float) -> None:
        """Fill the line with a command."""
        self._line[:] = command

    def step(self, command: Float) -> Float:
        """Send a command and return the one that arrives."""
        if self._at_once:
            return command
        length = len(self._line)
        if self._held and self._now == 0:
            self._line[:] = command
        self._line[self._now % length] = command
        arrived: Float = self._line[(self._now - self._ticks) % length, self._rows]
        self._now += 1
        return arrived


def rate_after(value: Any, rate: Any, shown: Any, w: Any, dt: Any) -> tuple[Any, Any]:
    """Value and rate of the filter w^2 / (s + w)^2 after a sample of dt [s], as arrays or CasADi expressions."""
    rate = rate + dt * (w**2 * (shown - value) - 2.0 * w * rate)
    return value + dt * rate, rate


class RateFilter:
    """Filter w^2 / (s + w)^2 by elements (semi-implicit Euler, stable below w dt = 2 (sqrt(2) - 1)).

    Args:
        corner: w / 2 pi [Hz]; dt: [s].

    Attributes:
        value, rate: of the input.
    """

    def __init__(self, corner: float, dt: float) -> None:
        self._w, self._dt = 2.0 * np.pi * corner, dt
        self.value: Float = np.zeros(0)
        self.rate: Float = np.zeros(0)

    def start(self, value: Float) -> None:
        """Start at rest at a value."""
        self.value, self.rate = value.copy(), np.zeros_like(value)

    def step(self, value: Float) -> Float:
        """Return the rate after a sample."""
        self.value, self.rate = rate_after(self.value, self.rate, value, self._w, self._dt)
        return self.rate
