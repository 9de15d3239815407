"""Franka state messages, which hold pose and estimated wrench.

`franka_msgs/FrankaState` (ROS 1, and some ROS 2 drivers in lower case) has `O_T_EE`, a column-major 4x4 matrix, and
`O_F_ext_hat_K`, six numbers. `franka_msgs/FrankaRobotState` (franka_ros2) has `geometry_msgs`. The wrench is at the
stiffness frame in base axes and positive as the robot acts on the environment (libfranka's `robot_state.h`), so its
sign is changed here. EE and K coincide unless `setK` was called.
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
    """Return (T, 7) position [m] and quaternion x, y, z, w of the end effector frame in base."""
    if kind == NESTED:
        parts = [(m.o_t_ee.pose.position, m.o_t_ee.pose.orientation) for m in messages]
        return np.array([(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for p, q in parts], dtype=float)
    columns = np.array([_field(m, "O_T_EE") for m in messages], dtype=float).reshape(-1, 4, 4)
    matrices = np.swapaxes(columns, -1, -2)
    return np.concatenate([matrices[:, :3, 3], quaternion_from_matrix(matrices[:, :3, :3])], axis=1)


def wrenches_of(kind: str, messages: Sequence[Any]) -> Float:
    """Return (T, 6) force and torque of the environment on the tool [N, Nm], base axes."""
    if kind == NESTED:
        return -np.array([six(m.o_f_ext_hat_k.wrench) for m in messages], dtype=float)
    return -np.array([_field(m, "O_F_ext_hat_K") for m in messages], dtype=float).reshape(-1, 6)


def six(wrench: Any) -> tuple[float, ...]:
    """Return the numbers of a `geometry_msgs/Wrench`."""
    force, torque = wrench.force, wrench.torque
    return (force.x, force.y, force.z, torque.x, torque.y, torque.z)


def _field(message: Any, name: str) -> Any:
    """A field by libfranka's name, or in lower case."""
    return getattr(message, name) if hasattr(message, name) else getattr(message, name.lower())
