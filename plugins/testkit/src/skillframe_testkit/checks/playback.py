"""Plays observations to a skill, and compares commands."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.extend import CoordinatorType, Document, SkillType
from skillframe.frames import Float
from skillframe.handover import asked
from skillframe.skill import Command, Observation, Skill
from skillframe_testkit.checks.examples import random_observations

TRIALS, TICKS, DT = 8, 25, 0.05  # 200 observations over 1.25 s
AGREEMENT = 1e-9
Rows = slice | NDArray[np.intp]


def play(skill: Skill, observations: Sequence[Observation], seeds: Sequence[int]) -> list[Command]:
    """Commands of a skill for observations, with one generator per trial."""
    asked(skill, skill.start, observations[0], [np.random.default_rng([7, seed]) for seed in seeds])
    return [kept(asked(skill, skill.step, observation)) for observation in observations]


def kept(command: Command) -> Command:
    """A copy of a command, whose arrays a skill may reuse."""
    return copy.deepcopy(command)


def arms_of(skill: SkillType, document: Document) -> tuple[int, ...]:
    """Dimension of arms, (arms,) for a coordinator and () for a skill."""
    if not isinstance(skill, CoordinatorType):
        return ()
    return (2 if skill.centers is None else len(skill.centers(document)),)


def observations_of(
    skill: SkillType, document: Document, seed: int = 1, ticks: int = TICKS, dt: float = DT
) -> list[Observation]:
    """Random observations of 8 trials for a skill, or for a coordinator's arms."""
    lead = (TRIALS, *arms_of(skill, document))
    found = []
    for flat in random_observations(np.random.default_rng([8, seed]), int(np.prod(lead)), ticks, dt):
        parts = (flat.time, *flat.pose, flat.twist, flat.wrench)
        time, position, rotation, twist, wrench = (each.reshape(*lead, *each.shape[1:]) for each in parts)
        found.append(Observation(time, flat.dt, type(flat.pose)(position, rotation), twist, wrench))
    return found


def with_row(base: Observation, other: Observation, i: int) -> Observation:
    """`base` with its trial i from `other`."""

    def mix(a: Float, b: Float) -> Float:
        result = a.copy()
        result[i] = b[i]
        result.setflags(write=False)
        return result

    pose = type(base.pose)(*(mix(a, b) for a, b in zip(base.pose, other.pose, strict=True)))
    return Observation(base.time, base.dt, pose, mix(base.twist, other.twist), mix(base.wrench, other.wrench))


def first_difference(
    a: Sequence[Command], b: Sequence[Command], rows: Rows, tolerance: float, what: str
) -> Iterator[str]:
    """The first tick at which rows of `a` differ from `b`, as a sentence."""
    for tick, (one, two) in enumerate(zip(a, b, strict=True)):
        for name, x, y in zip(NAMES, fields_of(rows_of_command(one, rows)), fields_of(two), strict=True):
            equal = x.tolist() == y.tolist() if x.dtype == object else _gap(x, y) <= tolerance
            if not equal:
                size = "" if x.dtype == object else f" by {_gap(x, y):.3g}"
                yield f"{what}: {name} differs{size} at tick {tick}"
                return


NAMES = ("position", "rotation", "twist", "stiffness", "damping", "feedforward", "status", "reason")


def rows_of_command(command: Command, rows: Rows) -> Command:
    """Rows of a command, with shared gains repeated."""
    lead = command.pose.position.shape[:-1]
    gains = [None if g is None else np.broadcast_to(g, (*lead, 6, 6))[rows] for g in command.impedance]
    assert gains[0] is not None
    return Command(
        type(command.pose)(*(v[rows] for v in command.pose)), command.twist[rows],
        type(command.impedance)(gains[0], gains[1]), command.feedforward[rows], command.status[rows],
        command.reason[rows],
    )  # fmt: skip


def fields_of(command: Command) -> list[NDArray[Any]]:
    """Fields of a command in the order of `NAMES`."""
    whole = rows_of_command(command, slice(None))
    damping = np.zeros(0) if whole.impedance.damping is None else whole.impedance.damping
    return [
        *whole.pose, whole.twist, whole.impedance.stiffness, damping, whole.feedforward, whole.status,
        np.asarray(whole.reason, dtype=object),
    ]  # fmt: skip


def _gap(x: Float, y: Float) -> float:
    if x.shape != y.shape:
        return float("inf")
    return float(np.abs(x - y).max(initial=0.0))
