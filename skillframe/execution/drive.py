"""`Drive`: what stands between a command and the plant, as the one loop sees it.

    prepare -> (sense -> [skill] -> act -> violations -> advance) each tick

The loop knows neither arms nor oil. A drive reads its sensors, turns a command into what its actuators take, holds its
own limits, and moves the plant by a tick. `skillframe.execution.drives` has those that ship: ideal joint torques,
several arms, electric servos as FMUs, a hydraulic machine.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from skillframe.control.endings import Broken
from skillframe.execution.result import Result
from skillframe.execution.trace import Trace
from skillframe.frames import Float
from skillframe.skill import Command, Observation
from skillframe.world.plant import Plant

Trials = NDArray[np.int64]


class Shares(NamedTuple):
    """What N trials took of their actuators so far.

    Attributes:
        energy: (N,) work of the controller on the tool [J].
        torque: (N,) of the worst joint: what the law asked for, over the joint's effort; NaN where none is given.
        speed: (N,) of the worst joint: its speed over its velocity limit; NaN where none is given.
        range: (N,) of the worst joint: its distance from the middle of its range over half the range; NaN where none
            is given, None where a drive does not tell.
        joints: (3, N) names of the worst joints of torque, speed and range; None where a drive does not tell.
    """

    energy: Float
    torque: Float
    speed: Float
    range: Float | None = None
    joints: NDArray[np.object_] | None = None


class TrialRecorder(Protocol):
    """What a drive's trials leave behind. `skillframe.execution.recorder.Recorder` is the plain one."""

    def record(self, tick: int, time: float, observation: Observation, command: Command, law: Float) -> None:
        """Take a sample if one is due at this tick."""

    def close(self, rows: Trials) -> None:
        """Mark trials as ended now."""

    def trace(self, i: int, meta: dict[str, Any]) -> Trace:
        """The trace of trial i, with its metadata."""


class Drive(Protocol):
    """Sensors and actuators of N trials. Trials are independent of each other, to the last bit.

    Where a drive steers several arms, observations, commands and the law's wrench are (N, arms, ...), else (N, ...).

    Attributes:
        plant: the simulated robots in their world.
        dt: [s] between two ticks.
        actuators: names of the joints that have an actuator of their own in the simulation; none for ideal torques.
    """

    plant: Plant
    dt: float
    actuators: tuple[str, ...]

    def prepare(self) -> list[Broken]:
        """Before the skill starts: tare, or identify. Trials that cannot run, each with the cause in words."""

    def sense(self, tick: int, active: Trials) -> Observation:
        """Read the sensors of the trials that still run. The other rows may hold anything finite or not."""

    def act(self, command: Command, ramp: float) -> Float:
        """Take in a command. The wrench (N, 6) that the law puts on the tool at the centre of compliance.

        Args:
            command: what the skill wants.
            ramp: 0 ... 1 fades desired twist and feed-forward in, so that a start is bumpless.
        """

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """Trials among `active` that broke a limit in this tick."""

    def advance(self, active: Trials) -> list[Broken]:
        """Move the plant by a tick. Trials whose actuators failed, each with a sentence that needs no time added."""

    def end(self, rows: Trials) -> None:
        """Trials end now, as they stand."""

    def contact_torque(self) -> Float:
        """(N,) size of the true contact torque at the centre of compliance [Nm]."""

    def shares(self) -> Shares:
        """What the trials took of their actuators so far."""

    def notes(self, i: int) -> list[str]:
        """Sentences about what trial i's result holds and leaves out."""

    def recording(self, every: int) -> TrialRecorder:
        """What records the batch, a sample every `every` ticks."""

    def outcome(self, result: Result) -> Result:
        """The batch's result, with what this kind of drive has to add."""
