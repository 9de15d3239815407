"""Where a URDF's meshes lie, and how far they reach.

`package://NAME/REST` and `model://NAME/REST` are looked for as NAME/REST under every folder of `SKILLFRAME_PATH` and
`ROS_PACKAGE_PATH`, under `share` of every folder of `AMENT_PREFIX_PATH`, and every folder above the URDF; a folder that
is itself called NAME counts as the package. Other names are relative to the URDF. Only STL and OBJ are
measured, and no file beyond `LARGEST_FILE`.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

LARGEST_FILE = 100_000_000  # bytes: two million triangles, read in seconds; a link needs no more than some thousand


def resolve_mesh(uri: str, urdf: Path) -> Path | None:
    """The file that a mesh's `filename` means, or None where there is none."""
    scheme, separator, rest = uri.partition("://")
    if not separator:
        candidates: Iterator[Path] = iter([urdf.parent / uri])
    elif scheme == "file":
        candidates = iter([Path(unquote(rest))])
    elif scheme in ("package", "model"):
        package, _, inside = rest.partition("/")
        candidates = _in_package(package, inside, urdf)
    else:
        return None
    return next((path for path in candidates if _is_file(path)), None)


def mesh_names(urdf: Path) -> list[str]:
    """What the meshes of a URDF are called, each once. None where it is no XML, which its reader says."""
    try:
        root = ET.parse(urdf).getroot()
    except ET.ParseError:
        return []
    return sorted({mesh.get("filename", "") for mesh in root.iter("mesh")})


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a zero byte
        return False


def _in_package(package: str, inside: str, urdf: Path) -> Iterator[Path]:
    for folder in _package_roots(urdf):
        yield folder / package / inside
        if folder.name == package:
            yield folder / inside


def _package_roots(urdf: Path) -> Iterator[Path]:
    for variable, below in (("SKILLFRAME_PATH", ""), ("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        for folder in os.environ.get(variable, "").split(os.pathsep):
            if folder:
                yield Path(folder) / below
    yield from urdf.resolve().parents


def mesh_vertices(path: Path) -> Float | None:
    """Vertices (V, 3) of an STL or OBJ mesh, or None where it is of another kind or cannot be read."""
    readers = {".stl": _stl_vertices, ".obj": _obj_vertices}
    reader = readers.get(path.suffix.lower())
    try:
        vertices = reader(path.read_bytes()) if reader and path.stat().st_size <= LARGEST_FILE else None
    except (OSError, ValueError):
        return None
    usable = vertices is not None and vertices.size > 0 and bool(np.isfinite(vertices).all())
    return vertices if usable else None


def mesh_triangles(path: Path) -> Float | None:
    """Corners (T, 3, 3) of the triangles of an STL or OBJ mesh, or None as `mesh_vertices`."""
    vertices = mesh_vertices(path)
    if vertices is None:
        return None
    if path.suffix.lower() == ".stl":
        return vertices[: len(vertices) // 3 * 3].reshape(-1, 3, 3)
    try:
        faces = _obj_faces(path.read_bytes(), len(vertices))
    except (OSError, ValueError):
        return None
    return vertices[faces] if len(faces) else None


def _obj_faces(content: bytes, count: int) -> NDArray[np.int64]:
    """Triangles (T, 3) of polygons `f a/.. b/.. c/..`, counted from 1, or from the end where negative."""
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
    """Binary STL holds 50 bytes a triangle after 84 bytes of header. Anything else is its text form."""
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
