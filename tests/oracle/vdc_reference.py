"""Required velocities over arrays; the product writes them as expressions (`law.vdc_reference`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from skillframe_hydraulics.law.vdc_reference import ToolTask

from skillframe.frames import Float
from skillframe.robot.chain import ChainState


class Path(NamedTuple):
    """Desired position, velocity and acceleration of the task's rows (n,): tool coordinates [m], then joints."""

    position: Float
    velocity: Float
    acceleration: Float


class Required(NamedTuple):
    """Required rates zd_r and their derivative zdd_r (n,) in minimal coordinates."""

    rate: Float
    acceleration: Float


def required_motion(
    task: ToolTask,
    state: ChainState,
    path: Path,
    stiffness: Float,
    push: Float | None = None,
    push_rate: Float | None = None,
) -> Required:
    """Required rates.

    Args:
        task: what is commanded.
        state: measured.
        path: desired, (n,) each.
        stiffness: Lambda (n, n) [1/s].
        push: D^-1 (f - f_d) (n,) [m/s], zero where not given.
        push_rate: its rate.
    """
    jacobian, zero = task.jacobian(state), np.zeros(len(state.z))
    velocity = path.velocity + stiffness @ (path.position - task.position(state)) + (zero if push is None else push)
    rate = np.asarray(np.linalg.solve(jacobian, velocity), dtype=float)
    acceleration = path.acceleration + stiffness @ (path.velocity - jacobian @ state.zd)
    acceleration = acceleration + (zero if push_rate is None else push_rate) - task.drift(state, rate)
    return Required(rate, np.asarray(np.linalg.solve(jacobian, acceleration), dtype=float))
