"""`hose_coupler`: two coupler faces that align flush under push (seed, Fig. 12). The tool point is at the flange.

A disc of radius 30 mm and fillet 2 mm stands for the coupler's face, 150 mm ahead of the flange; the fixture is the
other half's flat face. With `interlock` the coupler carries two lugs, the fixture a low collar, 9 mm wider than the
face, and two claws: turned by that angle about the fixture's z, the lugs lie under the claws and rest against their
backs. Shapes and sizes are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world.scene import Geom, Scene, State, Task, Vector
from skillframe.world.shapes import FIXTURE_COLOUR, TOOL_COLOUR, filleted_peg, quaternion_about, shaft
from skillframe.world.worlds.common import TOOL_DOWN, require, tilt_lift, tilt_of, tool

FACE = 0.15
LUG, LUG_HEIGHT, REACH = 0.008, 0.006, 0.028  # a lug's width, height and length [m]
ABOVE, PLAY, CLEAR = 0.006, 0.0015, 0.0135  # lug over face, room over lug, claw from face [m]
TURN_TOLERANCE, TILT_UNDER_CLAWS = 0.035, 0.026  # [rad]; the lugs' room under the claws allows about 2 degrees
COLLAR_PLAY, COLLAR_WALL, COLLAR_HEIGHT = 0.009, 0.003, 0.003  # [m]
SEAT = 0.07  # half the seat's width [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class HoseParams:
    """Parameters of `hose_coupler`.

    Ranges end where parts are too small for a gripper, or too large for an arm (our choice).

    Attributes:
        radius: of the coupler's face [m, 1mm to 500mm].
        length: of the coupler [m, 1mm to 2m].
        fillet: of the face's edge [m, 1um to 200mm].
        friction: Coulomb coefficient [0 to 5].
        segments: of the mesh around [8 to 256].
        tolerance: tilt that counts as aligned [rad, 0.001deg to 90deg].
        interlock: turn that locks the couplers [rad, 0 to 1.2]; 0: there are no lugs, and a flush face is the
            goal.
    """

    radius: float = 0.030
    length: float = 0.050
    fillet: float = 0.002
    friction: float = 0.2
    segments: int = 48
    tolerance: float = 0.005235987755982988
    interlock: float = 0.0


def build(params: HoseParams) -> Scene:
    """The fixture's face is the plane z = 0. The goal is a flush face on its seat.

    Flush is a tilt below `tolerance`, within 1 mm. On its seat is a face whose middle is above the plate; past the
    plate's side it would tip over. With `interlock` the goal is lugs under the claws: turned to 2 degrees, within
    1.5 mm and 1.5 degrees of flush, and inside the collar: no farther off its axis than its play and its wall.
    """
    require(
        "hose_coupler",
        {
            "fillet < radius": params.fillet < params.radius,
            "interlock = 0, or 0.5 to 1.2 rad": params.interlock == 0.0 or 0.5 <= params.interlock <= 1.2,
        },
        params,
    )
    face = filleted_peg(params.radius, params.length, params.fillet, params.segments, FACE)
    seat = Geom(kind="box", size=(SEAT, SEAT, 0.02), position=(0.0, 0.0, -0.02), rgba=FIXTURE_COLOUR)

    def height(state: State) -> Float:
        return np.abs(state.tip.position[..., 2])

    def flush(state: State) -> NDArray[np.bool_]:
        above_seat = np.all(np.abs(state.tip.position[..., :2]) < SEAT, axis=-1)
        met: NDArray[np.bool_] = (tilt_of(state) < params.tolerance) & (height(state) < 0.001) & above_seat
        return met

    def unturned(state: State) -> Float:
        return np.abs(params.interlock - turned(state))

    def locked(state: State) -> NDArray[np.bool_]:
        under = (height(state) < PLAY) & (tilt_of(state) < TILT_UNDER_CLAWS)
        inside = norm(state.tip.position[..., :2]) < COLLAR_PLAY + COLLAR_WALL
        there: NDArray[np.bool_] = under & inside & (unturned(state) < TURN_TOLERANCE)
        return there

    locks = params.interlock > 0.0
    twist = Task(direction=(0.0, 0.0, -1.0), turn=(0.0, 0.0, 1.0), hand="lever")
    return Scene(
        name="hose_coupler",
        fixture=(seat, *((*_collar(params), *_claws(params)) if locks else ())),
        tool=tool((face, shaft(0.015, 0.015, FACE - params.length), *(_lugs(params) if locks else ())), tip=FACE),
        friction=params.friction,
        start_tip=(0.0, 0.0, 0.003),
        start_quaternion=TOOL_DOWN,
        start_lift=tilt_lift(params.radius),
        goal=locked if locks else flush,
        goal_error=(lambda state: (height(state), tilt_of(state) + unturned(state)))
        if locks
        else (lambda state: (height(state), tilt_of(state))),
        task=Task(
            direction=(0.0, 0.0, -1.0), aligned=TOOL_DOWN, hand="aligning",
            starts=({"start.tilt_y": float(np.deg2rad(8.0))}, {"start.tilt_y": float(np.deg2rad(-8.0))}),
            done=flush if locks else None, then=(twist,) if locks else (),
        ),
    )  # fmt: skip


def turned(state: State) -> Float:
    """How far the tool is turned about the fixture's z (N,) [rad]."""
    x_axis = state.tip.rotation[..., :, 0]
    return np.arctan2(x_axis[..., 1], x_axis[..., 0])


def _lugs(params: HoseParams) -> tuple[Geom, ...]:
    """Two lugs on the coupler's sides, at the tool's x and -x, high enough for the rim to touch first."""
    return tuple(
        Geom(
            kind="box", size=(0.5 * REACH, 0.5 * LUG, 0.5 * LUG_HEIGHT), rgba=TOOL_COLOUR,
            position=(side * (params.radius + 0.5 * REACH - 0.002), 0.0, FACE - ABOVE - 0.5 * LUG_HEIGHT),
        )
        for side in (1.0, -1.0)
    )  # fmt: skip


def _collar(params: HoseParams, boxes: int = 24) -> tuple[Geom, ...]:
    """A low ring of boxes that keeps the face from wandering off the seat."""
    radius = params.radius + COLLAR_PLAY + 0.5 * COLLAR_WALL
    half = float(radius * np.tan(np.pi / boxes))
    ring = []
    for k in range(boxes):
        place, turn = _around(radius, 2.0 * np.pi * k / boxes, 0.0, 0.5 * COLLAR_HEIGHT)
        size = (0.5 * COLLAR_WALL, half, 0.5 * COLLAR_HEIGHT)
        ring.append(Geom(kind="box", size=size, position=place, quaternion=turn, rgba=FIXTURE_COLOUR))
    return tuple(ring)


def _claws(params: HoseParams) -> tuple[Geom, ...]:
    """Two claws on the fixture: a back that stops the lug, and a roof over it. Both are clear of the coupler's face."""
    radius, half, thickness = params.radius + CLEAR + 0.005, 0.005, 0.004
    roof = ABOVE + LUG_HEIGHT + PLAY
    claws = []
    for side in (0.0, np.pi):
        angle = side + params.interlock
        for size, ahead, middle in (
            ((half, thickness, 0.5 * roof), 0.5 * LUG + thickness, 0.5 * roof),
            ((half, 0.5 * LUG + 2.0 * thickness, 0.002), thickness, roof + 0.002),
        ):
            place, turn = _around(radius, angle, ahead, middle)
            claws.append(Geom(kind="box", size=size, position=place, quaternion=turn, rgba=FIXTURE_COLOUR))
    return tuple(claws)


def _around(
    radius: float, angle: float, ahead: float, height: float
) -> tuple[Vector, tuple[float, float, float, float]]:
    """Place and attitude of a box at an angle, `ahead` of it along the circle, its middle at a height."""
    out, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    centre = radius * out + ahead * along
    return (float(centre[0]), float(centre[1]), height), quaternion_about("z", angle)
