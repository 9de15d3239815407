"""Records of the core, registered as an ordinary plug-in: drives, readers, exporters and robots."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.config import read_toml
from skillframe.extend.contract import CONTRACT
from skillframe.extend.hardware import DriveType, RobotType
from skillframe.extend.hookspecs import hookimpl
from skillframe.extend.outputs import ExporterType
from skillframe.extend.records import Lazy, ReaderType
from skillframe.files import shipped_dirs

skillframe_contract = CONTRACT


@hookimpl
def skillframe_drives() -> Iterable[DriveType]:
    """Drives of arms by torque, position or velocity commands, and of electric servos."""
    place = "skillframe.execution.drives"
    yield DriveType(
        name="torque", summary="ideal torques at the joints of one arm", make=Lazy(f"{place}.torque:make")
    )  # fmt: skip
    yield DriveType(
        name="admittance", summary="joint positions or velocities, made of forces by an admittance law",
        example="ur5e",
        make=Lazy(f"{place}.admittance:make"), adapted=Lazy(f"{place}.admittance:adapted"),
    )  # fmt: skip
    yield DriveType(
        name="arms", summary="ideal torques at the joints of several arms", example="",
        make=Lazy(f"{place}.arms:ArmsDrive"), adapted=Lazy(f"{place}.arms:adapted"),
    )  # fmt: skip
    yield DriveType(
        name="servo", summary="electric servos as FMUs at the joints of one arm", example="panda_servo",
        make=Lazy(f"{place}.servo:ServoDrive"), plots=Lazy(f"{place}.servo_plots:servo_plots"),
        quantities=Lazy("skillframe.world.quantities:of_actuators"),
    )  # fmt: skip


@hookimpl
def skillframe_readers() -> Iterable[ReaderType]:
    """Demonstration formats of the core: native npz, CSV and delimited text."""
    place = "skillframe.demonstration"
    yield ReaderType(
        name="npz", summary="native form: named arrays and JSON metadata", suffixes=(".npz",),
        read=Lazy(f"{place}.npz:read_npz"), write=Lazy(f"{place}.npz:write_npz"),
    )  # fmt: skip
    yield ReaderType(
        name="csv", summary="CSV with a header, metadata in NAME.meta.toml", suffixes=(".csv",),
        read=Lazy(f"{place}.csv:read_delimited"), write=Lazy(f"{place}.csv:write_csv"),
        table=Lazy(f"{place}.table:table_of_text"),
    )  # fmt: skip
    yield ReaderType(
        name="delimited", summary="delimited text of any layout, with --set columns", suffixes=(".dat", ".txt", ".tsv"),
        read=Lazy(f"{place}.csv:read_delimited"), table=Lazy(f"{place}.table:table_of_text"),
    )  # fmt: skip


@hookimpl
def skillframe_exporters() -> Iterable[ExporterType]:
    """Settings of three ROS 2 controllers."""
    yield ExporterType(
        name="crisp", summary="crisp_controllers CartesianController (ROS 2 parameters)",
        axes="base", checked="utiasDSL/crisp_controllers 2b33ab7 (releases 2.2.0 to 2.3.1)",
        notes=(
            "needs crisp_controllers 1.3.0 or newer: before, use_local_jacobian: false acts at the base's origin, "
            "where a push makes a torque (20 N at 0.5 m: 10 Nm) about axes that the skill leaves free",
        ),
        write=Lazy("skillframe.document.export:crisp"),
    )  # fmt: skip
    yield ExporterType(
        name="cartesian_controllers", axes="tool",
        summary="cartesian_controllers CartesianComplianceController (ROS 2 parameters)",
        checked="fzi-forschungszentrum-informatik/cartesian_controllers f53f798 (2024-10-20, ros2)",
        notes=(
            "the spring acts at end_effector_link; compliance_ref_link gives only its axes and the sensor's point: "
            "put both at the centre of compliance, with the tool's axes",
            "it holds stiffness alone: damping and speed follow from its own pd_gains and solver",
        ),
        write=Lazy("skillframe.document.export:cartesian_compliance"),
    )  # fmt: skip
    yield ExporterType(
        name="aic_motion_update", summary="aic_control_interfaces MotionUpdate (ROS 2 message)",
        axes="base", checked="intrinsic-dev/aic db40abc (2026-03-13)",
        notes=(
            "for aic_control_interfaces from 2026-02-19 on (2b0f671): wrench_feedback_gains_at_tip is float64[6]",
            "the toolkit's bring-up limits the wrench to 10 N and 10 Nm per axis (impedance.maximum_wrench): "
            "a larger push never arrives",
        ),
        write=Lazy("skillframe.document.export:motion_update"),
    )  # fmt: skip


@hookimpl
def skillframe_robots() -> Iterable[RobotType]:
    """The robots under robots/, with the summaries of their files."""
    for folder in shipped_dirs("robots"):
        for file in sorted(folder.glob("*/robot.toml")):
            summary = str(read_toml(file).get("summary", ""))
            yield RobotType(name=file.parent.name, summary=summary, folder=file.parent)
