r"""`hump`: a ball slides along a floor, over a ramp and into a pocket with an end stop behind it.

Floor and ramp face the same way, so the pushes that pass both lie between the *last* direction of motion and the
*first* push edge. For a ramp of slope r, friction mu = tan(phi) and a stop down which the ball must slide they are the
pushes whose angle D below the floor obeys

    phi < D < 90 degrees - phi - r.

Every mean of the motions lies before this set and every mean of the contact forces after it, whatever the weights (our
derivation: planar, Coulomb, quasi-static). A lower ramp before the first (`steps`) and a ramp that is turned about the
vertical, with a wall to lean on (`skew`), are the same task with one more contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan, cos, pi, sin, tan

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm, unit
from skillframe.world.scene import Geom, Scene, State, Task
from skillframe.world.shapes import FIXTURE_COLOUR, TOOL_COLOUR, shaft, slope
from skillframe.world.worlds.common import TOOL_DOWN, WRIST_TO_TIP, require, tool
from skillframe.world.worlds.turned import turned

WIDTH, THICK = 0.16, 0.02
BEHIND = 0.004  # play in the pocket beyond the ball [m]
LOWER = 0.022  # length of the lower ramp along its slope [m]
LEAN = 0.15  # sideways share of the push towards the wall
GAP = 0.002  # from the ball to the wall at the start [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class HumpParams:
    """Parameters of `hump`.

    Ranges end where parts are too small for a gripper, or too large for an arm (our choice).

    Attributes:
        slope: angle r of the ramp from the floor [rad, 0.5deg to 80deg].
        height: of the ramp, from its own foot [m, 1mm to 100mm].
        steps: angle of a lower ramp before it [rad, 0deg to 60deg]; 0: there is none.
        skew: angle by which the ramp is turned about the floor's normal [rad, 0deg to 40deg]; above 0 there is a wall.
        friction: Coulomb coefficient [0 to 5].
        radius: of the ball at the tip [m, 0.1mm to 200mm].
        tolerance: distance from the stop that counts as there [m, 1um to 100mm].
        turn: rotation vector by which the whole fixture is turned [rad, -180deg to 180deg].
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
    """The foot of the first ramp is the origin. The floor is z = 0, the ball comes along x."""
    half_width = 0.25 * pi - 0.5 * params.slope - atan(params.friction)
    require("hump", {"slope < 90 degrees - 2 atan(friction)": half_width > 0.0}, params)
    stop = _stop(params)
    wall = -params.radius - GAP

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
            fixture=_fixture(params, stop, wall),
            tool=tool((ball, shaft(0.004, 0.01, WRIST_TO_TIP - params.radius)), hand="grip"),
            friction=params.friction,
            start_tip=(-0.03, 0.0, params.radius + 0.002),
            start_quaternion=TOOL_DOWN,
            goal=in_pocket,
            goal_error=lambda state: (distance(state), np.zeros(len(state.tip.position))),
            task=Task(
                direction=_push(params), hand="sliding",
                starts=tuple({"start.offset_x": 0.03 - before} for before in (0.055, 0.012, 0.040, 0.030)),
            ),
            analytic={"push_half_width_rad": half_width},
        ),
        params.turn,
    )  # fmt: skip


def _push(params: HumpParams) -> tuple[float, float, float]:
    """The middle of the pushes that pass: (90 degrees - r) / 2 below the floor, leaning on the wall if there is one."""
    below = 0.25 * pi - 0.5 * params.slope
    x, y, z = unit(np.array([cos(below), -LEAN if params.skew else 0.0, -sin(below)]))
    return (float(x), float(y), float(z))


def _foot(params: HumpParams) -> tuple[float, float]:
    """Where the ramp begins, x and z: at the origin, or at the end of the lower ramp."""
    if not params.steps:
        return 0.0, 0.0
    return LOWER * cos(params.steps), LOWER * sin(params.steps)


def _stop(params: HumpParams) -> float:
    """Where the stop stands: the ball has room between it and the ramp's back, which falls at 90 degrees - r."""
    x, z = _foot(params)
    top = z + params.height
    sideways = WIDTH * tan(params.skew) * 0.1
    return x + params.height / tan(params.slope) + top * tan(params.slope) + 2.0 * params.radius + BEHIND + sideways


def _fixture(params: HumpParams, stop: float, wall: float) -> tuple[Geom, ...]:
    x, z = _foot(params)
    top = z + params.height
    ramp = slope(params.slope, params.skew, params.height / sin(params.slope), WIDTH, top / cos(params.slope))
    parts = [
        Geom(kind="box", size=(0.12, 0.5 * WIDTH, 0.5 * THICK), position=(0.0, 0.0, -0.5 * THICK), rgba=FIXTURE_COLOUR),
        _moved(ramp, x, z),
        _box((0.5 * THICK, 0.5 * WIDTH, 0.03), (stop + 0.5 * THICK, 0.0, 0.03)),
    ]
    if params.steps:
        parts.append(slope(params.steps, 0.0, LOWER, WIDTH))
    if params.skew:
        parts.append(_box((0.12, 0.5 * THICK, 0.03), (0.0, wall - 0.5 * THICK, 0.03)))
    return tuple(parts)


def _box(size: tuple[float, float, float], position: tuple[float, float, float]) -> Geom:
    return Geom(kind="box", size=size, position=position, rgba=FIXTURE_COLOUR)


def _moved(geom: Geom, x: float, z: float) -> Geom:
    a, b, c = geom.position
    return replace(geom, position=(a + x, b, c + z))
