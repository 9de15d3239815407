"""A simulated teacher with vision, whose hand also guides the tip to the hole entrance.

With e the error of the seen place, sampled once per demonstration, x the tip and n the push,

    a = (I - n n^T) (m + e - x - T v)
    F = F_look min(1, |a| / l) a / |a| - D max(n^T v - v_h, 0) n

acts at the tip: it pulls towards the hole entrance m and brakes a fall. The figures l = 3 mm, T = 30 ms, F_look = 10 N,
D = 600 Ns/m and v_h = 20 mm/s are assumptions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float, Pose, cross, norm, rotate
from skillframe.skill import Command, Observation
from skillframe.world import Scene
from skillframe_teaching.teacher import Hand, Teacher, TeacherSettings

FULL_M, AHEAD_S, URGE_N = 0.003, 0.03, 10.0
HELD_NS_M, LOWERED_M_S = 600.0, 0.02


class SeeingTeacher(Teacher):
    """A teacher who sees the tips of N tools.

    `fixture` is its true pose per trial, (N, 3) and (N, 3, 3); the hole entrance is the origin of the fixture frame.

    Raises:
        InputError: the task has stages, or no direction.
    """

    def __init__(self, scene: Scene, fixture: Pose, settings: TeacherSettings, hand: Hand | None = None) -> None:
        if scene.task.then or scene.task.direction is None:
            what = "has no hole entrance for the teacher to see"
            raise InputError(f"world {scene.name}", what, "leave out teacher.vision_error")
        super().__init__(scene.task, fixture, settings, hand)
        frames = scene.tool.frames
        self._to_tip: Float = np.array(frames["tip"]) - np.array(frames[scene.tool.hand])

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Hold the tool, and sample the seen hole entrance."""
        super().start(observation, rngs)
        error = self._settings.vision_error
        assert error is not None
        self._entrance = self._fixture.position + error * np.array([rng.standard_normal(3) for rng in rngs])

    def step(self, observation: Observation) -> Command:
        """Move the hand by one tick, guide the tip to the hole entrance, and brake its fall."""
        command = super().step(observation)
        if observation.time[0] < self._task.waits_s:
            return command
        arm = rotate(observation.pose.rotation, self._to_tip)
        speed = observation.twist[:, :3] + cross(observation.twist[:, 3:], arm)
        away = self._entrance - observation.pose.position - arm - AHEAD_S * speed
        assert self._direction is not None
        fast = np.maximum((speed * self._direction).sum(axis=-1, keepdims=True) - LOWERED_M_S, 0.0)
        away -= (away * self._direction).sum(axis=-1, keepdims=True) * self._direction
        added = command.feedforward.copy()
        urge = URGE_N * away / np.maximum(norm(away), FULL_M)[:, None] - HELD_NS_M * fast * self._direction
        added[:, :3] += urge
        added[:, 3:] += cross(arm, urge)
        return command._replace(feedforward=added)
