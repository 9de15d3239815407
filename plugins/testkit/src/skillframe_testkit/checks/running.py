"""Checks of a skill over a whole run: time, bounds, end, memory, side effects.

Runs use a fast closed loop: tools follow commands with a lag, above a soft floor, which takes a skill through its
phases in less than a second for a thousand ticks. Time is compared with a trivial skill in the same process, tick by
tick, so that load on the machine cancels.
"""

from __future__ import annotations

import contextlib
import gc
import time
import tracemalloc
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.extend import Document, SkillType
from skillframe.frames import Float, Pose, norm, rotation_matrix, rotation_vector
from skillframe.handover import CommandCheck, asked, check_shapes, shown
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe_testkit.checks.playback import arms_of
from skillframe_testkit.checks.watch import left_behind, watched

HEIGHT = 0.3  # m in base
TRIALS, TICKS, DT = 4, 2000, 1e-3
WINDOW, FASTEST = 10, (3.0, 10.0)
"""m/s, rad/s over 10 ms: twice those of a human-sized arm; smaller jumps than 30 mm do not count."""
END_DT, END_TICKS = 0.05, 2400
"""120 s, longer than usual time limits."""
NEVER = "never ends"


class Follower:
    """Tools (N, ...) that follow commands with a lag of 20 ms, over a floor 30 mm below their start.

    `lead` is (N,) or (N, arms).
    """

    def __init__(self, lead: tuple[int, ...], dt: float) -> None:
        self._lead, self._dt, self.tick = lead, dt, 0
        start = np.linspace(0.4, 0.5, int(np.prod(lead))).reshape(*lead, 1) * [1.0, 0.0, 0.0] + [0.0, 0.0, HEIGHT]
        down = np.broadcast_to(np.diag([1.0, -1.0, -1.0]), (*lead, 3, 3))
        self.pose, self.twist = Pose(start, down.copy()), np.zeros((*lead, 6))

    def observation(self) -> Observation:
        """The read-only observation at this tick."""
        wrench = np.zeros((*self._lead, 6))
        wrench[..., 2] = 1000.0 * np.maximum(HEIGHT - 0.03 - self.pose.position[..., 2], 0.0)
        time = np.full(self._lead, self.tick * self._dt)
        return shown(Observation(time, self._dt, self.pose, self.twist, wrench))

    def follow(self, command: Command) -> None:
        """Follow the command for a tick."""
        share = 1.0 - np.exp(-self._dt / 0.02)
        step = share * (command.pose.position - self.pose.position)
        turn = share * rotation_vector(command.pose.rotation @ np.swapaxes(self.pose.rotation, -1, -2))
        self.pose = Pose(self.pose.position + step, rotation_matrix(turn) @ self.pose.rotation)
        self.twist = np.concatenate([step, turn], axis=-1) / self._dt
        self.tick += 1


Look = Callable[[int, Observation, Command], bool]
"""Called with tick, observation and command; True ends the run."""


def run(skill: Skill, lead: tuple[int, ...], ticks: int, dt: float, look: Look) -> None:
    """Run a skill in the fast loop, and pass each command to `look`.

    Raises:
        SkillframeError: it writes into its observation, or returns an invalid command.
        LateError: the skill raised, with the tick.
    """
    follower = Follower(lead, dt)
    observation = follower.observation()
    rngs = [np.random.default_rng([7, i]) for i in range(lead[0])]
    with np.errstate(invalid="ignore", over="ignore"):  # as in the simulation loop
        asked(skill, skill.start, observation, rngs)
        for tick in range(ticks):
            command = stepped(skill, observation, tick)
            check_shapes(skill, command, lead)
            if look(tick, observation, command):
                return
            follower.follow(command)
            observation = follower.observation()


class LateError(Exception):
    """A skill raised during a run."""


def stepped(skill: Skill, observation: Observation, tick: int) -> Command:
    """Command of a step.

    Raises:
        LateError: the skill raised, with tick and error.
    """
    try:
        return asked(skill, skill.step, observation)
    except Exception as error:  # code of a plug-in
        when = f"in tick {tick}, at {float(observation.time.flat[0]):.3f} s"
        what = f"step raised {type(error).__name__} {when}: {error}"
        raise LateError(
            what if isinstance(error, SkillframeError) else f"{what}; catch it and end with FAILURE"
        ) from error


def lead_of(skill: SkillType, document: Document) -> tuple[int, ...]:
    """(N,), or (N, arms) for a coordinator."""
    return TRIALS, *arms_of(skill, document)


class Standing(Skill):
    """Holds the measured pose: the reference for the time of a step."""

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Do nothing."""

    def step(self, observation: Observation) -> Command:
        """Command the measured pose."""
        zero = np.zeros(observation.twist.shape)
        count = len(observation.time)
        return Command(
            observation.pose, zero, Impedance(np.eye(6)), zero, np.zeros(count, dtype=np.int64), no_reasons(count)
        )


def answers_in_time(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that a step takes at most five milliseconds, or a hundred times a trivial one."""
    taken: list[tuple[float, float]] = []
    tried, standing, start = _Timed(skill.build(document)), Standing(), time.perf_counter

    def look(tick: int, observation: Observation, command: Command) -> bool:
        began = start()
        standing.step(observation)
        taken.append((tried.seconds, start() - began))
        return False

    with contextlib.suppress(LateError, SkillframeError):  # reported by `answers_in_shape`
        run(tried, lead_of(skill, document), 40, DT, look)
    if not taken:
        return
    ours, reference = np.median(np.array(taken), axis=0)
    slow = 5e-3  # s
    if ours > slow and ours > 100.0 * reference:
        yield (
            f"a step takes {1e3 * ours:.2g} ms, and the loop ticks every {1e3 * DT:g} ms; make it "
            f"{ours / slow:.2g} times faster or more (the other checks wait for that)"
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
    """Check errors, poses, speeds, gains and feed-forward over 2000 ticks of 1 ms."""
    built, lead = skill.build(document), lead_of(skill, document)
    bounds = _Bounds(CommandCheck(built, lead))
    try:
        run(built, lead, TICKS, DT, bounds.look)
    except (LateError, SkillframeError) as error:
        yield str(error)
    yield from bounds.problems.values()


class _Bounds:
    """Checks bounds of commands, and stores the first excess of each kind."""

    def __init__(self, check: CommandCheck) -> None:
        self._check, self.problems = check, dict[str, str]()
        self._past: list[tuple[Float, Float]] = []

    def look(self, tick: int, observation: Observation, command: Command) -> bool:
        running = command.status == Status.RUNNING
        when = f"in tick {tick}, at {tick * DT:.3f} s"
        values = (*command.pose, command.twist, command.feedforward)
        if not all(np.isfinite(each[running]).all() for each in values):
            self.problems["finite"] = f"the command is not finite {when}; end with FAILURE before that"
            return True
        for fault in self._check.faults(command, tick):
            self.problems.setdefault("fault", f"{fault.cause} ({when})")
        # of feed-forward 2.5 times the 80 N limit of the shipped robots is taken
        for part, bound, unit in zip((slice(0, 3), slice(3, 6)), (200.0, 50.0), ("N", "Nm"), strict=True):
            most = norm(command.feedforward[running][..., part]).max(initial=0.0)
            if most > bound:
                text = f"the feed-forward is {most:.3g} {unit} {when}; bound it, no more than {bound:g} {unit} is taken"
                self.problems.setdefault(f"force {unit}", text)
        self._speed(command, running, when)
        return not running.any()

    def _speed(self, command: Command, running: NDArray[np.bool_], when: str) -> None:
        pose = (command.pose.position.copy(), command.pose.rotation.copy())
        self._past = [*self._past[-WINDOW:], pose]
        span = (len(self._past) - 1) * DT
        moved = norm((pose[0] - self._past[0][0])[running]).max(initial=0.0) / max(span, WINDOW * DT)
        turn = rotation_vector(pose[1][running] @ np.swapaxes(self._past[0][1][running], -1, -2))
        turned = norm(turn).max(initial=0.0) / max(span, WINDOW * DT)
        twist = command.twist[running]
        asked = (norm(twist[..., :3]).max(initial=0.0), norm(twist[..., 3:]).max(initial=0.0))
        for what, speeds in (("pose moves at", (moved, turned)), ("twist is", asked)):
            for speed, bound, unit in zip(speeds, FASTEST, ("m/s", "rad/s"), strict=True):
                if speed > bound:
                    text = f"the desired {what} {speed:.3g} {unit} {when}; no more than {bound:g} {unit} is taken"
                    self.problems.setdefault(f"{what} {unit}", text)


def leaves_nothing_behind(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that a run of 120 s prints nothing, writes no file and runs no program."""
    with watched() as seen, contextlib.suppress(Exception, SystemExit):  # errors are another check's
        ended_at(skill, document)
    yield from left_behind(seen)


def ended_at(skill: SkillType, document: Document) -> float | None:
    """Time at which every trial has ended [s], None after 120 s."""
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
    """Check that it ends, or that `describe` states that it never ends."""
    if ended_at(skill, document) is None and NEVER not in " ".join(skill.describe(document) if skill.describe else []):
        yield (
            f"is still under way after {END_DT * END_TICKS:g} s; give it a time limit, "
            f"or say in a line of `describe` that it {NEVER}"
        )


def remembers_little(skill: SkillType, document: Document) -> Iterator[str]:
    """Check that memory does not grow with ticks."""
    held: list[int] = []
    lead, span = lead_of(skill, document), 300  # ticks

    def look(tick: int, observation: Observation, command: Command) -> bool:
        if tick and tick % span == 0:
            gc.collect()
            held.append(tracemalloc.get_traced_memory()[0])
        return False

    tracing = tracemalloc.is_tracing()
    if not tracing:
        tracemalloc.start()
    gc.freeze()  # speeds up `collect`
    try:
        run(skill.build(document), lead, 3 * span + 1, DT, look)
    finally:
        gc.unfreeze()
        if not tracing:
            tracemalloc.stop()
    growth = float(np.diff(held).min()) / span / TRIALS
    if growth > 256:  # bytes a tick and trial, 15 MB a minute at 1 kHz; one number a tick is 8
        yield f"keeps {growth:.3g} more bytes a trial with every tick; keep what is needed for the next tick only"
