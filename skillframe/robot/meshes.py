r"""Mesh files of a URDF: search paths, vertices and triangles.

`package://NAME/REST` and `model://NAME/REST` are searched as NAME/REST under the folders of `SKILLFRAME_PATH` and
`ROS_PACKAGE_PATH`, `share` of `AMENT_PREFIX_PATH`, and the URDF's parents.

MuJoCo collides with the convex hull and so fills holes silently. The dent of a mesh is the largest depth of a vertex,
centroid or edge midpoint below the hull's faces, \(\max_p \min_k
-(n_k \cdot p + d_k)\), zero exactly for convex meshes. Volumes are \(V = \frac{1}{6} \left| \sum v_1 \cdot (v_2 \times
v_3) \right|\).

Very large meshes are reduced to few points that span nearly the same hull: a vertex per cell of a grid of 1/400 of the
mesh's size, then of a coarser one, besides the farthest vertices along 500 directions.
"""

from __future__ import annotations

import io
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import lru_cache
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross

LARGEST_FILE = 100_000_000  #: bytes: two million triangles, read in seconds

_UNIT = re.compile(rb"<unit[^>]*\bmeter=[\"']([^\"']+)")


def resolve_mesh(uri: str, urdf: Path) -> Path | None:
    """File of a mesh's `filename`, or None."""
    scheme, separator, rest = uri.partition("://")
    if not separator:
        candidates: Iterator[Path] = iter([urdf.parent / uri])
    elif scheme == "file":
        candidates = iter([Path(unquote(rest))])
    elif scheme in ("package", "model"):
        package, _, inside = rest.partition("/")
        roots = [
            Path(folder) / below
            for variable, below in (("SKILLFRAME_PATH", ""), ("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share"))
            for folder in os.environ.get(variable, "").split(os.pathsep)
            if folder
        ]
        roots += urdf.resolve().parents
        named = ((root / package / inside, root / inside if root.name == package else None) for root in roots)
        candidates = (path for pair in named for path in pair if path is not None)
    else:
        return None
    return next((path for path in candidates if _is_file(path)), None)


def mesh_names(urdf: Path) -> list[str]:
    """Distinct mesh names of a URDF, none if it is not XML."""
    try:
        root = ET.parse(urdf).getroot()
    except ET.ParseError:
        return []
    return sorted({mesh.get("filename", "") for mesh in root.iter("mesh")})


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def mesh_vertices(path: Path) -> Float | None:
    """Vertices (V, 3) of an STL, OBJ or COLLADA mesh, or None if it cannot be read."""
    readers = {".stl": _stl_vertices, ".obj": _obj_vertices, ".dae": _dae_vertices}
    reader = readers.get(path.suffix.lower())
    try:
        vertices = reader(path.read_bytes()) if reader and path.stat().st_size <= LARGEST_FILE else None
    except (OSError, ValueError, ImportError):
        return None
    usable = vertices is not None and vertices.size > 0 and bool(np.isfinite(vertices).all())
    return vertices if usable else None


def mesh_triangles(path: Path) -> Float | None:
    """Triangle corners (T, 3, 3) of a mesh, or None as in `mesh_vertices`."""
    vertices = mesh_vertices(path)
    if vertices is None:
        return None
    if path.suffix.lower() in (".stl", ".dae"):
        return vertices[: len(vertices) // 3 * 3].reshape(-1, 3, 3)
    try:
        faces = _obj_faces(path.read_bytes(), len(vertices))
    except (OSError, ValueError):
        return None
    return vertices[faces] if len(faces) else None


def _obj_faces(content: bytes, count: int) -> NDArray[np.int64]:
    faces: list[tuple[int, int, int]] = []
    for line in content.decode("utf-8", "replace").splitlines():
        words = line.split()
        if len(words) >= 4 and words[0] == "f":
            corner = [int(word.partition("/")[0]) for word in words[1:]]
            corner = [i - 1 if i > 0 else count + i for i in corner]
            faces += [(corner[0], b, c) for b, c in pairwise(corner[1:])]
    found = np.array(faces, dtype=np.int64).reshape(-1, 3)
    if len(found) and (found.min() < 0 or found.max() >= count):
        raise ValueError("a face of vertices that are not there")
    return found


def _stl_vertices(content: bytes) -> Float:
    """Vertices of a binary (84 bytes header, 50 a triangle) or text STL."""
    count = int.from_bytes(content[80:84], "little")
    if len(content) < 84 or len(content) < 84 + 50 * count:
        words = [line.split() for line in content.decode("ascii", "replace").splitlines()]
        return np.array([w[1:4] for w in words if len(w) == 4 and w[0] == "vertex"], dtype=float)
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles = np.frombuffer(content, dtype=record, count=count, offset=84)
    return triangles["corners"].reshape(-1, 3).astype(float)


def _obj_vertices(content: bytes) -> Float:
    words = [line.split() for line in content.decode("utf-8", "replace").splitlines()]
    return np.array([w[1:4] for w in words if len(w) >= 4 and w[0] == "v"], dtype=float)


def _dae_vertices(content: bytes) -> Float:
    import trimesh
    from collada import DaeError

    try:
        scene = trimesh.load_scene(io.BytesIO(content), file_type="dae", process=False)
        found = [np.asarray(mesh.triangles) for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh)]
    except (DaeError, ET.ParseError, KeyError, IndexError, AttributeError, TypeError) as error:
        raise ValueError(f"cannot be read as COLLADA ({error})") from None
    if not found:
        raise ValueError("holds no triangle")
    corners: Float = np.concatenate(found).astype(float)
    unit = _UNIT.search(content)
    return (corners * (float(unit[1]) if unit else 1.0)).reshape(-1, 3)


def missing_collada() -> bool:
    """Check whether COLLADA support is missing."""
    return find_spec("collada") is None or find_spec("trimesh") is None


ROUNDING = 1e-6  # of the mesh's size: a few roundings of STL's single precision
SMALLEST = 2e-4  #: m; a part of 0.2 m read a thousand times too small
LARGEST = 10.0  # m; a part of 10 mm read a thousand times too large


class Hull(NamedTuple):
    """Convex hull: vertices (V, 3), triangles (F, 3), planes (F, 4) with n p + d <= 0 inside."""

    vertices: Float
    faces: NDArray[np.int64]
    planes: Float
    volume: float


def hull_of(vertices: Float) -> Hull | None:
    """Convex hull of points (V, 3), or None if they lie in one plane."""
    from scipy.spatial import ConvexHull, QhullError

    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    if len(vertices) < 4 or not size > 0.0:
        return None
    centred = vertices - vertices.mean(axis=0)
    if np.linalg.svd(centred, compute_uv=False)[-1] <= ROUNDING * size * np.sqrt(len(vertices)):
        return None
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        return None
    renumbered = np.full(len(vertices), -1)
    renumbered[hull.vertices] = np.arange(len(hull.vertices))
    faces = renumbered[hull.simplices]
    corners = vertices[hull.simplices]
    turned = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.sum(turned * hull.equations[:, :3], axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return Hull(vertices[hull.vertices], faces, np.unique(hull.equations.round(12), axis=0), float(hull.volume))


def volume_of(vertices: Float, faces: NDArray[np.int64]) -> float:
    """Volume [m^3] of a closed mesh, for either orientation of its triangles."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return abs(float(np.sum(a * cross(b, c)))) / 6.0


def open_edges(vertices: Float, faces: NDArray[np.int64]) -> int:
    """Number of edges with an odd number of triangles. Equal vertices count as one."""
    _, same = np.unique(vertices, axis=0, return_inverse=True)
    merged = same.reshape(-1)[faces]
    whole = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    edges = np.sort(merged[whole][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    return int(np.sum(count % 2))


def dent(vertices: Float, faces: NDArray[np.int64], hull: Hull, enough: float = np.inf) -> float:
    """Greatest depth of the surface inside its hull [m]. The search stops above `enough`."""
    corners = vertices[faces]
    halves = 0.5 * (corners + np.roll(corners, 1, axis=1)).reshape(-1, 3)
    points = np.concatenate([vertices[np.unique(faces)], corners.mean(axis=1), halves])
    step = max(1, 4_000_000 // len(hull.planes))  # point-face pairs at a time: 32 MB
    deepest = 0.0
    for start in range(0, len(points), step):
        part = points[start : start + step] @ hull.planes[:, :3].T + hull.planes[:, 3]
        deepest = max(deepest, float((-part.max(axis=1)).max()))
        if deepest > enough:
            break
    return deepest


def is_convex(vertices: Float, faces: NDArray[np.int64], hull: Hull) -> bool:
    """Check whether a mesh fills its hull within tolerance."""
    allowed = 5e-5 + ROUNDING * float(np.ptp(vertices, axis=0).max())  # m, the penetration of contacts
    return dent(vertices, faces, hull, allowed) <= allowed


def unfit_to_collide(vertices: Float, faces: NDArray[np.int64] | None) -> tuple[str, str] | None:
    """Reason why a mesh cannot collide as drawn, and the fix, or None."""
    points = np.ascontiguousarray(vertices, dtype=float)
    triangles = None if faces is None else np.ascontiguousarray(faces, dtype=np.int64)
    return _unfit(points.tobytes(), None if triangles is None else triangles.tobytes())


@lru_cache(maxsize=256)
def _unfit(points: bytes, triangles: bytes | None) -> tuple[str, str] | None:
    vertices = np.frombuffer(points).reshape(-1, 3)
    if not np.isfinite(vertices).all():
        return "holds numbers that are not finite", "correct its vertices"
    hull = hull_of(vertices)
    if hull is None:
        return "is flat: its vertices lie in one plane", "give it a thickness, or take a box"
    size = float(np.ptp(vertices, axis=0).max())
    if not SMALLEST <= size <= LARGEST:
        why = "are its vertices in millimetres?" if size > LARGEST else "was it scaled to metres twice?"
        return f"is {size:.3g} m long ({why})", "give its vertices in metres"
    if triangles is None:
        return None
    faces = np.frombuffer(triangles, dtype=np.int64).reshape(-1, 3)
    if not len(faces) or faces.min() < 0 or faces.max() >= len(vertices):
        return "has triangles of vertices that it does not have", "correct its faces"
    if count := open_edges(vertices, faces):
        text = f"is not closed ({count} open edges): what is inside is not defined"
        return text, "close it, or leave its faces out to take the hull of its vertices"
    if is_convex(vertices, faces, hull):
        return None
    deep = 1000.0 * dent(vertices, faces, hull)
    filled = 100.0 * (hull.volume / max(volume_of(vertices, faces), 1e-30) - 1.0)
    more = f"{filled:.2g} % more, up to {deep:.3g} mm deep"
    text = f"is not convex: its hull holds {more}; a peg would stand on air there"
    return text, "split it into convex pieces, one Geom each, or give it collide = False to be seen only"


FINE, MOST = 400, 5000
"""Cells along the largest extent, and most points besides the farthest."""


def thinned(points: Float) -> Float:
    """At most `MOST` spread points of (P, 3), and the farthest along many directions."""
    size = float(np.ptp(points, axis=0).max())
    if not size > 0.0:
        return points[:1]
    fine = one_per_cell(points, size / FINE)
    spread, cell = fine, size / FINE
    while len(spread) > MOST:
        cell *= 1.5
        spread = one_per_cell(fine, cell)
    k = np.arange(500)  # a Fibonacci lattice on the sphere
    z = 1.0 - (2.0 * k + 1.0) / 500
    turn = k * np.pi * (3.0 - np.sqrt(5.0))
    around = np.sqrt(1.0 - z**2)
    ways = np.stack([around * np.cos(turn), around * np.sin(turn), z], axis=-1)
    farthest = fine[np.unique([np.argmax(fine @ way) for way in ways])]  # one product would take a gigabyte
    return np.unique(np.concatenate([spread, farthest]), axis=0)


def one_per_cell(points: Float, cell: float) -> Float:
    """First point of (P, 3) in each cell of a cubic grid."""
    index = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    side = index.max(axis=0) + 1
    _, first = np.unique((index[:, 0] * side[1] + index[:, 1]) * side[2] + index[:, 2], return_index=True)
    return np.asarray(points[np.sort(first)])
