"""What rows share: taught sets, skills run side by side, and counts against a threshold and nulls.

A row is its task, its nulls and its threshold. Trials of one set are correlated, so sets without a failure are counted,
too.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from math import radians
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from skillframe.demonstration import Demonstration
from skillframe.document import learned
from skillframe.errors import InputError
from skillframe.execution import Setup, load_robot_model, load_world, prepare
from skillframe.extend import Document, LearnOptions, RowRun, Verdict, registry
from skillframe.frames import Float
from skillframe.robot import RobotModel
from skillframe.skill import Skill
from skillframe.world import Scene
from skillframe_papers.bars import ahead, counted, judged, level, together
from skillframe_papers.rows.blocks import Ended, ran_made

SHARE = 0.9
"""Share that most rows require."""
X, Y, Z = np.eye(3)
DOWN = np.array([0.0, 0.0, -1.0])
HEAD = ("skill", "trials", "sets without a failure")

Key = tuple[tuple[str, float], ...]


def key_of(job: RowRun) -> Key:
    """A row's settings as a cache key."""
    return tuple(sorted(job.settings.items()))


class Ran(NamedTuple):
    """Successes of trials, by set and start, in text as a count with its interval."""

    success: NDArray[np.bool_]

    @classmethod
    def of(cls, hits: int, trials: int) -> Ran:
        """So many successes among trials whose order does not matter."""
        return cls(np.arange(trials) < hits)

    @property
    def hits(self) -> int:
        """Number of successes."""
        return int(self.success.sum())

    @property
    def trials(self) -> int:
        """Number of trials."""
        return int(self.success.size)

    @property
    def share(self) -> float:
        """Successes over trials."""
        return self.hits / self.trials

    @property
    def sets(self) -> str:
        """Sets whose every trial succeeded."""
        return f"{int(self.success.all(axis=1).sum())} of {len(self.success)}"

    def __str__(self) -> str:
        return counted(self.hits, self.trials)


def leads(job: RowRun, ours: Ran, null: Ran) -> bool:
    """Whether a count is ahead of a null's."""
    return ahead(ours.hits, null.hits, ours.trials, quick=job.quick, others=null.trials)


def not_behind(job: RowRun, ours: Ran, nulls: Mapping[str, Ran]) -> list[str]:
    """Names of the nulls that a count is not ahead of."""
    counts = {name: (null.hits, null.trials) for name, null in nulls.items()}
    return level(ours.hits, ours.trials, counts, quick=job.quick)


def compared(job: RowRun, ours: Iterable[Ran], beside: bool, share: float = SHARE) -> Verdict:
    """Verdict on counts that must all reach a share, failing if the nulls are not behind."""
    return together([judged(each.hits, each.trials, share, quick=job.quick) for each in ours], beside)


def lines(found: Mapping[str, Ran]) -> list[tuple[str, ...]]:
    """Rows of a table with `HEAD`."""
    return [(name, str(each), each.sets) for name, each in found.items()]


def world(job: RowRun, name: str, **params: Any) -> Scene:
    """A world with the row's friction."""
    return load_world(name, {"friction": job.settings["world.friction"], **params})


def teacher(job: RowRun, **settings: Any) -> TeacherSettings:
    """A simulated teacher with the row's noise of aim."""
    return TeacherSettings(aim_noise=radians(float(job.settings["teacher.aim_noise_deg"])), **settings)


def shown(
    scene: Scene, by: TeacherSettings, *, count: int, seed: int, robot: RobotModel | str = "free_tool", **how: Any
) -> list[Demonstration]:
    """Demonstrations in a scene, with the further arguments of `record`."""
    taught = load_robot_model(robot) if isinstance(robot, str) else robot
    return list(record(taught, scene, by, count=count, seed=seed, **how).demonstrations)


def lmc(given: Sequence[Demonstration], **options: Any) -> Document:
    """The LMC of demonstrations, with the fields of `LearnOptions`."""
    return learned(registry().skill("lmc"), list(given), LearnOptions(**options))


def lmc_if_any(given: Sequence[Demonstration], **options: Any) -> Document | None:
    """The same, or None where the learner refuses, which teaches nothing."""
    try:
        return lmc(given, **options)
    except InputError:
        return None


def changed(document: Document, **parts: Any) -> Document:
    """A copy with other entries in every phase, where a mapping changes some of a part's entries."""
    made = copy.deepcopy(dict(document))
    for phase in made["phases"]:
        for name, value in parts.items():
            phase[name] = {**phase[name], **value} if isinstance(value, Mapping) else value
    return made


def stiff(document: Document, part: str, stiffness: float) -> Document:
    """The document with one part ("translation", "rotation") stiff in every direction."""
    held = (stiffness * np.eye(3)).tolist()
    return changed(document, **{part: {"stiffness": held, "compliant_axes": [], "fully_compliant": False}})


def one_axis(part: Mapping[str, Any], wanted: Float) -> bool:
    """Whether there is exactly one compliant axis, within 20 degrees of (3,) in either sense."""
    axes = part["compliant_axes"]
    return len(axes) == 1 and bool(abs(np.dot(axes[0], wanted)) > np.cos(radians(20.0)))


def seeds(job: RowRun, first: int, sets: int) -> list[int]:
    """A seed for each set."""
    return [first + 1000 * job.seed + i for i in range(sets)]


def generators(count: int, *key: int) -> list[np.random.Generator]:
    """A generator for each trial."""
    return [np.random.default_rng([*key, k]) for k in range(count)]


class TaughtSet(NamedTuple):
    """Skills learned from one set of demonstrations, and the trials of each.

    Attributes:
        ways: skill by name, as a document or made ready with its setup; None fails every trial.
        draws: sampled quantities, each (N,).
        key: seeds of the trials' generators.
    """

    ways: Mapping[str, Document | tuple[Skill, Setup] | None]
    draws: Mapping[str, Float]
    key: tuple[int, ...]


def executed(
    job: RowRun, scene: Scene, sets: Sequence[TaughtSet], *, robot: str = "free_tool", duration_s: float,
    center: str | None = None,
) -> dict[str, list[Ended]]:  # fmt: skip
    """Ends of every set's trials by way, all run side by side, with the arguments of `blocks.ran`."""
    model, counts = load_robot_model(robot), [len(next(iter(each.draws.values()))) for each in sets]
    made, trials = list[tuple[Skill, Setup]](), list[tuple[Mapping[str, Float], list[np.random.Generator]]]()
    for each, count in zip(sets, counts, strict=True):
        for way in each.ways.values():
            if way is not None:
                made.append(way if isinstance(way, tuple) else prepare(model, scene, way, center))
                trials.append((each.draws, generators(count, *each.key)))
    done, found = iter(ran_made(made, trials, duration_s=duration_s)), dict[str, list[Ended]]()
    for i, (each, count) in enumerate(zip(sets, counts, strict=True)):
        lost = Ended(np.zeros(count, dtype=bool), np.full(count, duration_s))
        ended = {name: lost if way is None else next(done) for name, way in each.ways.items()}
        for name, end in ended.items():
            found.setdefault(name, []).append(end)
        told = ", ".join(f"{name} {int(end.success.sum())}" for name, end in ended.items())
        job.tell(f"{scene.name}, set {i}: {told} of {count}")
    return found


def successes(found: Mapping[str, Sequence[Ended]]) -> dict[str, Ran]:
    """Successes by way, of every set and start."""
    return {name: Ran(np.array([each.success for each in ends])) for name, ends in found.items()}
