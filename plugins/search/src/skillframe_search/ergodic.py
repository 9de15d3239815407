r"""Search trajectory by ergodic control: the time spent at a place follows the exploration distribution.

Spectral multiscale coverage (Mathew and Mezic, Physica D 240 (2011) 432-442), first-order dynamics:

    c_k(t) = 1/t int_0^t f_k(x(s)) ds,   b = sum_k L_k (c_k - phi_k) grad f_k(x),   x' = -v b / |b|,
    L_k = (1 + |k|^2)^(-(d+1)/2),   f_k = prod_i cos(k_i pi (x_i + R_i) / 2 R_i) / h_k

on a box of R_i = 3.2 standard deviations along the Gaussian's axes, with E[cos(k pi (x + R) / 2 R)] = cos(k pi / 2)
exp(-(k pi s / 2 R)^2 / 2).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from skillframe.frames import Float, norm
from skillframe_search.exploration import Exploration
from skillframe_search.smoothing import STEP_S

REACH = 3.2  # standard deviations
ORDERS = {1: 20, 2: 10, 3: 7, 4: 4, 5: 3}  # basis functions per axis


def ergodic(exploration: Exploration, speed: float, duration: float) -> Float:
    """(n, k) places every 20 ms [m], from the start (zero), at a constant speed [m/s]."""
    variance, axes = np.linalg.eigh(exploration.spread)
    half = REACH * np.sqrt(variance)
    basis = _Basis(half, ORDERS[len(half)])
    target = basis.of_normal(np.sqrt(variance))
    here = np.clip((np.zeros(len(half)) - exploration.center) @ axes, -half, half)
    here = here + 1e-3 * half * np.arange(1, len(half) + 1)  # the gradient vanishes at the middle
    total, path = np.zeros_like(target), [here]
    for tick in range(1, round(duration / STEP_S) + 1):
        value, slope = basis.at(here)
        total += value
        way = (basis.importance * (total / tick - target)) @ slope
        here = here - speed * STEP_S * way / max(float(norm(way)), 1e-12)
        here = np.where(here > half, 2.0 * half - here, np.where(here < -half, -2.0 * half - here, here))
        path.append(here)
    result: Float = exploration.center + np.array(path) @ axes.T
    result[0] = 0.0
    return result


class _Basis:
    """Cosines on the box [-half, half], with (n,) importance L_k."""

    def __init__(self, half: Float, order: int) -> None:
        self._half = half
        self._index = np.array(list(product(range(order), repeat=len(half))), dtype=float)
        lengths = np.where(self._index > 0.0, half, 2.0 * half)
        self._h = np.sqrt(lengths.prod(axis=1))
        self._frequency = self._index * np.pi / (2.0 * half)
        self.importance = (1.0 + (self._index**2).sum(axis=1)) ** (-0.5 * (len(half) + 1))

    def at(self, place: Float) -> tuple[Float, Float]:
        """Values (n,) and gradients (n, d) at a place (d,)."""
        phase = self._frequency * (place + self._half)
        cosine, sine = np.cos(phase), np.sin(phase)
        value = cosine.prod(axis=1) / self._h
        slope = np.empty_like(cosine)
        for axis in range(cosine.shape[1]):
            others = np.delete(cosine, axis, axis=1).prod(axis=1)
            slope[:, axis] = -self._frequency[:, axis] * sine[:, axis] * others / self._h
        return value, slope

    def of_normal(self, deviation: Float) -> Float:
        """(n,) coefficients of a centred normal density with these standard deviations."""
        one = np.cos(0.5 * np.pi * self._index) * np.exp(-0.5 * (self._frequency * deviation) ** 2)
        result: Float = one.prod(axis=1) / self._h
        return result
