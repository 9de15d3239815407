r"""`lid`: a ball pushes a lid shut about its hinge and catches on a lip at its free end.

With D the angle of the push from -z towards the free end, the lid at an angle a from shut and A at first,

    the ball does not slide to the hinge at first:  D > A - phi
    the push turns the lid shut:                    F l cos(D - a) > M, so cos(D) > M / (F l) when it is nearly shut

(planar, Coulomb with mu = tan(phi), quasi-static; l from hinge to ball, F the push, M the hinge's resistance). Pushes
between these always shut the lid. The first bound is not sharp, because the lid may shut while the ball slides.
Averages of a demonstration mostly pass.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan, cos, sin

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, matrix_from_quaternion
from skillframe.world import (
    FIXTURE_COLOUR,
    TOOL_COLOUR,
    TOOL_DOWN,
    WRIST_TO_TIP,
    Geom,
    Mover,
    Scene,
    State,
    Task,
    quaternion_about,
    require,
    shaft,
    tool,
)
from skillframe_worlds.turned import as_vector, turned, turned_quaternion

WIDTH = 0.12  # of the lid and the parts beside it [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class LidParams:
    """Parameters of `lid`.

    Attributes:
        opening: angle A of the lid at the start [rad, 20deg to 80deg].
        length: from the hinge to the lip [m, 40mm to 400mm].
        spring: that holds the lid open, slack at the start [Nm/rad, 0 to 10].
        stuck: friction of the hinge [Nm, 0 to 5].
        friction: Coulomb coefficient between ball and lid [0 to 5].
        radius: of the ball at the tip [m, 0.1mm to 200mm].
        tolerance: angle that counts as shut [rad, 0.1deg to 10deg].
        turn: rotation vector of the whole fixture [rad, -180deg to 180deg].
    """

    opening: float = 1.1344640137963142
    length: float = 0.1
    spring: float = 0.0
    stuck: float = 0.15
    friction: float = 0.1
    radius: float = 0.005
    tolerance: float = 0.05235987755982989
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)


def build(params: LidParams) -> Scene:
    """The scene. The hinge is the y axis, and the shut lid's upper face is z = 0, x > 0."""
    push_n = 15.0  # for which the bounds hold
    asked = (params.stuck + params.spring * params.opening) / (push_n * (params.length - params.radius))
    low, high = params.opening - atan(params.friction), acos(min(asked, 1.0))
    require("lid", {"a push that keeps the ball on the lid and shuts it": low < high, "length > 6 radius":
                    params.length > 6.0 * params.radius}, params)  # fmt: skip
    middle = 0.5 * (low + high)
    along, normal = _axes(params.opening)
    start = (params.length - params.radius - 0.030) * along + (params.radius + 0.002) * normal  # m from lip and lid
    lean = matrix_from_quaternion(quaternion_about("y", -params.opening))
    ball = Geom(kind="sphere", size=(params.radius,), position=(0.0, 0.0, WRIST_TO_TIP), rgba=TOOL_COLOUR)

    def left(state: State) -> Float:
        """Angle of the lid (N,) [rad]."""
        turned_by = state.second.get("lid.angle", np.zeros(len(state.tip.position)))
        result: Float = np.clip(params.opening - turned_by, 0.0, None)
        return result

    def shut(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = left(state) < params.tolerance
        return there

    return turned(
        Scene(
            name="lid",
            fixture=(
                Geom(kind="box", size=(0.03, 0.5 * WIDTH, 0.01), position=(-0.031, 0.0, -0.01), rgba=FIXTURE_COLOUR),
                Geom(kind="box", size=(0.06, 0.5 * WIDTH, 0.01), position=(0.06, 0.0, -0.016), rgba=FIXTURE_COLOUR),
            ),
            sprung=(_lid(params),),
            tool=tool((ball, shaft(0.003, 0.01, WRIST_TO_TIP - params.radius)), hand="grip"),
            friction=params.friction,
            start_tip=as_vector(start),
            start_quaternion=turned_quaternion(lean, TOOL_DOWN),
            goal=shut,
            goal_error=lambda state: (np.zeros(len(state.tip.position)), left(state)),
            task=Task(
                direction=(sin(middle), 0.0, -cos(middle)), hand="sliding",
                starts=tuple(
                    {f"start.offset_{a}": float(more * along[i]) for i, a in enumerate("xyz")}
                    for more in (0.0, 0.018, 0.010, -0.012)
                ),
            ),
            analytic={"push_half_width_rad": 0.5 * (high - low)},
        ),
        params.turn,
    )  # fmt: skip


def _axes(angle: float) -> tuple[Float, Float]:
    """Unit vectors (3,) along the lid and out of its upper face, at an angle from shut [rad]."""
    return np.array([cos(angle), 0.0, sin(angle)]), np.array([-sin(angle), 0.0, cos(angle)])


def _lid(params: LidParams) -> Mover:
    thick, lip_height, lip_thick, mass, colour = 0.004, 0.008, 0.004, 0.05, (0.75, 0.70, 0.55, 1.0)  # m, m, m, kg
    along, normal = _axes(params.opening)
    turn = quaternion_about("y", -params.opening)
    half = 0.5 * (params.length + lip_thick)
    plate = Geom(
        kind="box", size=(half, 0.5 * WIDTH, 0.5 * thick), position=as_vector(half * along - 0.5 * thick * normal),
        quaternion=turn, rgba=colour,
    )  # fmt: skip
    lip = Geom(
        kind="box", size=(0.5 * lip_thick, 0.5 * WIDTH, 0.5 * lip_height), quaternion=turn, rgba=colour,
        position=as_vector((params.length + 0.5 * lip_thick) * along + 0.5 * lip_height * normal),
    )  # fmt: skip
    squares = np.array([2.0 * half, WIDTH, thick]) ** 2
    own = mass / 12.0 * np.diag(squares.sum() - squares)
    axes = matrix_from_quaternion(turn)
    return Mover(
        name="lid", geoms=(plate, lip), joint="hinge", axis=(0.0, 1.0, 0.0), mass=mass,
        center_of_mass=as_vector(half * along - 0.5 * thick * normal), inertia=axes @ own @ axes.T,
        stiffness=params.spring, damping=0.02, friction=params.stuck, range=(0.0, params.opening),
    )  # fmt: skip
