r"""Joint encoders: positions in whole counts, velocities as filtered differences of them.

\(q_m = c \, \mathrm{round}(q / c)\) with the count \(c = 2 \pi / 2^b\) of a joint that turns, or metres of one that
slides. \(v \leftarrow v + a \, ((q_m - q_m^-) / h - v)\) with \(a = 1 - e^{-2 \pi f h}\): a first-order filter of
corner f, exact for a difference that holds over a tick h. It lags by \(1 / (2 \pi f)\), less half a tick.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from skillframe.frames import Float
from skillframe.robot.joint_settings import Encoders
from skillframe.world.convert import SPRUNG


class JointEncoders:
    """The encoders of N robots. Rows are independent of each other.

    Joints without a resolution, a free base and what the fixture has of its own are read exactly.

    Args:
        settings: resolution and filter.
        engine: the simulator's model, which orders coordinates and velocities.
        position: (N, nq) where the robots stand at rest, quaternions and all.
        dt: [s] between two samples.

    Attributes:
        position: (N, nq) as measured; velocity: (N, nv).
    """

    def __init__(self, settings: Encoders, engine: Any, position: Float, dt: float) -> None:
        counts = {
            int(mujoco.mjtJoint.mjJNT_HINGE): settings.count_rad, int(mujoco.mjtJoint.mjJNT_SLIDE): settings.step_m
        }  # fmt: skip
        own = [j for j in range(engine.njnt) if not engine.joint(j).name.startswith(SPRUNG)]
        joints = [j for j in own if counts.get(int(engine.jnt_type[j])) is not None]
        self._q, self._v = engine.jnt_qposadr[joints].astype(np.int64), engine.jnt_dofadr[joints].astype(np.int64)
        self._count = np.array([counts[int(engine.jnt_type[j])] for j in joints], dtype=float)
        self._pass, self._dt = 1.0 - np.exp(-2.0 * np.pi * settings.corner_hz * dt), dt
        self._last = self._counted(position)
        self._rate = np.zeros_like(self._last)
        self.position: Float = position.copy()
        self.position[:, self._q] = self._last
        self.velocity: Float = np.zeros((len(position), int(engine.nv)))

    @property
    def state(self) -> tuple[Float, Float]:
        """Position and velocity as measured, live views."""
        return self.position, self.velocity

    def _counted(self, position: Float) -> Float:
        counted: Float = np.rint(position[:, self._q] / self._count) * self._count
        return counted

    def sample(self, position: Float, velocity: Float) -> None:
        """A tick later: take in the true state (N, nq), (N, nv)."""
        now = self._counted(position)
        self._rate += self._pass * ((now - self._last) / self._dt - self._rate)
        self._last = now
        self.position[:] = position
        self.position[:, self._q] = now
        self.velocity[:] = velocity
        self.velocity[:, self._v] = self._rate
