"""`record`: demonstrations of a world from a simulated person."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from skillframe.api.tasks import Robot, Settings, World, robot_of, scene_of
from skillframe.errors import InputError, UnknownName, extras_named
from skillframe.robot.model import RobotModel
from skillframe.teaching import sessions
from skillframe.teaching.blind import BlindSettings
from skillframe.teaching.blind_sessions import record_blind
from skillframe.teaching.sessions import Recording
from skillframe.teaching.teacher import TeacherSettings
from skillframe.teaching.teleoperation import OperatorSettings
from skillframe.world.scene import Scene

Person = TeacherSettings | BlindSettings | OperatorSettings
REMOTE_DELAY_S, REMOTE_SCALE = 0.1, 2.0
"""One-way delay and motion scale of a person who teleoperates an arm, where nothing else is said; our choice."""
TEACHERS = ("blind", "kinesthetic", "teleoperation")


def record(
    world: World, robot: Robot = "panda", *, teacher: str | Person | None = None, count: int = 1, seed: int = 0,
    set: Settings | None = None, rate_hz: float | None = None, progress: Callable[[str], None] | None = None,
    watch: Callable[[float, float], None] | None = None,
) -> Recording:  # fmt: skip
    """Record demonstrations of a world from a simulated person.

    A demonstration that fails is redrawn and counted. The starts of the world's task are taken in turn, so that
    `count=2` shows the valley from both sides.

    Args:
        world: a name, a fixture file, or a scene of your own.
        robot: a name, a robot.toml or its folder, or a loaded robot.
        teacher: "kinesthetic", "teleoperation" or "blind" as they are by default, or how the person is in detail:
            `TeacherSettings`, `BlindSettings` or, for a hydraulic machine, `OperatorSettings`. None: somebody whose
            hand is on the arm; on a hydraulic machine an operator.
        count: demonstrations wanted.
        seed: everything random follows from it.
        set: what differs from the nominal, {"start.tilt_y": "5deg", "world.fillet": 8e-4}.
        rate_hz: sample rate; None for 500, of machines 100.
        progress: told in words what happens.
        watch: called with seconds simulated and the longest duration.

    Raises:
        InputError: the teacher does not suit robot or world, or a setting cannot be used.
        UnknownName: no such world, robot, teacher or setting.
        SkillframeError: a demonstration still fails after 20 attempts; says with what.
    """
    scene, draws = scene_of(world, set, depth=2)
    model = robot_of(robot)
    person = _person(teacher, model, scene)
    common: dict[str, Any] = {"count": count, "seed": seed, "draws": draws, "progress": progress, "watch": watch}
    common |= {} if rate_hz is None else {"rate_hz": rate_hz}
    if isinstance(person, OperatorSettings):
        with extras_named():
            from skillframe.teaching.machine_sessions import record_operated  # needs casadi, which arms do without

        return record_operated(model, scene, person, **common)
    if isinstance(person, BlindSettings):
        return record_blind(model, scene, person, **common)
    return sessions.record(model, scene, person, **common)


def _person(teacher: str | Person | None, robot: RobotModel, scene: Scene) -> Person:
    """The person in detail, and one who can teach this robot."""
    machine, name = robot.spec.hydraulic, robot.spec.name
    if isinstance(teacher, str) and teacher not in TEACHERS:
        raise UnknownName("teacher", teacher, TEACHERS)
    if teacher is None or isinstance(teacher, str):
        person = OperatorSettings() if machine and teacher in (None, "teleoperation") else seeing(teacher, scene)
    else:
        person = teacher
    if machine and not isinstance(person, OperatorSettings):
        raise InputError(
            f"teacher {person.kind}", f"nobody leads {name} by hand, it is a hydraulic machine", "use teleoperation"
        )
    if isinstance(person, OperatorSettings) and not machine:
        raise InputError("OperatorSettings", f"are for hydraulic machines, which {name} is not", "use TeacherSettings")
    return person


def seeing(teacher: str | None, scene: Scene) -> TeacherSettings | BlindSettings:
    """The person of a name as by default. One who is blindfolded believes what the world's task says."""
    if teacher == "blind":
        return BlindSettings(believed=scene.task.believed)
    if teacher == "teleoperation":
        return TeacherSettings(kind="teleoperation", delay_s=REMOTE_DELAY_S, scale=REMOTE_SCALE)
    return TeacherSettings()
