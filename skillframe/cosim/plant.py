"""The mechanical side of a co-simulation: one power bond per actuator, force in, motion out."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


class Motion(NamedTuple):
    """Motion of the pistons at an instant, each (count,): position [m], velocity [m/s], acceleration [m/s^2]."""

    position: Float
    velocity: Float
    acceleration: Float


class Mechanics(Protocol):
    """Mechanics with `count` bonds, trial by trial as in the bank of actuators.

    It may also have `where() -> (position, velocity)`, (count,) each, for the end of a step: where accelerations are
    dear the master then asks for them once a step, at its beginning.
    """

    count: int

    def motion(self, force: Float) -> Motion:
        """Motion now, with the bonds' forces (count,) [N] acting."""

    def advance(self, begin: Float, end: Float, step: float) -> None:
        """Advance by `step` [s] under forces that go linearly from `begin` to `end`, (count,) each [N]."""

    def effective_mass(self) -> Float:
        """Mass that each bond feels now, (count,) [kg]: inverse of the acceleration per newton on that bond alone."""

    def save(self) -> None:
        """Remember the state, for `restore`."""

    def restore(self) -> None:
        """Return to the state of the last `save`."""
