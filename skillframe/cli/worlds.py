"""`skillframe worlds`: which worlds there are, and what one of them is."""

from __future__ import annotations

from typing import Any

import click

from skillframe.cli import names
from skillframe.cli.output import LIST_WIDTH, emit_json, table


@click.group()
def command() -> None:
    """List and show worlds.

    \b
    Example:
      skillframe worlds list
      skillframe worlds show peg_in_hole
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def list_(as_json: bool) -> None:
    """Worlds that --world takes.

    \b
    Example:
      skillframe worlds list --json
    """
    from skillframe.cli.catalog import rows_of
    from skillframe.extend.registry import registry

    rows = rows_of(registry(), "world")
    if as_json:
        emit_json(rows)
    else:
        lines = [(row["name"], row["summary"], row["distribution"]) for row in rows]
        table(("world", "what it is", "from"), lines, LIST_WIDTH)


@command.command()
@click.argument("world", shell_complete=names.worlds)
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def show(world: str, as_json: bool) -> None:
    """What a world is: its parameters, where a run starts, and the points of its tool.

    \b
    Example:
      skillframe worlds show peg_in_hole
    """
    from skillframe.api.settings import of_world
    from skillframe.cli.settings import typed
    from skillframe.extend.registry import registry
    from skillframe.extend.worlds import make_scene

    record = registry().world(world)
    scene, settings = make_scene(record, {}), list(of_world(record))
    found: dict[str, Any] = {
        "name": world, "summary": record.summary, "distribution": registry().provider("world", world).distribution,
        "settings": settings, "start_tip_m": list(scene.start_tip), "frames": scene.tool.frames,
        "depth_m": None if scene.way is None else scene.way.of_m, "sprung": [part.name for part in scene.sprung],
        "second_arm_holds_it": scene.holder is not None,
    }  # fmt: skip
    if as_json:
        emit_json(found)
        return
    click.echo(f"{world} ({found['distribution']}): {record.summary}")
    click.echo(f"  the tip starts at {_point(scene.start_tip)} mm in the fixture frame, z up")
    for name, point in scene.tool.frames.items():
        click.echo(f"  {name} at {_point(point)} mm in the tool frame")
    if scene.way is not None:
        click.echo(f"  {scene.way.word} {scene.way.of_m * 1000:g} mm is all the way")
    if scene.holder is not None:
        click.echo("  a second arm, where there is one, holds the fixture")
    lines = [(row["name"], row["unit"], typed(row["default"]), row["about"]) for row in settings]
    table(("setting", "unit", "default", "what it is"), lines, LIST_WIDTH)


def _point(point: tuple[float, ...]) -> str:
    return ", ".join(f"{1000.0 * each:g}" for each in point)
