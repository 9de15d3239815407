"""`skillframe robots`: which robots there are, whether a URDF is usable for dynamics, what a robot is like."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from skillframe.cli import names

if TYPE_CHECKING:
    from skillframe.robot.audit import Audit
    from skillframe.robot.model import RobotModel
    from skillframe.robot.spec import RobotSpec

_MASS = "The robot's mass, base included, as on its data sheet: masses that have to be guessed are scaled to it."
_CLASS = "Instead of --mass, kind and payload in kg: cobot-3, -5, -10, -16, -20, industrial-7, -12, -25."


@click.group()
def command() -> None:
    """List, check and show robots.

    \b
    Example:
      skillframe robots check my_robot.urdf
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="JSON on stdout.")
def list_robots(as_json: bool) -> int:
    """Robots that can be named: the shipped ones, those of plug-ins, and those in $SKILLFRAME_PATH/robots.

    \b
    Example:
      skillframe robots list --json
    """
    from skillframe.errors import SkillframeError
    from skillframe.robot.spec import load_robot, robot_names

    rows = []
    for name, folder in sorted(robot_names().items()):
        try:
            spec = load_robot(folder)
            about = {"summary": spec.summary, "base": spec.base, "arms": [a.name for a in spec.arm], "error": None}
        except SkillframeError as error:
            about = {"summary": "", "base": None, "arms": [], "error": str(error)}
        rows.append({"name": name, "path": str(folder), **about})
    if as_json:
        click.echo(json.dumps(rows, indent=2))
        return 0
    for row in rows:
        click.echo(f"{row['name']:<14} {row['error'] or row['summary']}")
    return 0


@command.command()
@click.argument("robot", metavar="URDF|NAME", shell_complete=names.robots)
@click.option("--mass", "total_kg", type=float, metavar="KG", help=_MASS)
@click.option("--class", "kind", metavar="NAME", shell_complete=names.arm_classes, help=_CLASS)
@click.option("--json", "as_json", is_flag=True, help="JSON on stdout.")
def check(robot: str, total_kg: float | None, kind: str | None, as_json: bool) -> int:
    """Is a robot usable for dynamics? A URDF, a robot.toml, or a name.

    Exit code 0: usable; 1: it loads and is not; 2: it does not load.

    \b
    Example:
      skillframe robots check my_robot.urdf --mass 33.5
    """
    from dataclasses import replace

    from skillframe.errors import InputError, SkillframeError
    from skillframe.machine.checks.audit import audit
    from skillframe.robot.guesses import class_mass
    from skillframe.robot.model import load_model
    from skillframe.robot.spec import load_robot

    if kind is not None and total_kg is not None:
        raise InputError("--class", "and --mass say the same thing", "give one of them")
    total_kg = total_kg if kind is None else class_mass(kind)
    try:
        spec = load_robot(robot)
        model = load_model(spec)
        result = audit(model, total_kg)
        if _looks("whether bodies touch at home"):
            from skillframe.world.collision_report import collision_problems

            result = replace(result, problems=(*result.problems, *collision_problems(model)))
    except SkillframeError as error:
        if as_json:
            click.echo(json.dumps(_not_loaded(robot, str(error)), indent=2))
        raise
    if as_json:
        own = {} if spec.control.interface == "torque" else {"interface": spec.control.figures()}
        click.echo(json.dumps({**_plain(result), **own}, indent=2))
    else:
        _print_audit(robot, result, spec)
    return 0 if result.usable else 1


@command.command()
@click.argument("robot", metavar="NAME|URDF", shell_complete=names.robots)
@click.option("--json", "as_json", is_flag=True, help="JSON on stdout.")
def show(robot: str, as_json: bool) -> None:
    """What a robot is like: joints, limits, home, mass, tool frames.

    \b
    Example:
      skillframe robots show panda --json
    """
    from skillframe.cli.output import emit_json
    from skillframe.robot.describe import as_json as plain
    from skillframe.robot.describe import describe
    from skillframe.robot.model import load_model
    from skillframe.robot.spec import load_robot

    model = load_model(load_robot(robot))
    whole, derived = _with_gains(model)
    looks = _looks("which bodies may touch")
    if looks:
        from skillframe.world.collision_report import collision_lines, collision_values
    if as_json:
        emit_json({**plain(whole), "collisions": collision_values(model) if looks else None})
        return
    click.echo("\n".join([describe(whole), *(collision_lines(model) if looks else [])]))
    if derived:
        click.echo(f"  robot.toml does not give {', '.join(derived)}: derived from masses, oil and filters")


def _with_gains(model: RobotModel) -> tuple[RobotModel, list[str]]:
    """A machine with the gains that follow from its figures, and their names, or unchanged where it cannot run."""
    from skillframe.errors import SkillframeError
    from skillframe.machine.law.gains import missing_gains, with_derived_gains

    try:
        return with_derived_gains(model), missing_gains(model.spec)
    except SkillframeError:
        return model, []


def _looks(what: str) -> bool:
    """Whether shapes can be compared here. A note where they cannot."""
    from skillframe.cli.output import note
    from skillframe.errors import MissingDependency, need

    try:
        need("mujoco")
    except MissingDependency as error:
        note(f"note: {what} is not said: {error}")
        return False
    return True


def _plain(result: Audit) -> dict[str, object]:
    from dataclasses import asdict

    return {**asdict(result), "problems": [asdict(p) for p in result.problems]}


def _not_loaded(robot: str, message: str) -> dict[str, object]:
    fix = "fix the file, then check again"
    problem = {"code": "does_not_load", "severity": "fatal", "where": robot, "message": message, "fix": fix}
    return {"usable": False, "nq": None, "nv": None, "mass_kg": None, "problems": [problem]}


def _print_audit(robot: str, result: Audit, spec: RobotSpec) -> None:
    verdict = "usable for dynamics" if result.usable else "NOT usable for dynamics"
    click.echo(f"{robot}: {verdict} (nq {result.nq}, nv {result.nv}, {result.mass_kg:.4g} kg)")
    if spec.control.interface != "torque":
        click.echo(f"  {spec.control.admittance.told()}")
    said: set[str] = set()
    for problem in result.problems:
        click.echo(f"\n{problem.severity} {problem.code} at {problem.where}\n  {problem.message}")
        lines = problem.fix.splitlines()
        known = len(lines) > 1 and said.issuperset(lines[1:])  # the first one differs in what the masses add up to
        click.echo("  fix: " + ("as above" if known else "\n    ".join(lines)))
        said.update(lines)
