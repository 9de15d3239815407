r"""`lid`: a ball pushes a lid shut about its hinge. It catches on a lip at the lid's free end.

While the lid turns from its opening A to 0, the way that the ball is led turns by A too, and one push has to do all of
it. With D the angle of the push from the closing direction -z towards the free end, and the lid at an angle a,

    the ball does not slide to the hinge at first:  D > A - phi
    the push turns the lid home:                    F l cos(D - a) > M, so cos(D) > M / (F l) once it is nearly shut

(our derivation: planar, Coulomb with friction mu = tan(phi), quasi-static; l from hinge to ball, F the push, M what
the hinge asks). Pushes between these always shut the lid. The first bound is not sharp: a ball that slides towards the
hinge gives the lid time to shut, after which it slides no more. So averages of what a person shows mostly do, as in a
valley: there is one axis of motion, and all contact lies on one side of the push.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan, cos, sin

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, matrix_from_quaternion
from skillframe.world.scene import Geom, Mover, Scene, State, Task
from skillframe.world.shapes import FIXTURE_COLOUR, TOOL_COLOUR, quaternion_about, shaft
from skillframe.world.worlds.common import TOOL_DOWN, WRIST_TO_TIP, require, tool
from skillframe.world.worlds.turned import as_vector, turned, turned_quaternion

WIDTH, THICK = 0.12, 0.004
LIP, LIP_THICK = 0.008, 0.004  # how far the lip stands up, and its thickness [m]
CLEAR = 0.002  # from the ball to the lid at the start [m]
BEGIN = 0.030  # from the lip to the ball at the nominal start [m]
MASS = 0.05  # of the lid [kg]
PUSH_N = 15.0  # a person's push, for which the push's bounds are told
LID_COLOUR = (0.75, 0.70, 0.55, 1.0)
NAME = "lid"
SHUT = f"{NAME}.angle"


@dataclass(frozen=True, slots=True, kw_only=True)
class LidParams:
    """Parameters of `lid`.

    Ranges end where parts are too small for a gripper, or too large for an arm (our choice).

    Attributes:
        opening: angle A of the lid at the start [rad, 20deg to 80deg].
        length: from the hinge to the lip [m, 40mm to 400mm].
        spring: what holds the lid open, slack at the start [Nm/rad, 0 to 10].
        stuck: friction of the hinge, which holds the lid where it is [Nm, 0 to 5].
        friction: Coulomb coefficient between ball and lid [0 to 5].
        radius: of the ball at the tip [m, 0.1mm to 200mm].
        tolerance: angle that counts as shut [rad, 0.1deg to 10deg].
        turn: rotation vector by which the whole fixture is turned [rad, -180deg to 180deg].
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
    """The hinge is the y axis. Shut, the lid's upper face is the plane z = 0, x > 0, with the lip at its free end."""
    low, high = _pushes(params)
    require("lid", {"a push that keeps the ball on the lid and shuts it": low < high, "length > 6 radius":
                    params.length > 6.0 * params.radius}, params)  # fmt: skip
    middle = 0.5 * (low + high)
    along, normal = _axes(params.opening)
    start = (params.length - params.radius - BEGIN) * along + (params.radius + CLEAR) * normal
    lean = matrix_from_quaternion(quaternion_about("y", -params.opening))
    ball = Geom(kind="sphere", size=(params.radius,), position=(0.0, 0.0, WRIST_TO_TIP), rgba=TOOL_COLOUR)

    def left(state: State) -> Float:
        """How far the lid is from shut (N,) [rad]."""
        turned_by = state.second.get(SHUT, np.zeros(len(state.tip.position)))
        result: Float = np.clip(params.opening - turned_by, 0.0, None)
        return result

    def shut(state: State) -> NDArray[np.bool_]:
        there: NDArray[np.bool_] = left(state) < params.tolerance
        return there

    return turned(
        Scene(
            name="lid",
            fixture=_standing(),
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


def _pushes(params: LidParams) -> tuple[float, float]:
    """Between which angles from -z towards the free end a push of `PUSH_N` keeps the ball on the lid and shuts it."""
    asked = (params.stuck + params.spring * params.opening) / (PUSH_N * (params.length - params.radius))
    return params.opening - atan(params.friction), acos(min(asked, 1.0))


def _axes(angle: float) -> tuple[Float, Float]:
    """From the hinge along the lid, and out of its upper face, both (3,), at an angle from shut [rad]."""
    return np.array([cos(angle), 0.0, sin(angle)]), np.array([-sin(angle), 0.0, cos(angle)])


def _standing() -> tuple[Geom, ...]:
    """What the hinge is fixed to, and what the lid shuts."""
    behind = Geom(kind="box", size=(0.03, 0.5 * WIDTH, 0.01), position=(-0.031, 0.0, -0.01), rgba=FIXTURE_COLOUR)
    below = Geom(kind="box", size=(0.06, 0.5 * WIDTH, 0.01), position=(0.06, 0.0, -0.016), rgba=FIXTURE_COLOUR)
    return behind, below


def _lid(params: LidParams) -> Mover:
    """The lid as it stands open: a plate whose upper face goes through the hinge's axis, and its lip."""
    along, normal = _axes(params.opening)
    turn = quaternion_about("y", -params.opening)
    half = 0.5 * (params.length + LIP_THICK)
    plate = Geom(
        kind="box", size=(half, 0.5 * WIDTH, 0.5 * THICK), position=as_vector(half * along - 0.5 * THICK * normal),
        quaternion=turn, rgba=LID_COLOUR,
    )  # fmt: skip
    lip = Geom(
        kind="box", size=(0.5 * LIP_THICK, 0.5 * WIDTH, 0.5 * LIP), quaternion=turn, rgba=LID_COLOUR,
        position=as_vector((params.length + 0.5 * LIP_THICK) * along + 0.5 * LIP * normal),
    )  # fmt: skip
    squares = np.array([2.0 * half, WIDTH, THICK]) ** 2
    own = MASS / 12.0 * np.diag(squares.sum() - squares)
    axes = matrix_from_quaternion(turn)
    return Mover(
        name=NAME, geoms=(plate, lip), joint="hinge", axis=(0.0, 1.0, 0.0), mass=MASS,
        center_of_mass=as_vector(half * along - 0.5 * THICK * normal), inertia=axes @ own @ axes.T,
        stiffness=params.spring, damping=0.02, friction=params.stuck, range=(0.0, params.opening),
    )  # fmt: skip
