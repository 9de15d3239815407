"""Pictures of an environment: the tool over the fixture cut open, by the run page's renderer.

The robot's links and moving fixture parts are not drawn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from skillframe_reports.scene_picture import View

from skillframe.execution import geom_json
from skillframe.frames import Pose
from skillframe.world import Scene

WIDTH, HEIGHT = 320, 240
"""Pixels."""


class Camera:
    """Pictures of a scene from one place.

    Args:
        scene: what is drawn.
        tip: pose of the tool's tip in the fixture frame that the picture is fitted to.
    """

    def __init__(self, scene: Scene, tip: Pose) -> None:
        self._back = -np.array(scene.tool.frames["tip"])
        sprung = (geom for part in scene.sprung for geom in part.geoms)
        shown = ((*scene.fixture, *sprung), scene.tool.geoms)
        fixture, tool = ([geom_json(geom) for geom in geoms if geom.visible] for geoms in shown)
        self._view = View(fixture, tool, tip.at(self._back))

    def picture(self, tip: Pose) -> NDArray[np.uint8]:
        """(240, 320, 3), red, green and blue."""
        return self._view.image(tip.at(self._back), WIDTH, HEIGHT)
