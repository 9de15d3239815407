"""`free`: empty space, for free motions and controller tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.world import (
    TOOL_COLOUR,
    TOOL_DOWN,
    WRIST_TO_TIP,
    Geom,
    Scene,
    State,
    Task,
    anywhere,
    no_error,
    shaft,
    tool,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeParams:
    """Parameters of `free`.

    Attributes:
        direction: unit vector along which the simulated teacher moves, fixture frame [-1 to 1].
    """

    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)


def build(params: FreeParams) -> Scene:
    """The scene: a tool in empty space, where every pose is a goal."""
    ball = Geom(kind="sphere", size=(0.005,), position=(0.0, 0.0, WRIST_TO_TIP), rgba=TOOL_COLOUR)
    start = (0.0, 0.0, 0.05)

    def travelled(state: State) -> NDArray[np.bool_]:
        far: NDArray[np.bool_] = (state.tip.position - np.array(start)) @ np.array(params.direction) > 0.08
        return far

    return Scene(
        name="free", fixture=(), tool=tool((ball, shaft(0.004, 0.01, WRIST_TO_TIP))), friction=0.2,
        start_tip=start, start_quaternion=TOOL_DOWN, goal=anywhere, goal_error=no_error,
        task=Task(direction=params.direction, hand="sliding", done=travelled),
    )  # fmt: skip
