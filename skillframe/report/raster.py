"""A picture of meshes without any graphics library: z-buffer, two lights, dark outlines; numpy only.

Each triangle is filled where its three edge functions are positive (Pineda 1988), depth and brightness interpolated by
the same barycentric weights (1/z-linear depth is not needed at these angles of view). Outlines are drawn where the body
or the depth changes between neighbouring pixels, so that the picture reads like a technical drawing.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, unit
from skillframe.report.shapes import Mesh
from skillframe.report.stage import Camera

Image = NDArray[np.uint8]
INK = np.array([0.13, 0.17, 0.22])
KEY_LIGHT = np.array([0.35, -0.55, 0.76])
OVERSAMPLE = 2
NEAR = 1e-3


def draw(meshes: Sequence[Mesh], camera: Camera, width: int, height: int) -> Image:
    """A picture (height, width, 4) of meshes in base; clear where nothing is, every mesh with its outline."""
    w, h = OVERSAMPLE * width, OVERSAMPLE * height
    depth = np.full((h, w), np.inf)
    color = np.zeros((h, w, 3))
    owner = np.full((h, w), -1)
    for index, mesh in enumerate(meshes):
        _fill(mesh, index, camera, depth, color, owner)
    edge = _outline(depth, owner)
    color[edge] = INK
    return _reduced(color, (edge | (owner >= 0)).astype(float), height, width)


def _reduced(color: Float, solid: Float, height: int, width: int) -> Image:
    """Colour and opacity averaged over the finer grid; colour counts where something is."""
    blocks = (height, OVERSAMPLE, width, OVERSAMPLE, 1)
    weight = solid.reshape(blocks).mean(axis=(1, 3))
    mixed = (color * solid[..., None]).reshape(*blocks[:4], 3).mean(axis=(1, 3)) / np.where(weight > 0.0, weight, 1.0)
    result: Image = np.round(255.0 * np.clip(np.concatenate([mixed, weight], axis=-1), 0.0, 1.0)).astype(np.uint8)
    return result


def view_axes(camera: Camera) -> Float:
    """Rows right, up, backward (3, 3) of the camera in base."""
    backward = camera.backward
    right = unit(cross(np.array([0.0, 0.0, 1.0]), backward))
    return np.stack([right, cross(backward, right), backward])


def project(points: Float, camera: Camera, width: int, height: int) -> Float:
    """Pixel coordinates and distance before the eye (V, 3) of points (V, 3)."""
    local = (points - camera.eye) @ view_axes(camera).T
    distance = np.maximum(-local[:, 2], NEAR)
    scale = 0.5 * height / np.tan(0.5 * camera.field_of_view)
    x = 0.5 * width + scale * local[:, 0] / distance
    return np.stack([x, 0.5 * height - scale * local[:, 1] / distance, distance], axis=-1)


def _fill(mesh: Mesh, index: int, camera: Camera, depth: Float, color: Float, owner: NDArray[np.int64]) -> None:
    if not len(mesh.faces):
        return
    height, width = depth.shape
    points = project(mesh.vertices, camera, width, height)
    light = unit(KEY_LIGHT)
    shade = 0.60 + 0.34 * np.clip(mesh.normals @ light, 0.0, 1.0) + 0.10 * mesh.normals[:, 2]
    paint = mesh.colors[:, :3] * shade[:, None]
    for face in mesh.faces:
        _fill_triangle(points[face], paint[face], index, depth, color, owner)


def _fill_triangle(p: Float, paint: Float, index: int, depth: Float, color: Float, owner: NDArray[np.int64]) -> None:
    area = (p[1, 0] - p[0, 0]) * (p[2, 1] - p[0, 1]) - (p[2, 0] - p[0, 0]) * (p[1, 1] - p[0, 1])
    if area >= -1e-9 or p[:, 2].min() <= NEAR:  # seen from behind (pixels count downwards), or behind the eye
        return
    height, width = depth.shape
    x0, x1 = max(int(np.floor(p[:, 0].min())), 0), min(int(np.ceil(p[:, 0].max())) + 1, width)
    y0, y1 = max(int(np.floor(p[:, 1].min())), 0), min(int(np.ceil(p[:, 1].max())) + 1, height)
    if x0 >= x1 or y0 >= y1:
        return
    x, y = np.arange(x0, x1)[None] + 0.5, np.arange(y0, y1)[:, None] + 0.5
    a = ((p[2, 0] - p[1, 0]) * (y - p[1, 1]) - (p[2, 1] - p[1, 1]) * (x - p[1, 0])) / area
    b = ((p[0, 0] - p[2, 0]) * (y - p[2, 1]) - (p[0, 1] - p[2, 1]) * (x - p[2, 0])) / area
    c = 1.0 - a - b
    z = a * p[0, 2] + b * p[1, 2] + c * p[2, 2]
    window = (slice(y0, y1), slice(x0, x1))
    seen = (a >= 0.0) & (b >= 0.0) & (c >= 0.0) & (z < depth[window])
    depth[window][seen] = z[seen]
    owner[window][seen] = index
    color[window][seen] = (a[..., None] * paint[0] + b[..., None] * paint[1] + c[..., None] * paint[2])[seen]


def _outline(depth: Float, owner: NDArray[np.int64]) -> NDArray[np.bool_]:
    edge = np.zeros(depth.shape, dtype=bool)
    flat = np.where(np.isfinite(depth), depth, 1e3)
    for axis in (0, 1):
        jump = np.abs(np.diff(flat, axis=axis)) > 0.02 * np.minimum(*_sides(flat, axis))
        change = (np.diff(owner, axis=axis) != 0) | jump
        first, second = _windows(axis)
        edge[first] |= change
        edge[second] |= change
    return edge


def _windows(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    whole = slice(None)
    return (
        ((slice(None, -1), whole), (slice(1, None), whole))
        if axis == 0
        else ((whole, slice(None, -1)), (whole, slice(1, None)))
    )


def _sides(values: Float, axis: int) -> tuple[Float, Float]:
    first, second = _windows(axis)
    return values[first], values[second]


def png(image: Image) -> bytes:
    """An image (H, W, 4) as a PNG file: 8-bit RGBA, each row as its difference to the row above (filter 2)."""
    height, width, _ = image.shape
    rows = image.astype(np.int16).reshape(height, -1)
    rows[1:] = np.diff(image.astype(np.int16).reshape(height, -1), axis=0)
    raw = np.concatenate([np.full((height, 1), 2, dtype=np.uint8), (rows % 256).astype(np.uint8)], axis=1).tobytes()
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(raw, 9)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(name, data) for name, data in chunks)


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
