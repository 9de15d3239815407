"""How good a force estimate was on a pressing crane: error while it slides, as a share of the load."""

from typing import NamedTuple

import numpy as np

from tests.crane_press import DT, LANDED, Case

SLIDING = LANDED + 1.5  # s; the reference slides at its full speed


class Score(NamedTuple):
    """Per seed: root mean square and maximum of the error, of both components and of the normal force, in % of load."""

    rms: np.ndarray
    largest: np.ndarray
    normal_rms: np.ndarray
    normal_largest: np.ndarray
    load: np.ndarray

    def __str__(self):
        return (
            f"rms {self.rms.mean():.2f} (worst seed {self.rms.max():.2f}) %, max {self.largest.max():.2f} (median seed"
            f" {np.median(self.largest):.2f}) %; normal force rms {self.normal_rms.mean():.2f} max"
            f" {self.normal_largest.max():.2f} % of {self.load.mean():.0f} N"
        )


def case(seeds, plate=1e6):
    """Plants with friction 20 % more or less, cylinder by cylinder, and all masses 2 % more or less."""
    draws = [np.random.default_rng([seed, 7]) for seed in seeds]
    friction = np.array([1.0 + 0.2 * rng.choice([-1.0, 1.0], 3) for rng in draws])
    return Case(friction, np.array([1.0 + 0.02 * rng.choice([-1.0, 1.0]) for rng in draws]), plate)


def window(log, valid):
    """(T, N) both boom pistons truly faster than 10 mm/s and the estimate valid, and the same whether valid or not."""
    fast = (np.abs(log.speed[..., :2]) > 0.010).all(axis=-1) & (np.arange(len(valid)) * DT > SLIDING)[:, None]
    return fast & valid, fast


def score(log, force, chosen):
    """Of an estimate (T, N, 2) where `chosen` (T, N)."""
    error = force - log.force
    size, normal = np.hypot(*np.moveaxis(error, -1, 0)), np.abs(error[..., 1])
    rows = []
    for i in range(size.shape[1]):
        at = chosen[:, i]
        load = log.force[at, i, 1].mean()
        rows.append([100.0 / load * f(e[at, i]) for e in (size, normal) for f in (root_mean_square, np.max)] + [load])
    return Score(*np.array(rows).T)


def root_mean_square(x):
    return np.sqrt(np.mean(x**2))
