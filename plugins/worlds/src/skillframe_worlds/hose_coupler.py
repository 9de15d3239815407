"""`hose_coupler`: two coupler faces that align flush under push (seed, Fig. 12).

The coupler's face is a disc 150 mm ahead of the flange, where the tool point is; the fixture is the other half's flat
face. With `interlock` the coupler has two lugs, the fixture a low collar with 9 mm of play and two claws: turned by
that angle about the fixture's z, the lugs lie under the claws, against their backs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world import (
    FIXTURE_COLOUR,
    TOOL_COLOUR,
    TOOL_DOWN,
    Geom,
    Scene,
    State,
    Task,
    Vector,
    filleted_peg,
    quaternion_about,
    require,
    shaft,
    tilt_lift,
    tilt_of,
    tool,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class HoseParams:
    """Parameters of `hose_coupler`.

    Attributes:
        radius: of the coupler's face [m, 1mm to 500mm].
        length: of the coupler [m, 1mm to 2m].
        fillet: of the face's edge [m, 1um to 200mm].
        friction: Coulomb coefficient [0 to 5].
        segments: of the mesh around [8 to 256].
        tolerance: tilt that counts as aligned [rad, 0.001deg to 90deg].
        interlock: turn that locks the couplers [rad, 0 to 1.2]; 0 for no lugs and a flush face as the goal.
    """

    radius: float = 0.030
    length: float = 0.050
    fillet: float = 0.002
    friction: float = 0.2
    segments: int = 48
    tolerance: float = 0.005235987755982988
    interlock: float = 0.0


def build(params: HoseParams) -> Scene:
    """The scene, with the fixture's face at z = 0.

    The goal is a face flush within `tolerance` and 1 mm, with its middle above the plate. With `interlock` it is lugs
    under the claws: turned to 2 degrees, within 1.5 mm and 1.5 degrees of flush, and inside the collar.
    """
    require(
        "hose_coupler",
        {
            "fillet < radius": params.fillet < params.radius,
            "interlock = 0, or 0.5 to 1.2 rad": params.interlock == 0.0 or 0.5 <= params.interlock <= 1.2,
        },
        params,
    )
    at, half_seat = 0.15, 0.07  # m
    face = filleted_peg(params.radius, params.length, params.fillet, params.segments, at)
    seat = Geom(kind="box", size=(half_seat, half_seat, 0.02), position=(0.0, 0.0, -0.02), rgba=FIXTURE_COLOUR)
    lock = _Lock()

    def height(state: State) -> Float:
        return np.abs(state.tip.position[..., 2])

    def flush(state: State) -> NDArray[np.bool_]:
        above_seat = np.all(np.abs(state.tip.position[..., :2]) < half_seat, axis=-1)
        met: NDArray[np.bool_] = (tilt_of(state) < params.tolerance) & (height(state) < 0.001) & above_seat
        return met

    def unturned(state: State) -> Float:
        return np.abs(params.interlock - turned(state))

    def locked(state: State) -> NDArray[np.bool_]:
        under = (height(state) < lock.play) & (tilt_of(state) < 0.026)  # rad; there is room for about 2 degrees
        inside = norm(state.tip.position[..., :2]) < lock.collar_play + lock.collar_wall
        there: NDArray[np.bool_] = under & inside & (unturned(state) < 0.035)
        return there

    locks = params.interlock > 0.0
    lugs = lock.lugs(params.radius, at) if locks else ()
    twist = Task(direction=(0.0, 0.0, -1.0), turn=(0.0, 0.0, 1.0), hand="lever")
    return Scene(
        name="hose_coupler",
        fixture=(seat, *(lock.standing(params) if locks else ())),
        tool=tool((face, shaft(0.015, 0.015, at - params.length), *lugs), tip=at),
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
    """Rotation of the tool about the fixture's z (N,) [rad]."""
    x_axis = state.tip.rotation[..., :, 0]
    return np.arctan2(x_axis[..., 1], x_axis[..., 0])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lock:
    """Measures of lugs, claws and collar [m].

    Attributes:
        width, height: of a lug; above: from the face to a lug; play: room over a lug.
        collar_play, collar_wall: room around the coupler in the collar, and its thickness.
    """

    width: float = 0.008
    height: float = 0.006
    above: float = 0.006
    play: float = 0.0015
    collar_play: float = 0.009
    collar_wall: float = 0.003

    def lugs(self, radius: float, face: float) -> tuple[Geom, ...]:
        """Two lugs of 28 mm at the tool's x and -x, high enough for the rim to touch first."""
        reach = 0.028
        return tuple(
            Geom(
                kind="box", size=(0.5 * reach, 0.5 * self.width, 0.5 * self.height), rgba=TOOL_COLOUR,
                position=(side * (radius + 0.5 * reach - 0.002), 0.0, face - self.above - 0.5 * self.height),
            )
            for side in (1.0, -1.0)
        )  # fmt: skip

    def standing(self, params: HoseParams) -> tuple[Geom, ...]:
        """A collar of 24 boxes, and two claws at the angle of the locked lugs."""
        parts, high = [], 0.003
        radius = params.radius + self.collar_play + 0.5 * self.collar_wall
        half = float(radius * np.tan(np.pi / 24))
        for k in range(24):
            place, turn = _around(radius, 2.0 * np.pi * k / 24, 0.0, 0.5 * high)
            size = (0.5 * self.collar_wall, half, 0.5 * high)
            parts.append(Geom(kind="box", size=size, position=place, quaternion=turn, rgba=FIXTURE_COLOUR))
        radius, half, thickness = params.radius + 0.0135 + 0.005, 0.005, 0.004  # 13.5 mm from the face
        roof = self.above + self.height + self.play
        for side in (0.0, np.pi):
            for size, ahead, middle in (
                ((half, thickness, 0.5 * roof), 0.5 * self.width + thickness, 0.5 * roof),
                ((half, 0.5 * self.width + 2.0 * thickness, 0.002), thickness, roof + 0.002),
            ):
                place, turn = _around(radius, side + params.interlock, ahead, middle)
                parts.append(Geom(kind="box", size=size, position=place, quaternion=turn, rgba=FIXTURE_COLOUR))
        return tuple(parts)


def _around(
    radius: float, angle: float, ahead: float, height: float
) -> tuple[Vector, tuple[float, float, float, float]]:
    out, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    centre = radius * out + ahead * along
    return (float(centre[0]), float(centre[1]), height), quaternion_about("z", angle)
