"""Renderer of meshes in numpy: z-buffer, two lights, dark outlines.

Triangles are filled where three edge functions are positive (Pineda 1988), with depth and brightness from the same
barycentric weights (perspective correction is negligible here). Outlines mark changes of body or depth between pixels.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, cross, unit
from skillframe_reports.shapes import Mesh
from skillframe_reports.stage import Camera

Image = NDArray[np.uint8]
PAPER = (250, 250, 251)
OVERSAMPLE = 2
NEAR = 1e-3


class Canvas(NamedTuple):
    """Depth (h, w), colour (h, w, 3) and body number (h, w), on an oversampled grid."""

    depth: Float
    color: Float
    owner: NDArray[np.int64]

    def copy(self) -> Canvas:
        """Return a copy, to draw on over the same background."""
        return Canvas(self.depth.copy(), self.color.copy(), self.owner.copy())


def draw(meshes: Sequence[Mesh], camera: Camera, width: int, height: int) -> Image:
    """Return a picture (height, width, 4) of meshes in base with outlines, transparent elsewhere."""
    return picture(paint(blank(width, height), dict(enumerate(meshes)), camera))


def blank(width: int, height: int) -> Canvas:
    """Return an empty canvas for a picture of that size."""
    w, h = OVERSAMPLE * width, OVERSAMPLE * height
    return Canvas(np.full((h, w), np.inf), np.zeros((h, w, 3)), np.full((h, w), -1))


def paint(canvas: Canvas, meshes: Mapping[int, Mesh], camera: Camera) -> Canvas:
    """Draw meshes, by number, onto a canvas in place, and return it."""
    light, (height, width) = unit(np.array([0.35, -0.55, 0.76])), canvas.depth.shape
    for index, mesh in meshes.items():
        p = project(mesh.vertices, camera, width, height)[mesh.faces]
        shade = 0.60 + 0.34 * np.clip(mesh.normals @ light, 0.0, 1.0) + 0.10 * mesh.normals[:, 2]
        colors = (mesh.colors[:, :3] * shade[:, None])[mesh.faces]
        (ax, ay), (bx, by), (cx, cy) = (p[:, i, :2].T for i in range(3))
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        low = np.clip(np.floor(p[:, :, :2].min(axis=1)), 0, [width, height]).astype(np.int64)
        high = np.clip(np.ceil(p[:, :, :2].max(axis=1)) + 1, 0, [width, height]).astype(np.int64)
        front = (area < -1e-9) & (p[:, :, 2].min(axis=1) > NEAR)  # pixels count downwards, which reverses the sign
        for face in np.flatnonzero(front & (low < high).all(axis=1)):
            (x0, y0), (x1, y1) = low[face], high[face]
            _fill_triangle(p[face], colors[face], (slice(y0, y1), slice(x0, x1)), index, canvas)
    return canvas


def picture(canvas: Canvas) -> Image:
    """Return the picture (height, width, 4) of an unchanged canvas, with outlines."""
    edge = _outline(canvas.depth, canvas.owner)
    color = canvas.color.copy()
    color[edge] = (0.13, 0.17, 0.22)  # ink
    solid = edge | (canvas.owner >= 0)
    places = [(slice(i, None, OVERSAMPLE), slice(j, None, OVERSAMPLE)) for i, j in np.ndindex(OVERSAMPLE, OVERSAMPLE)]
    count = np.sum([solid[place] for place in places], axis=0)
    result: Image = np.empty((*count.shape, 4), dtype=np.uint8)
    mixed = sum(color[place] for place in places) * (255.0 / np.maximum(count, 1))[..., None]
    result[..., :3] = np.round(np.minimum(mixed, 255.0))
    result[..., 3] = np.round(255.0 / OVERSAMPLE**2 * count)
    return result


def view_axes(camera: Camera) -> Float:
    """Return the camera's rows right, up, backward (3, 3) in base."""
    backward = camera.backward
    right = unit(cross(np.array([0.0, 0.0, 1.0]), backward))
    return np.stack([right, cross(backward, right), backward])


def project(points: Float, camera: Camera, width: int, height: int) -> Float:
    """Return pixel coordinates and depth (V, 3) of points (V, 3)."""
    local = (points - camera.eye) @ view_axes(camera).T
    distance = np.maximum(-local[:, 2], NEAR)
    scale = 0.5 * height / np.tan(0.5 * camera.field_of_view)
    x = 0.5 * width + scale * local[:, 0] / distance
    return np.stack([x, 0.5 * height - scale * local[:, 1] / distance, distance], axis=-1)


def _fill_triangle(p: Float, colors: Float, window: tuple[slice, slice], index: int, canvas: Canvas) -> None:
    rows, columns = window
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = p.tolist()
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    x, y = np.arange(columns.start, columns.stop)[None] + 0.5, np.arange(rows.start, rows.stop)[:, None] + 0.5
    a = ((x2 - x1) * (y - y1) - (y2 - y1) * (x - x1)) / area
    b = ((x0 - x2) * (y - y2) - (y0 - y2) * (x - x2)) / area
    c = 1.0 - a - b
    z = a * z0 + b * z1 + c * z2
    seen = (a >= 0.0) & (b >= 0.0) & (c >= 0.0) & (z < canvas.depth[window])
    weight = np.stack([a[seen], b[seen], c[seen]], axis=1)
    canvas.depth[window][seen] = z[seen]
    canvas.owner[window][seen] = index
    canvas.color[window][seen] = weight @ colors


def _outline(depth: Float, owner: NDArray[np.int64]) -> NDArray[np.bool_]:
    edge = np.zeros(depth.shape, dtype=bool)
    flat = np.where(np.isfinite(depth), depth, 1e3)
    whole = slice(None)
    for axis, first, second in (
        (0, (slice(None, -1), whole), (slice(1, None), whole)), (1, (whole, slice(None, -1)), (whole, slice(1, None))),
    ):  # fmt: skip
        jump = np.abs(np.diff(flat, axis=axis)) > 0.02 * np.minimum(flat[first], flat[second])
        change = (np.diff(owner, axis=axis) != 0) | jump
        edge[first] |= change
        edge[second] |= change
    return edge


def over_paper(image: Image) -> Image:
    """Return a picture (H, W, 3) on paper from one (H, W, 4) with transparency."""
    opacity = image[..., 3:] / 255.0
    result: Image = np.round(image[..., :3] * opacity + np.array(PAPER) * (1.0 - opacity)).astype(np.uint8)
    return result


def png(image: Image) -> bytes:
    """Return an image (H, W, 4) as PNG: 8-bit RGBA, row filter 2."""
    height, width, _ = image.shape
    rows = image.astype(np.int16).reshape(height, -1)
    rows[1:] = np.diff(image.astype(np.int16).reshape(height, -1), axis=0)
    raw = np.concatenate([np.full((height, 1), 2, dtype=np.uint8), (rows % 256).astype(np.uint8)], axis=1).tobytes()
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(raw, 9)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        (struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)))
        for name, data in chunks
    )
