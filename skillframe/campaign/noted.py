"""`setup` of scene.json: with what a campaign's trials run, written down so that a page needs no robot and no world.

limits    of the robot; `transient`: how far above `force_n` a peak of one tick may be in the simulator
control   rate and interface
drive     "hydraulic", "servo", a plug-in's name, or "" for ideal torques
base      "fixed" or "free"
sensors   standard deviations of their noise
encoders  of the joints in words, or "" where the controller knows positions and velocities exactly
nominal   the quantities that this kind of robot has, where they stand unless a campaign moves them
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from skillframe.control.contact import TRANSIENT
from skillframe.execution.setup import Setup
from skillframe.robot.spec import RobotSpec
from skillframe.world.placement import lacks
from skillframe.world.quantities import VARIED


def setup_notes(setup: Setup) -> dict[str, Any]:
    """The set-up of a campaign's trials as plain JSON values."""
    robot = setup.robot.spec
    sensors = robot.sensors if robot.hydraulic else setup.sensors
    return {
        "limits": {**asdict(setup.limits), "transient": TRANSIENT}, "control": asdict(robot.control),
        "drive": drive_name(robot), "base": robot.base, "sensors": asdict(sensors),
        "encoders": "" if robot.encoders is None else str(robot.encoders),
        "nominal": {v.name: v.nominal for v in VARIED if v.nominal is not None and not lacks(v.name, robot)},
    }  # fmt: skip


def drive_name(robot: RobotSpec) -> str:
    """What stands between the law and the joints: "" for ideal torques."""
    return robot.other_drive or ("hydraulic" if robot.hydraulic else "servo" if robot.servo else "")
