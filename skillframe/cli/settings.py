"""`skillframe settings`: everything that --set takes, with unit and default."""

from __future__ import annotations

from typing import Any

import click

from skillframe.cli import names
from skillframe.cli.output import LIST_WIDTH, emit_json, table


@click.command()
@click.option("--world", shell_complete=names.worlds, help="Of this world only [all worlds].")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def command(world: str | None, as_json: bool) -> None:
    """List what --set takes in run, record and campaigns: a quantity's name, unit and default.

    A bare number is in SI units; 8mm, 5deg, 20N say their own. A learner's settings: skillframe plugins show NAME.

    \b
    Examples:
      skillframe settings --world peg_in_hole
      skillframe settings --json
    """
    from skillframe.api.settings import of_trials, of_world
    from skillframe.extend.registry import registry

    worlds = [registry().world(world)] if world is not None else list(registry().records("world"))
    rows = [*of_trials(), *(row for record in worlds for row in of_world(record))]
    if as_json:
        emit_json(rows)
        return
    lines = [(row["name"], row["world"] or "any", row["unit"], typed(row["default"]), row["about"]) for row in rows]
    table(("setting", "world", "unit", "default", "what it is"), lines, LIST_WIDTH)


def typed(value: Any) -> str:
    """A default as it would be typed; nothing where something else decides."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else f"{value}"
