"""`hose_coupler`: two coupler faces that align flush under push (seed, Fig. 12); tool point at the flange.

A disc of radius 30 mm and fillet 2 mm stands for the coupler's face, 150 mm ahead of the flange; the fixture is the
other half's flat face. The fixture's interlock is not modelled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skillframe.frames import Float
from skillframe.world.scene import Geom, Scene, State, Task
from skillframe.world.shapes import FIXTURE_COLOUR, filleted_peg, shaft
from skillframe.world.worlds.common import TOOL_DOWN, require, tilt_lift, tilt_of, tool

FACE = 0.15


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
    """

    radius: float = 0.030
    length: float = 0.050
    fillet: float = 0.002
    friction: float = 0.2
    segments: int = 48
    tolerance: float = 0.005235987755982988


def build(params: HoseParams) -> Scene:
    """The fixture's face is the plane z = 0; the goal is a flush face (tilt below `tolerance`, within 1 mm)."""
    require(
        "hose_coupler",
        {
            "0 < fillet < radius": 0.0 < params.fillet < params.radius,
            "friction >= 0": params.friction >= 0.0,
            "tolerance > 0": params.tolerance > 0.0,
            "8 to 256 segments": 8 <= params.segments <= 256,
        },
    )
    face = filleted_peg(params.radius, params.length, params.fillet, params.segments, FACE)
    seat = Geom(kind="box", size=(0.07, 0.07, 0.02), position=(0.0, 0.0, -0.02), rgba=FIXTURE_COLOUR)

    def height(state: State) -> Float:
        return np.abs(state.tip.position[..., 2])

    return Scene(
        name="hose_coupler",
        fixture=(seat,),
        tool=tool((face, shaft(0.015, 0.015, FACE - params.length)), tip=FACE),
        friction=params.friction,
        start_tip=(0.0, 0.0, 0.002),
        start_quaternion=TOOL_DOWN,
        start_lift=tilt_lift(params.radius - params.fillet),
        goal=lambda state: (tilt_of(state) < params.tolerance) & (height(state) < 0.001),
        goal_error=lambda state: (height(state), tilt_of(state)),
        task=Task(
            direction=(0.0, 0.0, -1.0), aligned=TOOL_DOWN, hand="aligning",
            starts=({"start.tilt_y": float(np.deg2rad(8.0))}, {"start.tilt_y": float(np.deg2rad(-8.0))}),
        ),
    )  # fmt: skip
