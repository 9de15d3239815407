"""World `dual_peg`: one arm holds a peg with a hemispherical tip, the other its hole (two-arm LMC paper).

Published: peg radius 16.5 mm, length 80 mm, rounded tip, hole radius 0.25 mm more. Assumed: a hemisphere, hole 60 mm
deep of 32 boxes, tip and hole entrance 0.15 m from the flanges, tools of 0.6 and 0.8 kg. The tip starts 1 mm above the
hole and is inserted at 50 mm. With one arm, the hole is fixed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world import (
    FLOOR,
    TOOL_COLOUR,
    TOOL_DOWN,
    Geom,
    Holder,
    Scene,
    State,
    Task,
    Tool,
    hole,
    insertion,
    require,
    shaft,
    tilt_of,
)

REACH = 0.15  # from the flange to tip and hole entrance [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class DualPegParams:
    """Parameters of `dual_peg`, within sizes for a gripper and an arm.

    Attributes:
        radius: of the peg and its hemispherical tip [m, 0.1mm to 200mm].
        clearance: hole radius minus peg radius [m, 1um to 50mm].
        length: of the peg [m, 1mm to 150mm].
        depth: of the hole [m, 1mm to 2m].
        friction: Coulomb coefficient [0 to 5].
        boxes: of the hole's ring [8 to 256].
        done_depth: depth of the tip that counts as inserted [m, 1um to 2m].
    """

    radius: float = 0.0165
    clearance: float = 0.00025
    length: float = 0.080
    depth: float = 0.060
    friction: float = 0.2
    boxes: int = 32
    done_depth: float = 0.050


def build(params: DualPegParams) -> Scene:
    """The scene, its hole along the fixture's z axis, its goal the tip between `done_depth` and the floor."""
    require(
        "dual_peg",
        {
            "length > 2 radius": params.length > 2.0 * params.radius,
            "length < 0.15": params.length < REACH,
            "done_depth <= depth": params.done_depth <= params.depth,
        },
        params,
    )

    half = 0.5 * params.length - params.radius
    place = (0.0, 0.0, REACH - params.radius - half)
    peg = Geom(kind="capsule", size=(params.radius, half), position=place, rgba=TOOL_COLOUR)
    mount = shaft(0.012, -REACH, max(-params.depth, 0.012 - REACH))

    def distance(state: State) -> Float:
        return norm(state.tip.position - np.array([0.0, 0.0, -params.depth]))

    def inserted(state: State) -> NDArray[np.bool_]:
        tip = state.tip.position
        above_floor = tip[..., 2] > -params.depth - FLOOR
        return (tip[..., 2] < -params.done_depth) & (norm(tip[..., :2]) < params.radius) & above_floor

    return Scene(
        name="dual_peg",
        fixture=(*hole(params.radius + params.clearance, params.depth, params.boxes, wall=0.025), mount),
        tool=_tool((peg, shaft(0.012, 0.012, REACH - params.length)), 0.6, "tip"),
        holder=Holder(tool=_tool((), 0.8, "mouth"), position=(0.0, 0.0, REACH)),
        friction=params.friction,
        start_tip=(0.0, 0.0, 0.001),
        start_quaternion=TOOL_DOWN,
        goal=inserted,
        goal_error=lambda state: (distance(state), tilt_of(state)),
        way=insertion(params.depth, params.radius),
        task=Task(
            direction=(0.0, 0.0, -1.0), aligned=TOOL_DOWN, hand="aligning",
            # tilted and offset so that the rim guides the tip
            starts=tuple(
                {"start.tilt_y": float(np.deg2rad(tilt)), "start.offset_x": offset}
                for tilt, offset in ((8.0, -0.006), (-8.0, 0.006))
            ),
        ),
    )  # fmt: skip


def _tool(geoms: tuple[Geom, ...], mass: float, end: str) -> Tool:
    inertia = mass * REACH**2 / 12.0
    return Tool(
        geoms=geoms, mass=mass, center_of_mass=(0.0, 0.0, 0.5 * REACH), inertia=(inertia, inertia, 3e-4),
        frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, REACH), end: (0.0, 0.0, REACH)}, hand=end,
    )  # fmt: skip
