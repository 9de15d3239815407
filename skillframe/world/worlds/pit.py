"""`pit`: two or three plane faces, each of its own slope. A ball is slid to where all of them meet.

Two opposite faces are a valley of unequal slopes, three around a point a corner of three faces, and a floor, a wall and
an end stop that are square to each other a slide. The faces lie on opposite sides of the push, so the mean contact
force of a demonstration that touched them all is itself a push that passes (our derivation): the world shows where
averages suffice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, unit
from skillframe.world.scene import Geom, Scene, State, Task
from skillframe.world.shapes import TOOL_COLOUR, shaft, slope
from skillframe.world.worlds.common import TOOL_DOWN, WRIST_TO_TIP, require, tool
from skillframe.world.worlds.turned import as_vector, turned

LENGTH, WIDTH = 0.12, 0.24
FAR, CLEAR = 0.025, 0.002  # from the middle to a start, and off every face [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class PitParams:
    """Parameters of `pit`.

    Ranges end where parts are too small for a gripper, or too large for an arm (our choice).

    Attributes:
        slopes: angle of each face from the horizontal [rad, -1deg to 90deg]; a third that is negative: there is none.
        azimuths: where each face rises to, about the vertical [rad, -360deg to 360deg].
        push: the push that a person who sees the pit gives [-1 to 1]; (0, 0, 0): against the sum of the normals.
        friction: Coulomb coefficient [0 to 5].
        radius: of the ball at the tip [m, 0.1mm to 200mm].
        tolerance: distance from every face that counts as there [m, 1um to 100mm].
        turn: rotation vector by which the whole fixture is turned [rad, -180deg to 180deg].
    """

    slopes: tuple[float, float, float] = (0.366519, 0.698132, 1.029744)
    azimuths: tuple[float, float, float] = (0.0, 2.094395, 4.18879)
    push: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float = 0.15
    radius: float = 0.005
    tolerance: float = 0.0015
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)


def build(params: PitParams) -> Scene:
    """The faces meet in the fixture's origin, or along a line through it. Demonstrations start up each face in turn."""
    require("pit", {"two or three slopes of at least 0": min(params.slopes[:2]) >= 0.0}, params)
    faces = [(s, a) for s, a in zip(params.slopes, params.azimuths, strict=True) if s >= 0.0]
    normals = np.array([[-np.sin(s) * np.cos(a), -np.sin(s) * np.sin(a), np.cos(s)] for s, a in faces])
    start = _resting(normals, params.radius + CLEAR)
    up = [FAR * np.array([np.cos(s) * np.cos(a), np.cos(s) * np.sin(a), np.sin(s)]) for s, a in faces]

    def off(state: State) -> Float:
        result: Float = state.tip.position @ normals.T - params.radius
        return result

    def in_pit(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = np.all(off(state) < params.tolerance, axis=-1)
        return there

    ball = Geom(kind="sphere", size=(params.radius,), position=(0.0, 0.0, WRIST_TO_TIP), rgba=TOOL_COLOUR)
    push = np.array(params.push) if any(params.push) else -normals.sum(axis=0)
    return turned(
        Scene(
            name="pit",
            fixture=tuple(slope(s, a, LENGTH, WIDTH) for s, a in faces),
            tool=tool((ball, shaft(0.004, 0.01, WRIST_TO_TIP - params.radius)), hand="grip"),
            friction=params.friction,
            start_tip=as_vector(start),
            start_quaternion=TOOL_DOWN,
            goal=in_pit,
            goal_error=lambda state: (np.clip(off(state).max(axis=-1), 0.0, None), np.zeros(len(state.tip.position))),
            task=Task(
                direction=as_vector(unit(push)), hand="sliding",
                starts=tuple({f"start.offset_{a}": float(each[i]) for i, a in enumerate("xyz")} for each in up),
            ),
        ),
        params.turn,
    )  # fmt: skip


def _resting(normals: Float, radius: float) -> Float:
    """The centre (3,) of a ball that touches all faces, or of two the one nearest to the origin."""
    centre: Float = np.linalg.lstsq(normals, np.full(len(normals), radius), rcond=None)[0]
    return centre
