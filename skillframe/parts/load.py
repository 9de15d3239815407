"""A fixture file loaded: its parts, how they go together, and what they collide with. Kept while unchanged."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.parts.checks import (
    HEAVIEST,
    HEAVY,
    SHARE,
    around,
    check_clearance,
    check_error,
    check_facets,
    check_two,
    check_walls,
    mend_error,
    unfit_pieces,
)
from skillframe.parts.declared import DENSITY, FixtureFile, mesh_files, read_fixture
from skillframe.parts.field import error_of, memory_of, surface_of
from skillframe.parts.fit import PartsFit, corners, fit, lowest, tilted
from skillframe.parts.kept import pieces_of
from skillframe.parts.pieces import EXACT_M, MOST_PIECES, ConvexPieces
from skillframe.parts.solid import MeshPart, arrays_of, read_part
from skillframe.world.surfaces import Surface, available

SIDEWAYS = 6e-3
"""How far beside the held part a cropped standing part is still touched [m]."""
_ABOVE = 2e-3
_FREE = 1e-5
_MOST_LOADED = 8
_LOADED: dict[tuple[str, ...], LoadedParts] = {}
"""The last parts by what their files hold, wherever these lie: a campaign's folder has copies of them."""
_CLIMB = 1e-3
"""Of a start that is not free, from one try to the next [m]."""
_TRIES = (1.0, 0.75, 0.5, 0.25, 0.0)


class PreparedPart(NamedTuple):
    """A part as it collides and is drawn, in the fixture frame, assembled.

    Attributes:
        solid: all of it.
        error: of its contact [m].
        pieces: what it collides with, or None where both parts have a surface.
        rest: the solid that is only drawn, because the other part cannot come there; None if all of it collides.
        surface: what it collides with otherwise.
        memory: bytes that the surface takes.
    """

    solid: Any
    error: float
    pieces: ConvexPieces | None = None
    rest: Any = None
    surface: Surface | None = None
    memory: int = 0


class LoadedParts(NamedTuple):
    """Everything that a fixture file and its meshes say.

    Attributes:
        name: for people.
        file: as declared; fit: as found.
        plug, socket: as they collide.
        mass: of the held part [kg]; center: (3,) of its mass, inertia: (3,) about it, in fixture axes from its tip.
        starts: the tip's height above the mouth [m] and the tilt (3,) [rad] of each demonstration.
        notes: sentences that people should read.
        hashes: SHA-256 of the file and its meshes.
    """

    name: str
    file: FixtureFile
    fit: PartsFit
    plug: PreparedPart
    socket: PreparedPart
    mass: float
    center: Float
    inertia: Float
    starts: tuple[tuple[float, Float], ...]
    notes: tuple[str, ...]
    hashes: Mapping[str, str]

    @property
    def backend(self) -> str:
        """How contact is made: "pieces" (convex pieces) or "surface" (our own contact generator)."""
        return "pieces" if self.plug.pieces is not None else "surface"

    @property
    def contact_error(self) -> float:
        """Of the worse of the two parts [m]."""
        return max(self.plug.error, self.socket.error)


def name_of(path: Path) -> str:
    """What a world of a file is called: the file's stem, or its folder where the file is called fixture.toml."""
    return path.resolve().parent.name if path.name == "fixture.toml" else path.stem


def load(path: Path) -> LoadedParts:
    """A fixture file and its meshes, checked.

    Raises:
        InputError: what is wrong, and in which file.
        MissingDependency: the extra `parts` is not installed.
    """
    hashes = {name: _digest(file) for name, file in {path.name: path, **mesh_files(path)}.items()}
    key = tuple(hashes.values())  # the file's own text names its meshes
    if key not in _LOADED:
        found = _load(path, hashes)
        if len(_LOADED) >= _MOST_LOADED:
            del _LOADED[next(iter(_LOADED))]
        _LOADED[key] = found
    return _LOADED[key]._replace(name=name_of(path), hashes=hashes)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _load(path: Path, hashes: Mapping[str, str]) -> LoadedParts:
    file = read_fixture(path)
    plug = read_part(path.parent / file.tool.mesh, file.tool.units, held=True)
    socket = read_part(path.parent / file.fixture.mesh, file.fixture.units)
    check_two(plug, socket)
    found = fit(plug, socket, file)
    mass, center, inertia, notes = _inertia(found, plug, file)
    check_clearance(found)
    reach = np.reshape(_reach(found).bounding_box(), (2, 3))
    if file.contact.as_meshed:
        errors = [plug.error, socket.error]
    else:
        sides = ((plug, file.tool.assembled), (socket, file.fixture.pose))
        errors = [mend_error(part, place, found, reach) for part, place in sides]
        check_facets(found, plug, socket)
    check_walls(found, plug, socket)
    held, standing = (
        side._replace(error=side.error + error)
        for side, error in zip(_prepared(plug, socket, found, file.contact.by), errors, strict=True)
    )
    return LoadedParts(
        name_of(path), file, found, held, standing, mass, center, inertia, _starts(found, file),
        (*plug.notes, *socket.notes, *notes, *around(found, plug, socket)), hashes,
    )  # fmt: skip


def _prepared(plug: MeshPart, socket: MeshPart, found: PartsFit, by: str) -> tuple[PreparedPart, PreparedPart]:
    """Both parts as convex pieces where these are exact, else both as surfaces, else as pieces that are exact enough.

    Args:
        plug: the held part.
        socket: the standing one.
        found: how they go together.
        by: "pieces" or "surface" asks for that, "auto" for neither.

    Raises:
        InputError: none is, or there is no compiler for surfaces.
    """
    if by == "pieces":
        return _all_in_pieces(plug, socket, found, 'contact.by is "pieces"')
    if not available():
        if by == "surface":
            what = 'is "surface", and there is no C compiler to build the contact generator with'
            raise InputError("contact.by", what, "install cc, gcc or clang, or pip install ziglang, or leave it out")
        return _all_in_pieces(plug, socket, found, "without a C compiler there is no other contact")
    exact = _exact_pieces(plug, socket, found) if by == "auto" else None
    if exact is not None:
        return exact
    try:
        return _as_surface(plug, found.plug, found), _as_surface(socket, found.socket, found)
    except InputError as error:
        if by == "surface":
            raise
        return _all_in_pieces(plug, socket, found, f"as a surface {error.problem}")


def _exact_pieces(plug: MeshPart, socket: MeshPart, found: PartsFit) -> tuple[PreparedPart, PreparedPart] | None:
    """Both parts in pieces, nothing thinned, or None where they are too many or not exact."""
    made = {}
    for part, solid in _harder_first(plug, socket, found):
        side = _in_pieces(solid, found, 0.0, MOST_PIECES)
        if side.pieces is None or not side.pieces.hulls or side.error > min(EXACT_M, SHARE * found.clearance):
            return None
        made[part.name] = side
    return made[plug.name], made[socket.name]


def _all_in_pieces(plug: MeshPart, socket: MeshPart, found: PartsFit, why: str) -> tuple[PreparedPart, PreparedPart]:
    """Both parts in pieces that are exact enough.

    Raises:
        InputError: there are none; says why nothing else is left.
    """
    made = {}
    for part, solid in _harder_first(plug, socket, found):
        side = _in_pieces(solid, found, SHARE * found.clearance, MOST_PIECES)
        assert side.pieces is not None
        if refused := unfit_pieces(side.pieces, found, part):
            raise InputError(part.name, f"{refused.problem}, and {why}", refused.fix)
        made[part.name] = side
    return made[plug.name], made[socket.name]


def _harder_first(plug: MeshPart, socket: MeshPart, found: PartsFit) -> list[tuple[MeshPart, Any]]:
    """Both parts and their solids in the fixture frame, the one first that is likelier to be refused."""
    return sorted(((plug, found.plug), (socket, found.socket)), key=lambda pair: -pair[1].num_tri())


def _in_pieces(solid: Any, found: PartsFit, allowed: float, most: int) -> PreparedPart:
    """The pieces of a whole part, or, where they are too many, of what the other part can reach of it."""
    pieces, rest = pieces_of(solid, allowed, most), None
    if not 0 < len(pieces.hulls) <= most:
        box = _reach(found)
        near = solid ^ box
        if not near.is_empty() and near.volume() < 0.999 * solid.volume():
            pieces, rest = pieces_of(near, allowed, most), solid - box
    return PreparedPart(solid, pieces.error, pieces, rest)


def _as_surface(part: MeshPart, solid: Any, found: PartsFit) -> PreparedPart:
    low, high = np.reshape(_reach(found).bounding_box(), (2, 3))
    surface = surface_of(solid, low, high)
    error = error_of(surface, low, high)
    check_error(error, found, part)
    return PreparedPart(solid, error, surface=surface, memory=memory_of(surface))


def _reach(found: PartsFit) -> Any:
    """Where the parts can meet, as a solid in the fixture frame: around the held part, below the standing one's top."""
    import manifold3d

    plug, socket = (np.reshape(each.bounding_box(), (2, 3)) for each in (found.plug, found.socket))
    low = np.maximum(plug[0], socket[0]) - SIDEWAYS
    high = np.minimum(plug[1], socket[1]) + SIDEWAYS
    high[2] = socket[1, 2] + _ABOVE
    return manifold3d.Manifold.cube([float(x) for x in high - low]).translate([float(x) for x in low])


def _inertia(found: PartsFit, plug: MeshPart, file: FixtureFile) -> tuple[float, Float, Float, tuple[str, ...]]:
    """Mass, centre and moments of inertia of the held part from its mesh, and what is to be said of it."""
    import trimesh

    vertices, faces = arrays_of(found.plug)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    density = DENSITY if file.tool.density is None else file.tool.density
    mass = float(mesh.volume) * density if file.tool.mass is None else file.tool.mass
    inertia = np.diag(mesh.moment_inertia) * (mass / float(mesh.volume))
    notes = []
    if mass > HEAVIEST:
        what = f"is {plug.size:.2g} m long and weighs {mass:.3g} kg at {density:g} kg/m3"
        raise InputError(plug.name, what, "check its units, or give mass")
    if file.tool.mass is None and mass > HEAVY:
        notes.append(f"{plug.name} weighs {mass:.2g} kg at {density:g} kg/m3; a hollow part? give mass")
    return mass, np.asarray(mesh.center_mass) + np.array([0.0, 0.0, found.depth]), inertia, tuple(notes)


def _starts(found: PartsFit, file: FixtureFile) -> tuple[tuple[float, Float], ...]:
    """Heights of the tip and tilts from which it is shown: tilted about y, then about x, as deep as it fits.

    Where the tilted part does not fit into the mouth with its lowest corner that deep, it is a quarter less, and so on,
    and then higher and higher, at most over all of the standing part, which may rise above its mouth.
    """
    shown, starts, points = file.task.demonstration, [], corners(found)
    top = max(0.0, float(found.socket.bounding_box()[5]))
    for axis in (1, 0):
        tilt = shown.tilt * np.eye(3)[axis]
        lift = -float(lowest(points, tilt[None])[0])
        inside = [lift - share * min(shown.deep, found.depth) for share in _TRIES]
        over = lift + file.task.start.above_mouth + np.arange(0.0, top + _CLIMB, _CLIMB)
        free = next((h for h in [*inside, *over.tolist()] if _is_free(found, tilt, h)), float(over[-1]))
        starts.append((free, tilt))
    return tuple(starts)


def _is_free(found: PartsFit, tilt: Float, height: float) -> bool:
    return bool(tilted(found, tilt, np.array([0.0, 0.0, height])).min_gap(found.socket, _FREE) >= _FREE)
