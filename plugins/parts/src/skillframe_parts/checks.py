"""Checks of two parts that fit: facets finer than their play, walls thicker than contact penetration, mass.

A facet of length L between corners that turn by t lies L / 2 tan(t / 4) inside its circle. A wall is thin where a
cross-section changes when shrunk and grown by half the least thickness.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe_parts.fit import PartsFit, placed
from skillframe_parts.pieces import MOST_PIECES, ConvexPieces
from skillframe_parts.second_declared import MeshPlace
from skillframe_parts.solid import MeshPart

SHARE = 0.25
"""Largest contact error, as a share of the clearance."""
THIN = 2e-4
"""Least thickness of a wall [m]: contacts sink by 0.06 mm, and beyond half of a wall leave on its other side."""


def check_two(plug: MeshPart, socket: MeshPart) -> None:
    """Refuse one mesh in both places.

    Raises:
        InputError: the meshes are the same.
    """
    if plug.sha256 == socket.sha256:
        what = f"{plug.name} and {socket.name} are one and the same mesh"
        raise InputError("the two parts", what, "give the held part, then the one that stands")


def around(fit: PartsFit, plug: MeshPart, socket: MeshPart) -> tuple[str, ...]:
    """Note on a held part that surrounds the standing one half way in: a cap on a post, or swapped files."""
    held, standing = (solid.slice(-0.5 * fit.depth) for solid in (fit.plug, fit.socket))
    if held.is_empty() or standing.is_empty() or not (standing - held.hull()).is_empty():
        return ()
    return (f"{plug.name}, which is held, reaches around {socket.name}, which stands; were the two swapped?",)


def mend_error(part: MeshPart, place: MeshPlace, fit: PartsFit, reach: Float) -> float:
    """Error of a part's triangles and mended places where the parts can meet [m].

    `reach` are the corners (2, 3) of that box in the fixture frame [m].

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
        InputError: with the play.
    """
    if fit.clearance <= 2.0 * SHARE * 1e-6:
        what = f"the play along the way is {fit.clearance * 1000.0:.3g} mm"
        raise InputError("the two parts", what, "give the hole a play: press fits are refused")


def check_facets(fit: PartsFit, plug: MeshPart, socket: MeshPart) -> None:
    """Refuse curves meshed more coarsely than the play.

    Raises:
        InputError: with the deviation.
    """
    low, high = np.reshape(fit.plug.trim_by_plane([0.0, 0.0, -1.0], 0.0).bounding_box(), (2, 3))[:, :2]
    for part, solid in ((plug, fit.plug), (socket, fit.socket)):
        worst, sides = 0.0, 0  # largest deviation of a facet at the hole entrance from its circle [m]
        for loop in solid.slice(-0.5 * fit.depth).to_polygons():
            corners = np.asarray(loop, dtype=float)
            corners = corners[_edges(corners)[1] > 1e-3]
            if len(corners) < 3:
                continue
            along, turn = _edges(corners)
            even = np.minimum(turn, np.roll(turn, -1)) > 0.8 * np.maximum(turn, np.roll(turn, -1))
            near = ((corners > low - 1e-3) & (corners < high + 1e-3)).all(axis=1)  # m
            curved = even & near & np.roll(near, -1) & (turn < np.radians(30.0))
            sag = np.where(curved, 0.5 * along * np.tan(0.25 * turn), 0.0)
            if sag.max() > worst:
                worst, sides = float(sag.max()), round(2.0 * np.pi / float(turn[sag.argmax()]))
        if worst > fit.clearance:
            what = f"a curve of it has {sides} sides a turn, {1000.0 * worst:.2g} mm inside its circle: more than the "
            raise InputError(part.name, f"{what}clearance of {1000.0 * fit.clearance:.2g} mm", "export it finer")


def _edges(loop: Float) -> tuple[Float, Float]:
    """Lengths of a loop's edges (V,) [m], and its turn where each begins (V,) [rad]."""
    edge = np.roll(loop, -1, axis=0) - loop
    before = np.roll(edge, 1, axis=0)
    turn = np.arctan2(before[:, 0] * edge[:, 1] - before[:, 1] * edge[:, 0], np.sum(before * edge, axis=1))
    return np.linalg.norm(edge, axis=1), np.abs(turn)


def check_walls(fit: PartsFit, plug: MeshPart, socket: MeshPart) -> None:
    """Refuse walls that a part could be pushed through.

    Raises:
        InputError: with the place.
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
            place = f"({1000.0 * where[0]:.1f}, {1000.0 * where[1]:.1f}) mm from the middle of the hole entrance"
            what = f"a wall near {place} is thinner than {1000.0 * THIN:g} mm"
            raise InputError(part.name, what, "a part could be pushed through it; make it thicker")


def _reachable(section: Any, thick: Any, other: Any) -> Any:
    """Cross-section that another part's section can reach without passing the thick walls of this one.

    It is unbounded where the other part has no section there.
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
    """Why convex pieces are not exact enough for a part, or None."""
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
        InputError: with the error.
    """
    if error > SHARE * fit.clearance:
        raise InputError(part.name, *_inexact(error, fit, "give the hole more play"))


def _inexact(error: float, fit: PartsFit, fix: str) -> tuple[str, str]:
    allowed, play = 1000.0 * SHARE * fit.clearance, 1000.0 * fit.clearance
    what = f"its contact error is {1000.0 * error:.2g} mm: more than {allowed:.2g} mm, a quarter of the clearance "
    return f"{what}of {play:.2g} mm", f"jam angles would not be right; {fix}"
