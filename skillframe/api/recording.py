"""`record`: demonstrations of a world by a simulated teacher."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from skillframe.api.inputs import Robot, Settings, World, robot_of, scene_of
from skillframe.config import build
from skillframe.errors import InputError, extras_named
from skillframe.extend.drives import drive_of
from skillframe.extend.reading import Recording
from skillframe.extend.registry import registry
from skillframe.robot.model import RobotModel
from skillframe.world.scene import Scene

Person = Any
"""Settings of a teacher of a plug-in, such as `TeacherSettings` and `BlindSettings`, or of a plug-in's drive."""
OF_TEACHER = "teacher."
"""Prefix of a teacher's settings among deviations from the nominal."""


def record(
    world: World, robot: Robot = "panda", *, teacher: str | Person | None = None, count: int = 1, seed: int = 0,
    set: Settings | None = None, angle: float | None = None, rate_hz: float | None = None,
    progress: Callable[[str], None] | None = None, watch: Callable[[float, float], None] | None = None,
) -> Recording:  # fmt: skip
    """Record demonstrations of a world by a simulated teacher.

    A demonstration that fails is sampled again and counted. The starts of the world's task are taken in turn, so that
    `count=2` shows the valley from both sides.

    Args:
        world: a name, a fixture file, or a scene of your own.
        robot: a name, a robot.toml or its folder, or a loaded robot.
        teacher: name of a plug-in's teacher with its defaults ("kinesthetic", "teleoperation", "blind",
            "disassembly"), or settings: `TeacherSettings`, `BlindSettings` or those of a plug-in's drive. None:
            kinesthetic; on a robot whose drive has teachers of its own, teleoperation.
        count: demonstrations wanted.
        seed: of everything random.
        set: deviations from the nominal, {"start.tilt_y": "5deg", "world.fillet": 8e-4, "teacher.aim_noise": "2deg"}.
        angle: of the push in the plane of a machine [rad], -pi/2 straight down; None for the world's direction.
        rate_hz: sample rate; None for 500, of machines 100.
        progress: receives messages.
        watch: called with seconds simulated and the longest duration.

    Raises:
        InputError: the teacher does not suit robot or world, or a setting cannot be used.
        UnknownName: no such world, robot, teacher or setting.
        SkillframeError: a demonstration still fails after 20 attempts; gives the reason.
    """
    given = dict(set or {})
    of_teacher = {key.removeprefix(OF_TEACHER): given.pop(key) for key in [*given] if key.startswith(OF_TEACHER)}
    scene, draws = scene_of(world, given, depth=2)
    model = robot_of(robot)
    own = drive_of(model.spec)
    person = _person(teacher, model, scene)
    if "kind" in of_teacher:
        raise InputError("--set teacher.kind", "is the teacher's", "name the teacher instead")
    if of_teacher:  # numbers in SI, or texts with a unit
        changed = build(type(person), of_teacher, f"--set {OF_TEACHER.removesuffix('.')}")
        person = replace(person, **{name: getattr(changed, name) for name in of_teacher})
    if angle is not None:
        if own is None or own.aimed is None:
            text = f"is for machines that are taught by an operator, and {model.spec.name} is not"
            raise InputError("angle", text, "leave it out")
        scene = own.aimed(model, scene, angle)
    common: dict[str, Any] = {"count": count, "seed": seed, "draws": draws, "progress": progress, "watch": watch}
    common |= {} if rate_hz is None else {"rate_hz": rate_hz}
    if own is not None and own.teach is not None:
        with extras_named():
            recording: Recording = own.teach(model, scene, person, **common)
        return recording
    name = teacher if isinstance(teacher, str) else person.kind
    shown: Recording = registry().teacher(name).record(model, scene, person, **common)
    return shown


def _person(teacher: str | Person | None, robot: RobotModel, scene: Scene) -> Person:
    if isinstance(teacher, str):
        registry().teacher(teacher)
    own = drive_of(robot.spec)
    if own is not None and own.teacher is not None and teacher in (None, "teleoperation"):
        return own.teacher()
    person: Person = seeing(teacher, scene) if teacher is None or isinstance(teacher, str) else teacher
    by_hand = isinstance(person, tuple(type(record.usual(scene)) for record in registry().records("teacher")))
    if own is not None and own.teacher is not None and by_hand:
        text = f"nobody leads {robot.spec.name} by hand, it is a {own.name} machine"
        raise InputError(f"teacher {person.kind}", text, "use teleoperation")
    if (own is None or own.teacher is None) and not by_hand:
        text = f"are for the drive of a plug-in, which {robot.spec.name} does not have"
        raise InputError(type(person).__name__, text, "use TeacherSettings")
    return person


def seeing(teacher: str | None, scene: Scene) -> Person:
    """Default settings of a named teacher, or of one with a hand on the robot. Raises `UnknownName`."""
    return registry().teacher(teacher or "kinesthetic").usual(scene)
