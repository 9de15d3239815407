"""`skillframe worlds`: which worlds there are, what one of them is, and new ones of two meshes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from skillframe.cli import names
from skillframe.cli.output import LIST_WIDTH, emit_json, table
from skillframe.errors import InputError


@click.group()
def command() -> None:
    """List and show worlds, and make one of two meshes.

    \b
    Example:
      skillframe worlds list
      skillframe worlds show peg_in_hole
      skillframe worlds new plug.stl socket.stl --units mm --out fixture.toml
    """


@command.command("list")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def list_(as_json: bool) -> None:
    """Worlds that --world takes by name. It takes the path of a fixture file as well (skillframe worlds new).

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
@click.option("--picture", type=click.Path(path_type=Path), help="PNG to draw: the scene at its start, cut open.")
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def show(world: str, picture: Path | None, as_json: bool) -> None:
    """What a world is: its parameters, where a run starts, and the points of its tool.

    \b
    Example:
      skillframe worlds show peg_in_hole
      skillframe worlds show parts/fixture.toml --picture parts.png
    """
    from skillframe.api.settings import of_world
    from skillframe.cli.settings import typed
    from skillframe.extend.registry import registry
    from skillframe.extend.worlds import make_scene

    record = registry().world(world)
    origin = world if world.endswith(".toml") else registry().provider("world", world).distribution
    scene, settings = make_scene(record, {}), list(of_world(record))
    found: dict[str, Any] = {
        "name": world, "summary": record.summary, "distribution": origin,
        "settings": settings, "start_tip_m": list(scene.start_tip), "frames": scene.tool.frames,
        "depth_m": None if scene.way is None else scene.way.of_m, "sprung": [part.name for part in scene.sprung],
        "second_arm_holds_it": scene.holder is not None,
    }  # fmt: skip
    if picture is not None:
        _draw(scene, picture)
    if as_json:
        emit_json(found)
        return
    click.echo(f"{scene.name} ({found['distribution']}): {record.summary}")
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


@command.command()
@click.argument("plug", type=click.Path(path_type=Path))
@click.argument("socket", type=click.Path(path_type=Path))
@click.option("--units", help='Of both files, as "mm"; needed for all but GLB and STEP.')
@click.option(
    "--out", default="fixture.toml", show_default=True, type=click.Path(path_type=Path), help="File to write."
)
@click.option(
    "--friction", default=0.2, show_default=True, type=click.FloatRange(0.0, 5.0), help="Coulomb coefficient."
)
@click.option(
    "--axis", default="auto", show_default=True,
    help='Of insertion, as "[0, 0, -1]"; auto takes the first of -z, z, -x, x, -y, y that is free.',
)  # fmt: skip
def new(plug: Path, socket: Path, units: str | None, out: Path, friction: float, axis: str) -> None:
    """Make a world of two meshes, PLUG (held) and SOCKET (standing), assembled as they were exported.

    Writes a fixture file and prints what is found: depth, clearance, way out, contact error. The meshes have to lie in
    the file's folder.

    \b
    Example:
      skillframe worlds new plug.stl socket.stl --units mm
    """
    from skillframe.files import write_whole
    from skillframe.parts.found import lines, needs_units, new_text, relative
    from skillframe.parts.load import load

    if out.suffix != ".toml":
        raise InputError(out, "is to be named .toml, as --world knows such files by", "choose another --out")
    if out.exists():
        raise InputError(out, "exists", "choose another --out, or edit it")
    if not out.parent.is_dir():
        raise InputError(out, f"cannot be written: there is no folder {out.parent}", "make it first")
    names_of_both = relative(plug, out), relative(socket, out)
    if units is None and needs_units(*names_of_both):
        unsaid = " and ".join(each.name for each in (plug, socket) if needs_units(each.name))
        raise InputError("--units", f"is missing: nothing is said of it in {unsaid}", "give for example --units mm")
    text = new_text(out.name, *names_of_both, units, friction, _axis(axis))
    write_whole(out, text.encode())
    try:
        found = lines(load(out))
    except BaseException:
        out.unlink(missing_ok=True)  # nobody wants a file of parts that are refused
        raise
    click.echo("\n".join([f"{out} written", *found]))


def _axis(said: str) -> str:
    """`--axis` as TOML: three numbers, or "auto"."""
    import json

    try:
        found = said if said == "auto" else [float(each) for each in json.loads(said)]
    except (ValueError, TypeError):
        found = []
    if said != "auto" and (len(found) != 3 or not any(found) or not all(math.isfinite(float(x)) for x in found)):
        raise InputError(f"--axis {said!r}", "is no direction", 'give three numbers as "[0, 0, -1]", or auto')
    return json.dumps(found)


@command.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="JSON alone on stdout.")
def check(file: Path, as_json: bool) -> None:
    """What is found in the two parts of a fixture FILE, or why they are refused (exit code 2).

    \b
    Example:
      skillframe worlds check fixture.toml
    """
    from skillframe.parts.found import lines, values
    from skillframe.parts.load import load

    loaded = load(file)
    if as_json:
        emit_json(values(loaded))
    else:
        click.echo("\n".join(lines(loaded)))


def _draw(scene: Any, picture: Path) -> None:
    from skillframe.api.pictures import picture_of
    from skillframe.files import write_whole

    if picture.suffix.lower() != ".png":
        raise InputError(f"--picture {picture}", "is no PNG", "name it .png")
    write_whole(picture, picture_of(scene))
