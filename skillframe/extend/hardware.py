"""Records of what a skill runs on: robots, drives and links to real ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotType:
    """A robot: a folder with a robot.toml and its files.

    Attributes:
        name: of the robot, and of the folder.
        summary: one line for listings.
        contract: see `skillframe.extend.records.SkillType`.
        folder: where robot.toml lies. Its files must lie within, as a campaign copies them.
    """

    name: str
    summary: str
    contract: str = ""
    folder: Path


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkType:
    """A way to command a real robot: the maker's interface, through the maker's or the community's client library.

    Attributes:
        name: as written in cell.toml.
        summary: one line for listings.
        contract: see `skillframe.extend.records.SkillType`.
        takes: what the robot is sent each period: joint "position" [rad], joint "torque" above gravity [N m], or
            the "impedance" of its tool.
        open: `open(host)` connects and returns the `skillframe_drive.link.Link`. Raises `SkillframeError`.
        fake: `fake(arm, host, lockstep=, faults=, say=)` returns a controller that speaks the maker's protocol with a
            `skillframe_drive.fake.FakeArm` behind it, for tests and rehearsal; None: there is none.
        robot: name of the robot that the fake is by default.
    """

    name: str
    summary: str
    contract: str = ""
    takes: Literal["position", "torque", "impedance"]
    open: Callable[[str], Any]
    fake: Callable[..., Any] | None = None
    robot: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveType:
    """A drive between a skill's command and the plant: ideal torques, a position controller, actuators.

    A robot selects the drive of a plug-in by `kind` of `[drive]` in robot.toml.

    Attributes:
        name: of the drive.
        summary: one line for listings and reports.
        contract: see `skillframe.extend.records.SkillType`.
        make: `make(setup, draws, rngs)` returns the `skillframe.execution.drive.Drive` of len(rngs) trials at their
            starts, from the run's set-up, its quantities per trial, each (N,), and a sensor generator per trial.
        example: name of a robot with which the test kit tries it, holding still; "" for none.
        actuated: whether it takes a robot that has [[actuation]] and names no drive.
        adapted: `adapted(skill, setup)` returns the skill as the drive needs it; None: unchanged.
        law: its controller in words, for reports; "" for the impedance of the tool.
        sensors: its sensors in words, for reports; "" for joint positions and a wrench at the wrist.
        check: `check(model)` refuses with `InputError` a robot that it cannot run.
        audit: `audit(model)` returns each `skillframe.robot.link_checks.Problem` worth knowing before a run.
        derived: `derived(model)` returns the robot with values derived where robot.toml gives none, and their names.
        told: `told(spec)` returns the drive's tables of robot.toml, as lines of text and as plain values.
        tables: `tables()` returns the dataclass of each of the drive's tables of robot.toml, by name.
        write_out: `write_out(values, path)` returns the content of the robot.toml at `path` with the drive's own short
            tables as those of `skillframe.robot.spec.RobotFile`; unchanged if it has none.
        quantities: `quantities()` returns each `skillframe.config.units.Quantity` of its trials besides those of
            `skillframe.world.quantities`.
        lacks: `lacks(name, spec)`: why one of both has no effect on this robot, or "".
        noise: `noise(spec)` returns the dataclass of its sensors' standard deviations; None: those of a wrist sensor.
        teach: `teach(model, scene, person, **common)` records demonstrations of `person`, a value of `teacher`.
        teacher: the settings dataclass of a teacher who uses this drive.
        aimed: `aimed(model, scene, angle)` returns the scene with the teacher's aim turned by an angle [rad].
        plots: `plots(trace)` returns a list of `skillframe.extend.records.TimePlot` of the arrays that the drive
            stores in a trace.
    """

    name: str
    summary: str
    contract: str = ""
    make: Callable[..., Any]
    example: str = "panda"
    actuated: bool = False
    adapted: Callable[..., Any] | None = None
    law: str = ""
    sensors: str = ""
    check: Callable[..., None] | None = None
    audit: Callable[..., Any] | None = None
    derived: Callable[..., Any] | None = None
    told: Callable[..., Any] | None = None
    tables: Callable[[], Any] | None = None
    write_out: Callable[..., Any] | None = None
    quantities: Callable[[], Any] | None = None
    lacks: Callable[..., str] | None = None
    noise: Callable[..., Any] | None = None
    teach: Callable[..., Any] | None = None
    teacher: Callable[..., Any] | None = None
    aimed: Callable[..., Any] | None = None
    plots: Callable[..., Any] | None = None
