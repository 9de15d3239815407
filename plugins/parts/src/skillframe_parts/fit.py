"""How two parts fit, from their meshes: way out, hole entrance, depth, and clearance along the way.

The *fixture frame* has its origin in the middle of the hole entrance, z pointing out. Distances are the smallest
between the surfaces (`manifold3d`'s `min_gap`, exact for triangles), with the held part lifted in steps. Overlap is
measured by the mean thickness 2 V / A of the intersection.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float, rotation_matrix
from skillframe_parts.declared import OVERLAP, FixtureFile
from skillframe_parts.second_declared import MeshPlace
from skillframe_parts.shapes import turned
from skillframe_parts.solid import MeshPart, arrays_of

TOUCH = OVERLAP
"""Distance below which parts are checked for overlap, and tolerance between parts of a fixture [m]."""
NEAR = 8e-4
"""Sideways distance [m] from the held part within which material belongs to the hole entrance."""
Axis = tuple[float, float, float]


class WayOut(NamedTuple):
    """Way out of a held part: lifts (K,) [m], and rotations (K,) [rad] about a vertical line through `middle` [m].

    Rotation is linear between lifts, and constant above the last.
    """

    lifts: tuple[float, ...] = (0.0,)
    turns: tuple[float, ...] = (0.0,)
    middle: tuple[float, float] = (0.0, 0.0)

    @property
    def before(self) -> Float:
        """Orientation (3, 3) of the part before insertion, relative to its end."""
        return self._turned_by(self.turns[-1])

    def at(self, solid: Any, lift: float) -> Any:
        """The assembled part, lifted [m]."""
        if any(self.turns):
            turn = self._turned_by(float(np.interp(lift, self.lifts, self.turns)))
            there = solid.translate([-self.middle[0], -self.middle[1], 0.0])
            solid = _turned(there, turn).translate([self.middle[0], self.middle[1], 0.0])
        return solid.translate([0.0, 0.0, float(lift)])

    @staticmethod
    def _turned_by(angle: float) -> Float:
        return rotation_matrix(np.array([0.0, 0.0, angle]))


class PartsFit(NamedTuple):
    """Two fitting parts, in the fixture frame [m].

    Attributes:
        plug: the held part, assembled; socket: the standing one (`manifold3d.Manifold`).
        depth: from the hole entrance to the tip of the assembled part.
        clearance: median of the smallest distances along the way, (K,) `gaps` at `lifts` above the assembled pose.
        radius: half the longer side of the inserted part, seen along the axis.
        turn: (3, 3) from the frame of `pose` and `assembled` to the fixture frame.
        axis: of insertion in that frame.
        origin: (3,) of that frame, in the fixture frame.
        way: out of the held part.
    """

    plug: Any
    socket: Any
    depth: float
    clearance: float
    gaps: Float
    lifts: Float
    radius: float
    turn: Float
    axis: Axis
    origin: Float
    way: WayOut


def fit(plug: MeshPart, socket: MeshPart, file: FixtureFile) -> PartsFit:
    """The fit of a held and a standing part.

    Raises:
        InputError: they overlap, are apart, differ in scale, or cannot be separated.
    """
    one, two = moved(plug.solid, file.tool.assembled), moved(socket.solid, file.fixture.pose)
    _check_assembled(plug, socket, one, two, file.contact.overlap)
    turn, axis = _axis(plug, socket, one, two, file)
    one, two = (_turned(each, turn) for each in (one, two))
    mouth = _mouth(one, two)
    tip = _tip(one, mouth, turn, file)
    way = _way(file)
    origin = -np.array([tip[0], tip[1], mouth])
    one, two = (each.translate(list(origin)) for each in (one, two))
    depth = float(mouth - tip[2])
    if depth <= 0.0:
        what = f"{plug.name} does not go into {socket.name}: nothing of it lies below a hole entrance"
        raise InputError("the assembled pose", what, "move [tool] assembled, give task.axis, or check the units")
    lifts: Float = depth * np.arange(1.0, 25.0) / 25.0
    gaps: Float = np.full(len(lifts), 5e-3)  # m; the largest that is looked for
    for k, lift in enumerate(lifts):
        held = way.at(one, lift)
        for far in (5e-4, 1e-3, 2e-3, 5e-3):  # nearest first, for speed
            if (gap := float(held.min_gap(two, far))) < far:
                gaps[k] = gap
                break
    inside = np.reshape(one.trim_by_plane([0.0, 0.0, -1.0], 0.0).bounding_box(), (2, 3))
    radius = 0.5 * float(np.ptp(inside[:, :2], axis=0).max())
    return PartsFit(one, two, depth, float(np.median(gaps)), gaps, lifts, radius, turn, axis, origin, way)


def nothing_stops(fit: PartsFit, table: bool, fall: float) -> bool:
    """Whether an assembled part can move on by `fall` [m], past the socket and a `table`."""
    floor = float(fit.socket.bounding_box()[2])
    if table and float(fit.plug.bounding_box()[2]) - fall < floor:
        return False
    common = fit.plug.translate([0.0, 0.0, -fall]) ^ fit.socket
    return thickness(common) < TOUCH


def moved(solid: Any, place: MeshPlace) -> Any:
    """A solid at its pose in a fixture file."""
    return _turned(solid, turned(place.rpy)).translate(list(place.xyz))


def placed(points: Float, place: MeshPlace, fit: PartsFit) -> Float:
    """Points (P, 3) of a mesh [m], at its pose in a fixture file, in the fixture frame."""
    found: Float = (points @ turned(place.rpy).T + np.array(place.xyz)) @ fit.turn.T + fit.origin
    return found


def _turned(solid: Any, rotation: Float) -> Any:
    return solid.transform(np.column_stack([rotation, np.zeros(3)]))


def _way(file: FixtureFile) -> WayOut:
    points = [(0.0, 0.0), *((each.lift, each.turn) for each in file.task.turns)]
    return WayOut(tuple(lift for lift, _ in points), tuple(turn for _, turn in points))


def _check_assembled(plug: MeshPart, socket: MeshPart, one: Any, two: Any, most: float) -> None:
    """Refuse parts whose scales differ, that lie apart, or that overlap by more than a thickness [m]."""
    ratio = plug.size / socket.size
    if not 1.0 / 50.0 <= ratio <= 50.0:
        large, small = (plug, socket) if ratio > 1.0 else (socket, plug)
        what = f"{large.name} is {max(ratio, 1.0 / ratio):.0f} times as large as {small.name}"
        raise InputError("the two parts", what, "correct the units of one of them")
    (a, b), (c, d) = (np.reshape(each.bounding_box(), (2, 3)) for each in (one, two))
    apart = float(np.linalg.norm(np.maximum(0.0, np.maximum(a - d, c - b))))
    if apart > 0.0:
        what = f"{plug.name} lies {1000.0 * apart:.3g} mm from {socket.name} in the assembled pose"
        raise InputError("the assembled pose", what, "export both from one assembly, or set [tool] assembled")
    worst = max((one ^ two).decompose(), key=thickness, default=None)
    if worst is not None and thickness(worst) > most:
        deep, where = 1000.0 * thickness(worst), np.reshape(worst.bounding_box(), (2, 3)).mean(axis=0)
        point = ", ".join(f"{1000.0 * x:.1f}" for x in where)
        what = f"{plug.name} and {socket.name} overlap by {deep:.2g} mm at ({point}) mm"
        more = f"more than the {1000.0 * most:.2g} mm that are let pass; move [tool] assembled (press fits are refused)"
        more += ", or give contact.overlap up to 0.1 mm"
        if repaired := " and ".join(part.name for part in (plug, socket) if part.places):
            more += f", or close {repaired} where it was drawn: its holes were closed, or sheets left out"
        raise InputError("the assembled pose", what, more)


def thickness(common: Any) -> float:
    """Mean thickness of a solid [m]."""
    return 0.0 if common.is_empty() else 2.0 * float(common.volume()) / float(common.surface_area())


def _axis(
    plug: MeshPart, socket: MeshPart, one: Any, two: Any, file: FixtureFile
) -> tuple[Float, tuple[float, float, float]]:
    """Rotation of the given or first free axis to down, and the axis. Tried: six axes, then normals of the plug."""
    given = file.task.axis
    blocked = []
    six = ((0, 0, -1), (0, 0, 1), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0))
    for axis in (*six, *face_normals(one)) if given == "auto" else (given,):
        along = np.array(axis, dtype=float) / np.linalg.norm(axis)
        turn = _down(along)
        there, way = (_turned(one, turn), _turned(two, turn)), WayOut()
        if file.task.turns:
            tip = _tip(there[0], _mouth(*there), turn, file)
            way = _way(file)._replace(middle=(float(tip[0]), float(tip[1])))
        stands = _in_the_way(*there, way, file.contact.overlap)
        if stands is None:
            return turn, (float(along[0]), float(along[1]), float(along[2]))
        blocked.append((along, *stands))
    along, deep, lift = max(blocked, key=lambda each: each[2])
    out = ", ".join(f"{-x + 0.0:g}" for x in along)
    by = " by task.turns" if file.task.turns else ""
    what = f"{plug.name} cannot leave {socket.name} along ({out}){by}: {1000.0 * deep:.2g} mm of it stand in the way "
    what += f"at {1000.0 * lift:.3g} mm of lift"
    fix = "give another axis" if given != "auto" else "such parts need more than one straight motion"
    fix += ", or task.turns of a part that is screwed in" if not file.task.turns else ", or other turns"
    raise InputError("task.axis", what, fix)


def face_normals(solid: Any) -> list[Axis]:
    """Unit normals of a solid's largest flat sides, the largest first: directions in which a tilted part may go."""
    vertices, faces = arrays_of(solid)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    raw = np.cross(b - a, c - a)
    size = np.maximum(np.linalg.norm(raw, axis=1, keepdims=True), 1e-300)
    same = np.round(raw / size, 3)  # normals within some 0.05 degrees
    _, first, side = np.unique(same, axis=0, return_index=True, return_inverse=True)
    area = np.bincount(side.ravel(), weights=size.ravel())
    some = first[np.argsort(-area)[:12]]  # the largest, twice those of a box
    return [(float(x), float(y), float(z)) for x, y, z in raw[some] / size[some]]


def _down(axis: Float) -> Float:
    """The smallest rotation (3, 3) of a unit vector to -z."""
    down = np.array([0.0, 0.0, -1.0])
    if float(axis @ down) < -1.0 + 1e-12:
        return rotation_matrix(np.array([np.pi, 0.0, 0.0]))
    turn = np.cross(axis, down)
    size = float(np.linalg.norm(turn))
    return rotation_matrix(turn * (np.arctan2(size, float(axis @ down)) / size)) if size > 0.0 else np.eye(3)


def _in_the_way(plug: Any, socket: Any, way: WayOut, most: float) -> tuple[float, float] | None:
    """Thickness and lift of the first obstacle [m], or None for a free way."""
    whole = float(socket.bounding_box()[5] - plug.bounding_box()[2])
    count = int(np.clip(np.ceil(whole / 5e-4), 8, 160))  # in steps of 0.5 mm
    lifts = whole * (np.arange(count) + 1.0) / count if whole > 0.0 else np.zeros(0)
    ends, degrees = zip(pairwise(way.lifts), pairwise(way.turns), strict=True), np.radians(2.0)  # most between two
    more = [np.linspace(*span, 2 + int(abs(b - a) / degrees))[1:] for span, (a, b) in ends if a != b]
    for lift in np.unique(np.concatenate([lifts, *more])):
        here = way.at(plug, lift)
        if here.min_gap(socket, TOUCH) < TOUCH and (deep := thickness(here ^ socket)) > most:
            return deep, float(lift)
    return None


def _mouth(plug: Any, socket: Any) -> float:
    """Height of the hole entrance: the highest point of the standing part near the held part's shadow.

    Near is `NEAR`, or up to eight times that if nothing is nearer.
    """
    import manifold3d

    low, high, tip = (float(solid.bounding_box()[k]) for solid, k in ((socket, 2), (socket, 5), (plug, 2)))
    outer = []
    for line in plug.project().to_polygons():
        x, y = line.T
        if 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 0.0:  # holes run the other way
            outer.append(line)
    outline = manifold3d.CrossSection(outer, manifold3d.FillRule.NonZero)
    for near in NEAR * np.array([1.0, 2.0, 4.0, 8.0]):
        shadow = outline.offset(float(near)).extrude(high - low + 2.0 * NEAR).translate([0.0, 0.0, low - NEAR])
        beside = shadow ^ socket
        if not beside.is_empty() and (top := float(beside.bounding_box()[5])) > tip + NEAR:
            return top
    return tip


def _tip(plug: Any, mouth: float, turn: Float, file: FixtureFile) -> Float:
    """Tip (3,) of the assembled part, after the rotation."""
    if file.tool.tip != "auto":
        tip, (least, most) = turn @ np.array(file.tool.tip), np.reshape(plug.bounding_box(), (2, 3))
        away = float(np.linalg.norm(np.maximum(0.0, np.maximum(least - tip, tip - most))))
        if away > 0.1 * float(np.linalg.norm(most - least)):
            what = f"lies {1000.0 * away:.3g} mm outside the assembled part"
            raise InputError("tool.tip", what, 'give it in metres in the frame of assembled, or "auto"')
        return np.asarray(tip, dtype=float)
    low = float(plug.bounding_box()[2])
    inside = plug.trim_by_plane([0.0, 0.0, -1.0], -mouth) if low < mouth else plug
    middle = np.reshape(inside.bounding_box(), (2, 3)).mean(axis=0)
    return np.array([middle[0], middle[1], low])


def tilted(fit: PartsFit, tilt: Float, tip: Float) -> Any:
    """The held part before insertion, its tip at a point (3,), rotated about it by a rotation vector (3,)."""
    at_tip = fit.plug.translate([0.0, 0.0, fit.depth])
    return _turned(at_tip, rotation_matrix(tilt) @ fit.way.before).translate([float(x) for x in tip])


def lowest(points: Float, tilt: Float) -> Float:
    """Height of the lowest of points (P, 3) above the tip for rotation vectors (N, 3), (N,) [m]."""
    found: Float = (rotation_matrix(tilt)[:, 2] @ points.T).min(axis=1)
    return found


def corners(fit: PartsFit) -> Float:
    """Corners (P, 3) of the held part's hull relative to its tip before insertion [m]."""
    found: Float = (arrays_of(fit.plug.hull())[0] + np.array([0.0, 0.0, fit.depth])) @ fit.way.before.T
    return found
