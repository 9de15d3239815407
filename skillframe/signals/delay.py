"""Commands that arrive later at their actuators: transport over a bus, or a valve's own dead time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float

LONGEST_DELAY = 1.0
"""Of a channel or a valve [s]; buses and valves take milliseconds, so more is a number in another unit (our choice)."""


def require_delay(seconds: float, where: object) -> None:
    """Refuse a delay that no channel has.

    Args:
        seconds: [s].
        where: what it is called, for the message.

    Raises:
        InputError: negative, longer than a second, or no number.
    """
    if not 0.0 <= seconds <= LONGEST_DELAY:
        text = f"cannot be {seconds:g} s, a delay lies between 0 and {LONGEST_DELAY:g} s"
        hint = f": {seconds:g} ms is {1e-3 * seconds:g}" if LONGEST_DELAY < seconds <= 1e3 * LONGEST_DELAY else ""
        raise InputError(where, text, f"give it in seconds{hint}")


class CommandDelay:
    """Commands (N, k) that arrive later, each trial's by its own whole number of samples.

    Args:
        ticks: (N,) samples of delay.
        k: commands of a trial.
        held: before the first command arrives there was the same one, as for a servo that holds; else zero.
    """

    def __init__(self, ticks: NDArray[np.int64], k: int, held: bool = False) -> None:
        self._held = held
        self._ticks, self._now, self._rows, self._at_once = ticks, 0, np.arange(len(ticks)), not ticks.any()
        self._line: Float = np.zeros((int(ticks.max(initial=0)) + 1, len(ticks), k))

    def start(self, command: Float) -> None:
        """As if this had been sent all the time before."""
        self._line[:] = command

    def step(self, command: Float) -> Float:
        """What arrives now, when this is sent."""
        if self._at_once:
            return command
        length = len(self._line)
        if self._held and self._now == 0:
            self._line[:] = command
        self._line[self._now % length] = command
        arrived: Float = self._line[(self._now - self._ticks) % length, self._rows]
        self._now += 1
        return arrived
