"""The true contact force of the simulator, held against the limits that the controller can only hold an estimate to.

A filtered estimate lags behind and smooths, so a trial can stay within `force_n` by its own account and exceed it in
the simulator. Such a trial is a failure of its own if

- the true force, averaged over any `MEAN_S`, is above `force_n` (so for torque and `torque_n_m`), or
- the true force of one control tick is above `TRANSIENT` times `force_n`.

Ten milliseconds is about what the controller's 25 Hz filter smooths over (1 / (2 pi 25 Hz) = 6.4 ms), so that the rule
asks no more than that the estimate be right. The factor of two is what ISO/TS 15066:2016, table A.2, allows a transient
contact with a person over a lasting one. That table is about people and contacts of up to half a second: to hold tools
and parts to it is our choice. An impact that stays below both is no failure: it is marked, by `over` ("peak 105 N for
under 10 ms").

The mean is that of the force's size, never less than the size of the mean. It is looked at every ten control ticks and
at the end of a trial, over all windows since the last look.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.control.endings import Broken, Ended
from skillframe.frames import Float
from skillframe.robot.spec import Limits

MEAN_S, TRANSIENT = 0.01, 2.0


class _Window:
    """One quantity of N trials: its largest value, and its largest mean over `width` ticks.

    A tick costs an entry in a list; the rest is done at each look, for all ticks since the last. What is kept is the
    running sum, so that a mean is the difference of two rows and does not depend on when it is looked at.
    """

    def __init__(self, count: int, width: int) -> None:
        self._width, self._sums = width, np.zeros((width, count))  # at each of the last ticks
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
        """Bring the largest mean of some trials up to date with the windows that ended since the last look."""
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
    """What N trials really push with, beside what their estimate says.

    Args:
        limits: of the robot.
        count: N.
        dt: [s] between two ticks.
    """

    def __init__(self, limits: Limits, count: int, dt: float) -> None:
        width = max(1, round(MEAN_S / dt))
        self._limits = limits
        self._force = _Window(count, width)
        self._torque = None if limits.torque_n_m is None else _Window(count, width)
        self._squares = np.zeros(count)  # of the largest estimate
        self._read: list[Float] = []

    @property
    def peak(self) -> Float:
        """(N,) largest true force so far [N]."""
        return self._force.peak

    @property
    def mean(self) -> Float:
        """(N,) largest mean of the true force over `MEAN_S` [N], as of the last look."""
        return self._force.mean

    @property
    def estimate(self) -> Float:
        """(N,) largest filtered force so far [N]."""
        self._take_in()
        largest: Float = np.sqrt(self._squares)
        return largest

    def _take_in(self) -> None:
        """Bring the largest estimate up to date."""
        if not self._read:
            return
        read = np.array(self._read)[..., :3]
        of_arms = np.vecdot(read, read).max(axis=0).reshape(len(self._squares), -1)
        np.maximum(self._squares, of_arms.max(axis=-1), out=self._squares)
        self._read.clear()

    @property
    def wants_torque(self) -> bool:
        """Is there a limit for the torque?"""
        return self._torque is not None

    def step(self, force: Float, estimate: Float, torque: Float | None) -> None:
        """Take in a tick. The arrays are kept until the next look and must not change.

        Args:
            force: (N,) size of the true contact force.
            estimate: (N, 6) filtered wrench, or (N k, 6) of k arms each.
            torque: (N,) size of the true contact torque, where it is limited.
        """
        self._force.step(force)
        self._read.append(estimate)
        if self._torque is not None and torque is not None:
            self._torque.step(torque)

    def look(self, rows: NDArray[np.int64]) -> list[Broken]:
        """The trials among `rows` that pushed harder than they may."""
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
        text = f"true {what} limit: {value:.{digits}f} {unit} in the simulator ({kind} {limit:g} {unit}"
        if what == "torque":
            return text
        return f"{text}, while the filtered estimate read at most {float(self.estimate[i]):.1f} N"


def over(peak: float, limit: float | None) -> str:
    """The mark of a trial that did not fail and still peaked above its limit, or "" if it did not.

    Args:
        peak: largest true force of the trial [N].
        limit: of its robot [N].
    """
    if limit is None or not peak > limit:
        return ""
    return f"true force peaked at {peak:.1f} N, above {limit:g} N, for under {1e3 * MEAN_S:.0f} ms"
