r"""Kalman filter of a wrench: every channel is a value whose slope wanders, seen through white noise.

With the state \(x = (w, \dot w)\) of one channel and the sample time h,

    x' = [[1, h], [0, 1]] x + noise of covariance q^2 [[h^3/3, h^2/2], [h^2/2, h]],     z = w + noise of variance r^2,

r being the sensor's noise (`WrenchModel.noise`) and q the walk of the slope (`walk`, N/s^1.5 and Nm/s^1.5). The gain
converges to a constant (Anderson and Moore, Optimal Filtering, 1979), after which a tick is

    w- = w + h s,     e = z - w-,     w = w- + k_1 e,     s = s + k_2 e                                   (1)

It depends on \(q^2 h^3 / r^2\) alone, so on the corner frequency \(f = (q^2 / (r^2 h))^{1/4} / 2\pi\), and follows
a ramp without lag. (1) runs in the loop. Over a recording the gain is the time-varying one (`signals.over_time`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float
from skillframe.signals.over_time import run_filter, run_smoother

FORCE_NOISE, TORQUE_NOISE, CORNER = 0.3, 0.02, 25.0
"""Noise of a wrist sensor on a moving robot [N, Nm] and a corner [Hz] at 1 kHz: our choice; 0.2-0.65 N are seen."""
CHUNK, OVERLAP = 4_000, 2_000
TOGETHER = 64
"""Chunks that are filtered side by side, so that memory does not grow with length: some 200 MB for the smoother."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WrenchModel:
    """Noise figures of the six channels, force then torque.

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
        """The model whose converged filter has this corner [Hz], a number or (6,), at sample time `dt` [s]."""
        noise = np.asarray(noise, dtype=float)
        return WrenchModel(noise=noise, walk=noise * np.sqrt(dt) * (2.0 * np.pi * np.asarray(corner)) ** 2)

    @staticmethod
    def default(dt: float = 1e-3) -> WrenchModel:
        """The loop's default: 0.3 N, 0.02 Nm, 25 Hz."""
        return WrenchModel.from_corner(np.repeat([FORCE_NOISE, TORQUE_NOISE], 3), CORNER, dt)

    def corner(self, dt: float) -> Float:
        """Corner frequencies (6,) of the converged filter at sample time `dt` [Hz]."""
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
    """(2, 2) covariance of one channel's process noise over `dt`."""
    return walk**2 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])


def steady_gain(noise: Float, walk: Float, dt: float) -> Gain:
    """The gain that the Kalman filter converges to, by doubling of the Riccati recursion.

    For P = F (P^-1 + H^T H / r^2)^-1 F^T + Q, with A = F^T and G = H^T H / r^2, each round (Anderson, Second-order
    convergent algorithms for the steady-state Riccati equation, 1978)

        A' = A W A,  G' = G + A W G A^T,  P' = P + A^T P W A,   W = (1 + G P)^-1

    does as many recursions as all rounds before it, so that 24 of them suffice for any corner.

    Args:
        noise: (...,) r.
        walk: (...,) q.
        dt: sample time [s].
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
    """Equation (1): value and slope after a measurement. Arrays (..., n) or casadi expressions."""
    value = value + dt * slope
    error = measured - value
    return value + gain.value * error, slope + gain.slope * error


class SteadyWrenchFilter:
    """The converged filter for N wrenches in lock-step, equation (1): array arithmetic only, each row for itself.

    Args:
        gain: of its channels; dt: [s] between two measurements. Both can be read.
    """

    def __init__(self, gain: Gain, dt: float) -> None:
        self.gain, self.dt = gain, dt
        self._value = np.zeros((0, 6))
        self._slope = np.zeros((0, 6))

    def start(self, wrench: Float) -> None:
        """Begin at a measured wrench (N, 6) with no slope."""
        self._value = np.array(wrench, dtype=float)
        self._slope = np.zeros_like(self._value)

    def step(self, wrench: Float) -> Float:
        """Take in one measurement (N, 6) and return the filtered wrench (N, 6), a fresh array."""
        self._value, self._slope = steady_step(self._value, self._slope, wrench, self.gain, self.dt)
        return self._value.copy()


def chunks(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First samples (K,) of chunks of a recording, and the rows (K, L) of each with its overlaps, all of one length."""
    starts = np.arange(0, count, CHUNK)
    length = min(count, CHUNK + 2 * OVERLAP)
    return starts, np.clip(starts - OVERLAP, 0, count - length)[:, None] + np.arange(length)


class WrenchFilter:
    """The design: a wrench model at a sample time, as filterpy's filter and as its converged gain.

    Args:
        model: noise figures; the loop's default if not given.
        dt: sample time [s].
    """

    def __init__(self, model: WrenchModel | None = None, dt: float = 1e-3) -> None:
        if not 0.0 < dt < float("inf"):
            raise SkillframeError(f"wrench filter: the sample time must be positive, got {dt} s")
        self.model, self.dt = model or WrenchModel.default(dt), dt

    def steady(self) -> SteadyWrenchFilter:
        """The filter for the loop."""
        return SteadyWrenchFilter(steady_gain(self.model.noise, self.model.walk, self.dt), self.dt)

    def kalman(self) -> Any:
        """Filterpy's `KalmanFilter` of all channels: state (12,), value and slope channel by channel."""
        from filterpy.kalman import KalmanFilter

        kalman = KalmanFilter(dim_x=12, dim_z=6)
        kalman.F, kalman.Q = self._matrices(self.dt)
        kalman.H = np.kron(np.eye(6), [[1.0, 0.0]])
        kalman.R = np.diag(self.model.noise**2)
        kalman.P = np.kron(np.diag(self.model.noise**2), np.diag([1.0, self.dt**-2]))
        return kalman

    def _matrices(self, dt: float) -> tuple[Float, Float]:
        noise: Float = np.zeros((12, 12))
        for i, walk in enumerate(self.model.walk):
            noise[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = process_noise(float(walk), dt)
        transitions: Float = np.kron(np.eye(6), transition(dt)).astype(np.float64)
        return transitions, noise

    def filter(self, time: Float, wrench: Float) -> Float:
        """Filtered wrench (T, 6), causal, with the time-varying gain and the samples' own spacing."""
        return self._over(time, wrench, smooth=False)

    def smooth(self, time: Float, wrench: Float) -> Float:
        """Smoothed wrench (T, 6): forward filter, then Rauch-Tung-Striebel backwards, without lag."""
        return self._over(time, wrench, smooth=True)

    def _over(self, time: Float, wrench: Float, smooth: bool) -> Float:
        """In chunks that overlap by far more than the filter's memory, side by side: a step is one for all chunks."""
        starts, rows = chunks(len(time))
        first = rows[:, 0]
        run = run_smoother if smooth else run_filter
        result = np.empty_like(wrench, dtype=float)
        for some in np.array_split(np.arange(len(starts)), -(-len(starts) // TOGETHER)):
            steps = np.concatenate([np.full((len(some), 1), self.dt), np.diff(time[rows[some]], axis=1)], axis=1)
            parts = run(self.model, self.dt, steps, wrench[rows[some]])
            for k, part in zip(some.tolist(), parts, strict=True):
                stop = min(len(time), int(starts[k]) + CHUNK)
                result[starts[k] : stop] = part[starts[k] - first[k] : stop - first[k]]
        return result
