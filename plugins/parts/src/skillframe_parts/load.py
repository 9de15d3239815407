"""Loads a fixture file: its parts, their fit, and their collision geometry. Cached while unchanged."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.world import Surface, available
from skillframe_parts.checks import (
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
from skillframe_parts.declared import DENSITY, FixtureFile, mesh_files, read_fixture
from skillframe_parts.field import error_of, memory_of, surface_of
from skillframe_parts.fit import PartsFit, corners, fit, lowest, tilted
from skillframe_parts.piece_cache import pieces_of
from skillframe_parts.pieces import EXACT_M, MOST_PIECES, ConvexPieces
from skillframe_parts.solid import MeshPart, arrays_of, read_part

MANY = 10_000
"""Triangles of both parts above which progress is reported: about 10 s of one core."""
Say = Callable[[str], None]
_LOADED: dict[tuple[str, ...], LoadedParts] = {}
"""The last parts, by content of their files."""


class PreparedPart(NamedTuple):
    """A part's collision and visual geometry, in the fixture frame, assembled.

    Attributes:
        solid: the whole part.
        error: of its contact [m].
        pieces: convex pieces, or None where both parts have a surface.
        rest: visual solid that the other part cannot reach; None if everything collides.
        surface: collision surface without pieces.
        memory: of the surface [bytes].
    """

    solid: Any
    error: float
    pieces: ConvexPieces | None = None
    rest: Any = None
    surface: Surface | None = None
    memory: int = 0


class LoadedParts(NamedTuple):
    """Content of a fixture file and its meshes.

    Attributes:
        name: for people.
        file: as declared; fit: of the parts.
        plug, socket: their geometry.
        mass: of the held part [kg]; center: (3,) of its mass, inertia: (3,) about it, in fixture axes from its tip.
        starts: the tip's height above the hole entrance [m] and the tilt (3,) [rad] of each demonstration.
        notes: sentences for the user.
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
        """Contact geometry: "pieces" (convex) or "surface" (the plug-in's contact generator)."""
        return "pieces" if self.plug.pieces is not None else "surface"

    @property
    def contact_error(self) -> float:
        """Error of the worse of the two parts [m]."""
        return max(self.plug.error, self.socket.error)


def name_of(path: Path) -> str:
    """Name of a file's world: its stem, or its folder for fixture.toml."""
    return path.resolve().parent.name if path.name == "fixture.toml" else path.stem


def load(path: Path, say: Say = lambda text: None) -> LoadedParts:
    """A checked fixture file with its meshes.

    `say` is called with progress messages for fine meshes.

    Raises:
        InputError: names the file and the problem.
        MissingDependency: the extra `parts` is not installed.
    """
    files = {path.name: path, **mesh_files(path)}
    hashes = {name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in files.items()}
    key = tuple(hashes.values())  # includes names of the meshes
    if key in _LOADED:
        return _LOADED[key]._replace(name=name_of(path), hashes=hashes)
    file = read_fixture(path)
    plug = read_part(path.parent / file.tool.mesh, file.tool.units, held=True)
    socket = read_part(path.parent / file.fixture.mesh, file.fixture.units)
    check_two(plug, socket)
    count = plug.solid.num_tri() + socket.solid.num_tri()
    told = say if count > MANY else lambda text: None
    told(f"{plug.name} and {socket.name} have {count:,} triangles, which takes a minute or several")
    told("1 of 3: finding the way out and the play along it")
    found = fit(plug, socket, file)
    told("2 of 3: checking curves, walls and what was mended")
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
    told("3 of 3: cutting both parts into convex pieces, or into points and grids; what is cut is kept")
    held, standing = (
        side._replace(error=side.error + error)
        for side, error in zip(_prepared(plug, socket, found, file.contact.by), errors, strict=True)
    )
    if len(_LOADED) >= 8:
        del _LOADED[next(iter(_LOADED))]
    _LOADED[key] = LoadedParts(
        name_of(path), file, found, held, standing, mass, center, inertia, _starts(found, file),
        (*plug.notes, *socket.notes, *notes, *around(found, plug, socket)), hashes,
    )  # fmt: skip
    return _LOADED[key]


def _prepared(plug: MeshPart, socket: MeshPart, found: PartsFit, by: str) -> tuple[PreparedPart, PreparedPart]:
    """Both parts as exact convex pieces if possible, else as surfaces, else as sufficiently exact pieces.

    `by` is "pieces", "surface" or "auto".

    Raises:
        InputError: none is possible, or surfaces lack a compiler.
    """
    if by == "pieces":
        return _all_in_pieces(plug, socket, found, 'contact.by is "pieces"')
    if not available():
        if by == "surface":
            what = 'is "surface", and there is no C compiler to build the contact generator with'
            raise InputError("contact.by", what, "install cc, gcc or clang, or pip install ziglang, or leave it out")
        return _all_in_pieces(plug, socket, found, "without a C compiler there is no other contact")
    if by == "auto":
        made = {}
        for part, solid in _harder_first(plug, socket, found):
            side = _in_pieces(solid, found, 0.0, MOST_PIECES)
            if side.pieces is None or not side.pieces.hulls or side.error > min(EXACT_M, SHARE * found.clearance):
                break
            made[part.name] = side
        else:
            return made[plug.name], made[socket.name]
    try:
        return _as_surface(plug, found.plug, found), _as_surface(socket, found.socket, found)
    except InputError as error:
        if by == "surface":
            raise
        return _all_in_pieces(plug, socket, found, f"as a surface {error.problem}")


def _all_in_pieces(plug: MeshPart, socket: MeshPart, found: PartsFit, why: str) -> tuple[PreparedPart, PreparedPart]:
    """Both parts as sufficiently exact pieces.

    Raises:
        InputError: not possible, with the reason.
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
    return sorted(((plug, found.plug), (socket, found.socket)), key=lambda pair: -pair[1].num_tri())


def _in_pieces(solid: Any, found: PartsFit, allowed: float, most: int) -> PreparedPart:
    """Pieces of a whole part, or, if too many, of its reachable region."""
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
    import manifold3d

    plug, socket = (np.reshape(each.bounding_box(), (2, 3)) for each in (found.plug, found.socket))
    sideways, above = 6e-3, 2e-3  # m beside and above the held part within which a cropped standing part collides
    low = np.maximum(plug[0], socket[0]) - sideways
    high = np.minimum(plug[1], socket[1]) + sideways
    high[2] = socket[1, 2] + above
    return manifold3d.Manifold.cube([float(x) for x in high - low]).translate([float(x) for x in low])


def _inertia(found: PartsFit, plug: MeshPart, file: FixtureFile) -> tuple[float, Float, Float, tuple[str, ...]]:
    import trimesh

    vertices, faces = arrays_of(found.plug)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    density = DENSITY if file.tool.density is None else file.tool.density
    mass = float(mesh.volume) * density if file.tool.mass is None else file.tool.mass
    inertia = np.diag(mesh.moment_inertia) * (mass / float(mesh.volume))
    notes = []
    if mass > 100.0:  # kg
        what = f"is {plug.size:.2g} m long and weighs {mass:.3g} kg at {density:g} kg/m3"
        raise InputError(plug.name, what, "check its units, or give mass")
    if file.tool.mass is None and mass > 1.5:  # kg
        notes.append(f"{plug.name} weighs {mass:.2g} kg at {density:g} kg/m3; a hollow part? give mass")
    return mass, np.asarray(mesh.center_mass) + np.array([0.0, 0.0, found.depth]), inertia, tuple(notes)


def _starts(found: PartsFit, file: FixtureFile) -> tuple[tuple[float, Float], ...]:
    """Tip heights and tilts of demonstrations: tilted about y, then about x, as deep as it fits.

    A start that does not fit is raised, in quarters of its depth and then above the hole entrance.
    """
    shown, starts, points = file.task.demonstration, [], corners(found)
    top = max(0.0, float(found.socket.bounding_box()[5]))
    for axis in (1, 0):
        tilt = shown.tilt * np.eye(3)[axis]
        lift = -float(lowest(points, tilt[None])[0])
        inside = [lift - share * min(shown.deep, found.depth) for share in (1.0, 0.75, 0.5, 0.25, 0.0)]
        over = lift + file.task.start.above_mouth + np.arange(0.0, top + 1e-3, 1e-3)  # in steps of 1 mm
        free = next((h for h in [*inside, *over.tolist()] if _is_free(found, tilt, h)), float(over[-1]))
        starts.append((free, tilt))
    return tuple(starts)


def _is_free(found: PartsFit, tilt: Float, height: float) -> bool:
    least = 1e-5  # m between the parts
    return bool(tilted(found, tilt, np.array([0.0, 0.0, height])).min_gap(found.socket, least) >= least)
