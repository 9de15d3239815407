"""Builds a skill and its set-up from names and values, for `run`, campaigns and demo.

Settings are the keys of `--set` and `[vary]`. Parameters of the world (`world.clearance`) shape the scene; quantities
of the executor (`start.tilt_y`, `fixture.offset_x`, `world.friction` ...) are per trial.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.config.units import require_within
from skillframe.cosim.servos import require_servos
from skillframe.demonstration.record import resolve_point
from skillframe.document.file import understood
from skillframe.document.frame import PLACES, as_plain, read_frame, with_center
from skillframe.errors import InputError, UnknownName
from skillframe.execution.executor import Setup
from skillframe.extend.drives import of_world, quantities, require_driven, typed_value, unknown
from skillframe.extend.records import CoordinatorType, Document, make_scene
from skillframe.extend.registry import registry
from skillframe.frames import Float, Pose
from skillframe.robot.kinematics import UnreachablePose, inverse_kinematics
from skillframe.robot.model import RobotModel, load_model
from skillframe.robot.spec import RobotSpec, load_robot
from skillframe.skill import Skill
from skillframe.world.placement import places_in_base, start_poses
from skillframe.world.scene import Scene


def split_settings(world: str | None, settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, float]]:
    """Split `--set` keys into scene parameters (without `world.`) and per-trial quantities.

    `world` is None if the scene is already built, which leaves the quantities.

    Raises:
        UnknownName: a key that exists in neither, with the nearest one.
        InputError: a quantity that is not a number, has a wrong unit, or is out of range.
    """
    fields = {} if world is None else of_world(registry().world(world).params)
    known = {**quantities(), **fields}
    params: dict[str, Any] = {}
    draws: dict[str, float] = {}
    for key, value in settings.items():
        if key not in known:
            raise unknown(key, known)
        if key in fields:
            params[key.removeprefix("world.")] = value
            continue
        where = f"--set {key}"
        draws[key] = typed_value(known[key], value, where)
        require_within(value, draws[key], known[key].unit, known[key].range, where)
    return params, draws


def load_world(name: str, params: Mapping[str, Any]) -> Scene:
    """A world's scene with parameters set.

    Raises:
        UnknownName: no such world.
        InputError: an unknown parameter, or one out of range.
    """
    return make_scene(registry().world(name), params)


def load_robot_model(robot: str | Path | RobotSpec) -> RobotModel:
    """A robot by name, path or declaration, ready for simulation.

    Raises:
        SkillframeError: unknown, cannot be loaded, has no arm, needs loops or actuators that cannot be simulated, or
            actuators with missing or impossible figures.
    """
    spec = robot if isinstance(robot, RobotSpec) else load_robot(robot)
    spec.require_simulated()
    if spec.servo:
        require_servos(spec)
    model = load_model(spec)
    require_driven(model)
    return model


def center_of_compliance(document: Document, scene: Scene, coc: str | None) -> Float:
    """Centre of compliance in the tool frame (3,): `coc` if given, else the skill file's.

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

    `coc` is the centre of compliance as typed, None for the learned one; `places` replace the scene's, in base.

    Raises:
        UnknownName: unknown skill type, centre of compliance or place.
        InputError: the skill leaves the robot's workspace.
    """
    known = {**places_in_base(robot, scene), **(places or {})}
    needed = document.get(PLACES)
    if isinstance(needed, dict) and needed:
        for name in needed:
            if name not in known:
                note = "the skill goes by it; say where it is: --places FILE.toml"
                raise UnknownName("place", name, known, note=note)
        document = {**document, PLACES: as_plain({name: known[name] for name in needed})}
    kind = registry().behaviour(document["type"])
    what = f"the {kind.name} skill"
    if isinstance(kind, CoordinatorType):
        with understood(what):
            coordinator = kind.build(document)
        if kind.centers is None:
            centers = np.tile(center_of_compliance(document, scene, coc), (2, 1))
        else:
            if coc is not None:
                raise InputError("--coc", f"each arm of a {kind.name} skill has its own", "set them in the skill file")
            centers = kind.centers(document)
        return coordinator, Setup(robot=robot, scene=scene, center_of_compliance=centers)
    center = center_of_compliance(document, scene, coc)
    placed = with_center(document, center.tolist())
    with understood(what):
        skill = kind.build(placed)
        area = None if kind.area is None else kind.area(document)
        speed = None if kind.speed is None else kind.speed(document)
    if area is not None:
        _check_area(robot, scene, document, area)
    return skill, Setup(
        robot=robot, scene=scene, center_of_compliance=center, skill_speed=speed
    )  # fmt: skip


def _check_area(robot: RobotModel, scene: Scene, document: Document, area: Float) -> None:
    """Check that a box (2, 3), relative to the start, is inside the robot's workspace at the nominal start.

    Without `limits.workspace_m`, the workspace is what the arm reaches in the start's orientation.
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


def _inside(robot: RobotModel, corners: Float, orientation: Float) -> bool:
    if robot.spec.limits.workspace_m is not None:
        low, high = np.array(robot.spec.limits.workspace_m)
        return bool(np.all(corners >= low) and np.all(corners <= high))
    if robot.spec.own_law:  # checked by its drive
        return True
    q = robot.home
    try:
        for corner in corners:
            q = inverse_kinematics(robot, 0, Pose(corner, orientation), q)
    except UnreachablePose:
        return False
    return True
