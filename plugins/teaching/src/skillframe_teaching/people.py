"""Several simulated teachers with different habits, one demonstration each.

They share the hand of `Teacher`; each habit distorts the average of the demonstrations in one way:

    biased        pushes along a direction that is off by a constant angle
    hesitating    lets go for 0.6 s in every 2 s, from a sampled moment
    wrong first   pushes along a wrong direction for some millimetres, then along the right one
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skillframe.frames import Float, Pose, cross, norm, rotate, unit
from skillframe.skill import Observation
from skillframe.world import Task, Vector
from skillframe_teaching.teacher import AIM_TIME, Teacher, TeacherSettings

PERIOD_S, OFF_S = 2.0, 0.6  # period of hesitation, and its part without the hand
LONGEST_WRONG_S = 4.0  # longest push along a wrong direction


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """Habits of one teacher.

    Attributes:
        push: unit vector of the intended push in the fixture frame; None for the task's.
        aim_noise: standard deviation of the pushing direction per axis [rad].
        hesitates: lets go periodically.
        wrong: unit vector of a first, wrong push in the fixture frame, or None.
        wrong_m: its length [m].
    """

    push: Vector | None = None
    aim_noise: float = 0.13962634015954636
    hesitates: bool = False
    wrong: Vector | None = None
    wrong_m: float = 0.010


def off_by(direction: Vector, angle: float, azimuth: float) -> Vector:
    """A direction `angle` [rad] off another one, at an azimuth about it [rad].

    Azimuth 0 is towards the coordinate axis that the direction has least of.
    """
    given = np.array(direction)
    least = np.eye(3)[np.argmin(np.abs(given))]
    first = unit(least - (least @ given) * given)
    aside = np.cos(azimuth) * first + np.sin(azimuth) * cross(given, first)
    x, y, z = np.cos(angle) * given + np.sin(angle) * aside
    return (float(x), float(y), float(z))


class People(Teacher):
    """The hands of N teachers on N tools.

    The task has one stage and a direction; `fixture` is its true pose per trial, (N, 3) and (N, 3, 3). `Person` sets
    the aim noise in place of `settings`.
    """

    def __init__(
        self, task: Task, fixture: Pose, people: Sequence[Person], settings: TeacherSettings | None = None
    ) -> None:  # fmt: skip
        super().__init__(replace(task, then=()), fixture, settings or TeacherSettings())
        self._people = people

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Hold every tool, and sample the phase of hesitation."""
        super().start(observation, rngs)
        meant = [self._task.direction if p.push is None else p.push for p in self._people]
        wrong = [right if p.wrong is None else p.wrong for p, right in zip(self._people, meant, strict=True)]
        self._right = rotate(self._fixture.rotation, np.array(meant))
        self._wrong = rotate(self._fixture.rotation, np.array(wrong))
        self._level = np.array([p.aim_noise for p in self._people])[:, None]
        self._off_at = np.array([rng.uniform(0.0, PERIOD_S) for rng in rngs])
        self._hesitates = np.array([p.hesitates for p in self._people])
        self._to_go = np.array([0.0 if p.wrong is None else p.wrong_m for p in self._people])
        self._home, self._clock = observation.pose.position.copy(), 0.0

    def _aimed(self, noise: Float, seen: Float, dt: float) -> Float:
        self._to_go[norm(seen - self._home) >= self._to_go] = 0.0
        if self._clock > LONGEST_WRONG_S:
            self._to_go[:] = 0.0
        self._aim += -self._aim * (dt / AIM_TIME) + self._level * np.sqrt(2.0 * dt / AIM_TIME) * noise
        return unit(np.where(self._to_go[:, None] > 0.0, self._wrong, self._right) + self._aim)

    def _push(self, noise: Float, seen: Float, dt: float, share: float | Float) -> Float:
        velocity = super()._push(noise, seen, dt, share)
        off = self._hesitates & ((self._clock + self._off_at) % PERIOD_S < OFF_S)
        self._clock += dt
        self._position = np.where(off[:, None], seen, self._position)
        return np.where(off[:, None], 0.0, velocity)
