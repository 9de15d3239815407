"""What the scenes share: the tool in the grip, tool-down attitude, and goals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.config.fields import require_ranges
from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe.world.scene import Geom, State, Tool, Way

TOOL_DOWN = (1.0, 0.0, 0.0, 0.0)
"""Attitude in the fixture frame of a tool that points down: half a turn about x (tool z = fixture -z)."""
WRIST_TO_TIP = 0.2
TOOL_MASS = 0.6
FLOOR = 0.002
"""[m] further below the floor of a hole nothing is in it, and further from an edge nothing lies on it.

Contacts give way less within a robot's limits (ours).
"""


def tool(geoms: tuple[Geom, ...], tip: float = WRIST_TO_TIP, hand: str = "wrist") -> Tool:
    """A 0.6 kg tool along +z with its tip `tip` metres from the wrist, its mass centred half way.

    The figures are ours: a light gripper with a part in it. A teacher holds it at "wrist", or, to guide a tip over
    slopes, like a pen at "grip", 40 mm behind the tip.
    """
    inertia = TOOL_MASS * tip**2 / 12.0 / 2.0
    return Tool(
        geoms=geoms, mass=TOOL_MASS, center_of_mass=(0.0, 0.0, 0.5 * tip), inertia=(inertia, inertia, 2e-4),
        frames={"wrist": (0.0, 0.0, 0.0), "tip": (0.0, 0.0, tip), "grip": (0.0, 0.0, tip - 0.04)}, hand=hand,
    )  # fmt: skip


def tilt_of(state: State) -> Float:
    """Angle (N,) [rad] between the tool's axis and the fixture's -z."""
    axis = state.tip.rotation[..., :, 2]
    return np.arctan2(norm(axis[..., :2]), -axis[..., 2])


def insertion(depth: float, radius: float) -> Way:
    """How deep the tip is in a hole that opens upwards at the fixture's origin.

    A tip that is farther than the peg's radius from the hole's axis is beside the hole, at whatever height.

    Args:
        depth: of the hole [m].
        radius: of the peg [m].
    """

    def reached(state: State) -> Float:
        tip = state.tip.position
        inside: Float = np.where(norm(tip[..., :2]) < radius, np.clip(-tip[..., 2], 0.0, None), 0.0)
        return inside

    return Way("inserted", depth, reached)


def no_error(state: State) -> tuple[Float, Float]:
    """Errors of a scene without a goal: zero."""
    zero = np.zeros(len(state.tip.position))
    return zero, zero


def anywhere(state: State) -> NDArray[np.bool_]:
    """The goal of a scene that has none: always reached."""
    return np.ones(len(state.tip.position), dtype=bool)


def require(world: str, checks: dict[str, bool], params: Any = None) -> None:
    """Refuse parameters that make no sense.

    Args:
        world: its name, for messages.
        checks: whether each rule holds, by the rule in words.
        params: a dataclass whose ranges are checked before that.

    Raises:
        InputError: names the first parameter beyond its range, or the first check that fails.
    """
    require_ranges(params, f"world {world}")
    for text, fine in checks.items():
        if not fine:
            raise InputError(f"world {world}", f"needs {text}", "change the parameter with --set world.KEY=VALUE")


Lift = Callable[[Float, Float], Float]


def tilt_lift(radius: float) -> Lift:
    """Lift of a tool of a radius [m] so that its tilted edge clears the plate: r |sin tilt|."""
    return lambda offset, tilt: radius * np.abs(np.sin(norm(tilt)))
