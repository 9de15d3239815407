"""What two parts must be besides fitting: rounder than their play, thicker than contacts are soft, and not too heavy.

A facet of length L between corners that turn by t lies L / 2 tan(t / 4) inside its circle. A wall is thin where a
cross-section, shrunk and grown by half the least thickness, does not come back.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.parts.fit import PartsFit, placed
from skillframe.parts.pieces import MOST_PIECES, ConvexPieces
from skillframe.parts.second_declared import MeshPlace
from skillframe.parts.solid import MeshPart

SHARE = 0.25
"""Largest contact error, as a share of the clearance."""
THIN = 2e-4
"""Least thickness of a wall [m]; ours: contacts sink by some 0.06 mm, and out the other side beyond half of a wall."""
HEAVY, HEAVIEST = 1.5, 100.0
"""Mass of a part that is asked about, and that no robot here holds [kg]."""
_ROUND = np.radians(30.0)
_BESIDE = 1e-3


def check_two(plug: MeshPart, socket: MeshPart) -> None:
    """Refuse one mesh in both places.

    Raises:
        InputError: says so.
    """
    if plug.sha256 == socket.sha256:
        what = f"{plug.name} and {socket.name} are one and the same mesh"
        raise InputError("the two parts", what, "give the held part, then the one that stands")


def around(fit: PartsFit, plug: MeshPart, socket: MeshPart) -> tuple[str, ...]:
    """What is said of a held part that is the outer one half way in: a cap on a post is, and so are swapped files."""
    held, standing = (solid.slice(-0.5 * fit.depth) for solid in (fit.plug, fit.socket))
    if held.is_empty() or standing.is_empty() or not (standing - held.hull()).is_empty():
        return ()
    return (f"{plug.name}, which is held, reaches around {socket.name}, which stands; were the two swapped?",)


def mend_error(part: MeshPart, place: MeshPlace, fit: PartsFit, reach: Float) -> float:
    """By how much a part's triangles and what was mended of them may be off where the parts can meet [m].

    Args:
        part: with its mended places.
        place: of its mesh.
        fit: of both parts.
        reach: (2, 3) corners of the box in which they can meet, in the fixture frame [m].

    Raises:
        InputError: it is more than the play allows.
    """
    worst = part.error
    check_error(worst, fit, part)
    for mend in part.places:
        points = placed(mend.points, place, fit)
        if (points.max(axis=0) < reach[0]).any() or (points.min(axis=0) > reach[1]).any():
            continue
        if mend.error > SHARE * fit.clearance:
            middle = ", ".join(f"{1000.0 * x:.1f}" for x in mend.points.mean(axis=0))
            what = (
                f"is open, or bounds nothing, near ({middle}) mm: mended, it may be off by {1000.0 * mend.error:.2g} mm"
            )
            what += f", more than {1000.0 * SHARE * fit.clearance:.2g} mm, a quarter of the clearance"
            raise InputError(part.name, what, "close it where it was drawn")
        worst = max(worst, part.error + mend.error)
    return worst


def check_clearance(fit: PartsFit) -> None:
    """Refuse parts without play.

    Raises:
        InputError: says how little it is.
    """
    if fit.clearance <= 2.0 * SHARE * 1e-6:
        what = f"the play along the way is {fit.clearance * 1000.0:.3g} mm"
        raise InputError("the two parts", what, "give the hole a play: press fits are refused")


def check_facets(fit: PartsFit, plug: MeshPart, socket: MeshPart) -> None:
    """Refuse curves that are drawn more coarsely than the play.

    Raises:
        InputError: says how coarsely.
    """
    for part, solid in ((plug, fit.plug), (socket, fit.socket)):
        sag, sides = _coarsest(solid.slice(-0.5 * fit.depth), fit)
        if sag > fit.clearance:
            what = f"a curve of it has {sides} sides a turn, {1000.0 * sag:.2g} mm inside its circle: more than the "
            raise InputError(part.name, f"{what}clearance of {1000.0 * fit.clearance:.2g} mm", "export it finer")


def _coarsest(section: Any, fit: PartsFit) -> tuple[float, int]:
    """How far the worst facet beside the mouth is inside its circle [m], and how many sides a whole turn would have."""
    inside = np.reshape(fit.plug.trim_by_plane([0.0, 0.0, -1.0], 0.0).bounding_box(), (2, 3))[:, :2]
    worst, sides = 0.0, 0
    for loop in section.to_polygons():
        corners = _bent(np.asarray(loop, dtype=float))
        if len(corners) < 3:
            continue
        along, turn = _edges(corners)
        even = np.minimum(turn, np.roll(turn, -1)) > 0.8 * np.maximum(turn, np.roll(turn, -1))
        near = ((corners > inside[0] - _BESIDE) & (corners < inside[1] + _BESIDE)).all(axis=1)
        curved = even & near & np.roll(near, -1) & (turn < _ROUND)
        sag = np.where(curved, 0.5 * along * np.tan(0.25 * turn), 0.0)
        if sag.max() > worst:
            worst, sides = float(sag.max()), round(2.0 * np.pi / float(turn[sag.argmax()]))
    return worst, sides


def _bent(loop: Float) -> Float:
    """A loop (V, 2) without the corners at which it goes straight on."""
    return loop[_edges(loop)[1] > 1e-3]


def _edges(loop: Float) -> tuple[Float, Float]:
    """Lengths (V,) of a loop's edges [m], and how far it turns where each begins, (V,) [rad]."""
    edge = np.roll(loop, -1, axis=0) - loop
    before = np.roll(edge, 1, axis=0)
    turn = np.arctan2(before[:, 0] * edge[:, 1] - before[:, 1] * edge[:, 0], np.sum(before * edge, axis=1))
    return np.linalg.norm(edge, axis=1), np.abs(turn)


def check_walls(fit: PartsFit, plug: MeshPart, socket: MeshPart) -> None:
    """Refuse walls that a part could be pushed through.

    Raises:
        InputError: says where.
    """
    import manifold3d

    miter = manifold3d.JoinType.Miter
    for part, solid, against in ((plug, fit.plug, fit.socket), (socket, fit.socket, fit.plug)):
        section, other = (each.slice(-0.5 * fit.depth) for each in (solid, against))
        thick = section.offset(-0.5 * THIN, miter).offset(0.5 * THIN, miter)
        walls = _reachable(section, thick, other) ^ (section - thick)
        thin = [each for each in walls.decompose() if each.area() > 4.0 * THIN**2]
        if thin:
            where = np.reshape(thin[0].bounds(), (2, 2)).mean(axis=0)
            place = f"({1000.0 * where[0]:.1f}, {1000.0 * where[1]:.1f}) mm from the middle of the mouth"
            what = f"a wall near {place} is thinner than {1000.0 * THIN:g} mm"
            raise InputError(part.name, what, "a part could be pushed through it; make it thicker")


def _reachable(section: Any, thick: Any, other: Any) -> Any:
    """Where another part's section can come that does not pass the thick walls of this one: a cross-section.

    Everywhere where the other part has no section there: nothing says on which side of the walls it is.
    """
    import manifold3d

    if section.is_empty() or other.is_empty():
        return section
    low, high = np.reshape([section.bounds(), other.bounds()], (2, 2, 2)).transpose(1, 0, 2)
    corner, far = low.min(axis=0) - THIN, high.max(axis=0) + THIN
    whole = manifold3d.CrossSection.square([float(x) for x in far - corner]).translate([float(x) for x in corner])
    rooms = [room for room in (whole - thick).decompose() if not (room ^ other).is_empty()]
    return manifold3d.CrossSection.batch_boolean([whole - whole, *rooms], manifold3d.OpType.Add)


def unfit_pieces(pieces: ConvexPieces, fit: PartsFit, part: MeshPart) -> InputError | None:
    """Why convex pieces do not hold a part well enough, how many it takes or which error, or None."""
    allowed = 1000.0 * SHARE * fit.clearance
    limit = f"{allowed:.2g} mm, a quarter of the clearance"
    fix = "leave out roundings that do not touch, or draw it as extrusions"
    if not pieces.hulls:
        return InputError(part.name, f"is too curved to be cut into convex pieces within {limit}", fix)
    if len(pieces.hulls) > MOST_PIECES:
        what = f"takes {len(pieces.hulls)} convex pieces to stay within {limit}, and {MOST_PIECES} are the most"
        return InputError(part.name, what, fix)
    if pieces.error > SHARE * fit.clearance:
        return InputError(part.name, *_inexact(pieces.error, fit, fix))
    return None


def check_error(error: float, fit: PartsFit, part: MeshPart) -> None:
    """Refuse a part whose contact is less exact than its play needs.

    Raises:
        InputError: says how exact.
    """
    if error > SHARE * fit.clearance:
        raise InputError(part.name, *_inexact(error, fit, "give the hole more play"))


def _inexact(error: float, fit: PartsFit, fix: str) -> tuple[str, str]:
    allowed, play = 1000.0 * SHARE * fit.clearance, 1000.0 * fit.clearance
    what = f"its contact error is {1000.0 * error:.2g} mm: more than {allowed:.2g} mm, a quarter of the clearance "
    return f"{what}of {play:.2g} mm", f"jam angles would not be right; {fix}"
