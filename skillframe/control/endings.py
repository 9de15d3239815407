"""What ended a trial, as a short code for tables. The sentence that goes with it stands in `failure` and `reason`."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Ended(StrEnum):
    """The column `ended_by` of results.csv."""

    GOAL = "goal"  # what the run waited for was there
    SKILL = "skill"  # the skill said that it is done, or has failed
    TIME = "time"
    FORCE = "force"  # of the filtered estimate
    TORQUE = "torque"
    TRUE_FORCE = "true_force"  # of the simulator
    TRUE_TORQUE = "true_torque"
    TORQUE_RATE = "torque_rate"
    MOTOR = "motor"
    SPEED = "speed"  # of a joint
    RANGE = "range"  # of a joint
    COLLISION = "collision"
    WORKSPACE = "workspace"
    ENERGY = "energy"
    DIVERGED = "diverged"
    COMMAND = "command"  # what the skill handed back is no command
    MACHINE = "machine"  # its FMUs, their coupling, its swing
    SENSOR = "sensor"  # of a machine: its readings cannot be
    WATCHDOG = "watchdog"  # a machine that does not do what it is told
    INTERRUPTED = "interrupted"
    LOST = "lost"  # the process that ran it left no outcome


class Broken(NamedTuple):
    """A trial that has to end now.

    Attributes:
        row: which trial.
        code: of `ended_by`.
        cause: why, in words.
    """

    row: int
    code: Ended
    cause: str
