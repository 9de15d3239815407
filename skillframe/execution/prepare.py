"""From names and values to a skill and a set-up that the executor can run. Shared by `run`, campaigns and quickstart.

Settings are the keys of `--set` and of `[vary]`: parameters of the world's dataclass (`world.clearance`) shape the
scene; the quantities of the executor (`start.tilt_y`, `fixture.offset_x`, `world.friction` ...) are per trial.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.config.ranges import require_within
from skillframe.config.units import si
from skillframe.cosim.servos import require_servos
from skillframe.demonstration.places import KEY, as_plain
from skillframe.demonstration.record import resolve_point
from skillframe.document.file import understood
from skillframe.document.frame import read_frame, with_center
from skillframe.errors import InputError, UnknownName
from skillframe.execution.executor import Setup
from skillframe.extend.records import CoordinatorType, Document
from skillframe.extend.registry import registry
from skillframe.extend.worlds import make_scene
from skillframe.frames import Float, Pose
from skillframe.machine.checks.figures import require_figures
from skillframe.robot.kinematics import UnreachablePose, inverse_kinematics
from skillframe.robot.model import RobotModel, load_model
from skillframe.robot.spec import OWN_DRIVES, RobotSpec, load_robot
from skillframe.skill import Skill
from skillframe.world.placement import places_in_base, start_poses
from skillframe.world.quantities import QUANTITIES, RANGES, UNITS
from skillframe.world.scene import Scene


def split_settings(world: str | None, settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, float]]:
    """Scene parameters (without the `world.` prefix) and per-trial quantities out of `--set` keys.

    Args:
        world: its name; None where its scene is built already, which leaves the per-trial quantities.
        settings: by name.

    Raises:
        UnknownName: a key that exists in neither, with the nearest one.
        InputError: a quantity that is not a number, has a unit of another dimension, or is beyond its range.
    """
    params_type = None if world is None else registry().world(world).params
    fields = set() if params_type is None else {f"world.{f.name}" for f in dataclasses.fields(params_type)}
    params: dict[str, Any] = {}
    draws: dict[str, float] = {}
    for key, value in settings.items():
        if key in fields:
            params[key.removeprefix("world.")] = value
        elif key in QUANTITIES:
            typed, value = value, si(value, UNITS[key], f"--set {key}")
            if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
                raise InputError(
                    f"--set {key}",
                    f"expected a finite number, got {value!r}",
                    "give it in SI units, or with a unit: 8mm, 5deg",
                )
            require_within(typed, value, UNITS[key], RANGES[key], f"--set {key}")
            draws[key] = float(value)
        else:
            known = {*fields, *QUANTITIES}
            group = f"{key.partition('.')[0]}."
            raise UnknownName("setting", key, [k for k in known if k.startswith(group)] or known)
    return params, draws


def load_world(name: str, params: Mapping[str, Any]) -> Scene:
    """A world's scene with parameters set.

    Raises:
        UnknownName: no such world. InputError: a parameter it does not have, or out of range.
    """
    return make_scene(registry().world(name), params)


def load_robot_model(robot: str | Path | RobotSpec) -> RobotModel:
    """A robot by name, by path or as declared, ready to be simulated.

    Raises:
        SkillframeError: unknown, does not load, has no arm, needs loops or actuators that a run does not simulate, or
            cylinders or servos whose figures are missing or impossible.
    """
    spec = robot if isinstance(robot, RobotSpec) else load_robot(robot)
    spec.require_simulated()
    if (name := spec.other_drive) and name not in registry().names("drive"):
        known = [*OWN_DRIVES, *registry().names("drive")]
        raise InputError(f"{spec.folder / 'robot.toml'}: drive.kind", str(UnknownName("drive", name, known)))
    if spec.servo:
        require_servos(spec)
    elif not name:
        require_figures(spec)
    return load_model(spec)


def drive_maker(robot: RobotModel) -> Callable[..., Any] | None:
    """What makes the drive that robot.toml names and a plug-in brings. None where it names none.

    Raises:
        UnknownName: there is no such drive.
    """
    name = robot.spec.other_drive
    return registry().drive(name).make if name else None


def center_of_compliance(document: Document, scene: Scene, coc: str | None) -> Float:
    """The point of the tool frame (3,) that the skill steers: `coc` if given, else the skill file's own.

    Raises:
        UnknownName: `coc` is neither three numbers nor a frame of the tool.
    """
    frame = read_frame(document)
    return frame.center_of_compliance if coc is None else resolve_point(coc, {**frame.points, **scene.tool.frames})


def prepare(
    robot: RobotModel, scene: Scene, document: Document, coc: str | None = None,
    places: Mapping[str, Pose] | None = None,
) -> tuple[Skill, Setup]:  # fmt: skip
    """A runnable skill and its set-up from a checked skill document.

    Args:
        robot: who runs it.
        scene: where. A skill that goes by places is told where the scene's are, the fixture standing as it should.
        document: as read.
        coc: centre of compliance, as typed; None as learned.
        places: poses of places in base, in place of the scene's.

    Raises:
        UnknownName: the skill's type or the centre of compliance is unknown, or nobody says where a place is.
        InputError: the skill says where it goes, and that is outside the robot's workspace.
    """
    document = _told_places(document, {**places_in_base(robot, scene), **(places or {})})
    kind = registry().behaviour(document["type"])
    what, made = f"the {kind.name} skill", drive_maker(robot)
    if isinstance(kind, CoordinatorType):
        with understood(what):
            coordinator = kind.build(document)
        centers = _centers(kind, document, scene, coc)
        return coordinator, Setup(robot=robot, scene=scene, center_of_compliance=centers, make_drive=made)
    center = center_of_compliance(document, scene, coc)
    placed = with_center(document, center.tolist())
    with understood(what):
        skill = kind.build(placed)
        area = None if kind.area is None else kind.area(document)
        speed = None if kind.speed is None else kind.speed(document)
    if area is not None:
        _check_area(robot, scene, document, area)
    return skill, Setup(
        robot=robot, scene=scene, center_of_compliance=center, make_drive=made, skill_speed=speed
    )  # fmt: skip


def _told_places(document: Document, known: Mapping[str, Pose]) -> Document:
    """The document with the poses of its places as they are now, not as they were shown."""
    needed = document.get(KEY)
    if not isinstance(needed, dict) or not needed:
        return document
    for name in needed:
        if name not in known:
            note = "the skill goes by it; say where it is: --places FILE.toml"
            raise UnknownName("place", name, known, note=note)
    return {**document, KEY: as_plain({name: known[name] for name in needed})}


def _centers(kind: CoordinatorType, document: Document, scene: Scene, coc: str | None) -> Float:
    """(arms, 3) centres of compliance of a coordinator."""
    if kind.centers is None:
        return np.tile(center_of_compliance(document, scene, coc), (2, 1))
    if coc is not None:
        raise InputError("--coc", f"each arm of a {kind.name} skill has its own", "set them in the skill file")
    return kind.centers(document)


def _check_area(robot: RobotModel, scene: Scene, document: Document, area: Float) -> None:
    """Refuse a box (2, 3), relative to the start, that leaves the robot's workspace from the nominal start.

    The workspace is `limits.workspace_m`; without one, an arm's is what it reaches in the attitude of the start.
    """
    start = start_poses(robot, scene, {}, 1)
    turn = start.rotation[0] if read_frame(document).from_start else np.eye(3)
    corners = np.array(list(itertools.product(*area.T))) @ turn.T + start.position[0]
    if _inside(robot, corners, start.rotation[0]):
        return
    reach = " to ".join(str(np.round(c, 3).tolist()) for c in (corners.min(axis=0), corners.max(axis=0)))
    raise InputError(
        f"skill type {document['type']}", f"its search area, {reach} m, leaves the workspace of {robot.spec.name}",
        "start elsewhere, search less far, or widen limits.workspace_m in robot.toml",
    )  # fmt: skip


def _inside(robot: RobotModel, corners: Float, attitude: Float) -> bool:
    if robot.spec.limits.workspace_m is not None:
        low, high = np.array(robot.spec.limits.workspace_m)
        return bool(np.all(corners >= low) and np.all(corners <= high))
    if robot.spec.hydraulic:  # a machine's path is judged by its cylinders
        return True
    q = robot.home
    try:
        for corner in corners:
            q = inverse_kinematics(robot, 0, Pose(corner, attitude), q)
    except UnreachablePose:
        return False
    return True
