"""What the robot measures: joint encoders turned into pose and twist, and a force-torque sensor at the wrist.

The force-torque sensor sits between the robot's tool frame and the tool. It reads contact, tool weight and the tool's
inertial forces, plus a bias drawn per trial and white noise. Before the skill starts the robot holds still for a
moment and tares: bias and tool weight are removed as on a real cell, with the *nominal* tool weight, so that a wrong
grasp leaves its error in the wrench. Inertial forces are left in, as real sensors do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skillframe.frames import Float, Pose, cross, move_wrench, rotate, rotate_spatial, skew
from skillframe.world.plant import Plant
from skillframe.world.reading import compiled_wrist

BLOCK = 100
TARE_TICKS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """Noise of the sensors, as standard deviations per 1 kHz sample.

    Attributes:
        force_noise: [N]; 0.3 N is a wrist sensor on a moving robot (0.2-0.65 N in the kuka_ati recordings).
        torque_noise: [Nm].
        force_bias: of the bias drawn per trial [N]; torque_bias: [Nm].
        position_noise: of the tool point from encoders [m]; rotation_noise: [rad].
    """

    force_noise: float = 0.3
    torque_noise: float = 0.02
    force_bias: float = 1.0
    torque_bias: float = 0.05
    position_noise: float = 5e-5
    rotation_noise: float = 3.5e-4


class Sensors:
    """The sensors of N trials. All randomness comes from one generator per trial, drawn in blocks."""

    def __init__(
        self, settings: SensorSettings, plant: Plant, rngs: Sequence[np.random.Generator], draws: Mapping[str, Float]
    ) -> None:
        self._plant, self._rngs = plant, list(rngs)
        count = len(self._rngs)
        self._scale = _noise_scales(settings, count, draws)
        self._bias = _biases(settings, self._rngs, draws)  # what is left of it after taring, from then on
        self._noise, self._turn = np.zeros((BLOCK, count, 12)), np.zeros((BLOCK, count, 3, 3))
        self._next = BLOCK
        tool = plant.tool
        self._weight = tool.mass * np.array(plant.model.opt.gravity)
        self._com = np.array(tool.center_of_mass, dtype=float)
        self._compiled = compiled_wrist(plant.gauge, self._noise, self._bias, self._weight, self._com)

    def _draw(self) -> tuple[Float, Float]:
        """Noise of force, torque and position (N, 12), and the rotation (N, 3, 3) that attitude noise turns by."""
        if self._next == BLOCK:
            for i, rng in enumerate(self._rngs):
                self._noise[:, i] = rng.standard_normal((BLOCK, 12))
            self._noise *= self._scale
            self._turn = _small_rotation(self._noise[..., 9:])
            self._next = 0
        now = self._next
        self._next += 1
        return self._noise[now], self._turn[now]

    def sample(self, pose: Pose) -> tuple[Pose, Float]:
        """Measured pose of the tool frame, and the wrench (N, 6) on the tool there without weight and tare, base axes.

        Args:
            pose: true pose of the tool frame.
        """
        noise, turn = self._draw()
        measured = Pose(pose.position + noise[:, 6:9], turn @ pose.rotation)
        if self._compiled is not None:
            return measured, self._compiled.wrench(self._next - 1, measured.rotation)
        wrench = rotate_spatial(measured.rotation, self._plant.sensor_wrench() + (self._bias + noise[:, :6]))
        wrench[:, :3] -= self._weight
        wrench[:, 3:] -= cross(rotate(measured.rotation, self._com), self._weight)
        return measured, wrench

    def set_tare(self, mean: Float, rotation: Float) -> None:
        """Take the mean wrench (N, 6) of a still moment, base axes, as the bias from now on."""
        self._bias -= rotate_spatial(np.swapaxes(rotation, -1, -2), mean)


def _small_rotation(vector: Float) -> Float:
    """1 + K + K^2 / 2 of rotation vectors (..., 3): exact to 1e-10 for the milliradians of sensor noise."""
    k = skew(vector)
    square = k @ k
    square *= 0.5
    k += np.eye(3)
    k += square
    return k


def at_point(wrench: Float, rotation: Float, offset: Float) -> Float:
    """A wrench at the tool frame's origin, base axes, taken at a point of the tool frame instead."""
    return move_wrench(wrench, rotate(rotation, offset))


def _noise_scales(settings: SensorSettings, count: int, draws: Mapping[str, Float]) -> Float:
    scale = np.empty((count, 12))
    scale[:, :3] = np.asarray(draws.get("sensor.force_noise", np.full(count, settings.force_noise)))[:, None]
    scale[:, 3:6] = np.asarray(draws.get("sensor.torque_noise", np.full(count, settings.torque_noise)))[:, None]
    scale[:, 6:9] = settings.position_noise
    scale[:, 9:] = settings.rotation_noise
    return scale


def _biases(settings: SensorSettings, rngs: Sequence[np.random.Generator], draws: Mapping[str, Float]) -> Float:
    bias = np.stack([rng.standard_normal(6) for rng in rngs])
    bias[:, :3] *= settings.force_bias
    bias[:, 3:] *= settings.torque_bias
    for kind, first in (("force", 0), ("torque", 3)):
        for axis, letter in enumerate("xyz"):
            key = f"sensor.{kind}_bias_{letter}"
            if key in draws:
                bias[:, first + axis] = draws[key]
    return bias
