r"""`bayonet`: a cap with two pins that is pushed and turned at once, along two grooves to a stop.

Unrolled, with s = R theta along the turn and z up, a groove has a level rim, a lead-in wall that descends at an angle
a, a level bottom, and a stop. A push P with a torque T moves a pin by D = (T / R, -P), at d = atan(P R / T) below the
level. With mu = tan(phi) a pin slides along a face that descends by b iff |d - b| < 90 degrees - phi, so

    the push alone (d = 90)     sticks on rim and bottom, whatever the friction
    the turn alone (d = 0)      passes the lead-in iff a < 90 degrees - phi
    both                        pass everything iff a + phi - 90 degrees < d < 90 degrees - phi

if the pins share the load (Coulomb, quasi-static). If only one carries the push, the upper limit is atan(1 / (2 mu)).
Averages of a demonstration pass too. Press gently, because the cap drops by the groove's depth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan, cos, pi, radians, sin, tan

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm, quaternion_from_matrix, rotate, rotation_matrix
from skillframe.world import (
    FIXTURE_COLOUR,
    TOOL_COLOUR,
    WRIST_TO_TIP,
    Geom,
    Scene,
    State,
    Task,
    quaternion_about,
    require,
    shaft,
    tool,
)
from skillframe_worlds.turned import turned


@dataclass(frozen=True, slots=True, kw_only=True)
class BayonetParams:
    """Parameters of `bayonet`.

    Attributes:
        lead: angle a of the lead-in from the level [rad, 30deg to 89deg].
        depth: of the groove under the rim [m, 1mm to 100mm].
        lock: travel of the pins along the bottom [m, 1mm to 100mm].
        reach: from the axis to a pin, R [m, 5mm to 300mm].
        pin: radius of a pin's ball [m, 0.1mm to 100mm].
        play: of a pin in its groove [m, 0 to 20mm].
        friction: Coulomb coefficient [0 to 5].
        tolerance: distance from the stop that counts as reached [m, 1um to 100mm].
        turn: rotation vector of the whole fixture [rad, -180deg to 180deg].
    """

    lead: float = 1.4835298641951802
    depth: float = 0.008
    lock: float = 0.006
    reach: float = 0.03
    pin: float = 0.003
    play: float = 0.002
    friction: float = 0.2
    tolerance: float = 0.002
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)


def build(params: BayonetParams) -> Scene:
    """The scene, with the axis along z, the rim at z = 0, and pins along the tool's x and -x."""
    stop = 2.0 * params.pin + params.play + params.depth / tan(params.lead) + params.lock
    tilt, before = atan(params.friction), radians(30.0)  # the start is so far before the groove
    require("bayonet", {"a stop within a quarter turn": stop < 0.7 * params.reach,
                        "lock > pin + tolerance": params.lock > params.pin + params.tolerance}, params)  # fmt: skip

    def short(state: State) -> Float:
        """Distance of the rearmost pin to its stop, and height above the bottom (N, 2) [m]."""
        missing = []
        for side in (1.0, -1.0):
            arm = rotate(state.tip.rotation, np.array([side * params.reach, 0.0, 0.0]))
            at = state.tip.position + arm
            missing.append([stop - params.pin - side * at[..., 1], at[..., 2] + params.depth - params.pin])
        result: Float = np.max(np.clip(np.array(missing), 0.0, None), axis=0).T
        return result

    def locked(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = np.all(short(state) < params.tolerance, axis=-1)
        return there

    start = quaternion_from_matrix(rotation_matrix(np.array([0.0, 0.0, -before])) @ np.diag([1.0, -1.0, -1.0]))
    pins = [Geom(kind="sphere", size=(params.pin,), position=(side * params.reach, 0.0, WRIST_TO_TIP),
                 rgba=TOOL_COLOUR) for side in (1.0, -1.0)]  # fmt: skip
    bar = Geom(kind="box", size=(params.reach, 0.4 * params.pin, 0.4 * params.pin), position=(0.0, 0.0, WRIST_TO_TIP),
               rgba=TOOL_COLOUR, collide=False)  # fmt: skip
    return turned(
        Scene(
            name="bayonet",
            fixture=tuple(_around(geom, side) for side in (0.0, pi) for geom in _groove(params, stop)),
            tool=tool((*pins, bar, shaft(0.008, 0.01, WRIST_TO_TIP)), hand="grip"),
            friction=params.friction,
            start_tip=(0.0, 0.0, params.pin + 0.002),
            start_quaternion=(float(start[0]), float(start[1]), float(start[2]), float(start[3])),
            goal=locked,
            goal_error=lambda state: (norm(short(state)), np.zeros(len(state.tip.position))),
            task=Task(
                direction=(0.0, 0.0, -1.0), turn=(0.0, 0.0, 1.0), hand="lever",
                starts=tuple({"start.tilt_z": radians(back)} for back in (-4.0, 6.0, 0.0, 3.0)),
            ),
            analytic={"least_push_angle_rad": params.lead + tilt - 0.5 * pi, "most_push_angle_rad": 0.5 * pi - tilt},
        ),
        params.turn,
    )  # fmt: skip


def _groove(params: BayonetParams, stop: float) -> tuple[Geom, ...]:
    width, deep = 2.0 * params.pin + params.play, params.depth
    rim, thick, above = 0.03, 0.006, 0.008  # length of the rim before the groove, thickness, height of the wall's top
    roof = -deep + 2.0 * params.pin + min(params.play, 0.001)
    down = np.array([cos(params.lead), -sin(params.lead)])  # along the wall, as (s, z)
    out = np.array([sin(params.lead), cos(params.lead)])  # out of the groove, into the wall
    length = (above - roof) / sin(params.lead)
    middle = np.array([width - above / tan(params.lead), above]) + 0.5 * length * down + 0.5 * thick * out
    wall = replace(
        _box(params, (middle[0], middle[1]), (0.5 * length, 0.5 * thick)),
        quaternion=quaternion_about("x", -params.lead),
    )
    return (
        _box(params, (-0.5 * rim, -0.5 * (deep + thick)), (0.5 * rim, 0.5 * (deep + thick))),
        wall,
        _box(params, (0.5 * stop, -deep - 0.5 * thick), (0.5 * stop + thick, 0.5 * thick)),
        _box(params, (stop + 0.5 * thick, 0.5 * (roof - deep)), (0.5 * thick, 0.5 * (roof + deep) + thick)),
    )


def _box(params: BayonetParams, middle: tuple[float, float], half: tuple[float, float]) -> Geom:
    """A box of 8 mm half radial width at the radius of the pins."""
    return Geom(
        kind="box", size=(0.008, half[0], half[1]), position=(params.reach, middle[0], middle[1]),
        rgba=FIXTURE_COLOUR,
    )  # fmt: skip


def _around(geom: Geom, angle: float) -> Geom:
    if not angle:
        return geom
    x, y, z = geom.position
    a, b, c, d = geom.quaternion  # half a turn about z times (a, b, c, d)
    return replace(geom, position=(-x, -y, z), quaternion=(-b, a, d, -c))
