"""`funnel`: slopes around a point, where a ball slides to the middle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skillframe.frames import Float, norm
from skillframe.world import TOOL_COLOUR, TOOL_DOWN, WRIST_TO_TIP, Geom, Scene, State, Task, require, shaft, slope, tool


@dataclass(frozen=True, slots=True, kw_only=True)
class FunnelParams:
    """Parameters of `funnel`.

    Attributes:
        slope: angle of the faces from the horizontal [rad, 0.5deg to 80deg].
        faces: number of plane faces around the vertical [3 to 16].
        friction: Coulomb coefficient [0 to 5].
        radius: of the ball at the tip [m, 0.1mm to 200mm].
        length: of each face along the slope [m, 1mm to 2m].
        tolerance: horizontal distance from the middle that counts as reached [m, 1um to 100mm].
    """

    slope: float = 0.7853981633974483
    faces: int = 4
    friction: float = 0.2
    radius: float = 0.005
    length: float = 0.1
    tolerance: float = 0.001


def build(params: FunnelParams) -> Scene:
    """The scene, with the deepest point at the fixture's origin."""
    require("funnel", {}, params)
    resting = params.radius / np.cos(params.slope)
    width = 2.0 * params.length * np.cos(params.slope) * np.tan(np.pi / params.faces)
    azimuths = 2.0 * np.pi * np.arange(params.faces) / params.faces
    ball = Geom(kind="sphere", size=(params.radius,), position=(0.0, 0.0, WRIST_TO_TIP), rgba=TOOL_COLOUR)

    def distance(state: State) -> Float:
        return norm(state.tip.position[..., :2])

    return Scene(
        name="funnel",
        fixture=tuple(slope(params.slope, float(a), params.length, float(width)) for a in azimuths),
        tool=tool((ball, shaft(0.004, 0.01, WRIST_TO_TIP - params.radius)), hand="grip"),
        friction=params.friction,
        start_tip=(0.0, 0.0, float(resting + 0.004)),
        start_quaternion=TOOL_DOWN,
        start_lift=lambda offset, tilt: norm(offset[..., :2]) * np.tan(params.slope),
        goal=lambda state: (distance(state) < params.tolerance)
        & (np.abs(state.tip.position[..., 2] - resting) < 0.002),
        goal_error=lambda state: (distance(state), np.zeros(len(state.tip.position))),
        task=Task(
            direction=(0.0, 0.0, -1.0), hand="sliding",
            starts=(
                {"start.offset_x": 0.022, "start.offset_y": 0.006},
                {"start.offset_x": -0.006, "start.offset_y": 0.022},
            ),
        ),
        analytic={"largest_tilt_rad": float(params.slope - np.arctan(params.friction))},
    )  # fmt: skip
