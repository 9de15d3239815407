r"""Measurements: pose and twist from joint encoders, and the wrist's force-torque sensor.

The tare at rest removes bias and *nominal* tool weight, so grasp errors remain.

Encoders quantise positions, \(q_m = c \, \mathrm{round}(q / c)\) with the count \(c = 2 \pi / 2^b\) of revolute joints
or metres of prismatic ones, and filter velocities, \(v \leftarrow v + a \, ((q_m - q_m^-) / h - v)\) with \(a = 1 -
e^{-2 \pi f h}\), corner f and step h.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from skillframe.frames import Float, Pose, cross, move_wrench, rotate, rotate_spatial, skew
from skillframe.robot.tables import Encoders
from skillframe.world.convert import SPRUNG
from skillframe.world.plant import Plant
from skillframe.world.quantities import SensorSettings
from skillframe.world.reading import compiled_wrist

BLOCK = 100
TARE_TICKS = 100


class Sensors:
    """Sensors of N trials, each with its own random generator, sampled in blocks."""

    def __init__(
        self, settings: SensorSettings, plant: Plant, rngs: Sequence[np.random.Generator], draws: Mapping[str, Float]
    ) -> None:
        self._plant, self._rngs = plant, list(rngs)
        count = len(self._rngs)
        self._scale = scale = np.empty((count, 12))
        scale[:, :3] = np.asarray(draws.get("sensor.force_noise", np.full(count, settings.force_noise)))[:, None]
        scale[:, 3:6] = np.asarray(draws.get("sensor.torque_noise", np.full(count, settings.torque_noise)))[:, None]
        scale[:, 6:9] = settings.position_noise
        scale[:, 9:] = settings.rotation_noise
        bias = np.stack([rng.standard_normal(6) for rng in self._rngs])
        bias[:, :3] *= settings.force_bias
        bias[:, 3:] *= settings.torque_bias
        for kind, first in (("force", 0), ("torque", 3)):
            for axis, letter in enumerate("xyz"):
                key = f"sensor.{kind}_bias_{letter}"
                if key in draws:
                    bias[:, first + axis] = draws[key]
        self._bias = bias  # the residual after taring
        self._noise, self._turn = np.zeros((BLOCK, count, 12)), np.zeros((BLOCK, count, 3, 3))
        self._next = BLOCK
        tool = plant.tool
        self._weight = tool.mass * np.array(plant.model.opt.gravity)
        self._com = np.array(tool.center_of_mass, dtype=float)
        self._compiled = compiled_wrist(plant.gauge, self._noise, self._bias, self._weight, self._com)

    def sample(self, pose: Pose) -> tuple[Pose, Float]:
        """Measured pose of the tool frame, and wrench (N, 6) on the tool without weight and tare, for a true pose."""
        if self._next == BLOCK:
            for i, rng in enumerate(self._rngs):
                self._noise[:, i] = rng.standard_normal((BLOCK, 12))
            self._noise *= self._scale
            self._turn = _small_rotation(self._noise[..., 9:])
            self._next = 0
        now = self._next
        self._next += 1
        noise, turn = self._noise[now], self._turn[now]
        measured = Pose(pose.position + noise[:, 6:9], turn @ pose.rotation)
        if self._compiled is not None:
            return measured, self._compiled.wrench(self._next - 1, measured.rotation)
        wrench = rotate_spatial(measured.rotation, self._plant.sensor_wrench() + (self._bias + noise[:, :6]))
        wrench[:, :3] -= self._weight
        wrench[:, 3:] -= cross(rotate(measured.rotation, self._com), self._weight)
        return measured, wrench

    def set_tare(self, mean: Float, rotation: Float) -> None:
        """Set the bias to the mean wrench (N, 6) at rest, base axes."""
        self._bias -= rotate_spatial(np.swapaxes(rotation, -1, -2), mean)


def _small_rotation(vector: Float) -> Float:
    """1 + K + K^2 / 2 of rotation vectors (..., 3), exact to 1e-10 for milliradians."""
    k = skew(vector)
    square = k @ k
    square *= 0.5
    k += np.eye(3)
    k += square
    return k


def at_point(wrench: Float, rotation: Float, offset: Float) -> Float:
    """Move a wrench from the tool frame's origin to another point of it, base axes."""
    return move_wrench(wrench, rotate(rotation, offset))


class JointEncoders:
    """Encoders of N robots, for `engine` of MuJoCo and sampling time `dt` [s].

    Joints without a resolution, a free base and the fixture's joints are read exactly.

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
        """Measured position and velocity, as views."""
        return self.position, self.velocity

    def _counted(self, position: Float) -> Float:
        counted: Float = np.rint(position[:, self._q] / self._count) * self._count
        return counted

    def sample(self, position: Float, velocity: Float) -> None:
        """Sample the true state (N, nq), (N, nv), one step later."""
        now = self._counted(position)
        self._rate += self._pass * ((now - self._last) / self._dt - self._rate)
        self._last = now
        self.position[:] = position
        self.position[:, self._q] = now
        self.velocity[:] = velocity
        self.velocity[:, self._v] = self._rate
