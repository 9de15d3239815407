"""A simulated person who demonstrates several stages in a row without letting go: one hand after another.

A stage ends when its `done` has held for 0.2 s, a person's reaction time; the next hand takes over where the last one
was, pushes on as hard as it did, and keeps the person's aim, tremor and randomness. Figures ours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.frames import Float, Pose, move_wrench, rotate, rotate_spatial
from skillframe.skill import Command, Observation, Skill, row, stack_commands
from skillframe.teaching.teacher import HANDS, Hand, Teacher, TeacherSettings, firm
from skillframe.world.scene import REACTION_S, Scene, State, Task


def teacher_for(scene: Scene, fixture: Pose, settings: TeacherSettings, firmly: bool = False) -> Skill:
    """The person who demonstrates a scene, whose fixture stands at (N, 3), (N, 3, 3), `firmly` against friction."""
    if not scene.task.then:
        return Teacher(scene.task, fixture, settings, hand_of(scene.task, firmly))
    return StagedTeacher(scene, fixture, settings, firmly)


def hand_of(task: Task, firmly: bool) -> Hand | None:
    """The firm hand of a task, or None for its ordinary one."""
    return firm(HANDS[task.hand]) if firmly and task.hand in HANDS else None


class StagedTeacher(Skill):
    """The person's hand on N tools, each in its own stage.

    Args:
        scene: its task says what follows what.
        fixture: true pose of the fixture per trial, (N, 3) and (N, 3, 3).
        settings: how well the person aims.
        firmly: with the hand for an arm with friction.
    """

    def __init__(self, scene: Scene, fixture: Pose, settings: TeacherSettings, firmly: bool = False) -> None:
        frames = scene.tool.frames
        reach: Float = np.array(frames["tip"]) - np.array(frames[scene.tool.hand])
        self._hands = [
            _StagedHand((scene.task, *scene.task.then), Pose(*(v[i : i + 1] for v in fixture)), settings, reach, firmly)
            for i in range(len(fixture.position))
        ]

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Take hold of every tool."""
        for i, (hand, rng) in enumerate(zip(self._hands, rngs, strict=True)):
            hand.start(row(observation, i), [rng])

    def step(self, observation: Observation) -> Command:
        """Move every hand one tick on."""
        return stack_commands([hand.step(row(observation, i)) for i, hand in enumerate(self._hands)])

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """When the person went over to the next stage."""
        return self._hands[trial].journal(0)


class _StagedHand(Skill):
    """One hand, stage by stage (N = 1)."""

    def __init__(
        self, stages: Sequence[Task], fixture: Pose, settings: TeacherSettings, hand_to_tip: Float, firmly: bool
    ) -> None:  # fmt: skip
        self._stages, self._fixture, self._settings, self._hand_to_tip = stages, fixture, settings, hand_to_tip
        self._firmly = firmly

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        self._stage, self._held, self._changes = 0, 0.0, list[float]()
        self._teacher = self._hand(0)
        self._teacher.start(observation, rngs)

    def step(self, observation: Observation) -> Command:
        done = self._stages[self._stage].done
        if done is not None and self._stage + 1 < len(self._stages):
            self._held = self._held + observation.dt if bool(done(self._seen(observation))[0]) else 0.0
            if self._held >= REACTION_S:
                self._next_stage(observation)
        return self._teacher.step(observation)

    def _next_stage(self, observation: Observation) -> None:
        self._stage, self._held = self._stage + 1, 0.0
        self._changes.append(float(observation.time[0]))
        follower = self._hand(self._stage)
        follower.take_over(self._teacher, observation)
        self._teacher = follower

    def _hand(self, stage: int) -> Teacher:
        task = self._stages[stage]
        return Teacher(task, self._fixture, self._settings, hand_of(task, self._firmly))

    def journal(self, trial: int) -> list[tuple[float, str]]:
        return [(time, f"stage {i} begins") for i, time in enumerate(self._changes, start=2)]

    def _seen(self, observation: Observation) -> State:
        """What the person sees and feels of the tip, in the fixture's frame."""
        back = np.swapaxes(self._fixture.rotation, -1, -2)
        tip = observation.pose.at(self._hand_to_tip)
        shift = rotate(observation.pose.rotation, self._hand_to_tip)
        pose = Pose(rotate(back, tip.position - self._fixture.position), back @ tip.rotation)
        return State(pose, rotate_spatial(back, move_wrench(observation.wrench, shift)))
