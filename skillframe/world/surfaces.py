"""Contact of parts of any shape: a contact generator in C in MuJoCo's table of collision functions.

The points of each part are looked up in the other's grid of signed distances.
"""

from __future__ import annotations

import ctypes
import weakref
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.fmu.build import build_library
from skillframe.frames import Float, cross, norm

Ints = NDArray[np.int64]
SOURCES = ("surfaces.h", "distance_grid.c", "narrow_phase.c")


class _Mesh(ctypes.Structure):
    _fields_ = (("count", ctypes.c_int64), ("corner", ctypes.c_void_p), ("normal", ctypes.c_void_p))


class _Grid(ctypes.Structure):
    _fields_ = (
        ("origin", ctypes.c_double * 3), ("cell", ctypes.c_double), ("size", ctypes.c_int64 * 3),
        *((name, ctypes.c_void_p) for name in ("value", "gap", "listed", "before", "start", "triangle")),
    )  # fmt: skip


class _Part(ctypes.Structure):
    _fields_ = (
        ("mesh", _Mesh), ("grid", _Grid * 2), ("turn", ctypes.c_double * 9), ("shift", ctypes.c_double * 3),
        ("apart", ctypes.c_double), ("agrees", ctypes.c_int64), ("points", ctypes.c_int64),
        ("blocks", ctypes.c_int64), ("groups", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("point", "ball", "first", "around", "group")),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Triangles:
    """A closed mesh for exact distances.

    Attributes:
        corners: (T, 3, 3) [m].
        normals: (T, 7, 3) of the face, edges ab, bc, ca and corners a, b, c (J. A. Baerentzen and H. Aanaes, IEEE TVCG
            11(3), 2005).
    """

    corners: Float
    normals: Float


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceGrid:
    """Signed distance on a grid.

    Attributes:
        origin: (3,) first node [m]; cell: [m].
        value: (X, Y, Z) at the nodes [m], negative inside.
        gap: (X, Y, Z) coded distance of a cell to the inside, 0 where a point may be inside.
        listed: one bit per node if its cell has a list; before: listed cells before each word.
        start: (cells + 1,) into triangle: candidates for the nearest in a listed cell.
        disagree: share of nodes whose three rays disagree on inside.
    """

    origin: Float
    cell: float
    value: NDArray[np.float32]
    gap: NDArray[np.uint8]
    listed: NDArray[np.uint64]
    before: NDArray[np.uint32]
    start: NDArray[np.int32]
    triangle: NDArray[np.int32]
    disagree: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Surface:
    """Contact data of a part. `turn` (3, 3) and `shift` (3,) transform it to its body's frame.

    Attributes:
        triangles: of the part.
        grids: one, or a fine one where parts can meet and a coarse one.
        points: (P, 3) on the surface [m], by block; first: (B + 1,) start of each block.
        balls: (B, 4) centre and radius of each block [m].
        group: (G + 1,) start of each group of blocks; around: (G, 4) their balls.
        apart: least distance of contacts [m].
    """

    triangles: Triangles
    grids: tuple[DistanceGrid, ...]
    points: Float
    first: Ints
    balls: Float
    group: Ints
    around: Float
    apart: float
    turn: Float
    shift: Float

    def look_up(self, points: Float) -> Float:
        """Signed distances (P,) of points (P, 3) in the part's frame, as used for contact [m]."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        out = np.empty(len(points))
        _require().skillframe_look_up(ctypes.byref(_part(self)), len(points), _at(points), _at(out))
        return out


def available() -> bool:
    """Whether the contact generator can be used."""
    return library() is not None


def opened() -> ctypes.CDLL | None:
    """Library of the generator, built if necessary, or None."""
    import mujoco

    folder = Path(__file__).parent
    text = {name: (folder / name).read_text(encoding="utf-8") for name in SOURCES}
    header = f"#define SKILLFRAME_MUJOCO {mujoco.mj_version()}\n"
    whole = header + "".join(text[name].replace('#include "surfaces.h"', "") for name in SOURCES)
    for _ in range(2):
        headers = Path(mujoco.__file__).parent / "include"
        built = build_library("contacts", whole, include=headers, flags=("-O3",))
        if built is None:
            return None
        try:
            _engine()
        except (OSError, StopIteration):
            return None
        try:
            return ctypes.CDLL(str(built), mode=ctypes.RTLD_LOCAL)
        except OSError:
            built.unlink(missing_ok=True)
    return None


@lru_cache(maxsize=1)
def library() -> ctypes.CDLL | None:
    """Install the contact generator in MuJoCo's table, or return None."""
    import mujoco

    found = opened()
    if found is None or found.skillframe_version() != mujoco.mj_version():
        return None
    found.skillframe_mark.restype = found.skillframe_lists.restype = ctypes.c_int64
    found.skillframe_mark.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]
    table = (ctypes.c_void_p * 1).in_dll(_engine(), "mjCOLLISIONFUNC")
    found.skillframe_install(ctypes.byref(table))
    return found


def _engine() -> ctypes.CDLL:
    import mujoco

    return ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))), mode=ctypes.RTLD_GLOBAL)


def _require() -> Any:
    found = library()
    if found is None:
        raise SkillframeError("contact of curved parts needs a C compiler (cc, gcc, clang or $CC): pip install ziglang")
    return found


def _at(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _mesh(triangles: Triangles) -> _Mesh:
    return _Mesh(len(triangles.corners), _at(triangles.corners), _at(triangles.normals))


def _grid(grid: DistanceGrid) -> _Grid:
    lists = (_at(each) for each in (grid.value, grid.gap, grid.listed, grid.before, grid.start, grid.triangle))
    return _Grid((ctypes.c_double * 3)(*grid.origin), grid.cell, (ctypes.c_int64 * 3)(*grid.value.shape), *lists)


def _part(surface: Surface) -> _Part:
    made = _Part(mesh=_mesh(surface.triangles), apart=surface.apart)
    for level, grid in enumerate(surface.grids):
        made.grid[level] = _grid(grid)
    made.turn[:] = surface.turn.ravel().tolist()
    made.shift[:] = surface.shift.tolist()
    made.points, made.blocks, made.groups = len(surface.points), len(surface.balls), len(surface.around)
    for name, array in (
        ("point", surface.points), ("ball", surface.balls), ("first", surface.first), ("around", surface.around),
        ("group", surface.group),
    ):  # fmt: skip
        setattr(made, name, _at(array).value)
    return made


_NUMBERS: weakref.WeakKeyDictionary[Surface, int] = weakref.WeakKeyDictionary()


def number_of(surface: Surface) -> int:
    """Number of a surface in the generator, registered on first use.

    Raises:
        SkillframeError: no compiler, or a thousand surfaces.
    """
    if surface not in _NUMBERS:
        part = _part(surface)
        part.agrees = _require().skillframe_agrees(ctypes.byref(part))
        number = int(_require().skillframe_add(ctypes.byref(part)))
        if not number:
            raise SkillframeError("a thousand parts are in contact already, which is all that there is room for")
        weakref.finalize(surface, _removed, number, part)
        _NUMBERS[surface] = number
    return _NUMBERS[surface]


def _removed(number: int, part: _Part) -> None:
    """Remove a surface. The finalizer keeps `part` alive until then."""
    _require().skillframe_remove(number)


def triangles_of(vertices: Float, faces: Ints) -> Triangles:
    """Triangles and normals of a closed mesh (V, 3), (F, 3), without degenerate ones."""
    raw = cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    size = norm(raw)
    faces, raw, size = faces[size > 1e-18], raw[size > 1e-18], size[size > 1e-18]
    face = raw / size[:, None]
    corners = np.ascontiguousarray(vertices[faces])
    at_edges, at_corners = np.zeros((len(faces), 3, 3)), np.zeros((len(vertices), 3))
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, edge = np.unique(ends, axis=0, return_inverse=True)
    edge = edge.reshape(-1, 3)
    of_edge = np.zeros((edge.max() + 1, 3))
    for k in range(3):
        np.add.at(of_edge, edge[:, k], face)
        one, two = (corners[:, (k + step) % 3] - corners[:, k] for step in (1, 2))
        angle = np.arctan2(norm(cross(one, two)), (one * two).sum(axis=-1))
        np.add.at(at_corners, faces[:, k], angle[:, None] * face)
    at_edges = of_edge[edge]
    normals = np.concatenate([face[:, None], at_edges, at_corners[faces]], axis=1)
    length = norm(normals)[..., None]
    return Triangles(corners=corners, normals=np.ascontiguousarray(normals / np.where(length > 0.0, length, 1.0)))


def grid_of(triangles: Triangles, low: Float, high: Float, cell: float) -> DistanceGrid:
    """Signed distance grid of triangles over a box [m].

    Raises:
        SkillframeError: no compiler, or no memory.
    """
    found = _require()
    size = np.maximum(np.ceil((high - low) / cell).astype(int) + 1, 2)
    mesh, value = _mesh(triangles), np.empty(size, dtype=np.float32)
    listed, disagree = np.zeros(value.size // 64 + 1, dtype=np.uint64), ctypes.c_int64()
    none, gap = np.zeros(1, dtype=np.int32), np.empty(size, dtype=np.uint8)
    grid = DistanceGrid(
        origin=np.array(low, dtype=float), cell=cell, value=value, gap=gap, listed=listed,
        before=np.zeros(1, dtype=np.uint32), start=none, triangle=none, disagree=0.0,
    )  # fmt: skip
    made = _grid(grid)
    if found.skillframe_values(ctypes.byref(made), ctypes.byref(mesh), _at(value), ctypes.byref(disagree)):
        raise SkillframeError(f"a grid of {value.size:,} nodes for contact does not fit into memory; take larger cells")
    linear_within = 1e-6  # m
    count = int(found.skillframe_mark(ctypes.byref(made), linear_within, _at(listed)))
    found.skillframe_gaps(ctypes.byref(made), _at(gap))
    if hasattr(np, "bitwise_count"):
        bits = np.bitwise_count(listed)
    else:
        bits = np.unpackbits(listed.view(np.uint8)).reshape(-1, 64).sum(axis=1).astype(np.uint8)
    before = (np.cumsum(bits, dtype=np.uint32) - bits).astype(np.uint32)
    made.before = _at(before).value
    nearest, many, pairs = np.zeros(count, dtype=np.float32), np.zeros(count, dtype=np.int32), ctypes.c_void_p()
    listed_at = _at(nearest), _at(many), ctypes.byref(pairs)
    total = int(found.skillframe_lists(ctypes.byref(made), ctypes.byref(mesh), ctypes.c_int64(count), *listed_at))
    if total < 0:
        raise SkillframeError("lists of triangles for contact do not fit into memory; take a mesh of fewer triangles")
    start = np.concatenate([[0], np.cumsum(many)]).astype(np.int32)
    triangle, next_ = np.zeros(max(total, 1), dtype=np.int32), start.copy()
    found.skillframe_sort(ctypes.c_int64(total), pairs, _at(next_), _at(triangle))
    return DistanceGrid(
        origin=grid.origin, cell=cell, value=value, gap=gap, listed=listed, before=before, start=start,
        triangle=triangle, disagree=disagree.value / value.size,
    )  # fmt: skip


def exact_distances(triangles: Triangles, points: Float) -> Float:
    """Exact signed distances (P,) of points (P, 3) from a closed mesh [m].

    Raises:
        SkillframeError: no compiler, or no memory.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    out = np.empty(len(points))
    mesh, count = _mesh(triangles), ctypes.c_int64(len(points))
    if _require().skillframe_exact(ctypes.byref(mesh), count, _at(points), _at(out)):
        raise SkillframeError(f"{len(triangles.corners):,} triangles do not fit into memory a second time")
    return out
