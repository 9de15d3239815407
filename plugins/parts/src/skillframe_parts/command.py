"""`skillframe worlds new`: a world of two parts from mesh files."""

from __future__ import annotations

import json
import math
from pathlib import Path

import click

from skillframe.cli import note
from skillframe.errors import InputError


@click.command()
@click.argument("plug", type=click.Path(path_type=Path))
@click.argument("socket", type=click.Path(path_type=Path))
@click.option("--units", help='Of both files, as "mm"; needed for all but GLB and STEP.')
@click.option(
    "--out", default="fixture.toml", show_default=True, type=click.Path(path_type=Path), help="File to write."
)
@click.option(
    "--axis", default="auto", show_default=True,
    help='Of insertion, as "[0, 0, -1]"; auto takes the first free of -z, z, -x, x, -y, y and the sides of the plug.',
)  # fmt: skip
def new(plug: Path, socket: Path, units: str | None, out: Path, axis: str) -> None:
    """Make a world of two meshes, PLUG (held) and SOCKET (standing), assembled as they were exported.

    Writes a fixture file and prints what is found: depth, clearance, way out, contact error. The meshes have to lie in
    the file's folder. Friction and other keys can be edited in the file.

    \b
    Example:
      skillframe worlds new plug.stl socket.stl --units mm
    """
    from skillframe.files import write_whole
    from skillframe_parts.found import lines, needs_units, new_text, relative
    from skillframe_parts.load import load

    if out.suffix != ".toml":
        raise InputError(out, "is to be named .toml, as --world knows such files by", "choose another --out")
    if out.exists():
        raise InputError(out, "exists", "choose another --out, or edit it")
    if not out.parent.is_dir():
        raise InputError(out, f"cannot be written: there is no folder {out.parent}", "make it first")
    names_of_both = relative(plug, out), relative(socket, out)
    if units is None and needs_units(*names_of_both):
        unsaid = " and ".join(each.name for each in (plug, socket) if needs_units(each.name))
        raise InputError("--units", f"is missing: it does not stand in {unsaid}", "give for example --units mm")
    try:
        along = axis if axis == "auto" else [float(each) for each in json.loads(axis)]
    except (ValueError, TypeError):
        along = []
    if axis != "auto" and (len(along) != 3 or not any(along) or not all(math.isfinite(float(x)) for x in along)):
        raise InputError(f"--axis {axis!r}", "is no direction", 'give three numbers as "[0, 0, -1]", or auto')
    text = new_text(out.name, *names_of_both, units, json.dumps(along))
    write_whole(out, text.encode())
    try:
        found = lines(load(out, note))
    except BaseException:
        out.unlink(missing_ok=True)  # no file for refused parts
        raise
    click.echo("\n".join([f"{out} written", *found]))
