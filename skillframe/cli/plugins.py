"""`skillframe plugins`: list and show what is installed, check it against the contract, and start a new one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.catalog import by_kind
from skillframe.cli.output import emit_json, note, quiet_option
from skillframe.cli.settings import typed
from skillframe.cli.template import EVERY, KINDS
from skillframe.errors import UnknownName

if TYPE_CHECKING:
    from skillframe.conformance import Finding
    from skillframe.extend.registry import Plugin, Registry


@click.group()
def command() -> None:
    """List, show, check and start plug-ins.

    \b
    Example:
      skillframe plugins list
      skillframe plugins show peg_in_hole
      skillframe plugins new my_skill
      skillframe plugins check my_skill
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@quiet_option
def list_(as_json: bool) -> None:
    """List installed plug-ins: what each provides, and its error if it has one.

    \b
    Example:
      skillframe plugins list --json
    """
    from skillframe.extend.registry import registry

    known = registry()
    rows = distribution_rows(known)
    if as_json:
        emit_json(rows)
    else:
        _list(rows)
        note("skillframe plugins show NAME says what one is, and what can be set")
    for name in known.not_installed:
        click.echo(f"SKILLFRAME_PLUGINS asks for {name!r}, which is not installed", err=True)
    if known.unselected:
        click.echo(f"SKILLFRAME_PLUGINS leaves out {', '.join(known.unselected)}", err=True)


def _list(rows: Sequence[dict[str, Any]]) -> None:
    """A paragraph per distribution, a line per kind of what it provides."""
    for row in rows:
        click.echo(f"{row['name']} ({row['distribution']} {row['version']})")
        for kind, names in by_kind(row["provides"]).items():
            click.echo(f"  {kind:<13} {', '.join(names)}")
        if row["error"]:
            click.echo(f"  error         {row['error']}")


@command.command()
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def show(name: str, as_json: bool) -> None:
    """Say what a world, skill, ... is, and what --set can change: a world's parameters, a learner's settings.

    \b
    Example:
      skillframe plugins show peg_in_hole
      skillframe plugins show skill:lmc --json
    """
    from skillframe.cli.catalog import found
    from skillframe.extend.registry import registry

    row = found(registry(), name)
    if as_json:
        emit_json(row)
        return
    click.echo(f"{row['kind']} {row['name']} ({row['distribution']} {row['version']}): {row['summary']}")
    for what, text in row["facts"].items():
        click.echo(f"  {what}: {text}")
    prefix = "world." if row["kind"] == "world" else ""
    for each in row["settings"] or ():
        unit = f" [{each['unit']}]" if each["unit"] else ""
        click.echo(f"  --set {prefix}{each['name']}{_default(each['default'])}{unit}")
        click.echo(f"      {each['about']}")


def _default(value: Any) -> str:
    """As it would be typed. Nothing where the recordings decide."""
    return "" if value is None else f"={typed(value)}"


def distribution_rows(registry: Registry) -> list[dict[str, Any]]:
    """A row per distribution. A distribution with several plug-ins lists them together, and its commands last."""
    from skillframe.cli.main import COMMANDS
    from skillframe.extend.commands import plugin_commands

    rows: dict[str, dict[str, Any]] = {}
    for plugin in registry.plugins:
        row = rows.setdefault(
            plugin.distribution,
            {"name": "", "distribution": plugin.distribution, "version": plugin.version, "provides": [], "error": None},
        )
        row["name"] = f"{row['name']},{plugin.name}" if row["name"] else plugin.name
        row["provides"] += plugin.provides
        row["error"] = "; ".join(error for error in (row["error"], plugin.error) if error) or None
    for command in plugin_commands().values():
        for row in (rows[name] for name in command.distributions if name in rows):
            row["provides"].append(f"command:{command.name}")
            if command.name in COMMANDS or not command.place:
                rivals = ("skillframe",) if command.name in COMMANDS else command.distributions
                error = f"the command {command.name} is in {' and '.join(rivals)}, too"
                row["error"] = f"{row['error']}; {error}" if row["error"] else error
    return list(rows.values())


@command.command()
@click.argument("name")
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), help="Folder to write (default: skillframe-NAME)."
)
@click.option(
    "--kind",
    "kinds",
    multiple=True,
    default=("skill",),
    show_default=True,
    type=click.Choice([*KINDS, EVERY]),
    help="What it provides; repeat for several.",
)
@quiet_option
def new(name: str, out: Path | None, kinds: tuple[str, ...]) -> None:
    """Write a working plug-in to start from, with its conformance tests.

    \b
    Example:
      skillframe plugins new my_skill --out my-skill
      skillframe plugins new my_lab --kind robot --kind world
      skillframe plugins new my_lab --kind all
    """
    from skillframe.cli.template import plugin_name, write_template

    name = plugin_name(name)
    folder = out or Path(f"skillframe-{name.replace('_', '-')}")
    for path in write_template(name, folder, kinds):
        click.echo(path)
    note(f"next: pip install -e {folder} && skillframe plugins check {name}")


@command.command()
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def check(names: tuple[str, ...], as_json: bool) -> int:
    """Run the conformance checks of the plug-ins named, or of all. Exits 1 if one fails.

    \b
    Example:
      skillframe plugins check
      skillframe plugins check my_skill --json
    """
    from skillframe.conformance import check_plugin
    from skillframe.extend.registry import registry

    known = registry()
    results = [(plugin, check_plugin(known, plugin)) for plugin in _chosen(known, names)]
    if as_json:
        emit_json([_check_row(plugin, finding) for plugin, findings in results for finding in findings])
    else:
        for plugin, findings in results:
            _say(plugin, findings)
    return int(any(finding.problems for _, findings in results for finding in findings))


def _chosen(registry: Registry, names: tuple[str, ...]) -> list[Plugin]:
    """Plug-ins by their own name or their distribution's, in the order of loading."""
    known = {alias for plugin in registry.plugins for alias in (plugin.name, plugin.distribution)}
    for name in names:
        if name not in known:
            raise UnknownName("plug-in", name, [plugin.name for plugin in registry.plugins])
    return [p for p in registry.plugins if not names or p.name in names or p.distribution in names]


def _check_row(plugin: Plugin, finding: Finding) -> dict[str, Any]:
    return {
        "name": plugin.name,
        "distribution": plugin.distribution,
        "version": plugin.version,
        "subject": finding.subject,
        "checked": finding.problems is not None,
        "problems": finding.problems or [],
        "warnings": finding.warnings,
    }


def _say(plugin: Plugin, findings: list[Finding]) -> None:
    click.echo(f"{plugin.name} ({plugin.distribution} {plugin.version})")
    for finding in findings:
        if finding.problems is not None:
            click.echo(f"  {finding.subject}: {'FAILS' if finding.problems else 'passes'}")
        for problem in finding.problems or []:
            click.echo(f"    - {problem}")
        for warning in finding.warnings:
            click.echo(f"    - warning: {warning}")
    for kind, names in by_kind([finding.subject for finding in findings if finding.problems is None]).items():
        click.echo(f"  {kind} {', '.join(names)}: no checks for this kind")
