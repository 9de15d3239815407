"""Picture of a scene without a run: the tool at its start over the fixture, cut open along y = 0.

Pieces are cut one by one, which is right for convex ones (`shapes.section`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skillframe.frames import Pose, norm, quaternion_from_matrix
from skillframe_reports.raster import Image, draw, over_paper, png
from skillframe_reports.shapes import Mesh, merge, mesh_of, section
from skillframe_reports.stage import CLOSE, Camera, fitted

Geoms = Sequence[Mapping[str, Any]]


def scene_picture(fixture: Geoms, tool: Geoms, place: Pose, reach: float = CLOSE) -> bytes:
    """Return a PNG of a scene.

    Args:
        fixture: geoms in the fixture frame, as plain values.
        tool: geoms in the tool frame, likewise.
        place: of the tool frame in the fixture frame.
        reach: distance from the fixture's origin of what fills the picture [m].
    """
    image = View(fixture, tool, place, reach).image(place, 640, 480)
    return png(np.concatenate([image, np.full((*image.shape[:2], 1), 255, np.uint8)], axis=-1))


class View:
    """A scene cut open, with a fixed camera.

    Args:
        fixture: geoms in the fixture frame, as plain values.
        tool: geoms in the tool frame, likewise.
        first: pose of the tool frame in the fixture frame for which the camera is chosen.
        reach: distance from the fixture's origin of what fills the picture [m].
    """

    def __init__(self, fixture: Geoms, tool: Geoms, first: Pose, reach: float = CLOSE) -> None:
        still = [section(mesh, np.zeros(3), np.array([0.0, -1.0, 0.0])) for mesh in _meshes(fixture)]
        self._still, self._tool = [merge(still)] if still else [], _meshes(tool)
        points = np.concatenate([np.zeros((1, 3)), *(mesh.vertices for mesh in self._shown(first))])
        self._camera = fitted(points[norm(points) < reach], Camera(np.zeros(3), 1.0))

    def image(self, place: Pose, width: int, height: int) -> Image:
        """Return the RGB picture (height, width, 3) with the tool frame at a place in the fixture frame."""
        return over_paper(draw(self._shown(place), self._camera, width, height))

    def _shown(self, place: Pose) -> list[Mesh]:
        turn = quaternion_from_matrix(place.rotation)
        held = [mesh.placed(place.position, turn) for mesh in self._tool]
        return [*self._still, *([merge(held)] if held else [])]


def _meshes(geoms: Geoms) -> list[Mesh]:
    return [mesh for geom in geoms if len((mesh := mesh_of(geom)).faces)]
