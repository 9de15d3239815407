"""`peg_in_hole`: a filleted peg and a blind hole with 0.25 mm of play (seed, Fig. 15; [6], section IV).

Published: peg radius 16.5 mm, length 80 mm, rounded tip, hole radius 0.25 mm more. Assumed: a fillet of 5 mm, which
decides what tilt is caught, and a hole 60 mm deep.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world import (
    FLOOR,
    TOOL_DOWN,
    WRIST_TO_TIP,
    Scene,
    State,
    Task,
    filleted_peg,
    hole,
    insertion,
    require,
    shaft,
    tilt_lift,
    tilt_of,
    tool,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PegParams:
    """Parameters of `peg_in_hole`.

    Attributes:
        radius: of the peg [m, 0.1mm to 200mm].
        clearance: hole radius minus peg radius [m, 1um to 50mm].
        length: of the peg [m, 1mm to 2m].
        depth: of the hole [m, 1mm to 2m].
        fillet: radius of the peg's rounded edge [m, 1um to 200mm].
        friction: Coulomb coefficient [0 to 5].
        segments: of the peg's mesh around [8 to 256].
        boxes: of the hole's ring [8 to 256].
        done_depth: depth of the tip that counts as inserted [m, 1um to 2m].
    """

    radius: float = 0.0165
    clearance: float = 0.00025
    length: float = 0.080
    depth: float = 0.060
    fillet: float = 0.005
    friction: float = 0.2
    segments: int = 48
    boxes: int = 32
    done_depth: float = 0.058


def build(params: PegParams) -> Scene:
    """The scene, whose hole opens upwards at the fixture's origin. The goal is the tip below `done_depth`.

    The tip must be nearer to the axis than the peg's radius and at most `FLOOR` below the hole's floor, which excludes
    places beside and under the block.
    """
    require(
        "peg_in_hole",
        {
            "fillet < radius": params.fillet < params.radius,
            "fillet < length": params.fillet < params.length,
            "done_depth <= depth": params.done_depth <= params.depth,
        },
        params,
    )
    peg = filleted_peg(params.radius, params.length, params.fillet, params.segments, WRIST_TO_TIP)

    def distance(state: State) -> Float:
        return norm(state.tip.position - np.array([0.0, 0.0, -params.depth]))

    def inserted(state: State) -> NDArray[np.bool_]:
        tip = state.tip.position
        above_floor = tip[..., 2] > -params.depth - FLOOR
        return (tip[..., 2] < -params.done_depth) & (norm(tip[..., :2]) < params.radius) & above_floor

    return Scene(
        name="peg_in_hole",
        fixture=hole(params.radius + params.clearance, params.depth, params.boxes, wall=0.025),
        tool=tool((peg, shaft(0.012, 0.012, WRIST_TO_TIP - params.length))),
        friction=params.friction,
        start_tip=(0.0, 0.0, 0.001),
        start_quaternion=TOOL_DOWN,
        start_lift=tilt_lift(params.radius),
        goal=inserted,
        goal_error=lambda state: (distance(state), tilt_of(state)),
        way=insertion(params.depth, params.radius),
        task=Task(
            direction=(0.0, 0.0, -1.0), aligned=TOOL_DOWN, hand="aligning",
            starts=({"start.tilt_y": float(np.deg2rad(8.0))}, {"start.tilt_y": float(np.deg2rad(-8.0))}),
        ),
    )  # fmt: skip
