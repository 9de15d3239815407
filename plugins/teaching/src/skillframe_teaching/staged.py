"""A simulated teacher who demonstrates several stages in a row without letting go.

A stage ends when its `done` has held for 0.2 s, a human reaction time. The next hand starts with the same pose, force,
aim, tremor and random state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, move_wrench, rotate, rotate_spatial
from skillframe.skill import Command, Impedance, Observation, Skill, no_reasons, rows_of
from skillframe.world import REACTION_S, Scene, State, Task
from skillframe_teaching.teacher import HANDS, Hand, Teacher, TeacherSettings, firm


def teacher_for(scene: Scene, fixture: Pose, settings: TeacherSettings, firmly: bool = False) -> Skill:
    """The teacher of a scene, `firmly` against friction. `fixture` is its pose per trial, (N, 3) and (N, 3, 3)."""
    if not scene.task.then:
        return Teacher(scene.task, fixture, settings, hand_of(scene.task, firmly))
    return StagedTeacher(scene, fixture, settings, firmly)


def hand_of(task: Task, firmly: bool) -> Hand | None:
    """The firm hand of a task, or None for its ordinary one."""
    return firm(HANDS[task.hand]) if firmly and task.hand in HANDS else None


class StagedTeacher(Skill):
    """The hand on N tools, each in its own stage. Tools in one stage share a `Teacher`."""

    def __init__(self, scene: Scene, fixture: Pose, settings: TeacherSettings, firmly: bool = False) -> None:
        frames = scene.tool.frames
        self._hand_to_tip: Float = np.array(frames["tip"]) - np.array(frames[scene.tool.hand])
        self._stages = (scene.task, *scene.task.then)
        self._fixture, self._settings, self._firmly = fixture, settings, firmly

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Hold every tool."""
        count = len(rngs)
        self._held, self._changes = np.zeros(count), [list[float]() for _ in rngs]
        everyone = np.arange(count)
        first = self._hand(0, everyone)
        first.start(observation, rngs)
        self._groups = {0: _Group(everyone, first)}
        self._hold_as_now()

    def step(self, observation: Observation) -> Command:
        """Move every hand by one tick."""
        for stage in sorted(self._groups, reverse=True):  # last first: one stage per tick at most
            self._look(stage, observation)
        count = len(self._held)
        position, rotation = np.empty((count, 3)), np.empty((count, 3, 3))
        twist, tremor, status = np.empty((count, 6)), np.empty((count, 6)), np.empty(count, dtype=np.int64)
        for rows, teacher in self._groups.values():
            command = teacher.step(rows_of(observation, rows))
            position[rows], rotation[rows] = command.pose
            twist[rows], tremor[rows], status[rows] = command.twist, command.feedforward, command.status
        return Command(Pose(position, rotation), twist, self._impedance, tremor, status, no_reasons(count))

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """Times at which stages began."""
        return [(time, f"stage {i} begins") for i, time in enumerate(self._changes[trial], start=2)]

    def _look(self, stage: int, observation: Observation) -> None:
        done = self._stages[stage].done
        if done is None or stage + 1 == len(self._stages):
            return
        rows, teacher = self._groups[stage]
        seen = done(self._seen(rows, rows_of(observation, rows)))
        self._held[rows] = np.where(seen, self._held[rows] + observation.dt, 0.0)
        over = self._held[rows] >= REACTION_S
        if not over.any():
            return
        going, staying = np.flatnonzero(over), np.flatnonzero(~over)
        self._enter(stage + 1, rows[going], teacher.some(going), observation)
        if len(staying):
            self._groups[stage] = _Group(rows[staying], teacher.some(staying))
        else:
            del self._groups[stage]
        self._hold_as_now()

    def _enter(self, stage: int, rows: NDArray[np.intp], leaving: Teacher, observation: Observation) -> None:
        self._held[rows] = 0.0
        for trial in rows.tolist():
            self._changes[trial].append(float(observation.time[trial]))
        follower = self._hand(stage, rows)
        follower.take_over(leaving, rows_of(observation, rows))
        there = self._groups.get(stage)
        self._groups[stage] = (
            _Group(rows, follower)
            if there is None
            else _Group(np.concatenate([there.rows, rows]), there.teacher.beside(follower))
        )

    def _hold_as_now(self) -> None:
        stiffness, damping = np.empty((2, len(self._held), 6, 6))
        for rows, teacher in self._groups.values():
            stiffness[rows], damping[rows] = teacher.impedance.stiffness, teacher.impedance.damping
        self._impedance = Impedance(stiffness, damping)

    def _hand(self, stage: int, rows: NDArray[np.intp]) -> Teacher:
        task = self._stages[stage]
        fixture = Pose(*(value[rows] for value in self._fixture))
        return Teacher(task, fixture, self._settings, hand_of(task, self._firmly))

    def _seen(self, rows: NDArray[np.intp], observation: Observation) -> State:
        back = np.swapaxes(self._fixture.rotation[rows], -1, -2)
        tip = observation.pose.at(self._hand_to_tip)
        shift = rotate(observation.pose.rotation, self._hand_to_tip)
        pose = Pose(rotate(back, tip.position - self._fixture.position[rows]), back @ tip.rotation)
        return State(pose, rotate_spatial(back, move_wrench(observation.wrench, shift)))


class _Group(NamedTuple):
    """Trials (M,) in one stage, and their teacher."""

    rows: NDArray[np.intp]
    teacher: Teacher
