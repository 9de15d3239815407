"""Several skills side by side in one simulation, whose cost is its ticks.

Trials are independent, so results equal, to the last bit, those of one skill alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.execution import Setup, prepare, simulate
from skillframe.extend import Document
from skillframe.frames import Float, Pose
from skillframe.robot import RobotModel
from skillframe.skill import Command, Impedance, Observation, Skill, rows_of
from skillframe.world import Scene


class Trials(NamedTuple):
    """Trials of one document: sampled quantities, each (N,), and a generator for each."""

    document: Document
    draws: Mapping[str, Float]
    rngs: Sequence[np.random.Generator]


def successes(
    robot: RobotModel, scene: Scene, trials: Sequence[Trials], *, duration_s: float, center: str | None = None
) -> list[NDArray[np.bool_]]:
    """Successes (N,) by document, with the arguments of `ran`."""
    return [each.success for each in ran(robot, scene, trials, duration_s=duration_s, center=center)]


class Ended(NamedTuple):
    """Ends of a document's trials (N,): success, and duration [s]."""

    success: NDArray[np.bool_]
    seconds: Float

    @property
    def found(self) -> Float:
        """Seconds (N,) to the success, inf without one."""
        return np.where(self.success, self.seconds, np.inf)


def ran(
    robot: RobotModel, scene: Scene, trials: Sequence[Trials], *, duration_s: float, center: str | None = None
) -> list[Ended]:
    """Run documents side by side.

    Args:
        robot: that runs them.
        scene: of all.
        trials: of each document, with the same quantities.
        duration_s: time limit [simulated s].
        center: of compliance of all; None: where each was learned, with one simulation for each such point.

    Returns:
        ends of the trials by document.
    """
    made = [prepare(robot, scene, each.document, center) for each in trials]
    return ran_made(made, [(each.draws, each.rngs) for each in trials], duration_s=duration_s)


def ran_made(
    made: Sequence[tuple[Skill, Setup]], trials: Sequence[tuple[Mapping[str, Float], Sequence[np.random.Generator]]],
    *, duration_s: float,
) -> list[Ended]:  # fmt: skip
    """Run skills side by side, each with its trials' quantities and generators.

    Args:
        made: skills and setups of the same robot and scene.
        trials: of each skill, with the same quantities.
        duration_s: time limit [simulated s].

    Returns:
        ends of the trials by skill.
    """
    alike: dict[bytes, list[int]] = {}
    for i, (_, setup) in enumerate(made):
        alike.setdefault(setup.center_of_compliance.tobytes(), []).append(i)
    found = dict[int, Ended]()
    for which in alike.values():
        some, sizes = [trials[i] for i in which], [len(trials[i][1]) for i in which]
        draws = {key: np.concatenate([each[key] for each, _ in some]) for key in some[0][0]}
        rngs = [rng for _, each in some for rng in each]
        skill = Blocks([made[i][0] for i in which], sizes)
        done = simulate(skill, made[which[0]][1], draws, rngs, duration_s=duration_s)
        parts = (np.split(values, np.cumsum(sizes)[:-1]) for values in (done.success, done.duration_s))
        found |= {i: Ended(*each) for i, *each in zip(which, *parts, strict=True)}
    return [found[i] for i in range(len(trials))]


class Blocks(Skill):
    """Skills, each of a block of trials.

    Args:
        skills: in the order of the trials.
        sizes: trials of each.
    """

    def __init__(self, skills: Sequence[Skill], sizes: Sequence[int]) -> None:
        ends = np.cumsum(sizes).tolist()
        self._blocks = [
            (skill, slice(end - size, end)) for skill, size, end in zip(skills, sizes, ends, strict=True)
        ]  # fmt: skip
        self._said: list[Impedance] = []
        self._all: Impedance | None = None

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Start each in its trials."""
        for skill, rows in self._blocks:
            skill.start(rows_of(observation, rows), rngs[rows])

    def step(self, observation: Observation) -> Command:
        """The joined commands."""
        commands = [skill.step(rows_of(observation, rows)) for skill, rows in self._blocks]
        return Command(
            Pose(*(np.concatenate(values) for values in zip(*(c.pose for c in commands), strict=True))),
            np.concatenate([c.twist for c in commands]),
            self._gains([c.impedance for c in commands]),
            np.concatenate([c.feedforward for c in commands]),
            np.concatenate([c.status for c in commands]),
            np.concatenate([c.reason for c in commands]),
        )  # fmt: skip

    def _gains(self, said: list[Impedance]) -> Impedance:
        """All gains, the identical arrays while no skill changes its own, which spares the controller a check.

        Raises:
            ValueError: only some skills state their damping.
        """
        before, self._said = self._said, said
        if self._all is not None and all(
            new.stiffness is old.stiffness and new.damping is old.damping for new, old in zip(said, before, strict=True)
        ):
            return self._all
        sizes = [rows.stop - rows.start for _, rows in self._blocks]
        damping = [_each(i.damping, n) for i, n in zip(said, sizes, strict=True) if i.damping is not None]
        if damping and len(damping) < len(said):
            raise ValueError("skills that run side by side must all say their damping, or none of them")
        stiffness = [_each(i.stiffness, n) for i, n in zip(said, sizes, strict=True)]
        self._all = Impedance(np.concatenate(stiffness), np.concatenate(damping) if damping else None)
        return self._all

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """The journal of the trial's skill."""
        skill, rows = next((s, r) for s, r in self._blocks if r.start <= trial < r.stop)
        return skill.journal(trial - rows.start)


def _each(matrix: Float, count: int) -> Float:
    """Gains of each trial, of one arm (count, 6, 6) or several (count, arms, 6, 6)."""
    return np.broadcast_to(matrix, (count, *(matrix.shape[1:] if matrix.ndim > 2 else matrix.shape)))
