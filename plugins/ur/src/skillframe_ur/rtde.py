"""RTDE, version 2: the packets of Universal Robots' real-time data exchange, as the controller sees them.

A packet is `uint16 size, uint8 type, body`, big-endian. Source: Universal Robots, "Real-Time Data Exchange (RTDE)
Guide". The names and types below are those that clients ask for.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

FORMATS = {
    "DOUBLE": "d", "INT32": "i", "UINT32": "I", "UINT64": "Q", "VECTOR6D": "6d", "VECTOR3D": "3d",
    "VECTOR6INT32": "6i", "BOOL": "?", "UINT8": "B",
}  # fmt: skip
UNKNOWN = "NOT_FOUND"
VECTORS = [
    "target_q",
    "target_qd",
    "target_qdd",
    "target_current",
    "target_moment",
    "actual_q",
    "actual_qd",
    "actual_qdd",
    "actual_current",
    "actual_current_as_torque",
    "actual_moment",
    "joint_control_output",
    "actual_TCP_pose",
    "actual_TCP_speed",
    "actual_TCP_force",
    "target_TCP_pose",
    "target_TCP_speed",
    "joint_temperatures",
    "actual_joint_voltage",
    "ft_raw_wrench",
    "payload_inertia",
    "external_force_torque",
]
TYPES: dict[str, str] = {
    **dict.fromkeys(VECTORS, "VECTOR6D"),
    **dict.fromkeys(("payload_cog", "actual_tool_accelerometer"), "VECTOR3D"),
    **dict.fromkeys(
        (
            "timestamp", "actual_execution_time", "speed_scaling", "target_speed_fraction", "actual_momentum",
            "actual_main_voltage", "actual_robot_voltage", "actual_robot_current", "standard_analog_input0",
            "standard_analog_input1", "standard_analog_output0", "standard_analog_output1", "payload",
            "speed_slider_fraction",
        ),
        "DOUBLE",
    ),
    **dict.fromkeys(("robot_mode", "safety_mode"), "INT32"),
    **dict.fromkeys(("actual_digital_input_bits", "actual_digital_output_bits"), "UINT64"),
    **dict.fromkeys(
        (
            "runtime_state", "robot_status_bits", "safety_status_bits", "output_bit_registers0_to_31",
            "output_bit_registers32_to_63", "speed_slider_mask",
        ),
        "UINT32",
    ),
    "joint_mode": "VECTOR6INT32",
}  # fmt: skip
PATTERNS = (
    ("int_register", "INT32"), ("double_register", "DOUBLE"), ("bit_register", "BOOL"), ("_mask", "UINT8"),
    ("digital_output", "UINT8"), ("_type", "UINT8"),
)  # fmt: skip


def kind(name: str) -> str:
    """Type of a variable by its name, `UNKNOWN` for others."""
    return TYPES.get(name) or next((what for part, what in PATTERNS if part in name), UNKNOWN)


def layout(names: Sequence[str]) -> struct.Struct:
    """Layout of the values of variables, without those that are unknown."""
    return struct.Struct(">" + "".join(FORMATS.get(kind(name), "") for name in names))


def packet(what: str, body: bytes) -> bytes:
    """A whole packet."""
    return struct.pack(">HB", 3 + len(body), ord(what)) + body


def packets(received: bytearray) -> Iterator[tuple[str, bytes]]:
    """Take all complete packets out of what was received: type and body of each."""
    while len(received) >= 3:
        size, what = struct.unpack_from(">HB", received)
        if len(received) < size:
            return
        body = bytes(received[3:size])
        del received[:size]
        yield chr(what), body


def packed(names: Sequence[str], shape: struct.Struct, values: Mapping[str, Any]) -> bytes:
    """The values of variables, 0 where `values` has none."""
    row: list[Any] = []
    for name in names:
        if (width := FORMATS.get(kind(name), "")) == "":
            continue
        value = values.get(name, 0)
        count = int(width[:-1] or 1)
        row += [value] if count == 1 else list(value) if name in values else [0] * count
    return shape.pack(*row)
