"""How two parts go together: the way out, the mouth, the depth, and the play along the way, all found from the meshes.

The parts are brought into the *fixture frame*: its origin is the middle of the mouth, z points out of it. Distances are
the smallest between the two surfaces (`manifold3d`'s `min_gap`, exact for triangles), the held part lifted by steps.
Overlap is told by its mean thickness, 2 V / A of what the parts have in common.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float, rotation_matrix
from skillframe.parts.declared import OVERLAP, FixtureFile
from skillframe.parts.scenes import turned
from skillframe.parts.second_declared import MeshPlace
from skillframe.parts.solid import MeshPart, arrays_of

TOUCH = OVERLAP
"""Parts nearer than this are looked at for an overlap, and parts of a fixture may overlap by it [m]."""
NEAR = 8e-4
"""Material this near to the held part, sideways, belongs to the mouth [m]."""
_STEP, _MOST_STEPS, _TURN_STEP = 5e-4, 160, np.radians(2.0)
_GAPS, _FAR = 24, (5e-4, 1e-3, 2e-3, 5e-3)  # looked for near by first, which is faster
_RATIO = 50.0
_BESIDE = 0.1  # of the part's size, how far its tip may lie outside it
Axis = tuple[float, float, float]
_AXES = ((0, 0, -1), (0, 0, 1), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0))


class WayOut(NamedTuple):
    """How a held part leaves: lifted, and turned about an upright line by (K,) `turns` [rad] at (K,) `lifts` [m].

    Between these it turns evenly, and no further above the last. The line goes through `middle` (x, y) [m].
    """

    lifts: tuple[float, ...] = (0.0,)
    turns: tuple[float, ...] = (0.0,)
    middle: tuple[float, float] = (0.0, 0.0)

    @property
    def before(self) -> Float:
        """Attitude (3, 3) of the part before it goes in, against that at its end."""
        return self._turned_by(self.turns[-1])

    def at(self, solid: Any, lift: float) -> Any:
        """The assembled part, lifted so far [m]."""
        if any(self.turns):
            turn = self._turned_by(float(np.interp(lift, self.lifts, self.turns)))
            there = solid.translate([-self.middle[0], -self.middle[1], 0.0])
            solid = _turned(there, turn).translate([self.middle[0], self.middle[1], 0.0])
        return solid.translate([0.0, 0.0, float(lift)])

    @staticmethod
    def _turned_by(angle: float) -> Float:
        return rotation_matrix(np.array([0.0, 0.0, angle]))


class PartsFit(NamedTuple):
    """Two parts that go together, in the fixture frame [m].

    Attributes:
        plug: the held part, assembled; socket: the standing one (`manifold3d.Manifold`).
        depth: from the mouth to the tip of the assembled part.
        clearance: the median of the smallest distances along the way, (K,) `gaps` at `lifts` above the assembled pose.
        radius: half the longer side of what goes into the mouth, seen along the axis.
        turn: (3, 3) from the frame of `pose` and `assembled` to the fixture frame.
        axis: of insertion in that frame.
        origin: (3,) of that frame, in the fixture frame.
        way: by which the held part leaves.
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
    """How a held part goes into a standing one.

    Raises:
        InputError: they overlap, lie apart, are of other scales, or the one cannot leave the other.
    """
    _check_scales(plug, socket)
    one, two = moved(plug.solid, file.tool.assembled), moved(socket.solid, file.fixture.pose)
    _check_places(plug, socket, one, two)
    _check_overlap(plug, socket, one, two, file.contact.overlap)
    turn, axis = _axis(plug, socket, one, two, file)
    one, two = (_turned(each, turn) for each in (one, two))
    mouth = _mouth(one, two)
    tip = _tip(one, mouth, turn, file)
    way = _way(file)
    origin = -np.array([tip[0], tip[1], mouth])
    one, two = (each.translate(list(origin)) for each in (one, two))
    depth = float(mouth - tip[2])
    if depth <= 0.0:
        what = f"{plug.name} does not go into {socket.name}: nothing of it lies below a mouth"
        raise InputError("the assembled pose", what, "move [tool] assembled, give task.axis, or check the units")
    lifts: Float = depth * np.arange(1.0, _GAPS + 1.0) / (_GAPS + 1.0)
    gaps: Float = np.array([_gap(way.at(one, lift), two) for lift in lifts])
    inside = np.reshape(one.trim_by_plane([0.0, 0.0, -1.0], 0.0).bounding_box(), (2, 3))
    radius = 0.5 * float(np.ptp(inside[:, :2], axis=0).max())
    return PartsFit(one, two, depth, float(np.median(gaps)), gaps, lifts, radius, turn, axis, origin, way)


def nothing_stops(fit: PartsFit, table: bool, fall: float) -> bool:
    """Whether an assembled part goes straight on for `fall` [m], past the socket and, if there is one, the `table`."""
    floor = float(fit.socket.bounding_box()[2])
    if table and float(fit.plug.bounding_box()[2]) - fall < floor:
        return False
    common = fit.plug.translate([0.0, 0.0, -fall]) ^ fit.socket
    return thickness(common) < TOUCH


def _gap(one: Any, two: Any) -> float:
    """The smallest distance of two solids [m], at most the last of `_FAR`."""
    gaps = (float(one.min_gap(two, far)) for far in _FAR)
    return next((gap for gap, far in zip(gaps, _FAR, strict=True) if gap < far), _FAR[-1])


def moved(solid: Any, place: MeshPlace) -> Any:
    """A solid placed as a fixture file says."""
    return _turned(solid, turned(place.rpy)).translate(list(place.xyz))


def placed(points: Float, place: MeshPlace, fit: PartsFit) -> Float:
    """Points (P, 3) of a mesh [m], placed as a fixture file says, in the fixture frame."""
    found: Float = (points @ turned(place.rpy).T + np.array(place.xyz)) @ fit.turn.T + fit.origin
    return found


def _turned(solid: Any, rotation: Float) -> Any:
    return solid.transform(np.column_stack([rotation, np.zeros(3)]))


def _way(file: FixtureFile) -> WayOut:
    """The way out that a file gives, about the line through the tip."""
    points = [(0.0, 0.0), *((each.lift, each.turn) for each in file.task.turns)]
    return WayOut(tuple(lift for lift, _ in points), tuple(turn for _, turn in points))


def _way_before(one: Any, two: Any, turn: Float, file: FixtureFile) -> WayOut:
    """The same while the parts are not yet in the fixture frame."""
    if not file.task.turns:
        return WayOut()
    tip = _tip(one, _mouth(one, two), turn, file)
    return _way(file)._replace(middle=(float(tip[0]), float(tip[1])))


def _check_scales(plug: MeshPart, socket: MeshPart) -> None:
    ratio = plug.size / socket.size
    if not 1.0 / _RATIO <= ratio <= _RATIO:
        large, small = (plug, socket) if ratio > 1.0 else (socket, plug)
        what = f"{large.name} is {max(ratio, 1.0 / ratio):.0f} times as large as {small.name}"
        raise InputError("the two parts", what, "correct the units of one of them")


def _check_places(plug: MeshPart, socket: MeshPart, one: Any, two: Any) -> None:
    (a, b), (c, d) = (np.reshape(each.bounding_box(), (2, 3)) for each in (one, two))
    apart = float(np.linalg.norm(np.maximum(0.0, np.maximum(a - d, c - b))))
    if apart > 0.0:
        what = f"{plug.name} lies {1000.0 * apart:.3g} mm from {socket.name} in the assembled pose"
        raise InputError("the assembled pose", what, "export both from one assembly, or set [tool] assembled")


def thickness(common: Any) -> float:
    """Mean thickness of a solid [m]."""
    return 0.0 if common.is_empty() else 2.0 * float(common.volume()) / float(common.surface_area())


def _check_overlap(plug: MeshPart, socket: MeshPart, one: Any, two: Any, most: float) -> None:
    bodies = (one ^ two).decompose()
    worst = max(bodies, key=thickness, default=None)
    if worst is not None and thickness(worst) > most:
        deep, where = 1000.0 * thickness(worst), np.reshape(worst.bounding_box(), (2, 3)).mean(axis=0)
        point = ", ".join(f"{1000.0 * x:.1f}" for x in where)
        what = f"{plug.name} and {socket.name} overlap by {deep:.2g} mm at ({point}) mm"
        more = (
            f"more than the {1000.0 * most:.2g} mm that are let pass; move [tool] assembled (press fits are refused), "
        )
        more += "or give contact.overlap up to 0.1 mm"
        if repaired := " and ".join(part.name for part in (plug, socket) if part.places):
            more += f", or close {repaired} where it was drawn: its holes were closed, or sheets left out"
        raise InputError("the assembled pose", what, more)


def _axis(
    plug: MeshPart, socket: MeshPart, one: Any, two: Any, file: FixtureFile
) -> tuple[Float, tuple[float, float, float]]:
    """The turn that lets the axis point down, of the axis that is given or of the first that is free."""
    given = file.task.axis
    blocked = []
    for axis in _AXES if given == "auto" else (given,):
        along = np.array(axis, dtype=float) / np.linalg.norm(axis)
        turn = _down(along)
        there = _turned(one, turn), _turned(two, turn)
        stands = _in_the_way(*there, _way_before(*there, turn, file), file.contact.overlap)
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


def _down(axis: Float) -> Float:
    """The smallest rotation (3, 3) that turns a unit vector to -z."""
    down = np.array([0.0, 0.0, -1.0])
    if float(axis @ down) < -1.0 + 1e-12:
        return rotation_matrix(np.array([np.pi, 0.0, 0.0]))
    turn = np.cross(axis, down)
    size = float(np.linalg.norm(turn))
    return rotation_matrix(turn * (np.arctan2(size, float(axis @ down)) / size)) if size > 0.0 else np.eye(3)


def _in_the_way(plug: Any, socket: Any, way: WayOut, most: float) -> tuple[float, float] | None:
    """How thick what stands in the way is, and at which lift [m], or None if the held part comes out."""
    whole = float(socket.bounding_box()[5] - plug.bounding_box()[2])
    count = int(np.clip(np.ceil(whole / _STEP), 8, _MOST_STEPS))
    lifts = whole * (np.arange(count) + 1.0) / count if whole > 0.0 else np.zeros(0)
    for lift in _with_turns(lifts, way):
        here = way.at(plug, lift)
        if here.min_gap(socket, TOUCH) < TOUCH and (deep := thickness(here ^ socket)) > most:
            return deep, float(lift)
    return None


def _with_turns(lifts: Float, way: WayOut) -> Float:
    """Lifts, and where the part turns so many more between that none of its turns is more than 2 degrees."""
    ends = zip(pairwise(way.lifts), pairwise(way.turns), strict=True)
    more = [np.linspace(*span, 2 + int(abs(b - a) / _TURN_STEP))[1:] for span, (a, b) in ends if a != b]
    found: Float = np.unique(np.concatenate([lifts, *more]))
    return found


def _mouth(plug: Any, socket: Any) -> float:
    """Height of the mouth: the highest point of the standing part near the held part's shadow, or in a hole of it.

    Near is `NEAR`, or twice, four or eight times that where nothing is so near above the held part's lowest end. A tube
    is over a post, however loose, once its end is below the post's.
    """
    low, high, tip = (float(solid.bounding_box()[k]) for solid, k in ((socket, 2), (socket, 5), (plug, 2)))
    outline = _filled(plug.project())
    for near in NEAR * np.array([1.0, 2.0, 4.0, 8.0]):
        shadow = outline.offset(float(near)).extrude(high - low + 2.0 * NEAR).translate([0.0, 0.0, low - NEAR])
        beside = shadow ^ socket
        if not beside.is_empty() and (top := float(beside.bounding_box()[5])) > tip + NEAR:
            return top
    return tip


def _filled(shadow: Any) -> Any:
    """A cross-section without its holes."""
    import manifold3d

    outer = [line for line in shadow.to_polygons() if _area(line) > 0.0]  # holes run the other way round
    return manifold3d.CrossSection(outer, manifold3d.FillRule.NonZero)


def _area(line: Float) -> float:
    """Signed area inside a closed line of points (P, 2) [m2]."""
    x, y = line.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _tip(plug: Any, mouth: float, turn: Float, file: FixtureFile) -> Float:
    """The tip (3,) of the assembled part, after the turn."""
    if file.tool.tip != "auto":
        return _given_tip(plug, turn @ np.array(file.tool.tip))
    low = float(plug.bounding_box()[2])
    inside = plug.trim_by_plane([0.0, 0.0, -1.0], -mouth) if low < mouth else plug
    middle = np.reshape(inside.bounding_box(), (2, 3)).mean(axis=0)
    return np.array([middle[0], middle[1], low])


def _given_tip(plug: Any, tip: Float) -> Float:
    low, high = np.reshape(plug.bounding_box(), (2, 3))
    away = float(np.linalg.norm(np.maximum(0.0, np.maximum(low - tip, tip - high))))
    if away > _BESIDE * float(np.linalg.norm(high - low)):
        what = f"lies {1000.0 * away:.3g} mm outside the assembled part"
        raise InputError("tool.tip", what, 'give it in metres in the frame of assembled, or "auto"')
    return np.asarray(tip, dtype=float)


def tilted(fit: PartsFit, tilt: Float, tip: Float) -> Any:
    """The held part before it goes in, with its tip at a point (3,) and turned about it by a rotation vector (3,)."""
    at_tip = fit.plug.translate([0.0, 0.0, fit.depth])
    return _turned(at_tip, rotation_matrix(tilt) @ fit.way.before).translate([float(x) for x in tip])


def lowest(points: Float, tilt: Float) -> Float:
    """Height of the lowest of points (P, 3) relative to the tip for rotation vectors (N, 3), (N,) [m]."""
    found: Float = (rotation_matrix(tilt)[:, 2] @ points.T).min(axis=1)
    return found


def corners(fit: PartsFit) -> Float:
    """The corners (P, 3) of the held part's hull relative to its tip before it goes in [m]."""
    found: Float = (arrays_of(fit.plug.hull())[0] + np.array([0.0, 0.0, fit.depth])) @ fit.way.before.T
    return found
