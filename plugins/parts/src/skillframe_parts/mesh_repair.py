"""Mesh repair: duplicate and flipped triangles, T-junctions, loose sheets, small holes.

Results are independent of the triangles' order. Each repair states its error, which counts where the other part can
come (`load`). A hole gets a cap in its best plane: an arc that meets the cap at an angle t over a width w deviates by w
/ 2 tan(t / 2), or zero where a neighbour lies in the cap's plane. A removed sheet's error is its largest distance from
the rest.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, norm
from skillframe_parts.polygons import area_vector, cut

_FLAT = 1e-6  # of the part's size
Faces = NDArray[np.int64]


class Mend(NamedTuple):
    """A repaired place: points (P, 3) around it and its error [m]."""

    points: Float
    error: float


class Mended(NamedTuple):
    """A repaired mesh [m], with sentences on its repairs, and their places."""

    vertices: Float
    faces: Faces
    notes: tuple[str, ...]
    places: tuple[Mend, ...]


class Edges(NamedTuple):
    """Edges of triangles: ends (E, 2), index (F, 3) of each side's, number of triangles at each (E,)."""

    ends: Faces
    of: Faces
    shared: Faces

    @property
    def odd(self) -> int:
        """Number of edges with an odd number of triangles, 0 for a closed surface."""
        return int(np.sum(self.shared % 2))


def same_within(vertices: Float) -> float:
    """Tolerance for equal corners, and for corners on an edge [m]."""
    size, far = np.ptp(vertices, axis=0).max(), np.abs(vertices).max()
    rounded = 4.0 * float(np.finfo(np.float32).eps)  # of the coordinates, which STL rounds to 24 bits
    return max(_FLAT * float(size), rounded * float(far))


def edges_of(faces: Faces) -> Edges:
    """The edges of triangles (F, 3)."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    ends, of, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    return Edges(ends, of.reshape(-1, 3), count)


def mended(vertices: Float, faces: Faces) -> Mended:
    """A mesh with all possible repairs."""
    notes: list[str] = []
    edges = edges_of(faces)
    forward = np.where(faces < np.roll(faces, -1, axis=1), 1, -1)
    turns = np.bincount(edges.of.reshape(-1), weights=forward.reshape(-1), minlength=len(edges.shared))
    if (edges.shared == 2).all() and not turns.any():
        return Mended(vertices, faces, (), ())
    kept = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
    if len(kept) < len(faces) and edges_of(faces[kept]).odd <= edges_of(faces).odd:  # else it would open the mesh
        notes.append(f"doubled triangles left out: {len(faces) - len(kept)}")
        faces = faces[np.sort(kept)]
    faces, split = _split(vertices, faces)
    if split:
        notes.append(f"edges split at corners that lie on them: {split}")
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
    widest = max(float(_extents(place.points)[0]) for place in places)
    error = round(1000.0 * max(place.error for place in places), 4)
    return f"largest {1000.0 * widest:.2g} mm; the surface may be off by {error:.2g} mm there"


def _split(vertices: Float, faces: Faces) -> tuple[Faces, int]:
    count = 0
    while len(parted := _parted(vertices, faces)):
        fans = [
            [(apex, *side) for side in pairwise(line) if apex not in side]  # a sliver with its apex on it vanishes
            for apex, line in parted.values()
        ]
        new = np.array([each for fan in fans for each in fan], dtype=np.int64).reshape(-1, 3)
        faces = np.concatenate([np.delete(faces, list(parted), axis=0), new])
        count += len(parted)
    return faces, count


def _parted(vertices: Float, faces: Faces) -> dict[int, tuple[int, list[int]]]:
    """Triangles with T-junctions by index: apex over the edge, and the edge's corners in order."""
    from scipy.spatial import KDTree

    edges, near = edges_of(faces), same_within(vertices)
    open_sides = np.nonzero(edges.shared[edges.of.reshape(-1)] % 2)[0]
    if not len(open_sides):
        return {}
    rim = np.unique(edges.ends[edges.shared % 2 == 1])
    tree, found = KDTree(vertices[rim]), {}
    for side in open_sides.tolist():
        face, corner = divmod(side, 3)
        start, end, apex = (int(faces[face, (corner + k) % 3]) for k in range(3))
        along = vertices[end] - vertices[start]
        inside = rim[tree.query_ball_point(vertices[start] + 0.5 * along, 0.5 * norm(along))]
        share = (vertices[inside] - vertices[start]) @ along / (along @ along)
        beside = norm(vertices[inside] - vertices[start] - share[:, None] * along)
        on = (beside < near) & (np.minimum(share, 1.0 - share) * norm(along) > near)
        if on.any():
            found[face] = apex, [start, *inside[on][np.argsort(share[on])].tolist(), end]
    return found


def _neighbours(edges: Edges) -> tuple[Faces, Faces, Faces]:
    """Pairs of triangles (N,), (N,) with a common edge of two, and its place (N, 2) in `edges.of`."""
    order = np.argsort(edges.of.reshape(-1), kind="stable")
    sides = order[np.repeat(edges.shared == 2, edges.shared)].reshape(-1, 2)
    return sides[:, 0] // 3, sides[:, 1] // 3, sides


def _without_sheets(vertices: Float, faces: Faces) -> tuple[Faces, list[Mend]]:
    """Triangles without sheets: patches, smallest first, whose removal leaves fewer odd edges."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    left, gone = faces, []
    largest = 0.05 * float(_areas(vertices, faces).sum())
    while (edges := edges_of(left)).odd:
        one, two, _ = _neighbours(edges)
        links = coo_matrix((np.ones(len(one)), (one, two)), shape=[len(left)] * 2)
        label, count, sheets = connected_components(links, directed=False)[1], edges.shared.copy(), []
        sizes = np.bincount(label, weights=_areas(vertices, left))
        for patch in np.argsort(sizes)[: int(np.sum(sizes <= largest))]:
            own, number = np.unique(edges.of[label == patch], return_counts=True)
            if np.sum(count[own] % 2) > np.sum((count[own] - number) % 2):
                count[own] -= number
                sheets.append(label == patch)
        if not sheets:
            break
        gone += [left[sheet] for sheet in sheets]
        left = left[~np.any(sheets, axis=0)]  # changes the patches
    return left, [Mend(vertices[np.unique(sheet)], _farthest(vertices, sheet, left)) for sheet in gone]


def _farthest(vertices: Float, sheet: Faces, rest: Faces) -> float:
    """Largest distance [m] of a sheet's corners and middles from the remaining triangles."""
    from trimesh.triangles import closest_point

    points = np.concatenate([vertices[sheet].mean(axis=1), vertices[np.unique(sheet)]])
    points = points[:: -(-len(points) // 200)]
    triangles, worst = vertices[rest], 0.0
    for point in points:
        near = closest_point(triangles, np.broadcast_to(point, (len(triangles), 3)))
        worst = max(worst, float(norm(near - point).min()))
    return worst


def _areas(vertices: Float, faces: Faces) -> Float:
    found: Float = 0.5 * norm(_normals(vertices, faces))
    return found


def _normals(vertices: Float, faces: Faces) -> Float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    found: Float = cross(b - a, c - a)
    return found


def _one_turn(vertices: Float, faces: Faces) -> tuple[Faces, int]:
    """Consistently oriented triangles, and the number of flipped ones: the majority by area decides.

    Each triangle is two nodes, one per orientation, linked to agreeing neighbours: a patch has two components, or one
    if it is one-sided (a Moebius strip), which is left alone.
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
    edges = edges_of(faces)
    alone = np.nonzero(edges.shared[edges.of.reshape(-1)] == 1)[0]
    if not len(alone):
        return faces, []
    ways = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size, normals = float(np.ptp(vertices, axis=0).max()), _normals(vertices, faces)
    beside = {(int(ways[k, 1]), int(ways[k, 0])): int(k // 3) for k in alone}
    caps, places = [faces], []
    for loop in _loops(vertices, sorted(beside)):
        points = vertices[loop]
        if _extents(points)[1] > 0.2 * size:  # too wide to close
            continue
        around = [beside[edge] for edge in zip(loop, [*loop[1:], loop[0]], strict=True)]
        caps.append(np.array(loop)[cut(points)])
        places.append(Mend(points, _sag(points, normals[around], size)))
    return np.concatenate(caps), places


def _loops(vertices: Float, ways: list[tuple[int, int]]) -> list[list[int]]:
    """Closed rings of vertices formed by directed edges, cut where they touch themselves.

    Of several edges at a vertex, the sharpest return is taken: the two sides of a slit belong together.
    """
    after: dict[int, list[int]] = {}
    for start, end in ways:
        after.setdefault(start, []).append(end)
    found = []
    for start in list(after):
        path = [start]
        while leaving := after.get(path[-1]):
            back = vertices[path[-2]] - vertices[path[-1]] if len(path) > 1 else np.zeros(3)
            away = vertices[leaving] - vertices[path[-1]]
            following = leaving.pop(int(np.argmax(away @ back / norm(away))))
            if following in path:
                at = path.index(following)
                found.append(path[at:])
                del path[at + 1 :]
            else:
                path.append(following)
    return [loop for loop in found if len(loop) > 2]


def _extents(points: Float) -> Float:
    """Length, least width, and height over its best plane (3,) of a ring (N, 3) [m]."""
    middle = points - points.mean(axis=0)
    axes = np.linalg.svd(middle, full_matrices=False)[2]
    length, wide, out = np.ptp(middle @ axes.T, axis=0)
    edges = (np.roll(middle, -1, axis=0) - middle) @ axes[:2].T
    across = np.stack([-edges[:, 1], edges[:, 0]])[:, norm(edges) > 0.0]
    widths = np.ptp(middle @ axes[:2].T @ (across / norm(across.T)), axis=0)
    return np.array([length, min(wide, widths.min(initial=wide)), out])


def _sag(points: Float, normals: Float, size: float) -> float:
    """Largest deviation of the true surface from the cap of a ring (N, 3) with normals (N, 3) [m]."""
    _, width, out = (float(x) for x in _extents(points))
    up = area_vector(points)
    long = norm(normals) > 0.0
    if width < _FLAT * size or not long.any():
        return max(width, out)
    bent = np.arccos(np.clip((normals[long] @ up) / (norm(normals[long]) * norm(up)), -1.0, 1.0))
    if out < _FLAT * size and bent.min() < 1e-3:
        return out
    return max(out, 0.5 * width * float(np.tan(0.5 * min(bent.max(), np.radians(150.0)))))
