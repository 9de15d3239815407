"""A picture of a scene before anything runs in it."""

from __future__ import annotations

import numpy as np

from skillframe.frames import Pose, matrix_from_quaternion
from skillframe.reports.still import scene_picture
from skillframe.world.drawing import geom_json
from skillframe.world.scene import Scene


def picture_of(scene: Scene) -> bytes:
    """A PNG of a scene cut open, with its tool where runs start."""
    tip = Pose(np.array(scene.start_tip), matrix_from_quaternion(scene.start_quaternion))
    sprung = (geom for part in scene.sprung for geom in part.geoms)
    fixture, tool = (
        [geom_json(geom) for geom in geoms if geom.visible] for geoms in ((*scene.fixture, *sprung), scene.tool.geoms)
    )
    return scene_picture(fixture, tool, tip.at(-np.array(scene.tool.frames["tip"])))
