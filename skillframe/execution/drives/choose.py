"""Choice of the drive for a robot in a scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.errors import InputError
from skillframe.execution.drive import Drive, Setup
from skillframe.extend.drives import check_quantities, drive_of
from skillframe.extend.registry import registry
from skillframe.skill import Skill
from skillframe.world.convert import held
from skillframe.world.plant import Draws

VERBS = sorted(name for name in (*vars(Drive), *Drive.__annotations__) if not name.startswith("_"))
"""Methods and attributes required of a drive."""


def chosen_drive(skill: Skill, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> tuple[Skill, Drive]:
    """The drive of len(rngs) trials at their starts, and the skill adapted to it.

    Raises:
        InputError, SkillframeError: the robot cannot run so; as `skillframe.execution.executor.simulate`.
    """
    check_quantities(draws, setup.robot)
    record = setup.drive or drive_of(setup.robot.spec) or registry().drive(own_drive(setup))
    drive: Drive = record.make(setup, draws, rngs)
    lacking = [verb for verb in VERBS if not hasattr(drive, verb)]
    if lacking:
        text = f"is made as a {type(drive).__name__}, which is no drive: it lacks {', '.join(lacking)}"
        raise InputError(f"robot {setup.robot.spec.name}: drive", text, "report this to its author")
    return (skill if record.adapted is None else record.adapted(skill, setup)), drive


def own_drive(setup: Setup) -> str:
    """Name of the core's drive for a robot and scene."""
    spec = setup.robot.spec
    if held(setup.robot, setup.scene) or np.ndim(setup.center_of_compliance) > 1:
        return "arms"
    if spec.servo:
        return "servo"
    return "torque" if spec.control.interface == "torque" else "admittance"
