r"""The contract of the loop: what a skill observes, what it commands, and how it ends.

Everything carries a leading dimension N, the trials that run in lock-step; one run is N = 1. A skill answers each
observation with a desired pose and an impedance, and the controller exerts, at the centre of compliance,

  F = K (x_d - x) + D (v_d - v) + F_ff                                                   (1)

which is equation (1) of the overview paper with the damping sign that dissipates: D acts on desired minus measured
twist, and a desired twist of zero is allowed. A skill owns no clock, no files and no randomness of its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from enum import IntEnum, StrEnum
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, Pose

Reasons = NDArray[np.object_]  #: why each trial ended, or None
_Scalar = TypeVar("_Scalar", bound=np.generic)


class Status(IntEnum):
    """State of a skill after a step."""

    RUNNING = 0
    SUCCESS = 1
    FAILURE = 2


class Observation(NamedTuple):
    """What a skill observes at one tick, for N trials.

    Attributes:
        time: (N,) seconds since the start of the run.
        dt: seconds between two ticks of the skill.
        pose: measured pose of the centre of compliance in base: position (N, 3), rotation (N, 3, 3).
        twist: (N, 6) measured twist of that point, base axes [m/s, rad/s].
        wrench: (N, 6) filtered wrench of the environment on the tool, at that point, base axes [N, Nm].
    """

    time: Float
    dt: float
    pose: Pose
    twist: Float
    wrench: Float


class Impedance(NamedTuple):
    """Stiffness and damping at the centre of compliance, base axes. Build it once per phase and reuse it.

    Attributes:
        stiffness: (N, 6, 6) or (6, 6), symmetric positive semi-definite; zero along compliant axes.
        damping: same shape, positive definite; None lets the controller design critical damping from the task-space
            inertia (with a floor on the compliant axes).
    """

    stiffness: Float
    damping: Float | None = None


class Command(NamedTuple):
    """What a skill commands, for N trials.

    Attributes:
        pose: desired pose of the centre of compliance in base.
        twist: (N, 6) desired twist, base axes.
        impedance: stiffness and damping.
        feedforward: (N, 6) wrench added to equation (1), robot on environment, base axes.
        status: (N,) integers of `Status`.
        reason: (N,) strings: why a trial ended, in words; empty while running.
    """

    pose: Pose
    twist: Float
    impedance: Impedance
    feedforward: Float
    status: NDArray[np.int64]
    reason: Reasons


class Skill(ABC):
    """A behaviour that runs in the loop, for N trials at once.

    `start` is called once with the first observation and one random generator per trial, then `step` at each tick.
    Rows of trials that have ended are still passed in (frozen), and their commands are ignored. A row's command may
    depend on that row's observations and generator only.
    """

    @abstractmethod
    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Prepare for a run of len(rngs) trials, from where the tool is now."""

    @abstractmethod
    def step(self, observation: Observation) -> Command:
        """Return the command for one observation, without waiting."""

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Start again in some trials, as `start` would in them alone. The others continue.

        Compositions use it to let trials enter a skill at different times. A skill without it runs there with one
        instance per trial.

        Args:
            rows: (M,) which trials.
            observation: of all N trials.
            rngs: M generators.
        """
        raise NotImplementedError(f"{type(self).__name__} cannot start again in some of its trials; see per_trial")

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """Events of a trial: times [s] and words, possibly none."""
        return []


def no_reasons(count: int) -> Reasons:
    """An array of `count` empty reasons."""
    return np.full(count, "", dtype=object)


class _PerTrial(Skill):
    """Runs one scalar skill per trial (see `per_trial`)."""

    def __init__(self, make: Callable[[], Skill]) -> None:
        self._make = make
        self._skills: list[Skill] = []

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        self._skills = [self._make() for _ in rngs]
        for i, (skill, rng) in enumerate(zip(self._skills, rngs, strict=True)):
            skill.start(row(observation, i), [rng])

    def step(self, observation: Observation) -> Command:
        return stack_commands([skill.step(row(observation, i)) for i, skill in enumerate(self._skills)])

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        for i, rng in zip(rows.tolist(), rngs, strict=True):
            self._skills[i] = self._make()
            self._skills[i].start(row(observation, i), [rng])

    def journal(self, trial: int) -> list[tuple[float, str]]:
        return self._skills[trial].journal(0)


def restartable(make: Callable[[], Skill]) -> Skill:
    """A skill that can start again in some of its trials: itself, or one instance per trial."""
    skill = make()
    return per_trial(make) if type(skill).restart is Skill.restart else skill


def per_trial(make: Callable[[], Skill]) -> Skill:
    """A batched skill from a factory of skills for one trial (N = 1 arrays), one instance per trial.

    The loop costs about 20 us per trial and tick; write the skill over arrays for large campaigns.
    """
    return _PerTrial(make)


def row(observation: Observation, i: int) -> Observation:
    """The observation of trial i alone, as a batch of one."""
    return rows_of(observation, slice(i, i + 1))


def rows_of(observation: Observation, rows: slice | NDArray[np.intp]) -> Observation:
    """The observation of some trials as a batch."""
    pose = Pose(observation.pose.position[rows], observation.pose.rotation[rows])
    return Observation(observation.time[rows], observation.dt, pose, observation.twist[rows], observation.wrench[rows])


def stack_commands(commands: Sequence[Command]) -> Command:
    """One command from commands of single trials."""

    def each(pick: Callable[[Command], NDArray[_Scalar]]) -> NDArray[_Scalar]:
        return np.concatenate([pick(c) for c in commands])

    def matrices(pick: Callable[[Command], Float | None]) -> Float | None:
        parts = [pick(c) for c in commands]
        if any(p is None for p in parts):
            return None
        return np.concatenate([np.broadcast_to(p, (1, 6, 6)) for p in parts if p is not None])

    stiffness = matrices(lambda c: c.impedance.stiffness)
    assert stiffness is not None
    return Command(
        Pose(each(lambda c: c.pose.position), each(lambda c: c.pose.rotation)),
        each(lambda c: c.twist),
        Impedance(stiffness, matrices(lambda c: c.impedance.damping)),
        each(lambda c: c.feedforward),
        each(lambda c: c.status),
        each(lambda c: c.reason),
    )


class Ended(StrEnum):
    """The column `ended_by` of results.csv."""

    GOAL = "goal"  # the goal was reached
    SKILL = "skill"  # the skill reported that it is done, or has failed
    TIME = "time"
    FORCE = "force"  # filtered estimate
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
    COMMAND = "command"  # the skill returned an invalid command
    MACHINE = "machine"  # its FMUs, their coupling, its swing
    SENSOR = "sensor"  # impossible readings of a machine
    LINK = "link"  # a real robot that stopped, or is no longer heard
    WATCHDOG = "watchdog"  # a machine that does not follow its command
    INTERRUPTED = "interrupted"
    START = "start"  # began in penetration: counts neither as success nor as failure
    LOST = "lost"  # the process ended without an outcome


class Broken(NamedTuple):
    """A trial `row` that has to end now, with its code and an explanation."""

    row: int
    code: Ended
    cause: str
