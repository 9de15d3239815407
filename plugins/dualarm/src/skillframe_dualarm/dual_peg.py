"""`dual_peg`: a peg with a hemispherical tip in one arm's hand, its hole in the other's (two-arm LMC paper).

Published: peg radius 16.5 mm, length 80 mm, rounded tip, hole radius 0.25 mm more, both bolted to the wrists. Ours: the
rounded tip is a hemisphere (a fillet of any radius would be as possible), hole 60 mm deep of 32 boxes, tip and
mouth 0.15 m from the flanges, tools of 0.6 and 0.8 kg. The tip starts 1 mm above the mouth; it is inserted at 50 mm.
A robot with one arm finds the hole standing still.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world.scene import Geom, Holder, Scene, State, Task, Tool
from skillframe.world.shapes import TOOL_COLOUR, hole, shaft
from skillframe.world.worlds.common import FLOOR, TOOL_DOWN, insertion, require, tilt_of

REACH = 0.15  # from the flange to tip and mouth [m]
MASSES = (0.6, 0.8)  # of peg and hole with their mounts [kg]


@dataclass(frozen=True, slots=True, kw_only=True)
class DualPegParams:
    """Parameters of `dual_peg`.

    Ranges end where parts are too small for a gripper, or too large for an arm (our choice).

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
    """The hole opens along the fixture's z axis. The goal is the tip in it, below `done_depth`, not below its floor."""
    require(
        "dual_peg",
        {
            "length > 2 radius": params.length > 2.0 * params.radius,
            "length < 0.15": params.length < REACH,
            "done_depth <= depth": params.done_depth <= params.depth,
        },
        params,
    )

    def distance(state: State) -> Float:
        return norm(state.tip.position - np.array([0.0, 0.0, -params.depth]))

    def inserted(state: State) -> NDArray[np.bool_]:
        tip = state.tip.position
        above_floor = tip[..., 2] > -params.depth - FLOOR
        return (tip[..., 2] < -params.done_depth) & (norm(tip[..., :2]) < params.radius) & above_floor

    return Scene(
        name="dual_peg",
        fixture=(*hole(params.radius + params.clearance, params.depth, params.boxes, wall=0.025), _mount(params)),
        tool=_peg_tool(params),
        holder=Holder(tool=_tool((), MASSES[1], "mouth"), position=(0.0, 0.0, REACH)),
        friction=params.friction,
        start_tip=(0.0, 0.0, 0.001),
        start_quaternion=TOOL_DOWN,
        goal=inserted,
        goal_error=lambda state: (distance(state), tilt_of(state)),
        way=insertion(params.depth, params.radius),
        task=Task(
            direction=(0.0, 0.0, -1.0), aligned=TOOL_DOWN, hand="aligning",
            starts=(_start(8.0, -0.006), _start(-8.0, 0.006)),
        ),
    )  # fmt: skip


def _start(tilt_deg: float, offset: float) -> dict[str, float]:
    """A demonstration's start: tilted, and off to the side so that the rim leads the tip in."""
    return {"start.tilt_y": float(np.deg2rad(tilt_deg)), "start.offset_x": offset}


def _peg_tool(params: DualPegParams) -> Tool:
    half = 0.5 * params.length - params.radius
    peg = Geom(
        kind="capsule", size=(params.radius, half), position=(0.0, 0.0, REACH - params.radius - half), rgba=TOOL_COLOUR
    )
    return _tool((peg, shaft(0.012, 0.012, REACH - params.length)), MASSES[0], "tip")


def _mount(params: DualPegParams) -> Geom:
    """What joins the hole's bottom to the flange that holds it, to be seen only."""
    return shaft(0.012, -REACH, max(-params.depth, 0.012 - REACH))


def _tool(geoms: tuple[Geom, ...], mass: float, end: str) -> Tool:
    inertia = mass * REACH**2 / 12.0
    return Tool(
        geoms=geoms, mass=mass, center_of_mass=(0.0, 0.0, 0.5 * REACH), inertia=(inertia, inertia, 3e-4),
        frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, REACH), end: (0.0, 0.0, REACH)}, hand=end,
    )  # fmt: skip
