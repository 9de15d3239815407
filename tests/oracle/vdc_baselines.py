r"""Two ordinary controllers to compare Virtual Decomposition Control with: piston PID, and plain model-based control.

    PID:          F = m (2 w (xd_d - xd) + w^2 (x_d - x) + w^3/8 int (x_d - x) dt)      per piston,
    model-based:  F = R^-T (M (zdd_d + 2 w (zd_d - zd) + w^2 (z_d - z)) + h)            computed torque, nominal model,

with m the piston's effective mass at the start. Both have one number w [1/s], so that both can be tuned by one
procedure (`tune`): the best of a ladder of factors sqrt(2) on a path that is not the test's, by rms error of the tool.
The laws are textbook forms; damping ratio 1 and the integral's share (an eighth, Routh's limit is 2) are our choice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from skillframe.frames import Float
from skillframe.robot.chain import ChainState, ClosedChain

LADDER = tuple(float(x) for x in 2.0 ** np.arange(0.0, 6.5, 0.5))  # 1 to 64 1/s


class PistonPid:
    """PID on each piston's position.

    Args:
        chain: for the effective masses at `start` (n,), minimal coordinates.
        bandwidth: w [1/s].
    """

    def __init__(self, chain: ClosedChain, start: Float, bandwidth: float) -> None:
        state = chain.at(start, np.zeros(len(start)))
        self._mass = 1.0 / np.diag(state.arms @ np.linalg.inv(state.mass) @ state.arms.T)
        self._w, self._sum = bandwidth, state.holding_force() / (self._mass * bandwidth**3 / 8.0)

    def forces(self, state: ChainState, desired: ChainState, dt: float) -> Float:
        """Piston forces (actuators,) for a measured and a desired state; the integral starts holding the machine."""
        (x, xd), (x_d, xd_d), w = state.driven_motion, desired.driven_motion, self._w
        self._sum = self._sum + dt * (x_d - x)
        return np.asarray(self._mass * (2 * w * (xd_d - xd) + w**2 * (x_d - x) + w**3 / 8.0 * self._sum))


class ModelBased:
    """Computed torque with the nominal model.

    Args:
        bandwidth: w [1/s].
    """

    def __init__(self, bandwidth: float) -> None:
        self._w = bandwidth

    def forces(self, state: ChainState, desired: ChainState, acceleration: Float) -> Float:
        """Piston forces (actuators,) for a measured and a desired state and desired zdd (n,)."""
        w = self._w
        zdd = acceleration + 2 * w * (desired.zd - state.zd) + w**2 * (desired.z - state.z)
        return state.actuator_force(state.mass @ zdd + state.bias)


def tune(error: Callable[[float], float], ladder: Sequence[float] = LADDER) -> float:
    """The number of the ladder with the least error; `error` gives infinity or NaN for a run that diverges."""
    results = [error(value) for value in ladder]
    return float(ladder[int(np.argmin([r if np.isfinite(r) else np.inf for r in results]))])
