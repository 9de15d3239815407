"""Where the trials of a hydraulic machine start, and the piston forces that hold it there."""

from __future__ import annotations

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.machine.checks.feasibility import require_feasible
from skillframe.machine.law.vdc_reference import ToolTask
from skillframe.robot.chain import ClosedChain
from skillframe.world.placement import start_poses
from skillframe.world.plant import Draws
from skillframe.world.scene import Scene


def closed_configurations(chain: ClosedChain, task: ToolTask, scene: Scene, draws: Draws, count: int) -> Float:
    """Closed configurations (N, nq) with the tool's point at its start, the other joints as at home.

    Raises:
        InputError: a start beside the machine's plane, or one that a cylinder cannot reach or hold.
    """
    robot, axes = chain.robot, task.axes
    across = f"start.offset_{'xyz'[({0, 1, 2} - set(axes)).pop()]}"
    if np.any(draws.get(across, 0.0)):
        raise InputError(across, f"{robot.spec.name} moves its tool in a plane, and not across it", "leave it out")
    home = chain.minimal(robot.home)
    rows = []
    for point in start_poses(robot, scene, draws, count).position[:, axes]:
        z = task.solve(chain, np.concatenate([point, home[2:]]), home)
        require_feasible(chain, z)
        rows.append(chain.configuration(z))
    return np.array(rows)


def holding_force(chain: ClosedChain, z: Float, draws: Draws) -> Float:
    """(N, k) piston forces that balance the gravity of each trial's own masses at rest.

    Args:
        chain: the nominal machine.
        z: (N, n) minimal coordinates.
        draws: quantities per trial.
    """
    scale = np.asarray(draws.get("robot.mass_scale", np.ones(len(z))))
    states = [chain.at(row, np.zeros(len(row))) for row in z]
    hold = np.array([state.holding_force() for state in states])
    payload = chain.robot.spec.payload
    if payload is not None and "robot.payload" in draws:
        more = (draws["robot.payload"] - payload.mass)[:, None] * chain.load_gravity(z)
        hold += [np.linalg.solve(state.arms.T, row) for state, row in zip(states, more, strict=True)]
    return np.asarray(scale[:, None] * hold)
