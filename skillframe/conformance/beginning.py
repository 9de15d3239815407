"""What a skill must do with time and beginnings: go by the observation's time, start again, restart in some trials."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from skillframe.conformance.loop import Follower
from skillframe.conformance.play import (
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
from skillframe.conformance.running import lead_of
from skillframe.extend.records import Document, SkillType
from skillframe.handover import asked
from skillframe.skill import Command, Skill, rows_of

HELD_TICKS, HELD_DT = 400, (0.005, 0.01)
"""The same 400 observations of a tool that is held, once as 2 s and once as 4 s."""
RESTARTED, RESTART_TICK = np.array([1, 4]), 12
JOURNAL_TICKS = 5


def goes_by_time(skill: SkillType, document: Document) -> Iterator[str]:
    """While the tool is held, commands change with the observation's time and not with the count of ticks."""
    fast, slow = (_held(skill, document, dt) for dt in HELD_DT)
    for i, name in enumerate(NAMES):
        if name == "reason":  # may hold a time, and says nothing more than status
            continue
        one, two = _values(fast, i), _values(slow, i)
        changes = any(not np.array_equal(one[1], values) for values in one[1:])
        if changes and _alike(one, two) and _alike(one, _values(_held(skill, document, HELD_DT[0], 8), i)):
            yield (
                f"{name} goes by the count of ticks: it is the same whether a tick takes {1e3 * HELD_DT[0]:g} ms or "
                f"{1e3 * HELD_DT[1]:g} ms; go by observation.time, or by observation.dt"
            )
            return


def _values(commands: list[Command], i: int) -> list[Any]:
    return [fields_of(command)[i] for command in commands]


def _alike(one: list[Any], two: list[Any]) -> bool:
    """Whether a field is the same in every tick but the first. What is drawn differs, with other generators."""
    return all(np.array_equal(a, b) for a, b in zip(one[1:], two[1:], strict=True))


def _held(skill: SkillType, document: Document, dt: float, seed: int = 7) -> list[Command]:
    """Commands to a tool that is held where it starts."""
    follower, built = Follower(lead_of(skill, document), dt), skill.build(document)
    first, commands = follower.observation(), []
    asked(built, built.start, first, [np.random.default_rng([seed, i]) for i in range(len(first.time))])
    for tick in range(HELD_TICKS):
        follower.tick = tick
        commands.append(kept(asked(built, built.step, follower.observation())))
    return commands


def starts_again(skill: SkillType, document: Document) -> Iterator[str]:
    """A second start gives the run that a first start would have given."""
    observations, others = observations_of(skill, document, 1), observations_of(skill, document, 2)
    built = skill.build(document)
    play(built, observations, range(100, 100 + TRIALS))
    again, fresh = (play(each, others, range(TRIALS)) for each in (built, skill.build(document)))
    for difference in first_difference(again, fresh, slice(None), 0.0, "a second start against a first"):
        yield f"{difference}; let start set all that a run needs"


def restarts_some_trials(skill: SkillType, document: Document) -> Iterator[str]:
    """Trials that restart do as after a start, and the others go on undisturbed. A skill without restart passes."""
    if type(skill.build(document)).restart is Skill.restart:
        return
    observations = observations_of(skill, document)
    undisturbed = play(skill.build(document), observations, range(TRIALS))[RESTART_TICK:]
    restarted = _restarted(skill, document)
    others = np.setdiff1d(np.arange(TRIALS), RESTARTED)
    rest = [rows_of_command(command, others) for command in restarted]
    yield from first_difference(undisturbed, rest, others, AGREEMENT, "a trial that goes on while others restart")
    tail = [rows_of(observation, RESTARTED) for observation in observations[RESTART_TICK:]]
    fresh = play(skill.build(document), tail, range(100, 100 + len(RESTARTED)))
    yield from first_difference(restarted, fresh, RESTARTED, AGREEMENT, "a restarted trial against one that starts")


def _restarted(skill: SkillType, document: Document) -> list[Command]:
    """Commands of all trials from the tick on in which some restart."""
    observations, built = observations_of(skill, document), skill.build(document)
    play(built, observations[:RESTART_TICK], range(TRIALS))
    rngs = [np.random.default_rng([7, 100 + k]) for k in range(len(RESTARTED))]
    built.restart(RESTARTED, observations[RESTART_TICK], rngs)
    return [kept(asked(built, built.step, observation)) for observation in observations[RESTART_TICK:]]


def tells_its_journal(skill: SkillType, document: Document) -> Iterator[str]:
    """After a few ticks and after many, `journal` gives times and words for every trial."""
    for ticks in (JOURNAL_TICKS, TICKS):
        built = skill.build(document)
        play(built, observations_of(skill, document)[:ticks], range(TRIALS))
        for trial in range(TRIALS):
            try:
                events = built.journal(trial)
            except Exception as error:  # foreign code: any failure is a finding
                yield f"journal({trial}) raised {type(error).__name__}: {error}; give [] where there is nothing to tell"
                return
            if not _is_journal(events):
                yield f"journal({trial}) gave {events!r:.60}; give a list of (seconds, words)"
                return


def _is_journal(events: Any) -> bool:
    return isinstance(events, list) and all(
        isinstance(event, tuple | list)
        and len(event) == 2
        and isinstance(event[0], int | float)
        and np.isfinite(event[0])
        and isinstance(event[1], str)
        for event in events
    )
