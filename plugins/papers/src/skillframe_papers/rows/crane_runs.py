r"""Runs of the crane on a desired path of the tool, with first-order impedance.

    D (X' - X_d') + K (X - X_d) = f,     X_d(t) given, legs from rest to rest by 10 s^3 - 15 s^4 + 6 s^5

Before a run the loop swings the crane in the air to identify friction and payload; the plant's masses and frictions
vary.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from skillframe.execution import Result, Setup, load_robot_model, simulate
from skillframe.frames import Float, Pose
from skillframe.robot import RobotModel
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe.world import Geom, Scene, Task, Tool, anywhere, no_error

Path = Callable[[float], tuple[Float, Float]]
"""Displacement from the start (3,) [m] and its rate at a time [s]."""
FIXTURE = np.array([3.0, 0.0, 0.0])
CORNERS = np.array([[2.5, 0.0, 1.0], [3.0, 0.0, 1.5], [3.5, 0.0, 1.0], [3.0, 0.0, 0.5]])
"""The published diamond, in base [m], 5 s a leg."""
LEG_S = 5.0
ABOVE, PLATE, RADIUS = 0.95, 0.45, 0.05  # tool start, plate top, radius of the tool's sphere [m]
NEAR, NEAR_S, SLIDING_S = 0.02, 2.5, 6.0
"""The path stops this far above the plate [m], presses from rest for 3 s, then slides [s], as a landing at speed
exceeds the force limit."""
STROKE, SPEED = 0.4, 0.19  # along the plate [m], [m/s]


class Stiffness(NamedTuple):
    """K [N/m] and D [N s/m], the same along both axes."""

    stiffness: float
    damping: float


MOVING = Stiffness(3.0e5, 5.0e4)  # Lambda = 6 1/s as published; D ours
PRESSING = Stiffness(1.0e5, 5.0e4)


class Follow(Skill):
    """Follows one path of displacements from the tool's start."""

    def __init__(self, path: Path, gains: Stiffness) -> None:
        self._path, self._gains = path, gains

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take the measured pose as the path's origin."""
        n, unit = len(rngs), np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._impedance = Impedance(
            np.tile(self._gains.stiffness * unit, (n, 1, 1)), np.tile(self._gains.damping * unit, (n, 1, 1))
        )
        self._nothing, self._status, self._reason = np.zeros((n, 6)), np.full(n, Status.RUNNING), no_reasons(n)

    def step(self, observation: Observation) -> Command:
        """The path's pose and rate now."""
        place, rate = self._path(float(observation.time[0]))
        twist = np.concatenate([np.broadcast_to(rate, (len(self._nothing), 3)), self._nothing[:, 3:]], axis=1)
        pose = Pose(self._home.position + place, self._home.rotation)
        return Command(pose, twist, self._impedance, self._nothing, self._status, self._reason)


def blend(s: float) -> tuple[float, float]:
    """Blend from 0 to 1 from rest to rest, and its rate."""
    s = min(max(s, 0.0), 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 30.0 * s**2 * (1.0 - s) ** 2


def diamond(time: float) -> tuple[Float, Float]:
    """The published path, repeated."""
    leg = int(time // LEG_S)
    begin, end = CORNERS[leg % 4], CORNERS[(leg + 1) % 4]
    value, rate = blend(time / LEG_S - leg)
    return begin - CORNERS[0] + value * (end - begin), rate / LEG_S * (end - begin)


def press_and_slide(depth: float) -> Path:
    """Down to near the plate, on until the desired tool is `depth` below its top [m], then to and fro."""
    above = ABOVE - PLATE - RADIUS - NEAR

    def place(time: float) -> Float:
        since = max(0.0, time - SLIDING_S)
        turn = SPEED / STROKE * (0.5 * since**2 if since < 1.0 else since - 0.5)
        down = -above * blend(time / NEAR_S)[0] - (NEAR + depth) * blend((time - NEAR_S) / 3.0)[0]
        return np.array([STROKE * np.sin(turn), 0.0, down])

    def path(time: float) -> tuple[Float, Float]:
        h = 1e-4
        return place(time), (place(time + h) - place(max(time - h, 0.0))) / (h + min(time, h))

    return path


def scene(start: Float, *, plate: bool) -> Scene:
    """A sphere at the tool, over a plate or in the air, from `start` in base [m]."""
    tool = Tool(
        geoms=(Geom(kind="sphere", size=(RADIUS,)),), mass=1e-3, center_of_mass=(0.0, 0.0, 0.0),
        inertia=(1e-6, 1e-6, 1e-6), frames={"tip": (0.0, 0.0, 0.0)},
    )  # fmt: skip
    slab = Geom(kind="box", size=(2.0, 0.5, 0.1), position=(0.0, 0.0, PLATE - 0.1))
    x, y, z = (float(value) for value in start - FIXTURE)
    return Scene(
        name="plate", fixture=(slab,) if plate else (), tool=tool, friction=0.3, start_tip=(x, y, z),
        start_quaternion=(0.0, 0.0, 0.0, 1.0), goal=anywhere, goal_error=no_error, task=Task(direction=None),
    )  # fmt: skip


def run(
    path: Path, gains: Stiffness, where: Scene, draws: Mapping[str, Float], *, seconds: float, seed: int,
    trace_hz: float = 100.0, robot: RobotModel | None = None,
) -> Result:  # fmt: skip
    """Run a crane on a path, a trial per sample."""
    count = len(next(iter(draws.values())))
    robot = robot or load_robot_model("hiab_xs031")
    setup = Setup(robot=robot, scene=where, center_of_compliance=np.zeros(3))
    rngs = [np.random.default_rng([seed, i]) for i in range(count)]
    return simulate(Follow(path, gains), setup, draws, rngs, duration_s=seconds, trace_hz=trace_hz)
