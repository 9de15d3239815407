"""Robots described by a URDF and robot.toml.

Only `spec` is imported here, so that reading robot.toml needs no Pinocchio.
"""

from skillframe.robot.interface import Control
from skillframe.robot.spec import Limits, RobotSpec, Workspace, load_robot, robot_names
from skillframe.robot.tables import Arm

__all__ = ["Arm", "Control", "Limits", "RobotSpec", "Workspace", "load_robot", "robot_names"]
