"""`pit`: two or three plane faces of different slopes, where a ball slides to where they meet.

Two opposite faces are a valley of unequal slopes, three a corner, and a floor, a wall and an end stop a slide. The
faces lie on opposite sides of the push, so the mean contact force over all of them is a push that passes: a world where
averages suffice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, unit
from skillframe.world import TOOL_COLOUR, TOOL_DOWN, WRIST_TO_TIP, Geom, Scene, State, Task, require, shaft, slope, tool
from skillframe_worlds.turned import as_vector, turned


@dataclass(frozen=True, slots=True, kw_only=True)
class PitParams:
    """Parameters of `pit`.

    Attributes:
        slopes: angle of each face from the horizontal [rad, -1deg to 90deg]; a negative third for two faces.
        azimuths: direction in which each face rises [rad, -360deg to 360deg].
        push: push of the simulated teacher [-1 to 1]; (0, 0, 0) for minus the sum of the normals.
        friction: Coulomb coefficient [0 to 5].
        radius: of the ball at the tip [m, 0.1mm to 200mm].
        tolerance: distance from every face that counts as reached [m, 1um to 100mm].
        turn: rotation vector of the whole fixture [rad, -180deg to 180deg].
    """

    slopes: tuple[float, float, float] = (0.366519, 0.698132, 1.029744)
    azimuths: tuple[float, float, float] = (0.0, 2.094395, 4.18879)
    push: tuple[float, float, float] = (0.0, 0.0, 0.0)
    friction: float = 0.15
    radius: float = 0.005
    tolerance: float = 0.0015
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)


def build(params: PitParams) -> Scene:
    """The scene, whose faces meet in the fixture's origin or a line through it. Demonstrations start on each face."""
    require("pit", {"two or three slopes of at least 0": min(params.slopes[:2]) >= 0.0}, params)
    faces = [(s, a) for s, a in zip(params.slopes, params.azimuths, strict=True) if s >= 0.0]
    normals = np.array([[-np.sin(s) * np.cos(a), -np.sin(s) * np.sin(a), np.cos(s)] for s, a in faces])
    # the centre of a ball 2 mm off all faces, nearest to the origin; starts are 25 mm from it
    start = np.linalg.lstsq(normals, np.full(len(normals), params.radius + 0.002), rcond=None)[0]
    up = [0.025 * np.array([np.cos(s) * np.cos(a), np.cos(s) * np.sin(a), np.sin(s)]) for s, a in faces]

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
            fixture=tuple(slope(s, a, 0.12, 0.24) for s, a in faces),
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
