"""Problems of a hydraulic machine: cylinder figures, loops, home, limits. What `skillframe run` refuses is fatal."""

from __future__ import annotations

from collections.abc import Iterator

from skillframe.errors import InputError, SkillframeError
from skillframe.extend import unmapped_warnings
from skillframe.robot import ClosedChain, Limits, Problem, RobotModel, cannot_run, warning
from skillframe_hydraulics.checks.feasibility import low_settings, problems, short_struts, strained_actuators
from skillframe_hydraulics.checks.figures import (
    CYLINDER,
    Unfit,
    called,
    doubtful_figures,
    doubtful_machine,
    lacks_static_friction,
    relief,
    unfit_figures,
    unfit_machine,
)
from skillframe_hydraulics.checks.pumps import unfit_pumps
from skillframe_hydraulics.checks.working_range import working_figures
from skillframe_hydraulics.cylinder.bank import foreign_specs
from skillframe_hydraulics.declared import fast_filters, gains_of, noise_of, require_declared
from skillframe_hydraulics.law.hydraulic import tool_task


def machine_warnings(robot: RobotModel) -> Iterator[Problem]:
    """Impossible, unusual or missing cylinder figures, open loops, a bad home, and limits made for arms.

    What a machine that can stand at home reaches and pushes with follows as "info".
    """
    spec = robot.spec
    unused = [a.unused for a in spec.actuation if a.fmu != CYLINDER]
    yield from unmapped_warnings(foreign_specs(spec), unused, spec.folder)
    try:
        require_declared(spec)
    except InputError as error:
        yield cannot_run(f"{error.where}: {error.problem}", error.fix)
        return
    slips = [cannot_run(*slip) for one in spec.actuation for slip in unfit_figures(one)]
    slips += [cannot_run(*slip) for slip in unfit_machine(robot)]
    for doubt in (*doubtful_machine(robot), *(each for one in spec.actuation for each in doubtful_figures(one))):
        if not doubt.refused:
            yield warning("unusual_figure", doubt.problem, doubt.fix)
    yield from slips
    for problem, fix in fast_filters(noise_of(spec), gains_of(spec), spec.control.rate_hz):
        yield cannot_run(problem, fix)
    for one in spec.actuation:
        supply, opens = one.known.get("supply_pressure"), relief(one)
        if isinstance(supply, int | float) and supply > opens:
            text = f"port relief of {called(one)} opens at {opens / 1e5:g} bar, below its supply of"
            text += f" {supply / 1e5:g} bar: it opens before the actuator pushes with all of it"
            fix = f"write relief_pressure = {1.1 * supply:.3g} in its parameters, or what its valve is set to"
            yield warning("relief_pressure", text, fix)
    if tied := [a.joint for a in spec.actuation if lacks_static_friction(a)]:
        text = f"no static_friction is given for {', '.join(tied)}: taken as equal to coulomb_friction"
        fix = "add it to parameters if the pistons stick harder than they slide"
        yield Problem(code="static_friction", severity="info", where="robot.toml", message=text, fix=fix)
    try:
        chain = ClosedChain(robot)
        z = chain.minimal(chain.home)
        unfit, small, strained, low = (
            [] if slips else problems(chain, z),
            list[Unfit](),
            list[str](),
            list[str](),
        )
        if not unfit:
            small = list(unfit_pumps(chain, tool_task(chain)))
            strained = list(strained_actuators(chain, z))
            low = list(low_settings(chain, z))
    except SkillframeError as error:
        text, fix = (error.problem, error.fix) if isinstance(error, InputError) else (str(error), "correct robot.toml")
        yield cannot_run(f"{text}: it can be checked and shown, not run", fix)
        return
    yield from (cannot_run(*slip) for slip in small)
    for index in chain.free[chain.steered :]:
        if not chain.model.damping[index] > 0.0:
            text = f"passive joint {chain.model.names[int(index) + 1]} has no damping: it swings without end"
            yield warning("undamped_swing", text, "write damping in its [[passive]] table")
    for text in short_struts(chain):
        yield warning("short_reach", text, "correct its pins, closed or stroke, or the joint's limits")
    for text in strained:
        yield warning("little_force_left", text, "a larger bore, more supply_pressure, less load, or another [home]")
    for text in low:
        yield warning("low_setting", text, "correct setting or port under counterbalance of its [[cylinder]]")
    for text in unfit:
        yield warning("impossible_home", f"at home {text}", "choose another [home]")
    given, default = spec.limits, Limits()
    if given.force_n == default.force_n:
        text = f"[limits] force_n is {default.force_n:g} N, the default for arms; a machine exceeds it at once"
        yield warning("arm_limits", text, "write force_n = 15000.0, or what the machine may push, under [limits]")
    if given.torque_rate_nm_s == default.torque_rate_nm_s:
        text = f"[limits] torque_rate_nm_s is {default.torque_rate_nm_s:g} N m/s, the default for arms"
        yield warning("arm_limits", text, "write torque_rate_nm_s = 1e7, or what the machine may do, under [limits]")
    if not unfit and not slips:
        for code, text, fix, figures in working_figures(chain):
            yield Problem(code=code, severity="info", where="robot.toml", message=text, fix=fix, figures=figures)
