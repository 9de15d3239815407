"""Reads a mesh file as a closed solid in metres, or explains why it is none.

A closed surface passes every edge once each way. Overlapping bodies are united, an inverted body inside another is a
cavity. trimesh reads the formats, manifold3d computes the union.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, need
from skillframe.frames import Float, cross
from skillframe.robot import LARGEST_FILE
from skillframe_parts import step
from skillframe_parts.contents import check_contents, no_number
from skillframe_parts.declared import SCALES
from skillframe_parts.mesh_repair import Mend, mended, same_within
from skillframe_parts.polygons import read_obj
from skillframe_parts.scenes import is_scene, one_piece, standing
from skillframe_parts.shapes import Shape

SIDES = 64
"""Sides of a cylinder in a scene or second part; their deviation is at most 0.12 % of the radius."""
FORMATS = (".stl", ".obj", ".ply", ".off", ".glb", *step.ENDINGS)
SMALLEST, LARGEST = 1e-3, 2.0
"""Plausible sizes of parts [m]."""
MOST_TRIANGLES = 40_000
_CHANGED = 0.01  # reported change of volume
Faces = NDArray[np.int64]


class MeshPart(NamedTuple):
    """A part.

    Attributes:
        name: its file's, for messages.
        solid: a `manifold3d.Manifold` in the file's frame [m].
        notes: sentences on repairs.
        sha256: of the file.
        places: of repairs, in the file's frame.
        error: of its triangles against the drawn surface [m].
    """

    name: str
    solid: Any
    notes: tuple[str, ...]
    sha256: str
    places: tuple[Mend, ...] = ()
    error: float = 0.0

    @property
    def size(self) -> float:
        """Its largest extent along an axis of its file [m]."""
        return float(np.ptp(np.reshape(self.solid.bounding_box(), (2, 3)), axis=0).max())


def read_part(path: Path, units: str | None, held: bool = False) -> MeshPart:
    """A part from its file.

    Args:
        path: STL, OBJ, PLY, OFF, GLB or STEP, or a scene, whose fixed shapes are taken.
        units: of its numbers; None for metres and for STEP.
        held: take the one body of a scene, fixed or free.

    Raises:
        MissingDependency: the extra `parts` is not installed, or for STEP `step`.
        InputError: it cannot be read, is not closed, or has an implausible size.
    """
    need("trimesh")
    need("manifold3d")
    if is_scene(path.name):
        solid = of_shapes(one_piece(path) if held else standing(path), path)
        _check_size(arrays_of(solid)[0], "m", path)
        return MeshPart(path.name, solid, (), hashlib.sha256(path.read_bytes()).hexdigest())
    raw = _content(path)
    left_out = check_contents(raw, path)
    drawn = path.suffix.lower() in step.ENDINGS
    if drawn and units is not None:
        raise InputError(path, "says its own unit, as every STEP file", "leave units out for it")
    vertices, faces = _triangles(step.as_glb(raw, path) if drawn else raw, path)
    _check_numbers(vertices, faces, path)
    _check_size(vertices, units or "m", path)
    mesh = mended(*_merged(vertices * SCALES[units or "m"], faces))
    _check_closed(mesh.vertices, mesh.faces, path)
    solid, notes = _united(mesh.vertices, mesh.faces, path)
    if drawn:
        left_out = (f"{path.name} was cut into triangles within {1e6 * step.TOLERANCE:g} um of what was drawn",)
    notes = (*left_out, *(f"{path.name}: {note}" for note in mesh.notes), *notes)
    if solid.num_tri() > MOST_TRIANGLES:
        before, solid = solid.num_tri(), solid.simplify(2e-6)
        kept = f"{path.name} has {before:,} triangles; {solid.num_tri():,} are kept within 2 um"
        notes = (*notes, kept)
    error = step.TOLERANCE if drawn else 0.0
    return MeshPart(path.name, solid, notes, hashlib.sha256(raw).hexdigest(), mesh.places, error)


def arrays_of(solid: Any) -> tuple[Float, Faces]:
    """Vertices (V, 3) [m] and triangles (F, 3) of a solid."""
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties[:, :3], dtype=float), np.array(mesh.tri_verts, dtype=np.int64)


def solid_of(vertices: Float, faces: Faces) -> Any:
    """A `manifold3d.Manifold` of a closed mesh."""
    import manifold3d

    points = np.ascontiguousarray(vertices, dtype=np.float64)
    return manifold3d.Manifold(
        manifold3d.Mesh64(vert_properties=points, tri_verts=np.ascontiguousarray(faces, dtype=np.uint64))
    )


def united(solids: Sequence[Any]) -> Any:
    """The union of solids."""
    import manifold3d

    return manifold3d.Manifold.batch_boolean(list(solids), manifold3d.OpType.Add)


def of_shapes(shapes: Sequence[Shape], path: Path) -> Any:
    """The union of a scene's shapes, in the scene's frame.

    Raises:
        InputError: an unusable mesh, or an invalid size.
    """
    import manifold3d

    solids = []
    for shape in shapes:
        if shape.kind == "mesh":
            vertices, faces, where = shape.vertices, shape.faces, shape.file or path
            if shape.file is not None:
                raw = _content(shape.file)
                if shape.file.suffix.lower() in step.ENDINGS:
                    what = f"names {shape.file.name}, and STEP is not read in scenes"
                    raise InputError(path, what, "export it as STL")
                check_contents(raw, shape.file)
                vertices, faces = _triangles(raw, shape.file)
            _check_numbers(vertices, faces, where)
            vertices, faces = _merged(vertices * np.array(shape.size or 1.0), faces)
            _check_closed(vertices, faces, where)
            solid = _united(vertices, faces, where)[0]
        elif not min(shape.size) > 0.0:
            raise InputError(path, f"{shape.name} has a size that is not above 0", "correct it")
        elif shape.kind == "box":
            solid = manifold3d.Manifold.cube(list(shape.size), True)
        else:
            radius, length = shape.size
            solid = manifold3d.Manifold.cylinder(length, radius, circular_segments=SIDES, center=True)
        solids.append(solid.transform(np.column_stack([shape.rotation, shape.origin])))
    return united(solids)


def _content(path: Path) -> bytes:
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise InputError(path, f"is no mesh that is read (there are: {', '.join(FORMATS)})", "export it as STL")
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(path, f"is larger than {LARGEST_FILE / 1e6:g} MB", "export it coarser")
        return path.read_bytes()
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror or error})", "check the path") from None


def _triangles(raw: bytes, path: Path) -> tuple[Float, Faces]:
    import trimesh

    ending = path.suffix.lower()
    kind = "glb" if ending in step.ENDINGS else ending.removeprefix(".")
    try:
        if kind == "obj":
            return read_obj(raw)
        mesh = trimesh.load(io.BytesIO(raw), file_type=kind, force="mesh", process=False)
        vertices, faces = np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)
    except Exception as error:  # readers raise arbitrary errors
        said = no_number(raw, path) or f" ({' '.join(str(error).split())[:120]})"
        raise InputError(path, f"cannot be read as {kind.upper()}{said}", "export it again") from None
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)


def _check_numbers(vertices: Float, faces: Faces, path: Path) -> None:
    if not len(faces):
        raise InputError(path, "is empty: it holds no triangle", "export it again")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(path, "has triangles of vertices that it does not have", "export it again")
    if bad := int(np.sum(~np.isfinite(vertices).all(axis=1))):
        what = f"has {bad} of {len(vertices)} vertices that are not finite numbers (NaN or infinite)"
        raise InputError(path, what, "export it again")


def _check_size(vertices: Float, units: str, path: Path) -> None:
    extent = float(np.ptp(vertices, axis=0).max())
    size = extent * SCALES[units]
    if SMALLEST <= size <= LARGEST:
        return
    likely = [word for word in ("mm", "m", "cm", "in", "um") if SMALLEST <= extent * SCALES[word] <= LARGEST]
    own = path.suffix.lower() in step.ENDINGS
    fix = f'say units = "{likely[0]}"' if likely and not own else "check what it was exported as"
    raise InputError(path, f"is {size:.3g} m long in {units}, and a part is 1 mm to 2 m", fix)


def _merged(vertices: Float, faces: Faces) -> tuple[Float, Faces]:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    vertices, same = np.unique(vertices, axis=0, return_inverse=True)
    near = KDTree(vertices).query_pairs(same_within(vertices), output_type="ndarray")
    links = coo_matrix((np.ones(len(near)), near.T), shape=[len(vertices)] * 2)
    _, first, number = np.unique(connected_components(links)[1], return_index=True, return_inverse=True)
    faces = number[same.reshape(-1)[faces]]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices[first], faces[whole]


def _check_closed(vertices: Float, faces: Faces, path: Path) -> None:
    ways = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges, number = np.unique(np.sort(ways, axis=1), axis=0, return_inverse=True)
    forward = np.bincount(number.reshape(-1), weights=np.where(ways[:, 0] < ways[:, 1], 1, -1), minlength=len(edges))
    odd = np.bincount(number.reshape(-1), minlength=len(edges)) % 2 == 1
    if odd.any():
        where = _mm(vertices[edges[odd][0]].mean(axis=0))
        what = f"has {int(odd.sum())} open edges, one near {where} mm: what is inside is not defined"
        raise InputError(path, what, "close it where it was drawn")
    if (forward != 0).any():
        where = _mm(vertices[edges[forward != 0][0]].mean(axis=0))
        what = (
            f"has triangles turned against their neighbours at {int((forward != 0).sum())} edges, one near {where} mm"
        )
        raise InputError(path, what, "let its normals point outwards where it was drawn")


def _united(vertices: Float, faces: Faces, path: Path) -> tuple[Any, tuple[str, ...]]:
    """The bodies of a closed mesh as one solid, and sentences on what was changed."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    a, b = faces[:, [0, 1]].T, faces[:, [1, 2]].T
    links = coo_matrix((np.ones(2 * len(faces)), np.concatenate([a, b], axis=1)), shape=[len(vertices)] * 2)
    count, label = connected_components(links, directed=False)
    of_face, notes = label[faces[:, 0]], []
    bodies = [faces[of_face == k] for k in range(count) if (of_face == k).any()]
    volumes = [_volume(vertices, body) for body in bodies]
    if sum(volumes) < 0.0:
        notes.append(f"{path.name} is inside out (volume {sum(volumes) * 1e6:.3g} cm3); its triangles were turned")
        bodies, volumes = [body[:, ::-1] for body in bodies], [-each for each in volumes]
    flat = 1e-12 * float(np.ptp(vertices, axis=0).max()) ** 3
    full = [_checked(vertices, body, path) for body, volume in zip(bodies, volumes, strict=True) if volume > flat]
    voids = [_checked(vertices, body[:, ::-1], path) for body, v in zip(bodies, volumes, strict=True) if v < -flat]
    if not full:
        raise InputError(path, "has no volume", "export a solid body, not a surface")
    whole = sum(each for each in volumes if each > flat)
    if abs(lost := 1.0 - sum(each.volume() for each in full) / whole) > 1e-4:  # by manifold3d's merging
        notes.append(f"the volume of {path.name} is off by {100.0 * abs(lost):.2g} %: it touches itself along an edge")
    solid = united(full)
    if len(full) > 1:
        lost = 1.0 - solid.volume() / sum(each for each in volumes if each > 0.0)
        more = f" ({100.0 * lost:.2g} % of their volume was counted twice)" if lost > _CHANGED else ""
        notes.append(f"{path.name} consists of {len(full)} bodies; overlapping ones were united{more}")
    return (solid - united(voids) if voids else solid), tuple(notes)


def _volume(vertices: Float, faces: Faces) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.sum(a * cross(b, c))) / 6.0


def _checked(vertices: Float, faces: Faces, path: Path) -> Any:
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3)
    solid = solid_of(vertices[used], faces)
    if solid.status().name != "NoError" or solid.is_empty():
        raise InputError(path, f"is no solid ({solid.status().name})", "repair it where it was drawn")
    lost = 1.0 - solid.volume() / _volume(vertices[used], faces)
    if abs(lost) > _CHANGED:
        off = f"its volume is off by {100.0 * abs(lost):.2g} %"
        what = f"cannot be made a solid: {off} where it touches itself along an edge"
        raise InputError(path, what, "let its bodies overlap or stay apart where it was drawn")
    return solid


def _mm(point: Any) -> str:
    return "(" + ", ".join(f"{1000.0 * float(x):.1f}" for x in point) + ")"
