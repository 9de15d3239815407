"""`Setup`: robot, task and settings of a run, what does not change between the trials of a batch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.robot.model import RobotModel
from skillframe.robot.spec import Limits
from skillframe.world.scene import Scene, State
from skillframe.world.sensors import SensorSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What does not change between the trials of a batch.

    Attributes:
        robot: the nominal robot.
        scene: the task.
        center_of_compliance: (3,) point of the tool frame that the skill sees and steers; (arms, 3) for several arms.
        sensors: noise of the sensors.
        filter_wrench: False hands the raw wrench to the skill and the limits.
        make_drive: makes a plug-in's drive, `make_drive(setup, draws, rngs)`; None takes one of skillframe's own.
        skill_speed: of the skill in contact, where its type knows it [m/s].
        stop_when: ends a trial as done, looked at every 10 ms; None leaves the end to the skill.
        attempts_at: for each trial, the number of what it is an attempt at. Once one reaches the goal, as `stop_when`
            finds it, later ones at the same are ended as interrupted; None: every trial is wanted.
    """

    robot: RobotModel
    scene: Scene
    center_of_compliance: Float = field(default_factory=lambda: np.zeros(3))
    sensors: SensorSettings = field(default_factory=SensorSettings)
    filter_wrench: bool = True
    make_drive: Callable[..., Any] | None = None
    skill_speed: float | None = None
    stop_when: Callable[[State], NDArray[np.bool_]] | None = None
    attempts_at: tuple[int, ...] | None = None

    @property
    def pace(self) -> float:
        """Seconds that a second of the skill takes on this robot, 1 or more."""
        return self.robot.spec.control.pace(self.skill_speed)

    @property
    def limits(self) -> Limits:
        """The robot's limits. No torque rate without joints, or where the arm's own loop makes the torques."""
        spec = self.robot.spec
        told = spec.base != "free" and spec.control.interface == "torque"
        return spec.limits if told else replace(spec.limits, torque_rate_nm_s=None)
