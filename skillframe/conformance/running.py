"""What a skill must do over a whole run: answer in time and within bounds, end, remember little, leave nothing behind.

The runs are in `skillframe.conformance.loop`, where tools follow the command. A time is compared with that of a skill
that does next to nothing, tick by tick in the same process, so that a busy machine slows both.
"""

from __future__ import annotations

import contextlib
import gc
import time
import tracemalloc
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.conformance.loop import LateError, run
from skillframe.conformance.play import arms_of
from skillframe.conformance.watch import left_behind, watched
from skillframe.errors import SkillframeError
from skillframe.extend.records import Document, SkillType
from skillframe.frames import Float, norm, rotation_vector
from skillframe.handover import CommandCheck
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons

TRIALS, TICKS, DT = 4, 2000, 1e-3
TIMED_TICKS, SLOW_S, SLOW_RATIO = 40, 5e-3, 100.0
"""A step is too slow (ours): five ticks of the loop's millisecond, and a hundred times a skill that only stands."""
WINDOW, FASTEST = 10, (3.0, 10.0)
"""m/s, rad/s over 10 ms (ours): twice what an arm of a person's size does; a jump of less than 30 mm is no speed."""
STRONGEST = (200.0, 50.0)
"""N, Nm of feed-forward (ours): 2.5 times the 80 N at which the limits of the robots that ship end a run."""
END_DT, END_TICKS = 0.05, 2400
"""120 s: longer than a run's time limit as a rule."""
LEAK_TICKS, LEAK_BYTES = 300, 256
"""Bytes a tick and trial (ours): 15 MB a minute at 1 kHz; a list of one number a tick is 8."""
NEVER = "never ends"


def lead_of(skill: SkillType, document: Document, trials: int = TRIALS) -> tuple[int, ...]:
    """(N,), or (N, arms) for a coordinator."""
    return trials, *arms_of(skill, document)


class Standing(Skill):
    """Asks for where the tool is: the measure of how long a step takes."""

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Remember nothing."""

    def step(self, observation: Observation) -> Command:
        """Ask for the measured pose."""
        zero = np.zeros(observation.twist.shape)
        count = len(observation.time)
        return Command(
            observation.pose, zero, Impedance(np.eye(6)), zero, np.zeros(count, dtype=np.int64), no_reasons(count)
        )


def answers_in_time(skill: SkillType, document: Document) -> Iterator[str]:
    """A step is back within five milliseconds, or within a hundred times what a skill needs that only stands."""
    taken: list[tuple[float, float]] = []
    tried, standing, start = _Timed(skill.build(document)), Standing(), time.perf_counter

    def look(tick: int, observation: Observation, command: Command) -> bool:
        began = start()
        standing.step(observation)
        taken.append((tried.seconds, start() - began))
        return False

    with contextlib.suppress(LateError, SkillframeError):  # is told by `answers_in_shape`
        run(tried, lead_of(skill, document), TIMED_TICKS, DT, look)
    if not taken:
        return
    ours, reference = np.median(np.array(taken), axis=0)
    if ours > SLOW_S and ours > SLOW_RATIO * reference:
        yield (
            f"a step takes {1e3 * ours:.2g} ms, and the loop ticks every {1e3 * DT:g} ms; make it "
            f"{ours / SLOW_S:.2g} times faster or more (the other checks wait for that)"
        )


class _Timed(Skill):
    """A skill with a stopwatch."""

    def __init__(self, skill: Skill) -> None:
        self._skill, self.seconds = skill, 0.0

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        self._skill.start(observation, rngs)

    def step(self, observation: Observation) -> Command:
        began = time.perf_counter()
        command = self._skill.step(observation)
        self.seconds = time.perf_counter() - began
        return command


def runs_for_two_seconds(skill: SkillType, document: Document) -> Iterator[str]:
    """Over 2000 ticks of 1 ms nothing raises, and poses, speeds, gains and feed-forward stay within bounds."""
    built, lead = skill.build(document), lead_of(skill, document)
    bounds = _Bounds(CommandCheck(built, lead))
    try:
        run(built, lead, TICKS, DT, bounds.look)
    except (LateError, SkillframeError) as error:
        yield str(error)
    yield from bounds.problems.values()


class _Bounds:
    """Looks whether commands stay within bounds. Notes the first excess of each kind."""

    def __init__(self, check: CommandCheck) -> None:
        self._check, self.problems = check, dict[str, str]()
        self._past: list[tuple[Float, Float]] = []

    def look(self, tick: int, observation: Observation, command: Command) -> bool:
        running = command.status == Status.RUNNING
        when = f"in tick {tick}, at {tick * DT:.3f} s"
        if not _finite(command, running):
            self.problems["finite"] = f"the command is not finite {when}; end with FAILURE before that"
            return True
        for fault in self._check.faults(command, tick):
            self.problems.setdefault("fault", f"{fault.cause} ({when})")
        self._force(command.feedforward[running], when)
        self._speed(command, running, when)
        return not running.any()

    def _force(self, feedforward: Float, when: str) -> None:
        for part, bound, unit in zip((slice(0, 3), slice(3, 6)), STRONGEST, ("N", "Nm"), strict=True):
            most = norm(feedforward[..., part]).max(initial=0.0)
            if most > bound:
                text = f"the feed-forward is {most:.3g} {unit} {when}; bound it, no more than {bound:g} {unit} is taken"
                self.problems.setdefault(f"force {unit}", text)

    def _speed(self, command: Command, running: NDArray[np.bool_], when: str) -> None:
        pose = (command.pose.position.copy(), command.pose.rotation.copy())
        self._past = [*self._past[-WINDOW:], pose]
        span = (len(self._past) - 1) * DT
        moved = norm((pose[0] - self._past[0][0])[running]).max(initial=0.0) / max(span, WINDOW * DT)
        turn = rotation_vector(pose[1][running] @ np.swapaxes(self._past[0][1][running], -1, -2))
        turned = norm(turn).max(initial=0.0) / max(span, WINDOW * DT)
        twist = command.twist[running]
        asked = (norm(twist[..., :3]).max(initial=0.0), norm(twist[..., 3:]).max(initial=0.0))
        for speed, bound, unit in zip((moved, turned), FASTEST, ("m/s", "rad/s"), strict=True):
            if speed > bound:
                text = f"the desired pose moves at {speed:.3g} {unit} {when}; no more than {bound:g} {unit} is taken"
                self.problems.setdefault(f"pose {unit}", text)
        for speed, bound, unit in zip(asked, FASTEST, ("m/s", "rad/s"), strict=True):
            if speed > bound:
                text = f"the desired twist is {speed:.3g} {unit} {when}; no more than {bound:g} {unit} is taken"
                self.problems.setdefault(f"twist {unit}", text)


def _finite(command: Command, running: NDArray[np.bool_]) -> bool:
    return all(np.isfinite(values[running]).all() for values in (*command.pose, command.twist, command.feedforward))


def leaves_nothing_behind(skill: SkillType, document: Document) -> Iterator[str]:
    """From building to the journal of a run of 120 s, it prints nothing, writes no file and runs no program."""
    with watched() as seen, contextlib.suppress(Exception, SystemExit):  # what raises is told by another check
        ended_at(skill, document)
    yield from left_behind(seen)


def ended_at(skill: SkillType, document: Document) -> float | None:
    """Seconds after which every trial has ended. None if one is still under way after 120 s."""
    built, end = skill.build(document), [-1]

    def look(tick: int, observation: Observation, command: Command) -> bool:
        if end[0] < 0 and np.all(command.status != Status.RUNNING):
            end[0] = tick
        return end[0] >= 0 and tick >= end[0] + 20

    run(built, lead_of(skill, document), END_TICKS, END_DT, look)
    for trial in range(TRIALS):
        built.journal(trial)
    return None if end[0] < 0 else end[0] * END_DT


def end_warnings(skill: SkillType, document: Document) -> Iterator[str]:
    """It ends, or says in a line of `describe` that it never ends."""
    if ended_at(skill, document) is None and NEVER not in " ".join(skill.describe(document) if skill.describe else []):
        yield (
            f"is still under way after {END_DT * END_TICKS:g} s; give it a time limit, "
            f"or say in a line of `describe` that it {NEVER}"
        )


def remembers_little(skill: SkillType, document: Document) -> Iterator[str]:
    """Memory does not grow with every tick."""
    held: list[int] = []
    lead = lead_of(skill, document)

    def look(tick: int, observation: Observation, command: Command) -> bool:
        if tick and tick % LEAK_TICKS == 0:
            gc.collect()
            held.append(tracemalloc.get_traced_memory()[0])
        return False

    tracing = tracemalloc.is_tracing()
    if not tracing:
        tracemalloc.start()
    gc.freeze()  # what was there before is not looked through at every `collect`
    try:
        run(skill.build(document), lead, 3 * LEAK_TICKS + 1, DT, look)
    finally:
        gc.unfreeze()
        if not tracing:
            tracemalloc.stop()
    growth = float(np.diff(held).min()) / LEAK_TICKS / TRIALS
    if growth > LEAK_BYTES:
        yield f"keeps {growth:.3g} more bytes a trial with every tick; keep what is needed for the next tick only"
