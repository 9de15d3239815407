"""Description of two fitting parts, as sentences and values, and their first fixture file."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from skillframe.errors import InputError
from skillframe_parts.checks import SHARE
from skillframe_parts.declared import check_file, has_units
from skillframe_parts.free_direction import free_direction
from skillframe_parts.load import LoadedParts, PreparedPart, load

FILE = """\
# Two parts that are put together. skillframe worlds {name} says what is found in them.
[fixture]                # stands still
mesh = {socket}
{socket_units}table = true             # a table under its lowest point
[tool]                   # what the robot holds
mesh = {plug}
{plug_units}density = 2700           # kg/m3; or mass = "0.12kg"
[contact]
friction = 0.2
[task]
axis = {axis}            # of insertion; "auto" takes the first free of -z, z, -x, x, -y, y and the plug's sides
"""


def new_text(name: str, plug: str, socket: str, units: str | None, axis: str) -> str:
    """Text of a fixture file for two meshes, with relative names."""
    both = needs_units(plug, socket)
    stated = [needs_units(mesh) or (not both and mesh.lower().endswith(".glb")) for mesh in (socket, plug)]
    lines = [f"units = {_quoted(units)}\n" if units and said else "" for said in stated]
    return FILE.format(
        name=name, socket=_quoted(socket), plug=_quoted(plug), socket_units=lines[0], plug_units=lines[1],
        axis=axis,
    )  # fmt: skip


def needs_units(*meshes: str) -> bool:
    """Whether any of these files lacks a unit."""
    return not all(has_units(mesh) for mesh in meshes)


def relative(mesh: Path, file: Path) -> str:
    """A mesh's path relative to the fixture file.

    Raises:
        InputError: no file, one outside the fixture file's folder, or a name that is not text.
    """
    check_file(mesh, mesh, "check the path")
    try:
        str(mesh).encode()
    except UnicodeEncodeError:
        raise InputError(ascii(str(mesh)), "has a name that is no text in UTF-8", "rename it") from None
    try:
        return mesh.resolve().relative_to(file.resolve().parent).as_posix()
    except ValueError:
        what = f"lies outside {file.resolve().parent}"
        raise InputError(mesh, what, "put both meshes into one folder, and the fixture file there") from None


def _quoted(text: str | None) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def found(path: Path, say: Callable[[str], None]) -> tuple[list[str], dict[str, Any]]:
    """What is found in the parts of a fixture file, in sentences and as plain JSON values in SI.

    Raises:
        InputError: the parts are refused.
    """
    loaded = load(path, say)
    return lines(loaded), values(loaded)


def values(loaded: LoadedParts) -> dict[str, Any]:
    """The fit as plain JSON values in SI."""
    found = loaded.fit
    return {
        "name": loaded.name, "axis": list(found.axis), "depth_m": found.depth, "clearance_m": found.clearance,
        "least_clearance_m": float(found.gaps.min()), "backend": loaded.backend,
        "contact_error_m": loaded.contact_error,
        "free_direction": _free(loaded),
        "pieces": {"tool": _count(loaded.plug), "fixture": _count(loaded.socket)},
        "memory_bytes": loaded.plug.memory + loaded.socket.memory,
        "mass_kg": loaded.mass, "notes": list(loaded.notes), "sha256": dict(loaded.hashes),
    }  # fmt: skip


def lines(loaded: LoadedParts) -> list[str]:
    """The fit in sentences."""
    found = loaded.fit
    out = ", ".join(f"{-x + 0.0:g}" for x in found.axis)
    least, play = (1000.0 * x for x in (float(found.gaps.min()), found.clearance))
    plug, socket = loaded.file.tool.mesh, loaded.file.fixture.mesh
    return [
        f"{plug} goes {1000.0 * found.depth:.3g} mm deep into {socket} and comes out along ({out})"
        + (f", turned by {math.degrees(found.way.turns[-1]):.3g} degrees" if any(found.way.turns) else ""),
        f"clearance along the way {play:.3g} mm (median; least {least:.3g} mm)",
        f"contact by {_contact(loaded)}; contact error {1e6 * loaded.contact_error:.2g} um "
        f"(at most {1e6 * SHARE * found.clearance:.3g} um is let pass)",
        f"{plug} weighs " + (f"{1000.0 * loaded.mass:.3g} g" if loaded.mass < 1.0 else f"{loaded.mass:.3g} kg"),
        *_unheld(loaded),
        *(f"note: {note}" for note in loaded.notes),
    ]  # fmt: skip


def _free(loaded: LoadedParts) -> list[float] | None:
    free = free_direction(loaded.fit, loaded.file.task.seated.sideways)
    return None if free is None else (free @ loaded.fit.turn).round(6).tolist()


def _unheld(loaded: LoadedParts) -> list[str]:
    if (free := _free(loaded)) is None:
        return []
    along, by = ", ".join(f"{x + 0.0:.2g}" for x in free), 1000.0 * loaded.file.task.seated.sideways
    return [
        f"assembled, {loaded.file.tool.mesh} slides freely by {by:.2g} mm both ways along ({along}): touch does "
        "not show its place there, so that a skill relies on the place that it was taught"
    ]


def _contact(loaded: LoadedParts) -> str:
    plug, socket = loaded.file.tool.mesh, loaded.file.fixture.mesh
    if loaded.backend == "pieces":
        return f"convex pieces: {_pieces(loaded.plug)} of {plug}, {_pieces(loaded.socket)} of {socket}"
    grids = [side.surface for side in (loaded.plug, loaded.socket) if side.surface is not None]
    cells = ", ".join(f"{1000.0 * surface.grids[0].cell:.2g}" for surface in grids)
    points = sum(len(surface.points) for surface in grids)
    memory = (loaded.plug.memory + loaded.socket.memory) / 1e6
    return f"our own generator: {points:,} points in grids of {cells} mm, {memory:.0f} MB"


def _count(side: PreparedPart) -> int:
    return 0 if side.pieces is None else len(side.pieces.hulls)


def _pieces(side: PreparedPart) -> str:
    assert side.pieces is not None
    more = " (of what the other part can reach)" if side.rest is not None else ""
    return f"{len(side.pieces.hulls)}{' after thinning' if side.pieces.thinned else ''}{more}"
