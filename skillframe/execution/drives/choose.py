"""Which drive a robot takes in a scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.errors import InputError, SkillframeError
from skillframe.execution.drive import Drive
from skillframe.execution.first_arm import FirstArm
from skillframe.execution.setup import Setup
from skillframe.skill import Skill
from skillframe.world.convert import held
from skillframe.world.placement import check_quantities
from skillframe.world.plant import Draws

VERBS = sorted(name for name in (*vars(Drive), *Drive.__annotations__) if not name.startswith("_"))
"""What a drive must have."""


def chosen_drive(skill: Skill, setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> tuple[Skill, Drive]:
    """The drive of len(rngs) trials, at their starts, and the skill as that drive needs it.

    Args:
        skill: for one arm, or a coordinator.
        setup: robot, scene and settings.
        draws: quantities per trial, each (N,).
        rngs: one generator per trial, for the sensors.

    Raises:
        InputError, SkillframeError: the robot cannot run so; as `skillframe.execution.executor.simulate`.
    """
    check_quantities(draws, setup.robot)
    if setup.make_drive is not None or setup.robot.spec.other_drive:
        return skill, _foreign(setup, draws, rngs)
    if held(setup.robot, setup.scene) or np.ndim(setup.center_of_compliance) > 1:
        from skillframe.execution.drives.arms import ArmsDrive

        require_arms(setup)
        single = np.ndim(setup.center_of_compliance) == 1
        return FirstArm(skill) if single else skill, ArmsDrive(setup, draws, rngs)
    if setup.robot.spec.servo:
        from skillframe.execution.drives.servo import ServoDrive

        return skill, ServoDrive(setup, draws, rngs)
    if setup.robot.spec.hydraulic:
        from skillframe.execution.drives.machine import MachineDrive

        check_quantities(draws)
        _require_origin(setup)
        return skill, MachineDrive(setup, draws, rngs)
    if (arm := setup.robot.spec.control).interface != "torque":
        from skillframe.execution.drives.admittance import AdmittanceDrive
        from skillframe.execution.paced import PacedSkill

        return PacedSkill(skill, arm.admittance.ticks, setup.pace), AdmittanceDrive(setup, draws, rngs)
    from skillframe.execution.drives.torque import OneArm, TorqueDrive

    return skill, TorqueDrive(setup, OneArm(setup, draws, rngs))


def _foreign(setup: Setup, draws: Draws, rngs: Sequence[np.random.Generator]) -> Drive:
    """The drive that a plug-in brings."""
    name = setup.robot.spec.other_drive
    where = f"robot {setup.robot.spec.name}: drive"
    if setup.make_drive is None:
        raise InputError(where, f"{name!r} is a plug-in's", "hand its `make` to the set-up, as `prepare` does")
    drive: Drive = setup.make_drive(setup, draws, rngs)
    lacking = [verb for verb in VERBS if not hasattr(drive, verb)]
    if lacking:
        text = f"is made as a {type(drive).__name__}, which is no drive: it lacks {', '.join(lacking)}"
        raise InputError(where, text, "tell its author")
    return drive


def require_arms(setup: Setup) -> None:
    """Refuse to coordinate what is no pair of arms.

    Raises:
        SkillframeError: the robot has one arm, or the scene nothing for a second one to hold.
    """
    if len(setup.robot.tool_frames) < 2 or setup.scene.holder is None:
        raise SkillframeError(
            f"robot {setup.robot.spec.name} in world {setup.scene.name}: a coordinator needs a robot with two arms and "
            "a world whose fixture can be held; take dual_panda and dual_peg"
        )


def _require_origin(setup: Setup) -> None:
    if np.any(np.abs(setup.center_of_compliance) > 1e-9):
        raise InputError(
            f"robot {setup.robot.spec.name}", "a hydraulic machine steers the origin of its tool frame",
            "set the centre of compliance to 0 0 0",
        )  # fmt: skip
