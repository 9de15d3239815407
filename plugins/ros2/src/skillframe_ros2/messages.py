"""The ROS 2 messages that the link needs, as DDS types with the names and layouts that ROS 2 gives them.

Sources: common_interfaces and rcl_interfaces (Humble). A message a/msg/B is the DDS type a::msg::dds_::B_, a topic /t
is rt/t, and a service /s is the topics rq/sRequest and rr/sReply. rmw_cyclonedds puts the client's number and the
call's number in front of requests and replies; other middlewares of ROS 2 carry them elsewhere.
"""

# The library reads the annotations as they are: no `from __future__ import annotations` here.
# mypy: disable-error-code="type-arg, assignment"

from dataclasses import dataclass, field

import numpy as np
from cyclonedds.core import Policy, Qos
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, int64, sequence, uint8, uint32
from cyclonedds.util import duration

from skillframe.frames import Float, Pose, matrix_from_quaternion, quaternion_from_matrix

NEWEST = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.Volatile, Policy.History.KeepLast(1)
)  # fmt: skip
"""Of targets: crisp_controllers subscribes so."""
SENSOR = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(5))
"""Of measurements: fits reliable and best-effort publishers."""
SERVICE = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.Volatile, Policy.History.KeepAll)
DOUBLE, STRING, BOOL, STRINGS = 3, 4, 1, 9
"""Kinds of a parameter's value: rcl_interfaces/msg/ParameterType."""


def _named(name: str) -> str:
    package, kind, message = name.split("/")
    return f"{package}::{kind}::dds_::{message}_"


@dataclass
class Time(IdlStruct, typename=_named("builtin_interfaces/msg/Time")):
    """A time: seconds and nanoseconds."""

    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename=_named("std_msgs/msg/Header")):
    """Time stamp, and name of the frame."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Point(IdlStruct, typename=_named("geometry_msgs/msg/Point")):
    """A position [m]."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Vector3(IdlStruct, typename=_named("geometry_msgs/msg/Vector3")):
    """A vector."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename=_named("geometry_msgs/msg/Quaternion")):
    """A rotation."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class PoseMessage(IdlStruct, typename=_named("geometry_msgs/msg/Pose")):
    """A pose."""

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped(IdlStruct, typename=_named("geometry_msgs/msg/PoseStamped")):
    """A pose with a header."""

    header: Header = field(default_factory=Header)
    pose: PoseMessage = field(default_factory=PoseMessage)


@dataclass
class Wrench(IdlStruct, typename=_named("geometry_msgs/msg/Wrench")):
    """Force [N] and torque [N m]."""

    force: Vector3 = field(default_factory=Vector3)
    torque: Vector3 = field(default_factory=Vector3)


@dataclass
class WrenchStamped(IdlStruct, typename=_named("geometry_msgs/msg/WrenchStamped")):
    """A wrench with a header."""

    header: Header = field(default_factory=Header)
    wrench: Wrench = field(default_factory=Wrench)


@dataclass
class JointState(IdlStruct, typename=_named("sensor_msgs/msg/JointState")):
    """Names, positions, velocities and efforts of joints."""

    header: Header = field(default_factory=Header)
    name: sequence[str] = ()
    position: sequence[float64] = ()
    velocity: sequence[float64] = ()
    effort: sequence[float64] = ()


@dataclass
class ParameterValue(IdlStruct, typename=_named("rcl_interfaces/msg/ParameterValue")):
    """A parameter's value of one of several kinds."""

    type: uint8 = 0
    bool_value: bool = False
    integer_value: int64 = 0
    double_value: float64 = 0.0
    string_value: str = ""
    byte_array_value: sequence[uint8] = ()
    bool_array_value: sequence[bool] = ()
    integer_array_value: sequence[int64] = ()
    double_array_value: sequence[float64] = ()
    string_array_value: sequence[str] = ()


@dataclass
class Parameter(IdlStruct, typename=_named("rcl_interfaces/msg/Parameter")):
    """A parameter."""

    name: str = ""
    value: ParameterValue = field(default_factory=ParameterValue)


@dataclass
class SetParametersResult(IdlStruct, typename=_named("rcl_interfaces/msg/SetParametersResult")):
    """Whether a parameter was set, and why not."""

    successful: bool = True
    reason: str = ""


@dataclass
class SetParametersRequest(IdlStruct, typename=_named("rcl_interfaces/srv/SetParameters_Request")):
    """Call of set_parameters."""

    client: int64 = 0
    call: int64 = 0
    parameters: sequence[Parameter] = ()


@dataclass
class SetParametersReply(IdlStruct, typename=_named("rcl_interfaces/srv/SetParameters_Response")):
    """Its answer."""

    client: int64 = 0
    call: int64 = 0
    results: sequence[SetParametersResult] = ()


@dataclass
class GetParametersRequest(IdlStruct, typename=_named("rcl_interfaces/srv/GetParameters_Request")):
    """Call of get_parameters."""

    client: int64 = 0
    call: int64 = 0
    names: sequence[str] = ()


@dataclass
class GetParametersReply(IdlStruct, typename=_named("rcl_interfaces/srv/GetParameters_Response")):
    """Its answer."""

    client: int64 = 0
    call: int64 = 0
    values: sequence[ParameterValue] = ()


def value_of(given: bool | float | str) -> ParameterValue:
    """A parameter's value."""
    if isinstance(given, bool):
        return ParameterValue(type=BOOL, bool_value=given)
    if isinstance(given, str):
        return ParameterValue(type=STRING, string_value=given)
    return ParameterValue(type=DOUBLE, double_value=float(given))


def seconds(stamp: Time) -> float:
    """A time stamp [s]."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def stamp_of(time: float) -> Time:
    """The stamp of a time [s]."""
    whole = round(1e9 * time)
    return Time(whole // 1_000_000_000, whole % 1_000_000_000)


def pose_message(header: Header, pose: Float) -> PoseStamped:
    """Message of a pose (7,): position [m], and quaternion x, y, z, w."""
    x = pose.tolist()
    return PoseStamped(header, PoseMessage(Point(*x[:3]), Quaternion(*x[3:])))


def wrench_message(header: Header, wrench: Float) -> WrenchStamped:
    """Message of a wrench (6,)."""
    w = wrench.tolist()
    return WrenchStamped(header, Wrench(Vector3(*w[:3]), Vector3(*w[3:])))


def pose_values(message: PoseStamped) -> Float:
    """Position and quaternion (7,) of a message."""
    p, q = message.pose.position, message.pose.orientation
    return np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w])


def wrench_values(message: WrenchStamped) -> Float:
    """Wrench (6,) of a message."""
    f, t = message.wrench.force, message.wrench.torque
    return np.array([f.x, f.y, f.z, t.x, t.y, t.z])


def flat(pose: Pose) -> Float:
    """Position and quaternion x, y, z, w (7,) of a pose (1,)."""
    result: Float = np.concatenate([pose.position[0], quaternion_from_matrix(pose.rotation)[0]])
    return result


def pose_of(values: Float) -> Pose:
    """The pose (1,) of a position and a quaternion (7,)."""
    return Pose(values[None, :3], matrix_from_quaternion(values[None, 3:]))
