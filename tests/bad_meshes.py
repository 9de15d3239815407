"""Meshes as programs, people and disks spoil them, written byte by byte where the fault is in the bytes."""

import json
import struct

import numpy as np
from skillframe_parts.solid import arrays_of

from tests.part_meshes import box, round_pair

CUBE = box((0, 0, 0), (10, 10, 10))
HEADER = b"solid? no, binary".ljust(80, b" ")


def cube():
    vertices, faces = arrays_of(CUBE)
    return vertices.copy(), faces.copy()


def binary_stl(vertices, faces, count=None):
    """A binary STL, which says that it holds `count` triangles."""
    record = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    record["corners"] = np.asarray(vertices, dtype=float)[np.asarray(faces, dtype=int)]
    return HEADER + struct.pack("<I", len(faces) if count is None else count) + record.tobytes()


def ascii_stl(vertices, faces):
    """An STL in words."""
    rows = ["solid part"]
    for face in faces:
        rows += ["facet normal 0 0 0", "outer loop"]
        rows += ["vertex " + " ".join(f"{float(x):g}" for x in vertices[i]) for i in face]
        rows += ["endloop", "endfacet"]
    return "\n".join([*rows, "endsolid part", ""])


def obj(vertices, faces, shift=1):
    """An OBJ of faces of any number of corners."""
    lines = ["v " + " ".join(f"{float(x):g}" for x in row) for row in vertices]
    return "\n".join([*lines, *("f " + " ".join(str(int(i) + shift) for i in face) for face in faces), ""])


def ply(vertices, faces, head="format ascii 1.0", count=None, end="end_header\n"):
    """A PLY in words."""
    lines = [" ".join(f"{float(x):g}" for x in row) for row in vertices]
    lines += [" ".join(map(str, [len(face), *face])) for face in faces]
    return (
        f"ply\n{head}\nelement vertex {len(vertices) if count is None else count}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\n{end}"
        + "\n".join([*lines, ""])
    )


def off(vertices, faces, counts=None):
    lines = [" ".join(f"{float(x):g}" for x in row) for row in vertices]
    lines += [" ".join(map(str, [len(face), *face])) for face in faces]
    return "\n".join(["OFF", counts or f"{len(vertices)} {len(faces)} 0", *lines, ""])


def glb(document, data=b"", magic=b"glTF", length=None):
    """A GLB of a JSON document and one buffer."""
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return magic + struct.pack("<II", 2, 12 + len(body) if length is None else length) + body


def scene(vertices, faces, count=None, **more):
    """A GLB's document and buffer of one mesh in metres."""
    points, numbers = np.asarray(vertices, dtype="<f4").tobytes(), np.asarray(faces, dtype="<u4").tobytes()
    low, high = (np.asarray(vertices, dtype=float).min(0).tolist(), np.asarray(vertices, dtype=float).max(0).tolist())
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5125, "count": count or 3 * len(faces), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(numbers)},
        ],
        "buffers": [{"byteLength": len(points) + len(numbers)}],
    }  # fmt: skip
    return {**document, **more}, points + numbers


def plug():
    """The sound plug of these cases."""
    return tuple(a.copy() for a in arrays_of(round_pair()[0]))


def pin(half=3.5):
    """Corners of a square pin that goes 12 mm deep into the round hole."""
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    return np.array([(x, y, z) for z in (-12, 8) for x, y in corners], dtype=float)


def quads():
    """The faces of a pin."""
    return [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


def joined(*solids):
    """Vertices and triangles of several bodies in one mesh."""
    vertices, faces, count = [], [], 0
    for solid in solids:
        v, f = arrays_of(solid) if not isinstance(solid, tuple) else solid
        vertices.append(v)
        faces.append(np.asarray(f) + count)
        count += len(v)
    return np.concatenate(vertices), np.concatenate(faces)
