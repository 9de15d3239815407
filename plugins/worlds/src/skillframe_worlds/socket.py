"""`socket`: a plug with two round pins and a key, and its socket, for a search in three dimensions (seed, Fig. 10).

Measures are of the common European kind: pins of 4.8 mm, 19 mm apart, and a key that fixes the plug's direction. The
key is shorter and has more play, so that only the pins decide. Their fillet sets how hard the search is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, norm
from skillframe.world import (
    FIXTURE_COLOUR,
    FLOOR,
    TOOL_COLOUR,
    TOOL_DOWN,
    WRIST_TO_TIP,
    Geom,
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
class SocketParams:
    """Parameters of `socket`.

    Attributes:
        radius: of the pins [m, 0.1mm to 3mm].
        clearance: radius of the holes minus that of the pins [m, 1um to 3mm].
        spacing: between the pins' axes [m, 16mm to 40mm].
        length: of the pins [m, 1mm to 500mm].
        depth: of the holes [m, 1mm to 500mm].
        fillet: radius of the pins' rounded tips [m, 1um to 3mm].
        friction: Coulomb coefficient [0 to 5].
        segments: of the pins' meshes around [8 to 256].
        boxes: of each hole's ring [12 to 256].
        done_depth: depth of the tip that counts as plugged in [m, 1um to 500mm].
    """

    radius: float = 0.0024
    clearance: float = 0.0005
    spacing: float = 0.019
    length: float = 0.019
    depth: float = 0.018
    fillet: float = 0.0008
    friction: float = 0.2
    segments: int = 16
    boxes: int = 16
    done_depth: float = 0.016


def build(params: SocketParams) -> Scene:
    """The scene, with the socket's face at z = 0 and holes on the x axis. The goal is the tip below `done_depth`."""
    free = params.radius + params.clearance
    require(
        "socket",
        {
            "fillet < radius": params.fillet < params.radius,
            "fillet < length": params.fillet < params.length,
            "done_depth <= depth": params.done_depth <= params.depth,
            "depth <= length": params.depth <= params.length,
            "radius + clearance <= 3 mm": free <= 0.003,
        },
        params,
    )

    x, key_x, key_y, key_at, shorter = 0.5 * params.spacing, 0.003, 0.0012, 0.007, 0.004  # half sizes of the key [m]
    pin = filleted_peg(params.radius, params.length, params.fillet, params.segments, WRIST_TO_TIP)
    half = 0.5 * (params.length - shorter)
    key = Geom(
        kind="box", size=(key_x, key_y, half), position=(0.0, -key_at, WRIST_TO_TIP - shorter - half),
        rgba=TOOL_COLOUR,
    )  # fmt: skip
    plug = (*(replace(pin, position=(side * x, 0.0, 0.0)) for side in (-1.0, 1.0)), key)

    wall, play, h = 0.003, 0.001, 0.045  # of the rings around the holes, of the key, half a plate [m]
    rings = [
        replace(geom, position=(geom.position[0] + side * x, *geom.position[1:]))
        for side in (-1.0, 1.0)
        for geom in hole(free, params.depth, params.boxes, wall)[:-1]
    ]
    square = (free + wall) / np.sqrt(2.0)  # its corners are inside the ring's outer polygon
    across, near, far = key_x + play, key_at - key_y - play, key_at + key_y + play
    plates = [
        (-h, h, -h, -square), (-h, -x - square, -square, square), (-x + square, x - square, -square, square),
        (x + square, h, -square, square), (-h, h, square, near), (-h, -across, near, far), (across, h, near, far),
        (-h, h, far, h),
    ]  # fmt: skip
    bottom = Geom(kind="box", size=(h, h, 0.005), position=(0.0, 0.0, -params.depth - 0.005), rgba=FIXTURE_COLOUR)

    def distance(state: State) -> Float:
        return norm(state.tip.position - np.array([0.0, 0.0, -params.depth]))

    def plugged(state: State) -> NDArray[np.bool_]:
        height = state.tip.position[..., 2]
        deep: NDArray[np.bool_] = (height < -params.done_depth) & (height > -params.depth - FLOOR)
        return deep & (norm(state.tip.position[..., :2]) < params.radius)

    return Scene(
        name="socket",
        fixture=(*rings, *(_plate(*plate, params.depth) for plate in plates), bottom),
        tool=tool((*plug, shaft(0.012, 0.012, WRIST_TO_TIP - params.length))),
        friction=params.friction,
        start_tip=(0.0, 0.0, 0.001),
        start_quaternion=TOOL_DOWN,
        start_lift=tilt_lift(0.5 * params.spacing + params.radius),
        goal=plugged,
        goal_error=lambda state: (distance(state), tilt_of(state)),
        way=insertion(params.depth, params.radius),
        task=Task(
            direction=(0.0, 0.0, -1.0), aligned=TOOL_DOWN, hand="aligning",
            starts=({"start.tilt_z": 0.0},), believed=(0.003, 0.003, float(np.deg2rad(5.0))),
        ),
    )  # fmt: skip


def _plate(left: float, right: float, low: float, high: float, depth: float) -> Geom:
    return Geom(
        kind="box", size=(0.5 * (right - left), 0.5 * (high - low), 0.5 * depth), rgba=FIXTURE_COLOUR,
        position=(0.5 * (left + right), 0.5 * (low + high), -0.5 * depth),
    )  # fmt: skip
