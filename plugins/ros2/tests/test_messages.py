"""Bytes of every message against those that rosbags writes."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from skillframe_ros2 import messages

STORE = get_typestore(Stores.ROS2_HUMBLE)
CALLS = {
    "SetParametersRequest": "int64 client\nint64 call\nrcl_interfaces/Parameter[] parameters",
    "SetParametersReply": "int64 client\nint64 call\nrcl_interfaces/SetParametersResult[] results",
    "GetParametersRequest": "int64 client\nint64 call\nstring[] names",
    "GetParametersReply": "int64 client\nint64 call\nrcl_interfaces/ParameterValue[] values",
}
for _name, _text in CALLS.items():
    STORE.register(get_types_from_msg(_text, f"calls/msg/{_name}"))


def theirs(ours):
    """The same message as rosbags' object, by the fields' names."""
    name = type(ours).__idl_typename__ if hasattr(type(ours), "__idl_typename__") else type(ours).__name__
    package, kind, message = name.replace("dds_::", "").rstrip("_").split("::")
    known = f"calls/msg/{type(ours).__name__}" if kind == "srv" else f"{package}/{kind}/{message}"
    fields = {}
    for field in vars(ours):
        value = getattr(ours, field)
        if isinstance(value, messages.IdlStruct):
            value = theirs(value)[1]
        elif isinstance(value, (list, tuple)):
            inner = [theirs(each)[1] if isinstance(each, messages.IdlStruct) else each for each in value]
            kinds = {"byte_array_value": np.uint8, "integer_array_value": np.int64, "bool_array_value": np.bool_}
            numbers = field.startswith("double_") or field in ("position", "velocity", "effort") or field in kinds
            value = np.array(inner, kinds.get(field, np.float64)) if numbers else inner
        fields[field] = value
    return known, STORE.types[known](**fields)


HEADER = messages.Header(messages.Time(-3, 7), "base")
EVERY = [
    messages.pose_message(HEADER, np.array([0.1, -0.2, 0.3, 0.5, -0.5, 0.5, 0.5])),
    messages.wrench_message(HEADER, np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])),
    messages.JointState(HEADER, ["a", "joint2"], [1.0, 2.0], [3.0, 4.0], []),
    messages.SetParametersRequest(
        -5,
        3,
        [messages.Parameter("task.k_pos_x", messages.value_of(2.5)), messages.Parameter("b", messages.value_of(True))],
    ),
    messages.SetParametersReply(
        -5, 3, [messages.SetParametersResult(False, "too large"), messages.SetParametersResult()]
    ),
    messages.GetParametersRequest(1, 2**40, ["joints", "end_effector_frame"]),
    messages.GetParametersReply(
        1, 2, [messages.value_of("tip"), messages.ParameterValue(type=9, string_array_value=["joint1", "j"])]
    ),
]


@pytest.mark.parametrize("ours", EVERY, ids=lambda each: type(each).__name__)
def test_a_message_has_the_bytes_that_ros_2_reads(ours):
    name, other = theirs(ours)
    expected, found = bytes(STORE.serialize_cdr(other, name)), ours.serialize()
    assert found[:2] == expected[:2] == b"\x00\x01"  # CDR, little-endian
    assert found[4 : len(expected)] == expected[4:]
    assert len(found) - len(expected) < 4 and not any(found[len(expected) :])  # DDS pads to whole words


def test_every_type_has_the_name_that_ros_2_gives_it():
    names = {each.__idl_typename__ for each in map(type, EVERY)}
    assert "geometry_msgs::msg::dds_::PoseStamped_" in names and "sensor_msgs::msg::dds_::JointState_" in names
    assert "rcl_interfaces::srv::dds_::SetParameters_Request_" in names


def test_values_come_back_from_messages():
    pose, wrench = np.array([0.1, -0.2, 0.3, 0.5, -0.5, 0.5, 0.5]), np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    assert (messages.pose_values(messages.pose_message(HEADER, pose)) == pose).all()
    assert (messages.wrench_values(messages.wrench_message(HEADER, wrench)) == wrench).all()
    assert messages.flat(messages.pose_of(pose)) == pytest.approx(pose)
    assert messages.seconds(messages.stamp_of(12.002)) == pytest.approx(12.002, abs=1e-9)
