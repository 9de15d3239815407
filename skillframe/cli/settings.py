"""`skillframe settings`: everything that --set takes, with unit and default."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import names
from skillframe.cli.output import LIST_WIDTH, emit_json, table
from skillframe.config.fields import settings_of
from skillframe.config.units import doubt

if TYPE_CHECKING:
    from skillframe.extend.records import WorldType


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
    from skillframe.extend.registry import registry

    worlds = [registry().world(world)] if world is not None else list(registry().records("world"))
    rows = [*_of_trials(), *(row for record in worlds for row in of_world(record))]
    if as_json:
        emit_json(rows)
        return
    lines = [(row["name"], row["world"] or "any", row["unit"], typed(row["default"]), row["about"]) for row in rows]
    table(("setting", "world", "unit", "default", "what it is"), lines, LIST_WIDTH)


def _of_trials() -> Iterator[dict[str, Any]]:
    from skillframe.world.quantities import VARIED

    for each in VARIED:
        yield {"name": each.name, "world": None, "unit": each.unit, "default": each.nominal, "about": each.about}


def of_world(record: WorldType) -> Iterator[dict[str, Any]]:
    """Rows of a world's own parameters."""
    for each in settings_of(record.params):
        yield {**each, "name": f"world.{each['name']}", "world": record.name}


def typed(value: Any) -> str:
    """A default as it would be typed; nothing where something else decides."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else f"{value}"


def warn(world: str, settings: Mapping[str, Any]) -> None:
    """Say on stderr which bare numbers look like millimetres or degrees."""
    from skillframe.extend.registry import registry

    rows = {row["name"]: row for row in [*_of_trials(), *of_world(registry().world(world))]}
    for key, value in settings.items():
        row = rows.get(key)
        if row is not None and (text := doubt(key, value, row["unit"], row["default"])):
            click.echo(f"warning: {text}", err=True)
