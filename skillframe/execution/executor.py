"""The simulation loop: N trials of one skill in lock-step, at the control rate.

    drive.sense -> Observation -> skill.step -> Command -> drive.act -> limits -> drive.advance

N is 1 for a run and 32 to 256 for a campaign's chunk. A trial's result does not depend, to the last bit, on the others
in its batch. Everything specific to a robot is in its `skillframe.execution.drive.Drive`.

A start in penetration (tool, part in the second hand, or link) is invalid, because the contact engine would throw the
tool out, which says nothing about a skill. It is not sampled again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.control.contact import TrueContact
from skillframe.errors import InputError
from skillframe.execution.drive import Drive, PacedSkill, Setup
from skillframe.execution.drives.choose import chosen_drive
from skillframe.execution.outcome import Outcomes
from skillframe.execution.recorder import ratio
from skillframe.execution.result import Result
from skillframe.frames import Float
from skillframe.handover import SLOW_TICKS, CommandCheck, Fault, asked, shown, unknown_end
from skillframe.skill import Broken, Command, Ended, Observation, Reasons, Skill, Status
from skillframe.world.collisions import Collisions
from skillframe.world.plant import START_DEPTH, Plant

__all__ = ["Loop", "Result", "Setup", "begin", "simulate"]

RAMP_S = 0.05  #: duration of the ramp of stiffness at the start [s]


def simulate(
    skill: Skill,
    setup: Setup,
    draws: Mapping[str, Float],
    rngs: Sequence[np.random.Generator],
    *,
    duration_s: float = 20.0,
    trace_hz: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Run a skill on len(rngs) trials until each has ended.

    Robot and scene determine the drive (`skillframe.execution.drives.choose`). If a second arm holds the fixture, a
    coordinator runs both arms; a skill runs the first while the second stands still.

    Args:
        skill: the skill; `start` is called once.
        setup: robot, scene and settings.
        draws: quantities of `skillframe.extend.drives` per trial, each (N,); absent ones are nominal.
        rngs: one generator per trial.
        duration_s: simulated time limit, longer where the robot's interface is slow.
        trace_hz: rate of the traces, or None.
        progress: called every 10 ms of simulated time with the seconds simulated.

    Raises:
        UnknownName: unknown quantity.
        UnreachablePose: the robot cannot reach a start.
        SkillframeError: rates that do not divide.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # limits end diverging trials
        loop = begin(skill, setup, draws, rngs, trace_hz)
        loop.prepare()
        loop.run(duration_s, progress)
        return loop.result()


def begin(
    skill: Skill, setup: Setup, draws: Mapping[str, Float], rngs: Sequence[np.random.Generator],
    trace_hz: float | None = None,
) -> Loop:  # fmt: skip
    """The loop of len(rngs) trials at their starts, before `prepare`. Arguments as `simulate`."""
    children = [rng.spawn(2) for rng in rngs]
    skill, drive = chosen_drive(skill, setup, draws, [pair[0] for pair in children])
    return Loop(skill, setup, drive, [pair[1] for pair in children], trace_hz)


class Loop:
    """The state of a running batch, whose skill has a row per trial, or per trial and arm."""

    def __init__(
        self, skill: Skill, setup: Setup, drive: Drive, rngs: Sequence[np.random.Generator], trace_hz: float | None
    ) -> None:
        count = len(rngs)
        self.skill, self.setup, self.drive, self.count, self.skill_rngs = skill, setup, drive, count, rngs
        self._paced = skill if isinstance(skill, PacedSkill) else None
        self.plant, self.dt = drive.plant, drive.dt
        self.collisions = Collisions(self.plant)
        self.contact = TrueContact(setup.robot.spec.limits, count, self.dt)
        self.outcomes = Outcomes(setup, drive, self.contact, count)
        self.check: CommandCheck
        self.faults: list[Fault] = []
        self.active = np.arange(count)
        every = None if trace_hz is None else ratio(1.0 / self.dt, trace_hz, "control", "the trace")
        self.recorder = None if every is None else drive.recording(every)
        self.interrupted = False

    def prepare(self) -> None:
        """Tare or identify. Trials that begin in penetration, or cannot run, end here."""
        inside = starts_inside(self.plant, self.collisions)
        self._end_failed([*inside, *self.drive.prepare()], 0.0)

    def run(self, duration_s: float, progress: Callable[[float], None] | None) -> None:
        """Tick until every trial has ended or time is up."""
        pace = self.setup.pace
        duration_s *= pace
        ticks = round(duration_s / self.dt)
        tick = 0
        try:
            for tick in range(ticks):
                self.tick(tick)
                if not len(self.active):
                    return
                if progress is not None and tick % SLOW_TICKS == 0:
                    progress(tick * self.dt / pace)
        except KeyboardInterrupt:
            self.interrupted = True
            self._end(self.active, tick * self.dt, "interrupted", True, Ended.INTERRUPTED)
        self.time_over(ticks, duration_s)

    def time_over(self, ticks: int, duration_s: float) -> None:
        """End the trials still running after `ticks` ticks, by a broken limit or by time."""
        if len(self.active):
            self._end_broken(self.contact.look(self.active), ticks * self.dt)
            self._end_touching(self.active, ticks * self.dt)
            text = f"time limit: {duration_s:g} s of simulated time are over"
            self._end(self.active, ticks * self.dt, text, False, Ended.TIME)

    def tick(self, tick: int) -> None:
        """Run one tick of the active trials. Ticks count up from 0 without gaps."""
        time = tick * self.dt
        observation = self.drive.sense(tick, self.active)
        command = self._ask(tick, observation)
        law = self.drive.act(command, min(1.0, time / RAMP_S))
        torque = self.drive.contact_torque() if self.contact.wants_torque else None
        self.contact.step(self.plant.contact_force(), observation.wrench.reshape(-1, 6), torque)
        if self.recorder is not None:
            self.recorder.record(tick, time, observation, command, law)
        self._stop_where_due(tick, time, command)
        if len(self.active):
            self._end_failed(self.drive.advance(self.active), time)

    def _ask(self, tick: int, observation: Observation) -> Command:
        if self._paced is not None and (last := self._paced.between()) is not None:
            self.faults = [] if tick % SLOW_TICKS else self.check.faults(last, tick)
            return last
        seen = shown(observation)
        if tick == 0:
            self.check = CommandCheck(self.skill, observation.time.shape)
            asked(self.skill, self.skill.start, seen, self.skill_rngs)
        command = asked(self.skill, self.skill.step, seen)
        self.faults = self.check.faults(command, tick)
        return command

    def _stop_where_due(self, tick: int, time: float, command: Command) -> None:
        slow, ending = tick % SLOW_TICKS == 0, np.count_nonzero(command.status)
        if tick % 100 == 0:  # how far bodies are apart costs about as much as a tick
            self.collisions.measure(self.plant, self.active)
        self._end_broken([Broken(row, Ended.COMMAND, cause) for row, cause in self.faults], time)
        broken = self.drive.violations(tick, self.active)
        if broken or slow or ending:
            self._end_broken([*broken, *self.contact.look(self.active)], time)
        if slow or ending:
            over = command.status[self.active] != Status.RUNNING
            self._end_touching(self.active if slow else self.active[over], time)
        if ending:
            for i in self.active[command.status[self.active] != Status.RUNNING]:
                status, reason = int(command.status[i]), command.reason[i]
                if wrong := unknown_end(status, reason):
                    self._end_broken([Broken(int(i), Ended.COMMAND, wrong)], time)
                else:
                    self.outcomes.status[i] = status
                    self._end(np.array([i]), time, str(reason) or "the skill ended", False, Ended.SKILL)
        if self.setup.stop_when is not None and slow and len(self.active):
            done = self.setup.stop_when(self.plant.tip_state())
            rows = self.active[done[self.active]]
            self.outcomes.status[rows] = Status.SUCCESS
            self._end(rows, time, "done", False, Ended.GOAL)
            reached = rows[self.outcomes.goal[rows]]
            if self.setup.attempts_at is not None and len(reached):
                at = np.array(self.setup.attempts_at)
                later = (at[self.active, None] == at[reached]) & (self.active[:, None] > reached)
                text = "an earlier attempt at the same has succeeded"
                self._end(self.active[later.any(axis=1)], time, text, False, Ended.INTERRUPTED)

    def _end_broken(self, broken: Sequence[Broken], time: float) -> None:
        for row, code, cause in broken:
            if row in self.active:
                self._end(np.array([row]), time, f"{cause} (at {time:.3f} s)", True, code)

    def _end_touching(self, rows: NDArray[np.int64], time: float) -> None:
        for touch in self.collisions.touches(self.plant, rows):
            self.outcomes.touched[touch.row] = touch.first, touch.second
            self._end_broken([Broken(touch.row, Ended.COLLISION, touch.cause)], time)

    def _end_failed(self, failed: Sequence[Broken], time: float) -> None:
        for row, code, cause in failed:
            if row in self.active:
                self._end(np.array([row]), time, cause, True, code)

    def _end(self, rows: NDArray[np.int64], time: float, reason: str, limit: bool, code: Ended) -> None:
        if not len(rows):
            return
        self.collisions.measure(self.plant, rows)
        self.outcomes.close(rows, time, reason, code, limit)
        self.active = np.setdiff1d(self.active, rows)
        self.drive.end(rows)
        if self.recorder is not None:
            self.recorder.close(rows)

    def result(self) -> Result:
        """The outcome of every trial."""
        result = self.outcomes.result(self.recorder, self.skill.journal, self.collisions, self.interrupted)
        return self.drive.outcome(result)


INSIDE = "begins inside something: "
"""Prefix of the reason of such a trial."""


def starts_inside(plant: Plant, collisions: Collisions) -> list[Broken]:
    """Invalid starts of a plant, each with both names and the depth."""
    found = {each.row: each.cause for each in plant.inside()}
    for touch in collisions.touches(plant, np.arange(plant.count), START_DEPTH):
        found.setdefault(touch.row, touch.cause)
    return [Broken(row, Ended.START, f"{INSIDE}{cause}") for row, cause in found.items()]


def require_starts(ended_by: Reasons, reason: Reasons) -> None:
    """Refuse a batch with an invalid start.

    Raises:
        InputError: with both names and the depth.
    """
    inside = np.flatnonzero(ended_by == Ended.START.value)
    if len(inside):
        fix = "move it with start.offset_x, start.tilt_y, fixture.offset_x ... (worlds --settings lists them)"
        raise InputError("the start", f"is no trial: {str(reason[inside[0]]).removeprefix(INSIDE)}", fix)
