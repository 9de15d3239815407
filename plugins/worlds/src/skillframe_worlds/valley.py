r"""`valley`: two slopes that meet in a line along y, where a ball slides to the bottom (seed, Fig. 3).

On a slope of angle a with friction mu, a push tilted by t from straight down slides the ball if t < a - atan(mu): the
convergence region of one desired direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.world import (
    FIXTURE_COLOUR,
    TOOL_COLOUR,
    TOOL_DOWN,
    WRIST_TO_TIP,
    Geom,
    Scene,
    State,
    Task,
    require,
    shaft,
    slope,
    tool,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ValleyParams:
    """Parameters of `valley`.

    Attributes:
        slope: angle of both sides from the horizontal [rad, 0.5deg to 80deg].
        friction: Coulomb coefficient [0 to 5].
        radius: of the ball at the tip [m, 0.1mm to 200mm].
        length: of each side along the slope [m, 1mm to 2m].
        tolerance: horizontal distance from the bottom that counts as reached [m, 1um to 100mm].
        wall_distance: distance towards +y to a wall that is the goal [m, 0m to 70mm] (seed, Fig. 17: two phases); 0 for
            no wall and the bottom as the goal.
    """

    slope: float = 0.7853981633974483
    friction: float = 0.2
    radius: float = 0.005
    length: float = 0.12
    tolerance: float = 0.001
    wall_distance: float = 0.0


def build(params: ValleyParams) -> Scene:
    """The scene, with the valley along y through the fixture's origin.

    The goal is a ball at the bottom, between its ends, and with `wall_distance` at the wall.
    """
    require("valley", {"wall_distance < 0.07 m": params.wall_distance < 0.07}, params)
    resting, width = params.radius / np.cos(params.slope), 0.16  # m along the valley
    ball = Geom(kind="sphere", size=(params.radius,), position=(0.0, 0.0, WRIST_TO_TIP), rgba=TOOL_COLOUR)

    def distance(state: State) -> Float:
        result: Float = np.abs(state.tip.position[..., 0])
        return result

    def at_bottom(state: State) -> NDArray[np.bool_]:
        resting_on_both = np.abs(state.tip.position[..., 2] - resting) < 0.002
        between_ends = np.abs(state.tip.position[..., 1]) < 0.5 * width
        reached: NDArray[np.bool_] = (distance(state) < params.tolerance) & resting_on_both & between_ends
        return reached

    def remaining(state: State) -> Float:
        return np.maximum(params.wall_distance - state.tip.position[..., 1], 0.0)

    def at_wall(state: State) -> NDArray[np.bool_]:
        reached: NDArray[np.bool_] = at_bottom(state) & (remaining(state) < params.tolerance)
        return reached

    goal = at_wall if params.wall_distance else at_bottom
    thick = 0.005  # m
    place = (0.0, params.wall_distance + params.radius + thick, 0.03)
    wall = Geom(kind="box", size=(0.03, thick, 0.03), position=place, rgba=FIXTURE_COLOUR)
    walls = (wall,) if params.wall_distance else ()
    slide_along = Task(direction=(0.0, 0.8, -0.6), hand="sliding")
    return Scene(
        name="valley",
        fixture=(*(slope(params.slope, side, params.length, width) for side in (0.0, np.pi)), *walls),
        tool=tool((ball, shaft(0.004, 0.01, WRIST_TO_TIP - params.radius)), hand="grip"),
        friction=params.friction,
        start_tip=(0.0, 0.0, float(resting + 0.004)),
        start_quaternion=TOOL_DOWN,
        start_lift=lambda offset, tilt: np.abs(offset[..., 0]) * np.tan(params.slope),
        goal=goal,
        goal_error=lambda state: (
            distance(state) + (remaining(state) if params.wall_distance else 0.0), np.zeros(len(state.tip.position))
        ),
        task=Task(
            direction=(0.0, 0.0, -1.0), hand="sliding",
            starts=({"start.offset_x": 0.04}, {"start.offset_x": -0.04}),
            done=at_bottom if params.wall_distance else None, then=(slide_along,) if params.wall_distance else (),
        ),
        analytic={"largest_tilt_rad": float(params.slope - np.arctan(params.friction))},
    )  # fmt: skip
