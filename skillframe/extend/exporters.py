"""The exporters that ship with the core. What writes a format is imported when it is written."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe.extend.contract import CONTRACT
from skillframe.extend.records import ExporterType, Lazy


def exporter_types() -> Iterable[ExporterType]:
    """Records of the core's exporters."""
    yield ExporterType(
        name="crisp", summary="crisp_controllers CartesianController (ROS 2 parameters)", contract=CONTRACT,
        axes="base", checked="utiasDSL/crisp_controllers 2b33ab7 (releases 2.2.0 to 2.3.1)",
        notes=(
            "needs crisp_controllers 1.3.0 or newer: before, use_local_jacobian: false acts at the base's origin, "
            "where a push makes a torque (20 N at 0.5 m: 10 Nm) about axes that the skill leaves free",
        ),
        write=Lazy("skillframe.document.export:crisp"),
    )  # fmt: skip
    yield ExporterType(
        name="cartesian_controllers", contract=CONTRACT, axes="tool",
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
        name="aic_motion_update", summary="aic_control_interfaces MotionUpdate (ROS 2 message)", contract=CONTRACT,
        axes="base", checked="intrinsic-dev/aic db40abc (2026-03-13)",
        notes=(
            "for aic_control_interfaces from 2026-02-19 on (2b0f671): wrench_feedback_gains_at_tip is float64[6]",
            "the toolkit's bring-up limits the wrench to 10 N and 10 Nm per axis (impedance.maximum_wrench): "
            "a larger push never arrives",
        ),
        write=Lazy("skillframe.document.export:motion_update"),
    )  # fmt: skip
