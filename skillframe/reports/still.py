"""A picture of a scene that no run is needed for: the tool at its start over the fixture, cut open along y = 0.

Pieces are cut one by one, which is right for convex ones (`shapes.section`). The renderer is the page's own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skillframe.frames import Pose, norm, quaternion_from_matrix
from skillframe.reports.raster import draw, over_paper, png
from skillframe.reports.shapes import Mesh, merge, mesh_of, section
from skillframe.reports.stage import CLOSE, Camera, fitted

WIDTH, HEIGHT = 640, 480
_AHEAD = np.array([0.0, -1.0, 0.0])
Geoms = Sequence[Mapping[str, Any]]


def scene_picture(fixture: Geoms, tool: Geoms, place: Pose) -> bytes:
    """A PNG of a scene.

    Args:
        fixture: geoms in the fixture frame, as plain values.
        tool: geoms in the tool frame, likewise.
        place: of the tool frame in the fixture frame.
    """
    still = [section(mesh, np.zeros(3), _AHEAD) for mesh in _meshes(fixture)]
    turn = quaternion_from_matrix(place.rotation)
    held = [mesh.placed(place.position, turn) for mesh in _meshes(tool)]
    shown = [merge(part) for part in (still, held) if part]
    points = np.concatenate([np.zeros((1, 3)), *(mesh.vertices for mesh in shown)])
    view = fitted(points[norm(points) < CLOSE], Camera(np.zeros(3), 1.0))
    image = over_paper(draw(shown, view, WIDTH, HEIGHT))
    return png(np.concatenate([image, np.full((HEIGHT, WIDTH, 1), 255, np.uint8)], axis=-1))


def _meshes(geoms: Geoms) -> list[Mesh]:
    return [mesh for geom in geoms if len((mesh := mesh_of(geom)).faces)]
