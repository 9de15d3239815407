"""Checks of a robot: its folder, loading, dynamics, and standing still."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.extend import RobotType
from skillframe_testkit.checks.problems import attempt
from skillframe_testkit.checks.trials import SHORT_S, Push


def check_robot(robot: RobotType) -> list[str]:
    """Problems of a robot."""
    for what, check in (("folder", _folder), ("loads", _loads), ("dynamics", _dynamics), ("stands", _stands)):
        if problems := attempt(what, lambda check=check: check(robot)):  # type: ignore[misc]
            return problems
    return []


def _folder(robot: RobotType) -> Iterator[str]:
    folder = Path(robot.folder)
    if not (folder / "robot.toml").is_file():
        yield f"there is no robot.toml in {folder.name!r}; does the distribution ship it?"
    elif folder.name != robot.name:
        yield f"the folder is called {folder.name!r}; call it {robot.name!r}, for results name a robot by its folder"


def _loads(robot: RobotType) -> Iterator[str]:
    from skillframe.extend import require_driven
    from skillframe.robot import load_model, load_robot

    folder = Path(robot.folder)
    try:
        spec = load_robot(folder)
        spec.require_simulated()
        require_driven(load_model(spec))
    except SkillframeError as error:
        yield f"{error}"
        return
    beside = spec.urdf.parent.parent == folder.resolve().parent and (spec.urdf.parent / "robot.toml").is_file()
    if not (beside or spec.urdf.is_relative_to(folder.resolve())):
        where = "outside its folder and those of robots beside it"
        yield f"its URDF {spec.urdf.name} lies {where}; campaigns copy these only"


def _dynamics(robot: RobotType) -> Iterator[str]:
    from skillframe.extend import audit
    from skillframe.robot import load_robot

    for problem in audit(load_robot(Path(robot.folder))).problems:
        if problem.severity == "fatal":
            yield f"{problem.code} at {problem.where}: {problem.message}"


def _stands(robot: RobotType) -> Iterator[str]:
    """Check that it holds its start in empty space for 0.1 s, without actuators only."""
    from skillframe.execution import Setup, load_robot_model, load_world, simulate

    model = load_robot_model(str(robot.folder))
    if model.spec.actuation:
        return
    try:
        result = simulate(
            Push(0.0), Setup(robot=model, scene=load_world("free", {})), {}, [np.random.default_rng(13)],
            duration_s=SHORT_S,
        )  # fmt: skip
    except SkillframeError as error:
        yield f"does not start in the world free: {error}"
        return
    if result.ended_by[0] != "time":
        yield f"holding its start in the world free for {1e3 * SHORT_S:g} ms ends: {result.reason[0]}"
