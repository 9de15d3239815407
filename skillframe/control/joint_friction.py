r"""Nominal friction and damping of the joints, added to the torques of a controller that knows them.

\(\tau_c = d \dot q + f \, \mathrm{clip}(\dot q / v_s, -1, 1)\) with \(v_s\) = 0.1 rad/s or m/s (ours: a sign of a
measured velocity would chatter at rest). It never drives a joint whose true friction is the nominal one:
\(|\tau_c - d \dot q| \le f\), which friction itself holds against. At rest it adds nothing, so a joint that sticks
still takes f to start.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float

SLOW = 0.1  # rad/s or m/s


class FrictionCompensation:
    """Of N rows, each with the joints of its arm.

    Args:
        engine: the simulator's nominal model, which holds friction and damping by generalised velocity.
        arms: of each arm its generalised velocities; None where a row has them all. Rows take the arms in turn.
        count: N.
    """

    def __init__(self, engine: Any, arms: Sequence[NDArray[np.int64]] | None, count: int) -> None:
        chosen = [np.arange(int(engine.nv))] if arms is None else arms
        turns = count // len(chosen)
        self._friction, self._damping = (
            np.tile(np.stack([np.array(values, dtype=float)[dofs] for dofs in chosen]), (turns, 1))
            for values in (engine.dof_frictionloss, engine.dof_damping)
        )

    def torque(self, velocity: Float) -> Float:
        """(N, nv) to be added at joint velocities (N, nv)."""
        along = np.minimum(np.maximum(velocity * (1.0 / SLOW), -1.0), 1.0)
        result: Float = self._damping * velocity + self._friction * along
        return result
