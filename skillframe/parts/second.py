"""Second parts of a fixture file: what stands beside the socket, turns, slides or lies there, as geoms and movers.

They collide as the two main parts do, by convex pieces or as surfaces. Mass and inertia are those of the solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.parts.checks import SHARE, check_error
from skillframe.parts.declared import DENSITY
from skillframe.parts.field import error_of, surface_of
from skillframe.parts.fit import TOUCH, moved, thickness
from skillframe.parts.load import LoadedParts
from skillframe.parts.pieces import MOST_PIECES, pieces_of
from skillframe.parts.scenes import is_scene, read_scene
from skillframe.parts.second_declared import MeshPlace, SecondPart
from skillframe.parts.solid import SIDES, MeshPart, arrays_of, of_shapes, read_part, united
from skillframe.world.convert import FASTEST_SWING, TIMESTEP
from skillframe.world.scene import MOVES, Geom, Mover, State, Vector

COLOUR = (0.45, 0.6, 0.5, 1.0)
_SMALL = 1e-9  # kg m^2; a part of less inertia cannot be simulated


class _Made(NamedTuple):
    """A second part that is ready: geoms in the fixture frame, its solid, mass, centre, inertia."""

    geoms: tuple[Geom, ...]
    solid: Any
    mass: float
    center: Float
    inertia: Float


_MADE: dict[tuple[tuple[str, str], ...], list[_Made]] = {}
"""Of the last parts that were loaded."""


def second_parts(path: Path, loaded: LoadedParts, above: float) -> tuple[tuple[Geom, ...], tuple[Mover, ...]]:
    """What a file's second parts add to the fixture, and those that move.

    Args:
        path: of the file.
        loaded: its main parts.
        above: height of the tip over the mouth at the start [m].

    Raises:
        InputError: a mesh or shape cannot be used, or stands where the held part is.
    """
    declared = loaded.file.second
    key = tuple(loaded.hashes.items())
    if key not in _MADE:
        made = [_made(part, path, loaded) for part in declared]
        _MADE.clear()
        _MADE[key] = made
    pairs = list(zip(declared, _MADE[key], strict=True))
    for part, ready in pairs:
        _check_free(part, ready.solid, loaded, above)
    fixed = tuple(geom for part, ready in pairs if part.joint == "fixed" for geom in ready.geoms)
    return fixed, tuple(_mover(part, ready, loaded) for part, ready in pairs if part.joint != "fixed")


def in_place(declared: Sequence[SecondPart], state: State) -> NDArray[np.bool_]:
    """(N,) whether every second part that has a goal is where that says."""
    there = np.ones(len(state.wrench), dtype=bool)
    for part in declared:
        if part.goal is not None:
            travel = state.second.get(f"{part.name}.{MOVES[part.joint][0]}", np.zeros(len(there)))
            there &= (travel >= part.goal[0]) & (travel <= part.goal[1])
    return there


def _made(part: SecondPart, path: Path, loaded: LoadedParts) -> _Made:
    import trimesh

    given, error = _solid(part, path)
    solid = moved(given, part.pose).transform(np.column_stack([loaded.fit.turn, loaded.fit.origin]))
    name = f"second part {part.name!r}" if is_scene(part.mesh) else part.mesh or f"second part {part.name!r}"
    whole = MeshPart(name, solid, (), "", error=error)
    geoms = _pieces(whole, loaded) if loaded.plug.pieces is not None else _surface(whole, loaded)
    mesh = trimesh.Trimesh(*arrays_of(solid), process=False)
    density = DENSITY if part.density is None else part.density
    mass = float(mesh.volume) * density if part.mass is None else part.mass
    inertia = np.asarray(mesh.moment_inertia) * (mass / float(mesh.volume))
    return _Made(geoms, solid, mass, np.asarray(mesh.center_mass), inertia)


def _solid(part: SecondPart, path: Path) -> tuple[Any, float]:
    """What it was drawn as, and by how much its triangles may be off that [m]."""
    import manifold3d

    if is_scene(part.mesh):
        scene = read_scene(path.parent / part.mesh)
        shapes = next(each.shapes for each in scene.moving if each.name == part.name)
        return of_shapes(shapes, path.parent / part.mesh), 0.0
    if part.mesh:
        read = read_part(path.parent / part.mesh, part.units)
        return read.solid, read.error
    drawn = [
        moved(manifold3d.Manifold.cube(list(box.size), True), MeshPlace(xyz=box.xyz, rpy=box.rpy)) for box in part.boxes
    ]
    for each in part.cylinders:
        rod = manifold3d.Manifold.cylinder(each.length, each.radius, circular_segments=SIDES, center=True)
        drawn.append(moved(rod, MeshPlace(xyz=each.xyz, rpy=each.rpy)))
    return united(drawn), 0.0


def _pieces(whole: MeshPart, loaded: LoadedParts) -> tuple[Geom, ...]:
    pieces = pieces_of(whole.solid, SHARE * loaded.fit.clearance)
    if not 0 < len(pieces.hulls) <= MOST_PIECES:
        what = f"takes more than {MOST_PIECES} convex pieces within a quarter of the clearance"
        raise InputError(whole.name, what, "draw it more simply, of extrusions and plane faces")
    check_error(pieces.error + whole.error, loaded.fit, whole)
    return tuple(Geom(kind="mesh", vertices=h.vertices, faces=h.faces, rgba=COLOUR) for h in pieces.hulls)


def _surface(whole: MeshPart, loaded: LoadedParts) -> tuple[Geom, ...]:
    low, high = np.reshape(whole.solid.bounding_box(), (2, 3))
    surface = surface_of(whole.solid, low, high)
    check_error(error_of(surface, low, high) + whole.error, loaded.fit, whole)
    vertices, faces = arrays_of(whole.solid)
    return (Geom(kind="mesh", vertices=vertices, faces=faces, rgba=COLOUR, surface=surface),)


def _check_free(part: SecondPart, solid: Any, loaded: LoadedParts, above: float) -> None:
    """Refuse a second part in which the held one stands at the start, or when it is assembled."""
    plug = loaded.fit.plug
    places = {"at the start": loaded.fit.way.at(plug, loaded.fit.depth + above)}
    if part.goal is None or part.goal[0] <= 0.0 <= part.goal[1]:
        places["in the assembled pose"] = plug
    for when, placed in places.items():
        deep = max((thickness(each) for each in (placed ^ solid).decompose()), default=0.0)
        if deep > TOUCH:
            what = f"stands {1000.0 * deep:.3g} mm in {loaded.file.tool.mesh} {when}"
            raise InputError(f"second part {part.name!r}", what, "move one of the two")
    if part.joint == "free":
        deep = max((thickness(each) for each in (solid ^ loaded.fit.socket).decompose()), default=0.0)
        if deep > TOUCH:
            what = f"stands {1000.0 * deep:.3g} mm in {loaded.file.fixture.mesh}"
            raise InputError(f"second part {part.name!r}", what, "move it out, or let it turn or slide on a joint")


def _mover(part: SecondPart, made: _Made, loaded: LoadedParts) -> Mover:
    turn, origin = loaded.fit.turn, loaded.fit.origin
    axis = turn @ (np.array(part.axis) / np.linalg.norm(part.axis))
    anchor = turn @ np.array(part.anchor) + origin
    lever = made.center - anchor
    about = axis @ made.inertia @ axis + made.mass * (lever @ lever - (lever @ axis) ** 2)
    _check_swing(part, made, float(about))
    return Mover(
        name=part.name, geoms=made.geoms, joint=part.joint, anchor=_vector(anchor), axis=_vector(axis), mass=made.mass,
        center_of_mass=_vector(made.center), inertia=made.inertia, stiffness=part.stiffness, rest=part.rest,
        damping=part.damping, friction=part.friction, range=part.range,
    )  # fmt: skip


def _check_swing(part: SecondPart, made: _Made, about: float) -> None:
    """Refuse what the simulation cannot follow: semi-implicit Euler is stable up to 2 rad a step."""
    where = f"second part {part.name!r}"
    if np.linalg.eigvalsh(made.inertia).min() < _SMALL * made.mass:
        raise InputError(where, "is too small or thin to be simulated as a body of its own", "let it be fixed")
    load = about if part.joint == "hinge" else made.mass
    if part.stiffness * TIMESTEP**2 > FASTEST_SWING**2 * load:
        most = FASTEST_SWING**2 * load / TIMESTEP**2
        what = f"swings faster on its spring than the simulation follows; at most {most:.3g} for its mass"
        raise InputError(f"{where}.stiffness", what, "lower it, or give a larger mass")


def _vector(values: Float) -> Vector:
    x, y, z = (float(v) for v in values)
    return (x, y, z)
