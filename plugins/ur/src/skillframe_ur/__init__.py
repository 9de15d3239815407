"""Universal Robots: a link through ur_rtde, and a fake controller. Listing plug-ins imports this module only."""

from __future__ import annotations

from collections.abc import Iterable

from skillframe import hookimpl
from skillframe.extend import ExporterType, Lazy, LinkType

skillframe_contract = "0.2"


@hookimpl
def skillframe_links() -> Iterable[LinkType]:
    """Joint positions by servoJ, 500 times a second."""
    yield LinkType(
        name="ur", summary="Universal Robots e-series by RTDE and servoJ, through ur_rtde", takes="position",
        open=Lazy("skillframe_ur.link:UrLink"), fake=Lazy("skillframe_ur.fake:FakeUr"), robot="ur5e",
    )  # fmt: skip


@hookimpl
def skillframe_exporters() -> Iterable[ExporterType]:
    """A learned skill as a program for the robot's own controller."""
    yield ExporterType(
        name="urscript", summary="Universal Robots e-series: an lmc skill as a URScript program, 500 Hz",
        axes=None,
        checked="the maker's script manual, e-series, PolyScope 5.9 or newer; no real controller has run it",
        notes=(
            "the robot's safety controller is the only safety function: set its limits of speed, force and space first",
            "set the payload in the controller and the active tool centre point to the flange, start in free air, and "
            "check the wrench by skillframe drive check --press",
            "unlike drive run, it has no simulated robot beside it: nothing measures distances to collision",
            "unlike drive run, it records no trace: report and drive hold have nothing to read",
            "unlike drive run, it asks nobody before it moves, and calls the skill's own end a success",
            "unlike drive run, it keeps the force limits of the skill and of robot.toml alone, not that of cell.toml",
            "unlike drive run, it gives up near a singular posture, at a joint's end, and 3 rad from the orientation",
            "a cycle has to take less than 2 ms of the controller's time, which was not measured: watch RTDE's "
            "actual_execution_time",
        ),
        write=Lazy("skillframe_ur.program:program"),
    )  # fmt: skip
