"""Messages in which a Franka publishes its state: pose and estimated wrench in one.

`franka_msgs/FrankaState` (ROS 1, and some drivers of ROS 2 with names in small letters) has `O_T_EE`, a 4x4 matrix by
columns, and `O_F_ext_hat_K`, six numbers. `franka_msgs/FrankaRobotState` (franka_ros2) has a pose and wrenches of
`geometry_msgs`. In both the wrench is the estimate at the stiffness frame in base axes, of which libfranka's
`robot_state.h` says: "Forces applied by the robot to the environment are positive". It is turned round here. The frames
EE and K are taken as one, as they are unless somebody calls `setK`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skillframe.frames import Float, quaternion_from_matrix

ARRAYS, NESTED = "franka_msgs/msg/FrankaState", "franka_msgs/msg/FrankaRobotState"
FRANKA = (ARRAYS, NESTED)
FRANKA_NOTE = (
    "the wrench is the Franka's estimate in base axes, turned round to be the environment's; a hand that leads the arm "
    "is in it as well"
)


def tool_poses_of(kind: str, messages: Sequence[Any]) -> Float:
    """(T, 7) position [m] and quaternion x, y, z, w of the end effector frame in base."""
    if kind == NESTED:
        parts = [(m.o_t_ee.pose.position, m.o_t_ee.pose.orientation) for m in messages]
        return np.array([(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for p, q in parts], dtype=float)
    columns = np.array([_field(m, "O_T_EE") for m in messages], dtype=float).reshape(-1, 4, 4)
    matrices = np.swapaxes(columns, -1, -2)
    return np.concatenate([matrices[:, :3, 3], quaternion_from_matrix(matrices[:, :3, :3])], axis=1)


def wrenches_of(kind: str, messages: Sequence[Any]) -> Float:
    """(T, 6) force and torque of the environment on the tool [N, Nm], base axes."""
    if kind == NESTED:
        return -np.array([six(m.o_f_ext_hat_k.wrench) for m in messages], dtype=float)
    return -np.array([_field(m, "O_F_ext_hat_K") for m in messages], dtype=float).reshape(-1, 6)


def six(wrench: Any) -> tuple[float, ...]:
    """Numbers of a `geometry_msgs/Wrench`."""
    force, torque = wrench.force, wrench.torque
    return (force.x, force.y, force.z, torque.x, torque.y, torque.z)


def _field(message: Any, name: str) -> Any:
    """A field under libfranka's name, or in small letters."""
    return getattr(message, name) if hasattr(message, name) else getattr(message, name.lower())
