"""Whether a machine can do a world's task: stand at its start, swing its tool in the air there, and reach its goal.

Where it cannot, a fixture is sought for `[workspace]` that puts all of this within reach: starts at home and on shells
around it, the nearest first.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float, Pose, norm
from skillframe.robot import ClosedChain
from skillframe.world import Scene
from skillframe_hydraulics.checks.feasibility import problems
from skillframe_hydraulics.force.calibration import CALIBRATION_S, swing
from skillframe_hydraulics.law.vdc_reference import ToolTask

LOOKS = 13  # of a swing of 6 s, which turns on whole and half seconds
SHELL, SHELLS = 0.1, 15  # distance [m] between shells of starts around home, and how many


def unfit_start(chain: ClosedChain, task: ToolTask, point: Float, part: float, goals: Float) -> str:
    """Why the machine cannot stand with its tool at a point of base, swing by `part` there and reach the goals, or "".

    `point` (3,) is in base, `goals` (G, 3) are relative to it [m].
    """
    home, axes = chain.minimal(chain.home), task.axes
    swung = [swing(float(time), len(axes), part) for time in np.linspace(0.0, CALIBRATION_S, LOOKS)]
    ways = [(np.zeros(len(axes)), 0.0, "there")]
    ways += [(axes @ goal, 0.0, f"at its goal, {_written(point + goal)} m,") for goal in goals]
    ways += [(moved, joint, "in the swing that identifies it before each run") for moved, _, joint, _ in swung]
    z = home
    for moved, joint, where in ways:
        try:
            z = task.solve(chain, np.concatenate([axes @ point + moved, home[len(axes) :] + joint]), z)
        except InputError:
            return f"{where} the tool would be out of reach"
        if found := problems(chain, chain.settled(z)):
            return f"{where} {found[0]}"
    return ""


def require_start(
    chain: ClosedChain, task: ToolTask, scene: Scene, starts: Float, fixtures: Pose, part: float
) -> None:  # fmt: skip
    """Refuse starts (N, 3) in base [m] at all of which, with fixtures (N,), `unfit_start` finds something.

    Raises:
        InputError: on the first, with a fixture that puts start and goals within reach.
    """
    reached, texts = np.array(scene.reached).reshape(-1, 3), list[str]()
    for start, place, turn in zip(starts, fixtures.position, fixtures.rotation, strict=True):
        texts.append(unfit_start(chain, task, start, part, place + reached @ turn.T - start))
        if not texts[-1]:
            return
    point, text = starts[0], texts[0]
    goals = fixtures.position[0] + reached @ fixtures.rotation[0].T - point
    spec = chain.robot.spec
    fix = "choose another machine, or place start and goal nearer to each other by the world's settings"
    for other in _starts(chain, task):
        if not unfit_start(chain, task, other, part, goals):
            fixture = np.asarray(spec.workspace.fixture) + task.axes.T @ task.axes @ (other - point)
            fix = f"write fixture = {_written(fixture)} under [workspace] of robot.toml"
            break
    raise InputError(f"robot {spec.name}", f"cannot begin with its tool at {_written(point)} m: {text}", fix)


def _starts(chain: ClosedChain, task: ToolTask) -> Iterator[Float]:
    """Tool points (3,) in base: home's, rounded to centimetres, then on shells around it along and between the axes."""
    home = chain.minimal(chain.home)
    state = chain.at(home, 0.0 * home)
    tip = np.round(state.data.oMf[chain.robot.tool_frames[0]].translation, 2)
    yield tip
    for shell in range(1, SHELLS + 1):
        for way in itertools.product((-1.0, 0.0, 1.0), repeat=len(task.axes)):
            if size := norm(np.array(way)):
                yield tip + np.round(SHELL * shell / size * (np.array(way) @ task.axes), 2)


def _written(place: Float) -> str:
    return f"[{', '.join(f'{x:.4g}' for x in np.round(place, 3) + 0.0)}]"
