"""Meshes whose faults have one cure: doubled and turned triangles, sheets that bound nothing, and small holes.

Every cure states an error, which counts where the other part can come (`load`). A hole gets a cap in its best plane: a
surface that goes on as an arc from the triangles around, which meet the cap at an angle t over a width w, is off by
w / 2 tan(t / 2), the arc's height over its chord; none where one of them lies in the plane of the cap. A sheet that is
left out is off by its largest distance from what is left. Sizes up to which this is done are ours.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, norm

WIDEST = 0.2
"""Width up to which a hole is closed, as a share of the part's size."""
SMALL = 0.05
"""Largest sheet that is left out, as a share of the part's area."""
_FLAT, _STEEPEST, _MOST_POINTS = 1e-6, np.radians(150.0), 200
Faces = NDArray[np.int64]


class Mend(NamedTuple):
    """A place that was mended: points (P, 3) around it and by how much the surface may be off there [m]."""

    points: Float
    error: float


class Mended(NamedTuple):
    """A mesh [m] with what was done to it, a sentence each without the file's name, and where."""

    vertices: Float
    faces: Faces
    notes: tuple[str, ...]
    places: tuple[Mend, ...]


class Edges(NamedTuple):
    """Edges of triangles: ends (E, 2), the number (F, 3) of each side's, how many triangles share each (E,)."""

    ends: Faces
    of: Faces
    shared: Faces

    @property
    def odd(self) -> int:
        """How many bound an odd number of triangles: a closed surface has none."""
        return int(np.sum(self.shared % 2))


def edges_of(faces: Faces) -> Edges:
    """The edges of triangles (F, 3)."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    ends, of, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    return Edges(ends, of.reshape(-1, 3), count)


def mended(vertices: Float, faces: Faces) -> Mended:
    """A mesh with all that can be mended. One that is closed and of one turn stays as it is."""
    notes: list[str] = []
    if _is_sound(faces):
        return Mended(vertices, faces, (), ())
    faces, doubled = _single(faces)
    if doubled:
        notes.append(f"doubled triangles left out: {doubled}")
    faces, sheets = _without_sheets(vertices, faces)
    if sheets:
        notes.append(f"{_many(sheets, 'sheet')} that bound nothing left out, {_said(sheets)}")
    faces, turned = _one_turn(vertices, faces)
    if turned:
        notes.append(f"triangles turned as their neighbours: {turned}")
    faces, holes = _closed(vertices, faces)
    if holes:
        notes.append(f"closed {_many(holes, 'hole')}, {_said(holes)}")
    return Mended(vertices, faces, tuple(notes), (*sheets, *holes))


def _many(places: list[Mend], word: str) -> str:
    return f"{len(places)} {word}" + ("" if len(places) == 1 else "s")


def _said(places: list[Mend]) -> str:
    """Their largest size and error."""
    widest = max(float(_extents(place.points)[0]) for place in places)
    error = round(1000.0 * max(place.error for place in places), 4)
    return f"largest {1000.0 * widest:.2g} mm; the surface may be off by {error:.2g} mm there"


def _is_sound(faces: Faces) -> bool:
    """Does every edge have two triangles, which run through it once each way?"""
    edges = edges_of(faces)
    forward = np.where(faces < np.roll(faces, -1, axis=1), 1, -1)
    turns = np.bincount(edges.of.reshape(-1), weights=forward.reshape(-1), minlength=len(edges.shared))
    return bool((edges.shared == 2).all() and not turns.any())


def _single(faces: Faces) -> tuple[Faces, int]:
    """Each triangle once, whichever way round, and how many that left out, where it does not open the mesh."""
    kept = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
    if len(kept) == len(faces) or edges_of(faces[kept]).odd > edges_of(faces).odd:
        return faces, 0
    return faces[np.sort(kept)], len(faces) - len(kept)


def _patches(faces: Faces, edges: Edges) -> Faces:
    """The number (F,) of each triangle's patch: triangles that meet at edges of two."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    one, two, _ = _neighbours(edges)
    links = coo_matrix((np.ones(len(one)), (one, two)), shape=[len(faces)] * 2)
    label: Faces = connected_components(links, directed=False)[1]
    return label


def _neighbours(edges: Edges) -> tuple[Faces, Faces, Faces]:
    """Pairs of triangles (N,), (N,) that share an edge with no third, and the place (N, 2) of it in `edges.of`."""
    order = np.argsort(edges.of.reshape(-1), kind="stable")
    sides = order[np.repeat(edges.shared == 2, edges.shared)].reshape(-1, 2)
    return sides[:, 0] // 3, sides[:, 1] // 3, sides


def _without_sheets(vertices: Float, faces: Faces) -> tuple[Faces, list[Mend]]:
    """Small patches left out that hang on edges of three, or on nothing, and where they were."""
    left, gone = faces, []
    largest = SMALL * float(_areas(vertices, faces).sum())
    while len(sheets := _hanging(vertices, left, largest)):
        gone += [left[sheet] for sheet in sheets]
        left = left[~np.any(sheets, axis=0)]  # which makes new patches of what they parted
    return left, [Mend(vertices[np.unique(sheet)], _farthest(vertices, sheet, left)) for sheet in gone]


def _hanging(vertices: Float, faces: Faces, largest: float) -> list[NDArray[np.bool_]]:
    """Masks (F,) of patches up to an area [m2] without which fewer edges are odd, the smallest first."""
    edges = edges_of(faces)
    if not edges.odd:
        return []
    label, count, found = _patches(faces, edges), edges.shared.copy(), []
    sizes = np.bincount(label, weights=_areas(vertices, faces))
    for patch in np.argsort(sizes)[: int(np.sum(sizes <= largest))]:
        own, number = np.unique(edges.of[label == patch], return_counts=True)
        if np.sum(count[own] % 2) > np.sum((count[own] - number) % 2):
            count[own] -= number
            found.append(label == patch)
    return found


def _farthest(vertices: Float, sheet: Faces, rest: Faces) -> float:
    """The largest distance [m] of a sheet's corners and middles from the triangles that are left."""
    from trimesh.triangles import closest_point

    points = np.concatenate([vertices[sheet].mean(axis=1), vertices[np.unique(sheet)]])
    points = points[:: -(-len(points) // _MOST_POINTS)]
    triangles, worst = vertices[rest], 0.0
    for point in points:
        near = closest_point(triangles, np.broadcast_to(point, (len(triangles), 3)))
        worst = max(worst, float(norm(near - point).min()))
    return worst


def _areas(vertices: Float, faces: Faces) -> Float:
    found: Float = 0.5 * norm(_normals(vertices, faces))
    return found


def _normals(vertices: Float, faces: Faces) -> Float:
    """Normals (F, 3) of triangles, of twice their areas."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    found: Float = cross(b - a, c - a)
    return found


def _one_turn(vertices: Float, faces: Faces) -> tuple[Faces, int]:
    """Triangles turned as most of their neighbours are, by area, and how many were turned.

    Each triangle is a node twice, once each way round. Neighbours are linked where they agree: the two components of a
    patch are its two turns. They are one where a patch has only one side, as a Moebius strip, which is left alone.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    one, two, sides = _neighbours(edges_of(faces))
    ways = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    against = (ways[sides[:, 0]] == ways[sides[:, 1]]).all(axis=1).astype(np.int64)
    if not against.any():
        return faces, 0
    number, area = len(faces), _areas(vertices, faces)
    starts, ends = (
        np.concatenate([one, one + number]),
        np.concatenate([two + number * against, two + number * (1 - against)]),
    )
    links = coo_matrix((np.ones(len(starts)), (starts, ends)), shape=[2 * number] * 2)
    count, label = connected_components(links, directed=False)
    as_is = np.bincount(label[:number], weights=area, minlength=count)
    turned = as_is[label[:number]] < as_is[label[number:]]
    tie = as_is[label[:number]] == as_is[label[number:]]
    turned |= tie & (label[:number] > label[number:])
    found = np.where(turned[:, None], faces[:, ::-1], faces)
    return found, int(turned.sum())


def _closed(vertices: Float, faces: Faces) -> tuple[Faces, list[Mend]]:
    """Triangles with caps over the holes that are small, and where these were."""
    edges = edges_of(faces)
    alone = np.nonzero(edges.shared[edges.of.reshape(-1)] == 1)[0]
    if not len(alone):
        return faces, []
    ways = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size, normals = float(np.ptp(vertices, axis=0).max()), _normals(vertices, faces)
    beside = {(int(ways[k, 1]), int(ways[k, 0])): int(k // 3) for k in alone}
    caps, places = [faces], []
    for loop in _loops(list(beside)):
        points = vertices[loop]
        if _extents(points)[1] > WIDEST * size:
            continue
        around = [beside[edge] for edge in zip(loop, [*loop[1:], loop[0]], strict=True)]
        caps.append(np.array(loop)[_cap(points)])
        places.append(Mend(points, _sag(points, normals[around], size)))
    return np.concatenate(caps), places


def _loops(ways: list[tuple[int, int]]) -> list[list[int]]:
    """Closed rings of vertices that directed edges form. A ring that meets itself is cut there."""
    after: dict[int, list[int]] = {}
    for start, end in ways:
        after.setdefault(start, []).append(end)
    found = []
    for start in list(after):
        path = [start]
        while after.get(path[-1]):
            following = after[path[-1]].pop()
            if following in path:
                at = path.index(following)
                found.append(path[at:])
                del path[at + 1 :]
            else:
                path.append(following)
    return [loop for loop in found if len(loop) > 2]


def _area_vector(points: Float) -> Float:
    """Of a ring (N, 3): its length is the area, its direction the normal of the best plane (Newell's method)."""
    middle = points - points.mean(axis=0)
    found: Float = 0.5 * cross(middle, np.roll(middle, -1, axis=0)).sum(axis=0)
    return found


def _cap(points: Float) -> Faces:
    """Triangles (N - 2, 3) over a ring (N, 3), as numbers of its points."""
    import manifold3d

    up, fan = _area_vector(points), np.array([[0, k, k + 1] for k in range(1, len(points) - 1)])
    if norm(up) < 1e-9 * float(np.ptp(points, axis=0).max()) ** 2:
        return fan  # of no area: a point on the edge of a neighbour
    up = up / norm(up)
    right = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    right = right / norm(right)
    flat = np.stack([points @ right, points @ np.cross(up, right)], axis=1)
    found = np.asarray(manifold3d.triangulate([flat]), dtype=np.int64).reshape(-1, 3)
    return found if len(found) == len(points) - 2 else fan


def _extents(points: Float) -> Float:
    """Length, least width and height over its best plane (3,) of a ring (N, 3) [m]."""
    middle = points - points.mean(axis=0)
    axes = np.linalg.svd(middle, full_matrices=False)[2]
    length, wide, out = np.ptp(middle @ axes.T, axis=0)
    edges = (np.roll(middle, -1, axis=0) - middle) @ axes[:2].T
    across = np.stack([-edges[:, 1], edges[:, 0]])[:, norm(edges) > 0.0]
    widths = np.ptp(middle @ axes[:2].T @ (across / norm(across.T)), axis=0)
    return np.array([length, min(wide, widths.min(initial=wide)), out])


def _sag(points: Float, normals: Float, size: float) -> float:
    """How far the true surface may be from the cap of a ring (N, 3) beside triangles of normals (N, 3) [m]."""
    _, width, out = (float(x) for x in _extents(points))
    up = _area_vector(points)
    long = norm(normals) > 0.0
    if width < _FLAT * size or not long.any():
        return max(width, out)
    bent = np.arccos(np.clip((normals[long] @ up) / (norm(normals[long]) * norm(up)), -1.0, 1.0))
    if out < _FLAT * size and bent.min() < 1e-3:
        return out
    return max(out, 0.5 * width * float(np.tan(0.5 * min(bent.max(), _STEEPEST))))
