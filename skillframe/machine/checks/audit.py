"""What is worth knowing about a driven machine before it runs: its cylinders' figures, its loops, its home, its limits.

All are warnings: the tree's dynamics are usable either way, and `skillframe run` refuses what it cannot run.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from skillframe.cosim.servos import actuator_specs, unfit_servo
from skillframe.errors import InputError, SkillframeError
from skillframe.fmu.unmapped import unmapped
from skillframe.machine.checks.feasibility import problems
from skillframe.machine.checks.figures import CYLINDER, lacks_static_friction, unfit_figures
from skillframe.machine.cylinder.bank import foreign_specs
from skillframe.robot.audit import Audit
from skillframe.robot.audit import audit as audit_robot
from skillframe.robot.chain import ClosedChain
from skillframe.robot.driven import fast_filters
from skillframe.robot.model import RobotModel, load_model
from skillframe.robot.problems import Problem
from skillframe.robot.spec import Limits, RobotSpec


def audit(robot: RobotSpec | RobotModel, total_kg: float | None = None) -> Audit:
    """Check a robot, and what drives it: the audit of `skillframe.robot.audit` and the warnings of this module.

    Args:
        robot: as declared, or loaded.
        total_kg: mass of the whole robot, its base included, that guessed masses are scaled to.

    Raises:
        InputError, UnknownName: it does not load, or its links weigh more than `total_kg` already.
    """
    model = load_model(robot) if isinstance(robot, RobotSpec) else robot
    found = audit_robot(model, total_kg)
    return replace(found, problems=(*found.problems, *machine_warnings(model)))


def machine_warnings(robot: RobotModel) -> Iterator[Problem]:
    """Figures that no cylinder has, or that are not given. Loops that do not close, home, and limits made for arms."""
    spec = robot.spec
    yield from _interface(spec)
    yield from _unmapped(spec)
    if spec.servo:
        yield from (_warning("cannot_run", *slip) for one in spec.actuation for slip in unfit_servo(one))
        return
    slips = [_warning("cannot_run", *slip) for one in spec.actuation for slip in unfit_figures(one)]
    yield from slips
    for problem, fix in fast_filters(spec.sensors, spec.gains, spec.control.rate_hz) if spec.actuation else ():
        yield _warning("cannot_run", problem, fix)
    if tied := [a.joint for a in spec.actuation if lacks_static_friction(a)]:
        text = f"no static_friction is given for {', '.join(tied)}: taken as equal to coulomb_friction"
        yield _warning("static_friction", text, "add it to parameters if the pistons stick harder than they slide")
    if not (robot.spec.loop and robot.spec.actuation):
        return
    try:
        chain = ClosedChain(robot)
        unfit = [] if slips else problems(chain, chain.minimal(robot.home))
    except SkillframeError as error:
        text, fix = (error.problem, error.fix) if isinstance(error, InputError) else (str(error), "correct robot.toml")
        yield _warning("cannot_run", f"{text}: it can be checked and shown, not run", fix)
        return
    for text in unfit:
        yield _warning("impossible_home", f"at home {text}", "choose another [home]")
    yield from _limits(robot.spec.limits)


def _interface(spec: RobotSpec) -> Iterator[Problem]:
    """An arm that takes velocities or positions so late, or for so stiff a contact, that it is slow."""
    if spec.control.interface == "torque":
        return
    fix = "shorten delay_s, mount the tool softly (a lower contact_stiffness), or give a larger push_n"
    for text in spec.control.admittance.doubts():
        yield _warning("slow_interface", text, f"{fix}, under [control]")


def _unmapped(spec: RobotSpec) -> Iterator[Problem]:
    """Inputs and outputs of other makers' FMUs that no mapping names. An FMU that cannot be read is told as that."""
    rows = actuator_specs(spec) if spec.servo else foreign_specs(spec)
    unused = [a.unused for a in spec.actuation if spec.servo or a.fmu != CYLINDER]
    try:
        found = unmapped(rows, unused, spec.folder)
    except SkillframeError as error:
        text, fix = (error.problem, error.fix) if isinstance(error, InputError) else (str(error), "correct it")
        yield _warning("cannot_run", f"its FMU cannot be read: {text}", fix)
        return
    for row in found:
        for text in row.sentences:
            yield _warning("not_mapped", text, "map it in the [[actuation]], or name it in unused")


def _limits(given: Limits) -> Iterator[Problem]:
    default = Limits()
    if given.force_n == default.force_n:
        text = f"[limits] force_n is {default.force_n:g} N, the default for arms; a machine exceeds it at once"
        yield _warning("arm_limits", text, "write force_n = 15000.0, or what the machine may push, under [limits]")
    if given.torque_rate_nm_s == default.torque_rate_nm_s:
        text = f"[limits] torque_rate_nm_s is {default.torque_rate_nm_s:g} N m/s, the default for arms"
        yield _warning("arm_limits", text, "write torque_rate_nm_s = 1e7, or what the machine may do, under [limits]")


def _warning(code: str, message: str, fix: str) -> Problem:
    return Problem(code=code, severity="warning", where="robot.toml", message=message, fix=fix)
