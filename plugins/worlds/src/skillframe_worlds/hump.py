r"""`hump`: a ball slides along a floor, over a ramp and into a pocket with an end stop.

For a ramp of slope r and friction mu = tan(phi), the pushes that pass have an angle D below the floor with

    phi < D < 90 degrees - phi - r.

Every mean of the motions is before this set and every mean of the contact forces after it (planar, Coulomb,
quasi-static). A lower ramp before the first (`steps`) and a turned ramp with a wall (`skew`) each add a contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan, cos, pi, sin, tan

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm, unit
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
from skillframe_worlds.turned import as_vector, turned


@dataclass(frozen=True, slots=True, kw_only=True)
class HumpParams:
    """Parameters of `hump`.

    Attributes:
        slope: angle r of the ramp from the floor [rad, 0.5deg to 80deg].
        height: of the ramp, from its own foot [m, 1mm to 100mm].
        steps: angle of a lower ramp before it [rad, 0deg to 60deg]; 0 for none.
        skew: rotation of the ramp about the floor's normal [rad, 0deg to 40deg]; above 0 there is a wall.
        friction: Coulomb coefficient [0 to 5].
        radius: of the ball at the tip [m, 0.1mm to 200mm].
        tolerance: distance from the stop that counts as reached [m, 1um to 100mm].
        turn: rotation vector of the whole fixture [rad, -180deg to 180deg].
    """

    slope: float = 0.9250245035569946
    height: float = 0.008
    steps: float = 0.0
    skew: float = 0.0
    friction: float = 0.1
    radius: float = 0.005
    tolerance: float = 0.002
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)


def build(params: HumpParams) -> Scene:
    """The scene. The foot of the first ramp is the origin, the floor z = 0, the ball comes along x."""
    half_width = 0.25 * pi - 0.5 * params.slope - atan(params.friction)
    require("hump", {"slope < 90 degrees - 2 atan(friction)": half_width > 0.0}, params)
    width, thick, lower = 0.16, 0.02, 0.022  # m; `lower` is the length of the lower ramp along its slope
    wall = -params.radius - 0.002  # m from ball to wall at the start
    x, z = (lower * cos(params.steps), lower * sin(params.steps)) if params.steps else (0.0, 0.0)  # the ramp's foot
    top, play, sideways = z + params.height, 0.004, width * tan(params.skew) * 0.1  # m of play in the pocket
    stop = x + params.height / tan(params.slope) + top * tan(params.slope) + 2.0 * params.radius + play + sideways
    ramp = slope(params.slope, params.skew, params.height / sin(params.slope), width, top / cos(params.slope))
    a, b, c = ramp.position
    fixture = [
        _box((0.12, 0.5 * width, 0.5 * thick), (0.0, 0.0, -0.5 * thick)),
        replace(ramp, position=(a + x, b, c + z)),
        _box((0.5 * thick, 0.5 * width, 0.03), (stop + 0.5 * thick, 0.0, 0.03)),
    ]
    if params.steps:
        fixture.append(slope(params.steps, 0.0, lower, width))
    if params.skew:
        fixture.append(_box((0.12, 0.5 * thick, 0.03), (0.0, wall - 0.5 * thick, 0.03)))
    below = 0.25 * pi - 0.5 * params.slope  # the middle of the passing pushes, leaning on a wall
    push = unit(np.array([cos(below), -0.15 if params.skew else 0.0, -sin(below)]))

    def distance(state: State) -> Float:
        x, y, z = np.moveaxis(state.tip.position, -1, 0)
        aside = y - wall - params.radius if params.skew else np.zeros_like(y)
        return norm(np.stack([stop - params.radius - x, aside, z - params.radius], axis=-1))

    def in_pocket(state: State) -> NDArray[np.bool_]:
        x, y, z = np.moveaxis(state.tip.position, -1, 0)
        there = (stop - params.radius - x < params.tolerance) & (z - params.radius < 0.75 * params.tolerance)
        if params.skew:
            there &= y - wall - params.radius < params.tolerance
        result: NDArray[np.bool_] = there
        return result

    ball = Geom(kind="sphere", size=(params.radius,), position=(0.0, 0.0, WRIST_TO_TIP), rgba=TOOL_COLOUR)
    return turned(
        Scene(
            name="hump",
            fixture=tuple(fixture),
            tool=tool((ball, shaft(0.004, 0.01, WRIST_TO_TIP - params.radius)), hand="grip"),
            friction=params.friction,
            start_tip=(-0.03, 0.0, params.radius + 0.002),
            start_quaternion=TOOL_DOWN,
            goal=in_pocket,
            goal_error=lambda state: (distance(state), np.zeros(len(state.tip.position))),
            task=Task(
                direction=as_vector(push), hand="sliding",
                starts=tuple({"start.offset_x": 0.03 - before} for before in (0.055, 0.012, 0.040, 0.030)),
            ),
            analytic={"push_half_width_rad": half_width},
        ),
        params.turn,
    )  # fmt: skip


def _box(size: tuple[float, float, float], position: tuple[float, float, float]) -> Geom:
    return Geom(kind="box", size=size, position=position, rgba=FIXTURE_COLOUR)
