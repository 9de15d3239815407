"""`edge`: a rod levered on a table's edge (seed, Fig. 7), whose contact moves the wrist."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.world import (
    FIXTURE_COLOUR,
    FLOOR,
    TOOL_COLOUR,
    WRIST_TO_TIP,
    Geom,
    Scene,
    State,
    Task,
    quaternion_about,
    require,
    tool,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeParams:
    """Parameters of `edge`.

    Attributes:
        friction: Coulomb coefficient [0 to 5].
        radius: of the rod [m, 0.1mm to 200mm].
        tilt: of the rod at the start, tip up from the horizontal [rad, 0.2 to 1.3].
        lever: distance along the rod from the wrist to the point on the edge [m, 30mm to 180mm].
    """

    friction: float = 0.2
    radius: float = 0.008
    tilt: float = 0.7853981633974483
    lever: float = 0.11


def build(params: EdgeParams) -> Scene:
    """The scene. The table fills x < 0, z < 0, its edge is the y axis, and the wrist is below at x > 0.

    The goal is a rod within 10 degrees of level that crosses the edge between wrist and tip and within the table's
    width, and touches it to `FLOOR`.
    """
    require("edge", {}, params)
    half = 0.1  # of the table's length and width [m]
    table = Geom(kind="box", size=(half, half, 0.02), position=(-half, 0.0, -0.02), rgba=FIXTURE_COLOUR)
    rod = Geom(
        kind="capsule", size=(params.radius, 0.5 * WRIST_TO_TIP - 0.5 * params.radius), rgba=TOOL_COLOUR,
        position=(0.0, 0.0, 0.5 * WRIST_TO_TIP - 0.5 * params.radius),
    )  # fmt: skip
    along = np.array([-np.cos(params.tilt), 0.0, np.sin(params.tilt)])  # from wrist to tip
    up = np.array([np.sin(params.tilt), 0.0, np.cos(params.tilt)])
    tip = (WRIST_TO_TIP - params.lever) * along + (params.radius + 0.0005) * up

    def level(state: State) -> Float:
        return np.arcsin(np.clip(state.tip.rotation[..., 2, 2], -1.0, 1.0))

    def on_edge(state: State) -> NDArray[np.bool_]:
        end, along = state.tip.position, state.tip.rotation[..., :, 2]
        wrist = end - WRIST_TO_TIP * along
        across = (end[..., 0] < 0.0) & (wrist[..., 0] > 0.0)
        share = np.where(across, end[..., 0], 0.0) / np.where(across, end[..., 0] - wrist[..., 0], 1.0)
        crossing = end + share[..., None] * (wrist - end)  # where the rod's axis is above the edge
        steep = np.hypot(along[..., 0], along[..., 2])
        gap = crossing[..., 2] * np.abs(along[..., 0]) / np.where(across, steep, 1.0) - params.radius
        lies: NDArray[np.bool_] = across & (np.abs(gap) < FLOOR) & (np.abs(crossing[..., 1]) < half)
        return lies

    return Scene(
        name="edge", fixture=(table,), tool=tool((rod,)), friction=params.friction,
        start_tip=(float(tip[0]), 0.0, float(tip[2])),
        start_quaternion=quaternion_about("y", params.tilt - 0.5 * np.pi),
        goal=lambda state: (np.abs(level(state)) < np.deg2rad(10.0)) & on_edge(state),
        goal_error=lambda state: (np.zeros(len(state.tip.position)), np.abs(level(state))),
        task=Task(direction=None, turn=(0.0, -1.0, 0.0), hand="lever"),
    )  # fmt: skip
