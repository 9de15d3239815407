"""`hose_coupler`: two coupler faces that align flush under push (seed, Fig. 12); tool point at the flange.

A disc of radius 30 mm and fillet 2 mm stands for the coupler's face, 150 mm ahead of the flange; the fixture is the
other half's flat face. With `interlock` the coupler carries two lugs, and the fixture two claws: turned by that angle
about the fixture's z, the lugs lie under the claws and rest against their backs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.world.scene import Geom, Scene, State, Task, Vector
from skillframe.world.shapes import FIXTURE_COLOUR, TOOL_COLOUR, filleted_peg, quaternion_about, shaft
from skillframe.world.worlds.common import TOOL_DOWN, require, tilt_lift, tilt_of, tool

FACE = 0.15
LUG, LUG_HEIGHT, PLAY = 0.008, 0.006, 0.0015  # reach and width of a lug, its height, room under the claw [m]
FALL = 0.025  # how much higher the couplers that interlock start [m]
TURN_TOLERANCE = 0.035  # [rad]
TOUCH = 3.0  # force that a person feels [N]


@dataclass(frozen=True, slots=True, kw_only=True)
class HoseParams:
    """Parameters of `hose_coupler`.

    Attributes:
        radius: of the coupler's face [m].
        length: of the coupler [m].
        fillet: of the face's edge [m].
        friction: Coulomb coefficient.
        segments: of the mesh around.
        tolerance: tilt that counts as aligned [rad].
        interlock: turn that locks the couplers [rad]; 0: there are no lugs, and a flush face is the goal.
    """

    radius: float = 0.030
    length: float = 0.050
    fillet: float = 0.002
    friction: float = 0.2
    segments: int = 48
    tolerance: float = 0.005235987755982988
    interlock: float = 0.0


def build(params: HoseParams) -> Scene:
    """The fixture's face is the plane z = 0; the goal is a flush face (tilt below `tolerance`, within 1 mm)."""
    require(
        "hose_coupler",
        {
            "0 < fillet < radius": 0.0 < params.fillet < params.radius,
            "friction >= 0": params.friction >= 0.0,
            "tolerance > 0": params.tolerance > 0.0,
            "8 to 256 segments": 8 <= params.segments <= 256,
            "interlock = 0, or 0.5 to 1.2 rad": params.interlock == 0.0 or 0.5 <= params.interlock <= 1.2,
        },
    )
    face = filleted_peg(params.radius, params.length, params.fillet, params.segments, FACE)
    seat = Geom(kind="box", size=(0.07, 0.07, 0.02), position=(0.0, 0.0, -0.02), rgba=FIXTURE_COLOUR)

    def height(state: State) -> Float:
        return np.abs(state.tip.position[..., 2])

    def flush(state: State) -> NDArray[np.bool_]:
        met: NDArray[np.bool_] = (tilt_of(state) < params.tolerance) & (height(state) < 0.001)
        return met

    def unturned(state: State) -> Float:
        return np.maximum(params.interlock - turned(state), 0.0)

    locks = params.interlock > 0.0
    low = FALL if locks else 0.0
    starts = [{"start.tilt_y": sign * float(np.deg2rad(8.0)), **({"start.offset_z": low} if locks else {})}
              for sign in (1.0, -1.0)]  # fmt: skip
    down = (0.0, 0.0, -1.0)
    align = Task(direction=down, aligned=TOOL_DOWN, hand="aligning", done=flush, starts=(starts[0], starts[1]))
    twist = Task(direction=down, turn=(0.0, 0.0, 1.0), hand="lever")
    lower = Task(direction=down, hand="sliding", done=touched, then=(align, twist), starts=align.starts)
    return Scene(
        name="hose_coupler",
        fixture=(seat, *(_claws(params) if locks else ())),
        tool=tool((face, shaft(0.015, 0.015, FACE - params.length), *(_lugs(params) if locks else ())), tip=FACE),
        friction=params.friction,
        start_tip=(0.0, 0.0, 0.003),
        start_quaternion=TOOL_DOWN,
        start_lift=tilt_lift(params.radius + (LUG if locks else 0.0)),
        goal=(lambda state: flush(state) & (unturned(state) < TURN_TOLERANCE)) if locks else flush,
        goal_error=(lambda state: (height(state), tilt_of(state) + unturned(state)))
        if locks
        else (lambda state: (height(state), tilt_of(state))),
        task=lower if locks else replace(align, done=None),
    )  # fmt: skip


def touched(state: State) -> NDArray[np.bool_]:
    """The couplers touch, as a hand feels it (N,)."""
    felt: NDArray[np.bool_] = state.wrench[..., 2] > TOUCH
    return felt


def turned(state: State) -> Float:
    """How far the tool is turned about the fixture's z (N,) [rad]."""
    x_axis = state.tip.rotation[..., :, 0]
    return np.arctan2(x_axis[..., 1], x_axis[..., 0])


def _lugs(params: HoseParams) -> tuple[Geom, ...]:
    """Two lugs on the coupler's sides, at the tool's x and -x, their lower faces 1 mm above its face."""
    reach = params.radius + 0.5 * LUG - 0.002
    return tuple(
        Geom(
            kind="box", size=(0.5 * LUG + 0.002, 0.5 * LUG, 0.5 * LUG_HEIGHT), rgba=TOOL_COLOUR,
            position=(side * reach, 0.0, FACE - 0.001 - 0.5 * LUG_HEIGHT),
        )
        for side in (1.0, -1.0)
    )  # fmt: skip


def _claws(params: HoseParams) -> tuple[Geom, ...]:
    """Two claws on the fixture: a back that stops the lug, and a roof over it."""
    radius, back = params.radius + 0.5 * LUG + 0.001, 0.004
    roof_z = 0.001 + LUG_HEIGHT + PLAY + 0.002
    half = float(np.arcsin(0.5 * LUG / radius))
    claws = []
    for side in (0.0, np.pi):
        angle = side + params.interlock
        stop = _around(radius, angle + half, back, roof_z)
        claws.append(
            Geom(kind="box", size=(0.5 * LUG, back, 0.5 * roof_z), position=stop[0], quaternion=stop[1],
                 rgba=FIXTURE_COLOUR)
        )  # fmt: skip
        roof = _around(radius, angle, 0.0, 2.0 * roof_z)
        claws.append(
            Geom(kind="box", size=(0.5 * LUG, 0.5 * LUG, 0.002), position=roof[0], quaternion=roof[1],
                 rgba=FIXTURE_COLOUR)
        )  # fmt: skip
    return tuple(claws)


def _around(
    radius: float, angle: float, ahead: float, height: float
) -> tuple[Vector, tuple[float, float, float, float]]:
    """Place and attitude of a box at an angle, `ahead` of it along the circle, its middle at half of `height`."""
    out, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    centre = radius * out + ahead * along
    return (float(centre[0]), float(centre[1]), 0.5 * height), quaternion_about("z", angle)
