"""`skillframe plugins`: list and show what is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.catalog import by_kind
from skillframe.cli.groups import Listing
from skillframe.cli.options import or_command
from skillframe.cli.output import emit_json, note
from skillframe.cli.settings import typed

if TYPE_CHECKING:
    from skillframe.extend.registry import Registry


@click.group("plugins", cls=Listing)
@click.argument("name", required=False, shell_complete=or_command())
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(name: str | None, as_json: bool) -> None:
    """List installed plug-ins: what each provides, and its error if it has one. With NAME, show what that is.

    NAME is a world, skill, ... The settings shown are those that --set can change: a world's parameters, a learner's
    settings. skillframe-testkit adds the commands that start and check a plug-in.

    \b
    Examples:
      skillframe plugins
      skillframe plugins peg_in_hole
      skillframe plugins skill:lmc --json
    """
    if name is not None:
        tell_record(name, as_json)
        return
    from skillframe.extend.registry import registry

    known = registry()
    rows = distribution_rows(known)
    if as_json:
        emit_json(rows)
    else:
        for row in rows:
            click.echo(f"{row['name']} ({row['distribution']} {row['version']})")
            for kind, names in by_kind(row["provides"]).items():
                click.echo(f"  {kind:<13} {', '.join(names)}")
            if row["error"]:
                click.echo(f"  error         {row['error']}")
        note("skillframe plugins NAME shows what a world, drive, ... is, and what can be set")
    for each in known.not_installed:
        click.echo(f"SKILLFRAME_PLUGINS names {each!r}, which is not installed; give names such as worlds", err=True)
    if known.unselected:
        click.echo(f"SKILLFRAME_PLUGINS leaves out {', '.join(known.unselected)}", err=True)


def tell_record(name: str, as_json: bool) -> None:
    """Print the details of a NAME or KIND:NAME for `plugins NAME`."""
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
    return "" if value is None else f"={typed(value)}"


def distribution_rows(registry: Registry) -> list[dict[str, Any]]:
    """A row per distribution, with all of its plug-ins, and its commands last."""
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
