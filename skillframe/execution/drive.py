"""`Drive`: interface between the simulation loop and a robot's sensors, actuators and plant.

    prepare -> (sense -> [skill] -> act -> violations -> advance) each tick

A drive reads its sensors, turns commands into actuator inputs, checks its limits, and steps the plant. The core's
drives are in `skillframe.execution.drives`; plug-ins add others.

`PacedSkill` runs a skill at an arm's command rate, on a clock slowed to the arm's speed: position-controlled arms
cannot push at the demonstrated speed (`skillframe.robot.interface`). A second of the skill takes `pace` seconds: it
sees times divided by the pace and twists multiplied by it; the caller divides its twists.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from skillframe.execution.result import Result
from skillframe.execution.trace import Trace
from skillframe.extend.hardware import DriveType
from skillframe.frames import Float
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import Limits
from skillframe.skill import Broken, Command, Observation, Skill
from skillframe.world.plant import Plant
from skillframe.world.quantities import SensorSettings
from skillframe.world.scene import Scene, State

Trials = NDArray[np.int64]  #: indices of trials


class Shares(NamedTuple):
    """Actuator use of N trials so far. Shares are NaN where no limit is given, None where a drive has none.

    Attributes:
        energy: (N,) work of the controller on the tool [J].
        torque: (N,) commanded torque over effort of the worst joint.
        speed: (N,) speed over velocity limit of the worst joint.
        range: (N,) distance from the middle of the range over half of it, of the worst joint.
        joints: (3, N) names of these joints.
    """

    energy: Float
    torque: Float
    speed: Float
    range: Float | None = None
    joints: NDArray[np.object_] | None = None


class TrialRecorder(Protocol):
    """Records the trials of a drive. `skillframe.execution.recorder.Recorder` is the default."""

    def record(self, tick: int, time: float, observation: Observation, command: Command, law: Float) -> None:
        """Record a sample if one is due at this tick."""

    def close(self, rows: Trials) -> None:
        """Mark trials as ended."""

    def trace(self, i: int, meta: dict[str, Any]) -> Trace:
        """The trace of trial i with its metadata."""


class Drive(Protocol):
    """Sensors and actuators of N trials, whose results are independent to the last bit.

    Observations, commands and wrenches are (N, arms, ...) for several arms, else (N, ...).

    Attributes:
        plant: the simulated robots in their world.
        dt: [s] between two ticks.
        actuators: names of joints with a simulated actuator; empty for ideal torques.
    """

    plant: Plant
    dt: float
    actuators: tuple[str, ...]

    def prepare(self) -> list[Broken]:
        """Tare or identify before the skill starts. Returns trials that cannot run, with the cause."""

    def sense(self, tick: int, active: Trials) -> Observation:
        """Read the sensors of the active trials. Other rows may hold anything."""

    def act(self, command: Command, ramp: float) -> Float:
        """Apply a command and return the controller's wrench (N, 6) on the tool at the centre of compliance.

        `ramp`, 0 to 1, scales desired twist and feed-forward for a smooth start.
        """

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """Trials among `active` that broke a limit in this tick."""

    def advance(self, active: Trials) -> list[Broken]:
        """Step the plant. Returns trials whose actuators failed, with a complete sentence."""

    def end(self, rows: Trials) -> None:
        """End trials in their current state."""

    def contact_torque(self) -> Float:
        """Size of the true contact torque at the centre of compliance (N,) [Nm]."""

    def shares(self) -> Shares:
        """Actuator use of the trials so far."""

    def notes(self, i: int) -> list[str]:
        """Sentences on assumptions and gaps of trial i's result."""

    def recording(self, every: int) -> TrialRecorder:
        """A recorder with a sample every `every` ticks."""

    def outcome(self, result: Result) -> Result:
        """The batch's result, with what this drive adds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Robot, task and settings shared by the trials of a batch.

    Attributes:
        robot: the nominal robot.
        scene: the task.
        center_of_compliance: (3,) point of the tool frame that the skill controls; (arms, 3) for several arms.
        sensors: noise of the sensors.
        filter_wrench: False passes the raw wrench to skill and limits.
        drive: replaces the robot's own drive.
        skill_speed: of the skill in contact, where known [m/s].
        stop_when: ends a trial as done, checked every 10 ms; None leaves the end to the skill.
        attempts_at: number of each trial's attempted goal. When `stop_when` finds a goal reached, later attempts at it
            end as interrupted. None runs all trials.
    """

    robot: RobotModel
    scene: Scene
    center_of_compliance: Float = field(default_factory=lambda: np.zeros(3))
    sensors: SensorSettings = field(default_factory=SensorSettings)
    filter_wrench: bool = True
    drive: DriveType | None = None
    skill_speed: float | None = None
    stop_when: Callable[[State], NDArray[np.bool_]] | None = None
    attempts_at: tuple[int, ...] | None = None

    @property
    def pace(self) -> float:
        """Seconds that a second of the skill takes on this robot, 1 or more."""
        return self.robot.spec.control.pace(self.skill_speed)

    @property
    def limits(self) -> Limits:
        """The robot's limits, with a torque rate only for torque-controlled joints."""
        spec = self.robot.spec
        told = spec.base != "free" and spec.control.interface == "torque"
        return spec.limits if told else replace(spec.limits, torque_rate_nm_s=None)


class PacedSkill(Skill):
    """A skill with a new command every `every` ticks, whose second takes `pace` >= 1 seconds."""

    def __init__(self, skill: Skill, every: int, pace: float) -> None:
        self._skill, self._every, self._pace = skill, every, pace
        self._tick = 0
        self._command: Command | None = None

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Start the skill and the tick count."""
        self._tick, self._command = 0, None
        self._skill.start(self._seen(observation), rngs)

    def step(self, observation: Observation) -> Command:
        """A new command if one is due, else the last one."""
        if self._command is None or self._tick % self._every == 0:
            self._command = self._skill.step(self._seen(observation))
        self._tick += 1
        return self._command

    def between(self) -> Command | None:
        """The last command, or None if a new one is due."""
        if self._command is None or self._tick % self._every == 0:
            return None
        self._tick += 1
        return self._command

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """Restart rows of the skill."""
        self._skill.restart(rows, self._seen(observation), rngs)

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """The skill's log, in seconds of the run."""
        return [(self._pace * time, text) for time, text in self._skill.journal(trial)]

    def _seen(self, observation: Observation) -> Observation:
        twist, time = self._pace * observation.twist, observation.time / self._pace
        return Observation(time, self._every * observation.dt / self._pace, observation.pose, twist, observation.wrench)
