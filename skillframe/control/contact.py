"""Limits on the simulator's true contact force, besides those on the filtered estimate.

The estimate lags and smooths. A trial fails if

- the true force, averaged over any `MEAN_S`, is above `force_n` (likewise torque and `torque_n_m`), or
- the true force of one control tick is above `TRANSIENT` times `force_n`.

10 ms is about the smoothing of the controller's 25 Hz filter (1 / (2 pi 25 Hz) = 6.4 ms). The factor of two is the
ratio of transient to lasting contact with people in ISO/TS 15066:2016, table A.2, assumed for tools and parts too.
`over` notes shorter peaks. Means are of the force's size, checked every ten ticks over all windows since.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, dot
from skillframe.robot.spec import Limits
from skillframe.skill import Broken, Ended

MEAN_S, TRANSIENT = 0.01, 2.0


class _Window:
    """Largest value of one quantity of N trials, and its largest mean over `width` ticks.

    Ticks are only stored, and evaluated at each `look`. Means are differences of running sums, which makes them
    independent of when they are evaluated.
    """

    def __init__(self, count: int, width: int) -> None:
        self._width, self._sums = width, np.zeros((width, count))  # sums at the last ticks
        self._new: list[Float] = []
        self._peak, self.mean = np.zeros(count), np.zeros(count)

    def step(self, size: Float) -> None:
        self._new.append(size)

    @property
    def peak(self) -> Float:
        if not self._new:
            return self._peak
        largest: Float = np.max([self._peak, *self._new], axis=0)
        return largest

    def look(self, rows: NDArray[np.int64]) -> None:
        if not self._new:
            return
        new = np.array(self._new)
        np.maximum(self._peak, new.max(axis=0), out=self._peak)
        sums = np.concatenate([self._sums, new])
        sums[self._width - 1 :] = np.add.accumulate(sums[self._width - 1 :], axis=0)
        gained = sums[self._width :] - sums[: -self._width]
        self.mean[rows] = np.maximum(self.mean, gained.max(axis=0) / self._width)[rows]
        self._sums = sums[-self._width :]
        self._new.clear()


class TrueContact:
    """True and estimated contact forces of N trials, checked against the robot's limits."""

    def __init__(self, limits: Limits, count: int, dt: float) -> None:
        width = max(1, round(MEAN_S / dt))
        self._limits = limits
        self._force = _Window(count, width)
        self._torque = None if limits.torque_n_m is None else _Window(count, width)
        self._squares = np.zeros(count)  # of the largest estimate
        self._read: list[Float] = []

    @property
    def peak(self) -> Float:
        """Largest true force so far (N,) [N]."""
        return self._force.peak

    @property
    def mean(self) -> Float:
        """Largest mean of the true force over `MEAN_S` (N,) [N], as of the last `look`."""
        return self._force.mean

    @property
    def estimate(self) -> Float:
        """Largest filtered force so far (N,) [N]."""
        self._take_in()
        largest: Float = np.sqrt(self._squares)
        return largest

    def _take_in(self) -> None:
        if not self._read:
            return
        read = np.array(self._read)[..., :3]
        of_arms = dot(read, read).max(axis=0).reshape(len(self._squares), -1)
        np.maximum(self._squares, of_arms.max(axis=-1), out=self._squares)
        self._read.clear()

    @property
    def wants_torque(self) -> bool:
        """Whether torque is limited."""
        return self._torque is not None

    def step(self, force: Float, estimate: Float, torque: Float | None) -> None:
        """Record one tick of force (N,), filtered wrench (N, 6) or (N k, 6), and torque (N,) where it is limited.

        The arrays must not change before the next `look`.
        """
        self._force.step(force)
        self._read.append(estimate)
        if self._torque is not None and torque is not None:
            self._torque.step(torque)

    def look(self, rows: NDArray[np.int64]) -> list[Broken]:
        """Return the trials among `rows` that exceeded a limit."""
        self._take_in()
        self._force.look(rows)
        broken = self._broken(rows, self._force, self._limits.force_n, Ended.TRUE_FORCE, "force", "N")
        if self._torque is not None:
            self._torque.look(rows)
            more = self._broken(rows, self._torque, self._limits.torque_n_m, Ended.TRUE_TORQUE, "torque", "Nm")
            broken += [one for one in more if one.row not in {known.row for known in broken}]
        return broken

    def _broken(
        self, rows: NDArray[np.int64], seen: _Window, limit: float | None, code: Ended, what: str, unit: str
    ) -> list[Broken]:
        if limit is None:
            return []
        over = (seen.mean > limit) | (seen.peak > TRANSIENT * limit)
        if not np.count_nonzero(over):
            return []
        return [Broken(int(i), code, self._told(int(i), seen, limit, what, unit)) for i in rows[over[rows]]]

    def _told(self, i: int, seen: _Window, limit: float, what: str, unit: str) -> str:
        mean, peak, digits = float(seen.mean[i]), float(seen.peak[i]), 1 if unit == "N" else 2
        kind = f"mean over {1e3 * MEAN_S:.0f} ms) is above" if mean > limit else f"peak) is above {TRANSIENT:g} x"
        value = mean if mean > limit else peak
        text = f"true {what} limit: {value:.{digits}f} {unit} ({kind} {limit:g} {unit}"
        if what == "torque":
            return text
        return f"{text}, while the filtered estimate read at most {float(self.estimate[i]):.1f} N"


def over(peak: float, limit: float | None) -> str:
    """Note on a successful trial whose largest true force `peak` [N] is above `limit` [N], else ""."""
    if limit is None or not peak > limit:
        return ""
    return f"true force peaked at {peak:.1f} N, above {limit:g} N, for under {1e3 * MEAN_S:.0f} ms"
