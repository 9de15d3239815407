"""How a file is to be read: the settings that `demonstration convert` and `check` share with `read_demonstration`.

Nothing is guessed that a setting can say. The conventions that files must follow otherwise are the contract's: SI
units, radians, quaternions x, y, z, w, the wrench of the environment on the tool at the tool point in base axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from skillframe.config import build
from skillframe.errors import InputError, UnknownName

SCALES: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "angle": {"rad": 1.0, "deg": 0.017453292519943295},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6, "lbf": 4.4482216152605},
    "torque": {"Nm": 1.0, "Nmm": 1e-3, "mNm": 1e-3, "kNm": 1e3},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """Reading settings. Every one is optional.

    Attributes:
        columns: column names in order, "t,px,py,pz,...", or picks by header, "t=stamp,px=x,...". "_" ignores a column.
        units: units that differ from SI, in any order: "mm,deg,us,kN,Nmm".
        euler: order of roll, pitch, yaw: lower case about fixed axes ("xyz"), upper case about moving ones ("ZYX").
        rate: sample rate [Hz] where there is no clock; replaces the clock where there is one.
        wrench: separate file with the wrench on its own clock.
        wrench_columns: its columns, as `columns`.
        wrench_units: its units; `units` if not given.
        wrench_rate: its rate; `rate` if not given.
        wrench_shift: seconds added to its clock.
        clock: whose samples are kept when two files are joined; "auto" takes the faster, the pose's if they are alike.
        start: first time kept [s], on the recording's clock.
        stop: last time kept [s].
        zero_time: let the clock start at 0 before `start` and `stop` are applied.
        position: constant tool point [m] for a file that holds none (an orientation recording).
        arm: the arm to read from a file with `ARM_` columns.
        wrench_frame: axes of the file's wrench, overriding its metadata.
        wrench_point: where it was taken: "tool", "x,y,z" in the tool frame, or a frame's name.
        wrench_sign: whose wrench it is; "teacher" is turned round, which holds while inertia is small.
        wrench_includes_tool_weight: whether the tool's weight is still in it.
        calibration: file of `skillframe calibrate`, whose bias and weight are taken off the sensor's readings.
        pose_topic: topic of a ROS bag with the tool's pose or, with `robot`, its joint states.
        pose_frames: "BASE,TOOL", frames of a ROS bag's transforms: the tool's pose is that of the second in the first.
        wrench_topic: topic of a ROS bag with the wrench.
        robot: the robot whose joint states a ROS bag holds.
        episode: which of several recordings of a file or data set: a group's name in HDF5, a number in LeRobot's.
    """

    columns: str | None = None
    units: str | None = None
    euler: str | None = None
    rate: float | None = None
    wrench: Path | None = None
    wrench_columns: str | None = None
    wrench_units: str | None = None
    wrench_rate: float | None = None
    wrench_shift: float = 0.0
    clock: Literal["auto", "pose", "wrench"] = "auto"
    start: float | None = None
    stop: float | None = None
    zero_time: bool = False
    position: str | None = None
    arm: str | None = None
    wrench_frame: Literal["base", "tool"] | None = None
    wrench_point: str | None = None
    wrench_sign: Literal["environment", "teacher"] | None = None
    wrench_includes_tool_weight: bool | None = None
    calibration: Path | None = None
    pose_topic: str | None = None
    pose_frames: str | None = None
    wrench_topic: str | None = None
    robot: str | None = None
    episode: str | None = None

    def __post_init__(self) -> None:
        for name in ("rate", "wrench_rate"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise InputError(
                    f"--{name.replace('_', '-')}", f"{value} is not a rate", "give samples per second, above 0"
                )

    @property
    def wrench_settings(self) -> dict[str, Any]:
        """What the settings say about the wrench, by metadata key."""
        keys = ("frame", "point", "sign", "includes_tool_weight")
        said = {k: v for k in keys if (v := getattr(self, f"wrench_{k}")) is not None}
        return {**said, **({"calibration": str(self.calibration.resolve())} if self.calibration else {})}


def read_options(values: Mapping[str, Any]) -> ReadOptions:
    """Settings from plain values, None meaning "not given".

    Raises:
        InputError: an unknown setting (with a suggestion) or a wrong value.
    """
    given = {k: str(v) if isinstance(v, Path) else v for k, v in values.items() if v is not None}
    return build(ReadOptions, given, "reading options")


def scales(text: str | None) -> dict[str, float]:
    """Factors to SI by quantity ("time", "length", "angle", "force", "torque") from a list of units.

    Raises:
        UnknownName: no such unit.
        InputError: two units of one quantity.
    """
    factors: dict[str, float] = {}
    for token in (part.strip() for part in (text or "").split(",") if part.strip()):
        name = token.partition("=")[2] or token
        quantity = next((q for q, units in SCALES.items() if name in units), None)
        if quantity is None:
            raise UnknownName("unit", name, [u for units in SCALES.values() for u in units])
        if quantity in factors:
            raise InputError(f"--units {text}", f"two units of {quantity}", "give one")
        factors[quantity] = SCALES[quantity][name]
    return factors
