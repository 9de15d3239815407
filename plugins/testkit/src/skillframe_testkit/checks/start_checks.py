"""Checks of a skill's use of time, its start, and its restart in some trials."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from skillframe.extend import Document, SkillType
from skillframe.handover import asked
from skillframe.skill import Skill, rows_of
from skillframe_testkit.checks.playback import (
    AGREEMENT,
    NAMES,
    TICKS,
    TRIALS,
    fields_of,
    first_difference,
    kept,
    observations_of,
    play,
    rows_of_command,
)
from skillframe_testkit.checks.running import Follower, lead_of


def goes_by_time(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that commands to a held tool depend on time and not on the tick count."""
    fast, slow = (_held(skill, document, dt, 7) for dt in (0.005, 0.01))  # s a tick, over 2 s and over 4 s
    for i, name in enumerate(NAMES[:-1]):  # the last one, reason, may contain a time
        one = [fields[i] for fields in fast[1:]]
        changes = any(not np.array_equal(one[0], values) for values in one)
        if changes and _alike(one, slow, i) and _alike(one, _held(skill, document, 0.005, 8), i):
            yield (
                f"{name} goes by the count of ticks: it is the same whether a tick takes 5 ms or 10 ms; "
                "go by observation.time, or by observation.dt"
            )
            return


def _alike(values: list[Any], run: list[list[Any]], i: int) -> bool:
    return all(np.array_equal(one, fields[i]) for one, fields in zip(values, run[1:], strict=True))


def _held(skill: SkillType, document: Document, dt: float, seed: int) -> list[list[Any]]:
    """Fields of the commands to a held tool for 400 observations."""
    follower, built = Follower(lead_of(skill, document), dt), skill.build(document)
    first, commands = follower.observation(), []
    asked(built, built.start, first, [np.random.default_rng([seed, i]) for i in range(len(first.time))])
    for tick in range(400):
        follower.tick = tick
        commands.append(fields_of(kept(asked(built, built.step, follower.observation()))))
    return commands


def starts_again(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that a second start is like the first."""
    observations, others = observations_of(skill, document, 1), observations_of(skill, document, 2)
    built = skill.build(document)
    play(built, observations, range(100, 100 + TRIALS))
    again, fresh = (play(each, others, range(TRIALS)) for each in (built, skill.build(document)))
    for difference in first_difference(again, fresh, slice(None), 0.0, "a second start against a first"):
        yield f"{difference}; let start set all that a run needs"


def restarts_some_trials(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that restarted trials behave as after a start, without effect on others."""
    if type(skill.build(document)).restart is Skill.restart:
        return
    observations, built, rows = observations_of(skill, document), skill.build(document), np.array([1, 4])
    head, tail = observations[:12], observations[12:]
    undisturbed = play(skill.build(document), observations, range(TRIALS))[12:]
    play(built, head, range(TRIALS))
    built.restart(rows, tail[0], [np.random.default_rng([7, 100 + k]) for k in range(len(rows))])
    restarted = [kept(asked(built, built.step, observation)) for observation in tail]
    others = np.setdiff1d(np.arange(TRIALS), rows)
    rest = [rows_of_command(command, others) for command in restarted]
    yield from first_difference(undisturbed, rest, others, AGREEMENT, "a trial that goes on while others restart")
    chosen = [rows_of(observation, rows) for observation in tail]
    fresh = play(skill.build(document), chosen, range(100, 100 + len(rows)))
    yield from first_difference(restarted, fresh, rows, AGREEMENT, "a restarted trial against one that starts")


def writes_its_journal(skill: SkillType, document: Document) -> Iterator[str]:
    """Check the entries of `journal` after a few ticks and after many."""
    for ticks in (5, TICKS):
        built = skill.build(document)
        play(built, observations_of(skill, document)[:ticks], range(TRIALS))
        for trial in range(TRIALS):
            try:
                events = built.journal(trial)
            except Exception as error:  # code of a plug-in
                yield f"journal({trial}) raised {type(error).__name__}: {error}; give [] where there are no events"
                return
            if not isinstance(events, list) or not all(
                isinstance(event, tuple | list)
                and len(event) == 2
                and isinstance(event[0], int | float)
                and np.isfinite(event[0])
                and isinstance(event[1], str)
                for event in events
            ):
                yield f"journal({trial}) gave {events!r:.60}; give a list of (seconds, words)"
                return
