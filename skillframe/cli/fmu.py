"""`skillframe fmu`: functional mock-up units, listed, built, checked and simulated."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.numbers import WithUnit
from skillframe.config.ranges import Range

if TYPE_CHECKING:
    from skillframe.fmu.library import BuiltFmu

_TIME = Range(-1e9, 1e9, "thirty years to either side")


@click.group(name="fmu")
def command() -> None:
    """List, build, check and simulate FMUs (FMI 2 and 3).

    \b
    Example:
      skillframe fmu simulate hydraulic_cylinder --stop 1 --step 0.001 --out out.csv
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="As JSON on stdout.")
def list_(as_json: bool) -> None:
    """List the FMUs that are built. Name those that are not.

    \b
    Example:
      skillframe fmu list --json
    """
    from skillframe.fmu.library import built, fmu_folders

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
@click.option("--json", "as_json", is_flag=True, help="What was built as JSON on stdout.")
def build(names: tuple[str, ...], as_json: bool) -> int:
    """Build FMUs from source: all of fmus/ by default, or a foreign FMU's own sources for this machine.

    \b
    Example:
      skillframe fmu build hydraulic_cylinder
    """
    from skillframe.errors import SkillframeError
    from skillframe.fmu.foreign import build_from_sources
    from skillframe.fmu.library import build_named, fmu_folders

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


@command.command("check")
@click.argument("file")
@click.option("--json", "as_json", is_flag=True, help="As JSON on stdout.")
@click.option("--allow", is_flag=True, help="Let this very file run inside skillframe's process from now on.")
def check(file: str, as_json: bool, allow: bool) -> int:
    """Check an FMU: what it is, what is inside, whether it runs here. Exit 1 if there are problems.

    \b
    Example:
      skillframe fmu check actuator.fmu --json
    """
    from skillframe.fmu.check import check_fmu
    from skillframe.fmu.library import find_fmu

    path = find_fmu(file)
    found = check_fmu(path)
    if allow:
        from skillframe.fmu.allow import allow as add

        click.echo(f"allowed: {add(path)}", err=True)
    if as_json:
        click.echo(json.dumps(found))
    else:
        _print_check(path, found)
    return 1 if found["problems"] else 0


def _print_check(path: Path, found: dict[str, Any]) -> None:
    """What was found, one line each, then what can be connected and set, with units and start values."""
    from skillframe.cli.output import table
    from skillframe.fmu.check import confinement_in_words
    from skillframe.fmu.inspection import inspect_fmu

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
      skillframe fmu simulate hydraulic_cylinder --set command=0.1 --stop 1 --step 0.001 --out out.csv
    """
    from skillframe.config import parse_setting
    from skillframe.fmu.record import simulate_to_csv

    ended = simulate_to_csv(
        file, stop, step, out, table=table, settings=dict(parse_setting(text) for text in settings), limit_s=timeout
    )
    if ended.problem:
        rows = "1 row is" if ended.rows == 1 else f"{ended.rows} rows are"
        click.echo(f"{ended.problem}; {rows} in {out}", err=True)
        return 1
    click.echo(f"{out}: {ended.rows} rows, {', '.join(ended.columns[1:])}")
    return 0
