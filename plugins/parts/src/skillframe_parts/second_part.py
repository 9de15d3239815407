"""Second parts of a fixture file, beside the socket, as geoms and moving bodies.

They collide as the main parts, by convex pieces or as surfaces, with mass and inertia of the solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.world import FASTEST_SWING, MOVES, TIMESTEP, Geom, Mover, State, Vector
from skillframe_parts.checks import SHARE, check_error
from skillframe_parts.declared import DENSITY
from skillframe_parts.field import error_of, surface_of
from skillframe_parts.fit import TOUCH, moved, thickness
from skillframe_parts.load import LoadedParts
from skillframe_parts.pieces import MOST_PIECES, pieces_of
from skillframe_parts.scenes import is_scene, read_scene
from skillframe_parts.second_declared import MeshPlace, SecondPart
from skillframe_parts.solid import SIDES, MeshPart, arrays_of, of_shapes, read_part, united

COLOUR = (0.45, 0.6, 0.5, 1.0)


class _Made(NamedTuple):
    """A prepared second part: geoms in the fixture frame, solid, mass, centre, inertia."""

    geoms: tuple[Geom, ...]
    solid: Any
    mass: float
    center: Float
    inertia: Float


_MADE: dict[tuple[tuple[str, str], ...], list[_Made]] = {}
"""Cache of the last parts."""


def second_parts(path: Path, loaded: LoadedParts, above: float) -> tuple[tuple[Geom, ...], tuple[Mover, ...]]:
    """Geoms that a file's second parts add to the fixture, and its moving parts.

    `above` is the height of the tip over the hole entrance at the start [m].

    Raises:
        InputError: an unusable mesh or shape, or one that intersects the held part.
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
    """Whether every second part with a goal has reached it (N,)."""
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
    vertices, faces = arrays_of(solid)
    if loaded.plug.pieces is not None:
        pieces = pieces_of(solid, SHARE * loaded.fit.clearance)
        if not 0 < len(pieces.hulls) <= MOST_PIECES:
            what = f"takes more than {MOST_PIECES} convex pieces within a quarter of the clearance"
            raise InputError(name, what, "draw it more simply, of extrusions and plane faces")
        check_error(pieces.error + error, loaded.fit, whole)
        geoms = tuple(Geom(kind="mesh", vertices=h.vertices, faces=h.faces, rgba=COLOUR) for h in pieces.hulls)
    else:
        low, high = np.reshape(solid.bounding_box(), (2, 3))
        surface = surface_of(solid, low, high)
        check_error(error_of(surface, low, high) + error, loaded.fit, whole)
        geoms = (Geom(kind="mesh", vertices=vertices, faces=faces, rgba=COLOUR, surface=surface),)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    density = DENSITY if part.density is None else part.density
    mass = float(mesh.volume) * density if part.mass is None else part.mass
    inertia = np.asarray(mesh.moment_inertia) * (mass / float(mesh.volume))
    return _Made(geoms, solid, mass, np.asarray(mesh.center_mass), inertia)


def _solid(part: SecondPart, path: Path) -> tuple[Any, float]:
    """The solid as drawn, and the error of its triangles [m]."""
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


def _check_free(part: SecondPart, solid: Any, loaded: LoadedParts, above: float) -> None:
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
    where = f"second part {part.name!r}"
    if np.linalg.eigvalsh(made.inertia).min() < 1e-9 * made.mass:  # kg m2
        raise InputError(where, "is too small or thin to be simulated as a body of its own", "let it be fixed")
    load = float(about) if part.joint == "hinge" else made.mass
    # semi-implicit Euler is stable up to 2 rad a step
    if part.stiffness * TIMESTEP**2 > FASTEST_SWING**2 * load:
        most = FASTEST_SWING**2 * load / TIMESTEP**2
        what = f"swings faster on its spring than the simulation follows; at most {most:.3g} for its mass"
        raise InputError(f"{where}.stiffness", what, "lower it, or give a larger mass")
    return Mover(
        name=part.name, geoms=made.geoms, joint=part.joint, anchor=vector(anchor), axis=vector(axis), mass=made.mass,
        center_of_mass=vector(made.center), inertia=made.inertia, stiffness=part.stiffness, rest=part.rest,
        damping=part.damping, friction=part.friction, range=part.range,
    )  # fmt: skip


def vector(values: Float) -> Vector:
    """Three numbers as a tuple."""
    x, y, z = (float(v) for v in values)
    return (x, y, z)
