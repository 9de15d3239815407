"""Several simulated people at once, each with habits of their own: shaky, biased, hesitating, wrong at first.

One row is one demonstration by one person. What they share with `Teacher` is the hand; habits are ours, chosen so that
averages of what they show are off in one way each:

    biased        pushes along a direction that is off by a constant angle, whatever the noise of the aim
    hesitating    lets go for 0.6 s in every 2 s, beginning at a drawn moment; the tool stands where it is
    wrong first   pushes along a wrong direction for some millimetres, then along the right one
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skillframe.frames import Float, Pose, cross, norm, rotate, unit
from skillframe.skill import Observation
from skillframe.teaching.teacher import AIM_TIME, Teacher, TeacherSettings
from skillframe.world.scene import Task, Vector

PERIOD_S, OFF_S = 2.0, 0.6  # of a hesitating person, and how much of it the hand is off
LONGEST_WRONG_S = 4.0  # a wrong try that meets something ends after this


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """The habits of one person.

    Attributes:
        push: unit vector of the fixture frame along which the person means to push; None takes the task's.
        aim_noise: standard deviation of the pushing direction per axis [rad].
        hesitates: lets go now and then.
        wrong: unit vector of the fixture frame along which the person pushes first, or None.
        wrong_m: how far [m].
    """

    push: Vector | None = None
    aim_noise: float = 0.13962634015954636
    hesitates: bool = False
    wrong: Vector | None = None
    wrong_m: float = 0.010


def off_by(direction: Vector, angle: float, azimuth: float) -> Vector:
    """A direction that is `angle` [rad] off another one, towards an azimuth about it [rad].

    Azimuth 0 is towards the coordinate axis that the direction has least of.
    """
    given = np.array(direction)
    least = np.eye(3)[np.argmin(np.abs(given))]
    first = unit(least - (least @ given) * given)
    aside = np.cos(azimuth) * first + np.sin(azimuth) * cross(given, first)
    x, y, z = np.cos(angle) * given + np.sin(angle) * aside
    return (float(x), float(y), float(z))


class People(Teacher):
    """The hands of N people on N tools.

    Args:
        task: what is to be done, in the fixture frame; it has a direction and one stage.
        fixture: true pose of the fixture per trial, (N, 3) and (N, 3, 3).
        people: one a trial.
        settings: what they have in common; its aim noise is not looked at.
    """

    def __init__(
        self, task: Task, fixture: Pose, people: Sequence[Person], settings: TeacherSettings | None = None
    ) -> None:  # fmt: skip
        super().__init__(replace(task, then=()), fixture, settings or TeacherSettings())
        self._people = people

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take hold of every tool. When a hesitating person first lets go is drawn here."""
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
