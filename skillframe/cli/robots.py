"""`skillframe robots`: list robots, show one, and check a URDF for dynamics."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from skillframe.cli import options

if TYPE_CHECKING:
    from skillframe.robot.audit import Audit
    from skillframe.robot.spec import RobotSpec

_MASS = (
    "With --check: the robot's mass, base included, as on its data sheet, or its kind and payload in kg: cobot-3, -5, "
    "-10, -16, -20, industrial-7, -12, -25. Masses that have to be guessed are scaled to it."
)


@click.command()
@click.argument("robot", required=False, metavar="[NAME|URDF]", shell_complete=options.robots)
@click.option("--check", is_flag=True, help="Check whether it is usable for dynamics.")
@click.option("--mass", metavar="KG|KIND", shell_complete=options.arm_classes, help=_MASS)
@click.option("--no-meshes", is_flag=True, help="With --check: count links by their joints and other shapes alone.")
@click.option("--keys", is_flag=True, help="List the keys of robot.toml, with default and range.")
@click.option("--json", "as_json", is_flag=True, help="JSON on stdout.")
def command(robot: str | None, check: bool, mass: str | None, no_meshes: bool, keys: bool, as_json: bool) -> int:
    """List robots by name, or show one: joints, limits, home, mass, tool frames. --check says whether it is usable.

    Listed are the shipped ones, those of plug-ins, and those in $SKILLFRAME_PATH/robots. Shown and checked is a name, a
    URDF, or a robot.toml. In --keys, NAME stands for a joint or link, [] for each of a list.

    Exit code of --check: 0 usable, 1 it loads and is not, 2 it does not load.

    \b
    Examples:
      skillframe robots
      skillframe robots panda
      skillframe robots my_robot.urdf --check --mass 33.5
    """
    from skillframe.api.settings import of_robot
    from skillframe.cli.output import emit_json
    from skillframe.cli.settings import tell_keys
    from skillframe.errors import InputError

    for option, given in (("--mass", mass is not None), ("--no-meshes", no_meshes)):
        if given and not check:
            raise InputError(option, "is for --check", "add --check, or leave it out")
    if keys and (robot is not None or check):
        raise InputError("--keys", "are those of any robot.toml", "give it alone")
    if check and robot is None:
        raise InputError("--check", "checks one robot", "name it: skillframe robots my_robot.urdf --check")
    if keys:
        rows = list(of_robot())
        if as_json:
            emit_json(rows)
        else:
            tell_keys(rows)
    elif robot is None:
        _list(as_json)
    elif check:
        return _check(robot, mass, no_meshes, as_json)
    else:
        _show(robot, as_json)
    return 0


def _list(as_json: bool) -> None:
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
        return
    for row in rows:
        click.echo(f"{row['name']:<14} {row['error'] or row['summary']}")


def _check(robot: str, mass: str | None, no_meshes: bool, as_json: bool) -> int:
    from dataclasses import asdict, replace

    from skillframe.cli.output import note
    from skillframe.errors import SkillframeError
    from skillframe.extend.drives import audit
    from skillframe.robot.bodies import without_meshes
    from skillframe.robot.link_checks import class_mass
    from skillframe.robot.model import load_model
    from skillframe.robot.spec import load_robot

    total_kg = None
    if mass is not None:
        try:
            total_kg = float(mass)
        except ValueError:
            total_kg = class_mass(mass)
    try:
        spec = load_robot(robot)
        model = load_model(spec)
        if no_meshes:
            model = replace(model, urdf=without_meshes(model.urdf))
            note("note: meshes are not read, so their sizes and contacts at home are not checked")
        result = audit(model, total_kg)
        if not no_meshes and _looks("whether bodies touch at home"):
            from skillframe.world.collisions import collision_problems

            result = replace(result, problems=(*result.problems, *collision_problems(model)))
    except SkillframeError as error:
        if as_json:
            fix = "fix the file, then check again"
            problem = {"code": "does_not_load", "severity": "fatal", "where": robot, "message": str(error), "fix": fix}
            told = {"usable": False, "nq": None, "nv": None, "mass_kg": None, "problems": [problem]}
            click.echo(json.dumps(told, indent=2))
        raise
    if as_json:
        own = {} if spec.control.interface == "torque" else {"interface": spec.control.figures()}
        problems = [asdict(problem) for problem in result.problems]
        click.echo(json.dumps({**asdict(result), "problems": problems, **own}, indent=2))
    else:
        _print_audit(robot, result, spec)
    return 0 if result.usable else 1


def _show(robot: str, as_json: bool) -> None:
    from skillframe.cli.output import emit_json
    from skillframe.extend.drives import told, with_derived
    from skillframe.robot.describe import as_json as plain
    from skillframe.robot.describe import describe
    from skillframe.robot.model import load_model
    from skillframe.robot.spec import load_robot

    model = load_model(load_robot(robot))
    whole, derived = with_derived(model)
    lines, values = told(whole.spec)
    looks = _looks("which bodies may touch")
    if looks:
        from skillframe.world.collisions import collision_lines, collision_values
    if as_json:
        emit_json({**plain(whole, values), "collisions": collision_values(model) if looks else None})
        return
    click.echo("\n".join([describe(whole, lines), *(collision_lines(model) if looks else [])]))
    if derived:
        click.echo(f"  robot.toml does not give {', '.join(derived)}: its drive derives it")


def _looks(what: str) -> bool:
    from skillframe.cli.output import note
    from skillframe.errors import MissingDependency, need

    try:
        need("mujoco")
    except MissingDependency as error:
        note(f"note: not checked: {what}: {error}")
        return False
    return True


def _print_audit(robot: str, result: Audit, spec: RobotSpec) -> None:
    verdict = "usable for dynamics" if result.usable else "NOT usable for dynamics"
    click.echo(f"{robot}: {verdict} (nq {result.nq}, nv {result.nv}, {result.mass_kg:.4g} kg)")
    if spec.control.interface != "torque":
        click.echo(f"  {spec.control.admittance.told()}")
    said: set[str] = set()
    for problem in result.problems:
        click.echo(f"\n{problem.severity} {problem.code} at {problem.where}\n  {problem.message}")
        lines = problem.fix.splitlines()
        known = len(lines) > 1 and said.issuperset(lines[1:])  # the first one depends on the sum of the masses
        click.echo("  fix: " + ("as above" if known else "\n    ".join(lines)))
        said.update(lines)
