"""A simulated person who looks: a hand that also leads the tip to where he sees the mouth.

With e the error of what he sees, drawn once a demonstration, x the tip and n the push,

    a = (I - n n^T) (m + e - x - T v)
    F = F_look min(1, |a| / l) a / |a| - D max(n^T v - v_h, 0) n

acts at the tip: he urges it to where he sees the mouth m, and holds it back where it falls in faster than he lowers it.
All figures are ours (l = 3 mm, T = 30 ms, F_look = 10 N, D = 600 Ns/m, v_h = 20 mm/s): two thirds of the push slide
a part over a rim of friction 0.5, and who pushes with 15 N into a gap meets the bottom with less than 80 N.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float, Pose, cross, norm, rotate
from skillframe.skill import Command, Observation
from skillframe.teaching.teacher import Hand, Teacher, TeacherSettings
from skillframe.world.scene import Scene

FULL_M, AHEAD_S, URGE_N = 0.003, 0.03, 10.0
HELD_NS_M, LOWERED_M_S = 600.0, 0.02


class LookingTeacher(Teacher):
    """The person's hand on N tools, and his eyes on their tips.

    Args:
        scene: its task has one stage and a direction; the mouth is the origin of its fixture frame.
        fixture: true pose of the fixture per trial, (N, 3) and (N, 3, 3).
        settings: how well the person aims and sees.
        hand: how the person holds; the task's if None.

    Raises:
        InputError: the task has stages, or no direction, so that there is nothing to look at.
    """

    def __init__(self, scene: Scene, fixture: Pose, settings: TeacherSettings, hand: Hand | None = None) -> None:
        if scene.task.then or scene.task.direction is None:
            what = "has no mouth that a person could look at"
            raise InputError(f"world {scene.name}", what, "leave out how exactly he looks")
        super().__init__(scene.task, fixture, settings, hand)
        frames = scene.tool.frames
        self._to_tip: Float = np.array(frames["tip"]) - np.array(frames[scene.tool.hand])

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take hold of the tool, and see the mouth."""
        super().start(observation, rngs)
        exactly = self._settings.looks
        assert exactly is not None
        self._mouth = self._fixture.position + exactly * np.array([rng.standard_normal(3) for rng in rngs])

    def step(self, observation: Observation) -> Command:
        """Move the hand one tick on, urge the tip to the mouth, and hold it back where it falls."""
        command = super().step(observation)
        if observation.time[0] < self._task.waits_s:
            return command
        arm = rotate(observation.pose.rotation, self._to_tip)
        speed = observation.twist[:, :3] + cross(observation.twist[:, 3:], arm)
        away = self._mouth - observation.pose.position - arm - AHEAD_S * speed
        assert self._direction is not None
        fast = np.maximum((speed * self._direction).sum(axis=-1, keepdims=True) - LOWERED_M_S, 0.0)
        away -= (away * self._direction).sum(axis=-1, keepdims=True) * self._direction
        added = command.feedforward.copy()
        urge = URGE_N * away / np.maximum(norm(away), FULL_M)[:, None] - HELD_NS_M * fast * self._direction
        added[:, :3] += urge
        added[:, 3:] += cross(arm, urge)
        return command._replace(feedforward=added)
