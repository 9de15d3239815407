"""Robots by URDF: robot.toml (`spec`), loading (`model`), mass audit (`audit`), kinematics and dynamics (`kinematics`).

Reading a robot.toml needs no Pinocchio; import the other modules by name where they are used.
"""

from skillframe.robot.interface import Control
from skillframe.robot.spec import Arm, Limits, RobotSpec, Workspace, load_robot, robot_names

__all__ = ["Arm", "Control", "Limits", "RobotSpec", "Workspace", "load_robot", "robot_names"]
