"""`corner`: a box set down on a table and pushed into the corner of two walls (seed, Fig. 2b)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world import FIXTURE_COLOUR, TOOL_COLOUR, TOOL_DOWN, Geom, Scene, State, Task, require, shaft, tool


@dataclass(frozen=True, slots=True, kw_only=True)
class CornerParams:
    """Parameters of `corner`.

    Attributes:
        size: length of the box's edges [m, 10mm to 100mm].
        friction: Coulomb coefficient [0 to 5].
        away: nominal distance of the box from both walls [m, 0.1mm to 100mm].
        above: nominal height of the box over the table [m, 0.1mm to 100mm].
        tolerance: distance from walls and table that counts as reached [m, 1um to 100mm].
    """

    size: float = 0.05
    friction: float = 0.2
    away: float = 0.05
    above: float = 0.03
    tolerance: float = 0.0015


def build(params: CornerParams) -> Scene:
    """The scene. In the corner the box's lower middle is at the origin, on the table's top."""
    require("corner", {}, params)
    half, tip_at, wall, reach, height = 0.5 * params.size, 0.12, 0.01, 0.12, 0.04  # m
    box = Geom(kind="box", size=(half, half, half), position=(0.0, 0.0, tip_at - half), rgba=TOOL_COLOUR)
    sizes = ((reach, reach, 0.02), (wall, reach, height), (reach, wall, height))  # of a table and two walls
    places = ((-0.05, -0.05, -0.02), (half + wall, -0.05, height - 0.02), (-0.05, half + wall, height - 0.02))

    def distance(state: State) -> Float:
        return norm(state.tip.position)

    def on_table(state: State) -> NDArray[np.bool_]:
        down: NDArray[np.bool_] = state.tip.position[..., 2] < params.tolerance
        return down

    def in_corner(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = np.all(np.abs(state.tip.position) < params.tolerance, axis=-1)
        return there

    push = Task(direction=(0.6, 0.6, -0.5291502622129182), hand="sliding")
    return Scene(
        name="corner",
        fixture=tuple(
            Geom(kind="box", size=size, position=place, rgba=FIXTURE_COLOUR)
            for size, place in zip(sizes, places, strict=True)
        ),
        tool=tool((box, shaft(0.008, 0.01, tip_at - params.size)), tip=tip_at, hand="grip"),
        friction=params.friction,
        start_tip=(-params.away, -params.away, params.above),
        start_quaternion=TOOL_DOWN,
        start_lift=lambda offset, tilt: params.size * np.abs(np.sin(norm(tilt))),
        goal=in_corner,
        goal_error=lambda state: (distance(state), np.zeros(len(state.tip.position))),
        task=Task(
            direction=(0.0, 0.0, -1.0), hand="sliding", done=on_table, then=(push,),
            starts=({"start.offset_x": 0.025}, {"start.offset_y": 0.025}),
        ),
    )  # fmt: skip
