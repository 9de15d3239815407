"""`skillframe settings`: everything that --set takes, with unit and default."""

from __future__ import annotations

import re
from typing import Any

import click

from skillframe.cli import names
from skillframe.cli.output import LIST_WIDTH, emit_json, table
from skillframe.errors import InputError


@click.command()
@click.option("--world", shell_complete=names.worlds, help="Of this world only [all worlds].")
@click.option("--robot-toml", is_flag=True, help="The keys of robot.toml instead.")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def command(world: str | None, robot_toml: bool, as_json: bool) -> None:
    """List what --set takes in run, record and campaigns: a quantity's name, default and range, with units.

    With --robot-toml it lists what a robot's own file may say: NAME stands for a joint or link, [] for each of a list.

    A bare number is in SI units; 8mm, 5deg, 20N say their own. A number beyond the range is refused as a typing
    mistake. A learner's settings: skillframe plugins show NAME.

    \b
    Examples:
      skillframe settings --world peg_in_hole
      skillframe settings --robot-toml
      skillframe settings --json
    """
    if robot_toml and world is not None:
        raise InputError("--robot-toml", "has nothing to do with a world", "leave out --world")
    rows = _of_robot() if robot_toml else _of_set(world)
    if as_json:
        emit_json(rows)
        return
    if robot_toml:
        keys = [(row["name"], *_figures(row), plain(row["about"]) if row["unit"] else row["about"]) for row in rows]
        table(("key", "default", "range", "what it is"), keys, LIST_WIDTH)
        return
    lines = [
        (row.get("option") or row["name"], row["world"] or "any", *_figures(row), plain(row["about"])) for row in rows
    ]
    table(("setting", "world", "default", "range", "what it is"), lines, LIST_WIDTH)


def _of_set(world: str | None) -> list[dict[str, Any]]:
    from skillframe.api.settings import of_runs, of_trials, of_world
    from skillframe.extend.registry import registry

    worlds = [registry().world(world)] if world is not None else list(registry().records("world"))
    return [*of_runs(), *of_trials(), *(row for record in worlds for row in of_world(record))]


def _of_robot() -> list[dict[str, Any]]:
    from skillframe.api.settings import of_robot

    return list(of_robot())


def _figures(row: dict[str, Any]) -> tuple[str, str]:
    """Default and range as they would be typed."""
    from skillframe.config.ranges import Range, shown

    default = row["default"]
    number = isinstance(default, int | float) and not isinstance(default, bool)
    limits = None if row["range"] is None else Range(*row["range"])
    said = shown(default, row["unit"]) if number and row["unit"] else typed(default)
    return said, "" if limits is None else limits.words(row["unit"])


def plain(about: str) -> str:
    """A text about a quantity without the unit and range that stand in columns of their own."""
    return re.sub(r" \[[^\]]*\]", "", about)


def typed(value: Any) -> str:
    """A default as it would be typed. Nothing where something else decides."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else f"{value}"
