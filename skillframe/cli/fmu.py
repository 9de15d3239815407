"""`skillframe fmu`: functional mock-up units, listed, checked, built and simulated."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli.groups import Listing
from skillframe.cli.options import WithUnit, or_command
from skillframe.config.units import Range
from skillframe.errors import InputError

if TYPE_CHECKING:
    from skillframe.fmu.build import BuiltFmu

_TIME = Range(-1e9, 1e9, "thirty years to either side")


@click.group(name="fmu", cls=Listing)
@click.argument("file", required=False, metavar="[FILE|NAME]", shell_complete=or_command())
@click.option("--allow", is_flag=True, help="Let this very file run inside skillframe's process from now on.")
@click.option("--json", "as_json", is_flag=True, help="As JSON on stdout.")
def command(file: str | None, allow: bool, as_json: bool) -> int:
    """List the FMUs (FMI 2 and 3) that are built, or check FILE: what it is, what is inside, whether it runs here.

    Exit code of a check: 1 if there are problems.

    \b
    Examples:
      skillframe fmu
      skillframe fmu actuator.fmu --json
    """
    if file is not None:
        return _check(file, as_json, allow)
    if allow:
        raise InputError("--allow", "is for one file", "name it")
    _list(as_json)
    return 0


def _list(as_json: bool) -> None:
    from skillframe.fmu.build import built, fmu_folders

    rows = built()
    if as_json:
        click.echo(_json(rows))
        return
    for row in rows:
        click.echo(_line(row))
    for name in fmu_folders():
        if name not in {row.name for row in rows}:
            click.echo(f"{name}  not built yet (skillframe fmu build {name})")


@command.command("build")
@click.argument("names", nargs=-1, metavar="[NAME|FILE.fmu]...")
@click.option("--out", type=click.Path(path_type=Path), metavar="FOLDER", help="Put copies there, as NAME_fmi2.fmu ...")
@click.option("--json", "as_json", is_flag=True, help="What was built as JSON on stdout.")
def build(names: tuple[str, ...], out: Path | None, as_json: bool) -> int:
    """Build FMUs from source: all of fmus/ by default, or a foreign FMU's own sources for this machine.

    \b
    Example:
      skillframe fmu build electric_servo
    """
    from skillframe.errors import SkillframeError
    from skillframe.fmu.build import build_named, copied, fmu_folders
    from skillframe.fmu.check import build_from_sources

    rows: list[BuiltFmu] = []
    failed = 0
    for name in names or tuple(fmu_folders()):
        try:
            foreign = name.endswith(".fmu")
            made = [build_from_sources(Path(name))] if foreign else build_named(name)
        except SkillframeError as error:
            if names:
                raise
            click.echo(f"error: {error}", err=True)
            failed += 1
            continue
        made = made if out is None else [copied(row, out) for row in made]
        rows += made
        for row in made:
            click.echo(_line(row), err=as_json)
    if as_json:
        click.echo(_json(rows))
    return 2 if failed else 0


def _json(rows: Sequence[BuiltFmu]) -> str:
    return json.dumps([{"name": row.name, "fmi_version": row.fmi_version, "path": str(row.path)} for row in rows])


def _line(row: BuiltFmu) -> str:
    return f"{row.name}  FMI {row.fmi_version}  {row.path}"


def _check(file: str, as_json: bool, allow: bool) -> int:
    from skillframe.cli.output import table
    from skillframe.fmu.build import find_fmu
    from skillframe.fmu.check import check_fmu, confinement_in_words
    from skillframe.fmu.inspection import inspect_fmu

    path = find_fmu(file)
    found = check_fmu(path)
    if allow:
        from skillframe.fmu.extract import allow as add

        click.echo(f"allowed: {add(path)}", err=True)
    code = 1 if found["problems"] else 0
    if as_json:
        click.echo(json.dumps(found))
        return code
    for key, value in {**found, "confinement": confinement_in_words(found["confinement"])}.items():
        text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
        click.echo(f"{key.replace('_', ' ')}: {text or 'none'}")
    shown = ("input", "output", "parameter")
    rows = [v for kind in shown for v in inspect_fmu(path).variables.values() if v.causality == kind]
    if rows:
        click.echo("")
        starts = [v.start if v.causality != "output" else "" for v in rows]
        table(
            ("variable", "what", "start", "unit", "description"),
            [(v.name, v.causality, start or "", v.unit, v.text) for v, start in zip(rows, starts, strict=True)],
        )
    return code


@command.command("simulate")
@click.argument("file")
@click.option("--stop", required=True, type=WithUnit("s", _TIME), help="End time [s].")
@click.option("--step", required=True, type=WithUnit("s", _TIME), help="Communication step [s].")
@click.option("--input", "table", type=click.Path(path_type=Path), help="CSV: time, then inputs by name; rows hold.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="CSV: time, then every output by name.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Parameter or start value of an input.")
@click.option(
    "--timeout",
    default=30.0,
    type=WithUnit("s", Range(0.0, 1e9, "thirty years"), above=True),
    show_default=True,
    help="Wall time without a sign of life [s].",
)
def simulate(
    file: str, stop: float, step: float, table: Path | None, out: Path, settings: tuple[str, ...], timeout: float
) -> int:
    """Simulate an FMU on its own. FMUs of other makers run in a child process with limits.

    \b
    Example:
      skillframe fmu simulate electric_servo --set torque=0.1 --stop 1 --step 0.001 --out out.csv
    """
    from skillframe.config import parse_setting
    from skillframe.fmu.simulate import simulate_to_csv

    ended = simulate_to_csv(
        file, stop, step, out, table=table, settings=dict(parse_setting(text) for text in settings), limit_s=timeout
    )
    if ended.problem:
        rows = "1 row is" if ended.rows == 1 else f"{ended.rows} rows are"
        click.echo(f"{ended.problem}; {rows} in {out}", err=True)
        return 1
    click.echo(f"{out}: {ended.rows} rows, {', '.join(ended.columns[1:])}")
    return 0
