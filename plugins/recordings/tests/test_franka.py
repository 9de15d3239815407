"""States of a Franka in bags: pose out of a matrix by columns, and the wrench turned round."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from skillframe_recordings.formats.franka import ARRAYS, NESTED

from plugins.recordings.tests.bags_written import START, head, pose_fields, stamps, wrench_fields
from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import read_demonstration

HEAD = "std_msgs/Header header\n"
TEXTS = {
    "upper": (ARRAYS, HEAD + "float64[6] O_F_ext_hat_K\nfloat64[6] K_F_ext_hat_K\nfloat64[16] O_T_EE\n"),
    "lower": (ARRAYS, HEAD + "float64[6] o_f_ext_hat_k\nfloat64[6] k_f_ext_hat_k\nfloat64[16] o_t_ee\n"),
    "nested": (NESTED, HEAD + "geometry_msgs/WrenchStamped o_f_ext_hat_k\ngeometry_msgs/PoseStamped o_t_ee\n"),
}
CASES = [("upper", ".bag"), ("lower", ".mcap"), ("nested", ".mcap")]


def state(store: Any, form: str, header: Any, d: Demonstration, i: int) -> dict[str, Any]:
    """Fields of a message, its wrench with the robot's sign."""
    ours = -d.wrench[i]
    if form == "nested":
        pose = pose_fields("PoseStamped", d.position[i], d.quaternion[i])(store)
        types = store.types
        return {
            "o_t_ee": types["geometry_msgs/msg/PoseStamped"](header=header, **pose),
            "o_f_ext_hat_k": types["geometry_msgs/msg/WrenchStamped"](header=header, **wrench_fields(ours)(store)),
        }
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = d.pose.rotation[i], d.position[i]
    other = np.full(6, 99.0)  # in axes of the stiffness frame, which must not be taken
    names = {"O_T_EE": matrix.T.ravel(), "O_F_ext_hat_K": ours, "K_F_ext_hat_K": other}
    return {name if form == "upper" else name.lower(): value for name, value in names.items()}


def write_states(path: Path, form: str, demo: Demonstration) -> Path:
    """A bag of one topic of states. Returns what a user gives."""
    ending = path.suffix
    kind, text = TEXTS[form]
    store = get_typestore(Stores.ROS1_NOETIC if ending == ".bag" else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(text, kind))
    plain = Writer2(path.with_suffix(""), version=9, storage_plugin=StoragePlugin.MCAP) if ending == ".mcap" else None
    with plain or Writer1(path) as writer:
        connection = writer.add_connection("/franka_states", kind, typestore=store)
        for i, stamp in enumerate(stamps(demo.time)):
            header = head(store, stamp, "base", {"seq": i} if ending == ".bag" else {})
            message = store.types[kind](header=header, **state(store, form, header, demo, i))
            data = store.serialize_ros1(message, kind) if ending == ".bag" else store.serialize_cdr(message, kind)
            writer.write(connection, stamp, data)
    return path if ending == ".bag" else path.with_suffix("")


@pytest.mark.parametrize(("form", "ending"), CASES)
def test_a_franka_s_state_is_pose_and_wrench_of_the_environment(
    form: str, ending: str, tmp_path: Path, demo: Demonstration
) -> None:
    found = read_demonstration(write_states(tmp_path / f"franka{ending}", form, demo))
    np.testing.assert_array_equal(found.position, demo.position)
    np.testing.assert_array_equal(found.wrench, demo.wrench)
    # a quaternion through a matrix and back: rounding
    np.testing.assert_allclose(np.abs(np.sum(found.quaternion * demo.quaternion, axis=1)), 1.0, atol=1e-12)
    assert found.meta["header_stamp_start_ns"] == START and "turned round" in str(found.meta)
