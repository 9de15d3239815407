"""`skillframe worlds`: list worlds, show one, and what --set takes there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from skillframe.cli import options
from skillframe.cli.groups import Listing
from skillframe.cli.output import LIST_WIDTH, emit_json, note, table
from skillframe.cli.settings import tell_settings
from skillframe.errors import InputError
from skillframe.files.documents import refuse_other


@click.group("worlds", cls=Listing)
@click.argument("world", required=False, shell_complete=options.or_command(options.worlds))
@click.option("--settings", is_flag=True, help="List what --set takes in run, record and campaigns, with units.")
@click.option(
    "--pictures", metavar="FOLDER", type=click.Path(path_type=Path),
    help="Draw WORLD, or every world, as FOLDER/NAME.png: the scene at its start, cut open.",
)  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def command(world: str | None, settings: bool, pictures: Path | None, as_json: bool) -> None:
    """List the worlds that --world takes, or show WORLD: its parameters, where a run starts, the points of its tool.

    WORLD may be a fixture file, too. It then says what is found in the parts, or why they are refused. With --settings
    it lists every quantity that --set takes there, or in all worlds, with default and range. A bare number is in SI
    units; 8mm, 5deg, 20N say their own. A number beyond the range is refused as a typing mistake. A learner's settings:
    skillframe skills NAME.

    \b
    Examples:
      skillframe worlds
      skillframe worlds peg_in_hole --settings
      skillframe worlds --pictures worlds
      skillframe worlds parts/fixture.toml --pictures parts
    """
    from skillframe.api.settings import of_trials, settings_of_world
    from skillframe.cli.catalog import rows_of
    from skillframe.extend.outputs import no_progress
    from skillframe.extend.records import make_scene
    from skillframe.extend.registry import registry

    if pictures is not None and settings:
        raise InputError("--pictures", "draws worlds, and --settings lists their settings", "give one of the two")
    if pictures is not None:
        draw = registry().output("scene").write
        chosen = registry().records("world") if world is None else [registry().world(world)]
        pictures.mkdir(parents=True, exist_ok=True)
        for record in chosen:
            draw(make_scene(record, {}), pictures / f"{Path(record.name).stem}.png", no_progress)
    if settings:
        chosen = [registry().world(world)] if world is not None else registry().records("world")
        rows = [*of_trials(), *(row for record in chosen for row in settings_of_world(record))]
        if as_json:
            emit_json(rows)
        else:
            tell_settings(rows)
    elif world is None:
        rows = rows_of(registry(), "world")
        if as_json:
            emit_json(rows)
        else:
            lines = [(row["name"], row["summary"], row["distribution"]) for row in rows]
            table(("world", "what it is", "from"), lines, LIST_WIDTH)
    else:
        _show(world, as_json)


def _show(world: str, as_json: bool) -> None:
    from skillframe.api.settings import settings_of_world
    from skillframe.cli.settings import typed
    from skillframe.extend.records import make_scene
    from skillframe.extend.registry import registry

    refuse_other(Path(world), "fixture")
    read = registry().world_file().found if world.endswith(".toml") else None
    parts, values = ([], None) if read is None else read(Path(world), note)
    record = registry().world(world)
    origin = world if world.endswith(".toml") else registry().provider("world", world).distribution
    scene, settings = make_scene(record, {}), list(settings_of_world(record))
    found: dict[str, Any] = {
        "name": world, "summary": record.summary, "distribution": origin,
        "settings": settings, "start_tip_m": list(scene.start_tip), "frames": scene.tool.frames,
        "depth_m": None if scene.way is None else scene.way.of_m, "sprung": [part.name for part in scene.sprung],
        "second_arm_holds_it": scene.holder is not None, "parts": values,
    }  # fmt: skip
    if as_json:
        emit_json(found)
        return
    click.echo(f"{scene.name} ({found['distribution']}): {record.summary}")
    for line in parts:
        click.echo(f"  {line}")
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
