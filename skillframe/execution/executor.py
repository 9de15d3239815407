"""The only loop: N trials of one skill in lock-step, from observation to plant, a thousand times a second.

    drive.sense -> Observation -> skill.step -> Command -> drive.act -> limits -> drive.advance

One run is N = 1, a campaign's chunk is N = 32 ... 256, and a trial's result does not depend, to the last bit, on which
others run beside it. What stands between a command and the plant is a `skillframe.execution.drive.Drive`: joint
torques, several arms, electric servos, a hydraulic machine. The loop knows none of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.control.contact import TrueContact
from skillframe.control.endings import Broken, Ended
from skillframe.execution.drive import Drive
from skillframe.execution.drives.choose import chosen_drive
from skillframe.execution.outcome import Outcomes
from skillframe.execution.paced import PacedSkill
from skillframe.execution.result import Result
from skillframe.execution.setup import Setup
from skillframe.frames import Float
from skillframe.handover import SLOW_TICKS, CommandCheck, Fault, asked, shown, unknown_end
from skillframe.skill import Command, Observation, Skill, Status
from skillframe.world.collisions import Collisions
from skillframe.world.quantities import QUANTITIES
from skillframe.world.rates import ratio

__all__ = ["QUANTITIES", "Loop", "Result", "Setup", "begin", "simulate"]

RAMP_S = 0.05
APART_TICKS = 100
"""Between two measurements of how far bodies are apart that may not touch; one costs about what a tick does (ours)."""


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

    What drives the robot follows from its robot.toml and the scene (`skillframe.execution.drives.choose`). Where a
    second arm holds the scene's fixture, a coordinator runs both arms, and a skill runs the first while the second
    stands still.

    Args:
        skill: what to run; `start` is called once.
        setup: robot, scene and settings.
        draws: quantities of `QUANTITIES` per trial, each (N,); absent ones are nominal.
        rngs: one generator per trial; sensors and skill draw from children of it.
        duration_s: simulated seconds after which a trial is stopped; more where the robot's interface is slow.
        trace_hz: rate of the traces; None keeps none.
        progress: called every 10 ms of simulated time with the seconds simulated.

    Raises:
        UnknownName: a quantity that nothing reads.
        UnreachablePose: the robot cannot reach a start.
        SkillframeError: rates that do not divide.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # a diverging trial is the limits' business, not a warning
        loop = begin(skill, setup, draws, rngs, trace_hz)
        loop.prepare()
        loop.run(duration_s, progress)
        return loop.result()


def begin(
    skill: Skill, setup: Setup, draws: Mapping[str, Float], rngs: Sequence[np.random.Generator],
    trace_hz: float | None = None,
) -> Loop:  # fmt: skip
    """The loop of len(rngs) trials at their starts, before its drive is prepared. Arguments as `simulate`."""
    children = [rng.spawn(2) for rng in rngs]
    skill, drive = chosen_drive(skill, setup, draws, [pair[0] for pair in children])
    return Loop(skill, setup, drive, [pair[1] for pair in children], trace_hz)


class Loop:
    """The state of one batch while it runs.

    Args:
        skill: what runs, with a row per trial, or per trial and arm, as the drive senses.
        setup: robot, scene and settings.
        drive: at the trials' starts.
        rngs: one generator per trial, for the skill.
        trace_hz: rate of the traces; None keeps none.
    """

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
        rate = setup.robot.spec.control.tick_hz
        self.recorder = None if trace_hz is None else drive.recording(ratio(rate, trace_hz, "control", "the trace"))
        self.interrupted = False

    def prepare(self) -> None:
        """Tare, or identify. Trials that cannot run end before their start."""
        self._end_failed(self.drive.prepare(), 0.0)

    def run(self, duration_s: float, progress: Callable[[float], None] | None) -> None:
        """Tick until every trial has ended or the time is up."""
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
        """End the trials that still run after `ticks` ticks: by a limit that they broke, else by the clock."""
        if len(self.active):
            self._end_broken(self.contact.look(self.active), ticks * self.dt)
            self._end_touching(self.active, ticks * self.dt)
            text = f"time limit: {duration_s:g} s of simulated time are over"
            self._end(self.active, ticks * self.dt, text, False, Ended.TIME)

    def tick(self, tick: int) -> None:
        """One tick of the trials that still run. Ticks are counted from 0 and none is left out."""
        time = tick * self.dt
        observation = self.drive.sense(tick, self.active)
        command = self._ask(tick, observation)
        law = self.drive.act(command, min(1.0, time / RAMP_S))
        self._feel(observation.wrench)
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

    def _feel(self, wrench: Float) -> None:
        """Take in the true contact of a tick, and the filtered wrench (N, ..., 6) beside it."""
        torque = self.drive.contact_torque() if self.contact.wants_torque else None
        self.contact.step(self.plant.contact_force(), wrench.reshape(-1, 6), torque)

    def _stop_where_due(self, tick: int, time: float, command: Command) -> None:
        slow, ending = tick % SLOW_TICKS == 0, np.count_nonzero(command.status)
        if tick % APART_TICKS == 0:
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
                self._end_told(int(i), time, int(command.status[i]), command.reason[i])
        if self.setup.stop_when is not None and slow and len(self.active):
            done = self.setup.stop_when(self.plant.tip_state())
            rows = self.active[done[self.active]]
            self.outcomes.status[rows] = Status.SUCCESS
            self._end(rows, time, "done", False, Ended.GOAL)
            self._end_needless(rows[self.outcomes.goal[rows]], time)

    def _end_broken(self, broken: Sequence[Broken], time: float) -> None:
        """End the trials that broke something, each for the first thing that is named."""
        for row, code, cause in broken:
            if row in self.active:
                self._end(np.array([row]), time, f"{cause} (at {time:.3f} s)", True, code)

    def _end_touching(self, rows: NDArray[np.int64], time: float) -> None:
        """End those of some trials whose bodies touch what they may not, with the names of both."""
        for touch in self.collisions.touches(self.plant, rows):
            self.outcomes.touched[touch.row] = touch.first, touch.second
            self._end_broken([Broken(touch.row, Ended.COLLISION, touch.cause)], time)

    def _end_needless(self, reached: NDArray[np.int64], time: float) -> None:
        """End later attempts at what has just been reached."""
        if self.setup.attempts_at is None or not len(reached):
            return
        at = np.array(self.setup.attempts_at)
        later = (at[self.active, None] == at[reached]) & (self.active[:, None] > reached)
        text = "an earlier attempt at the same has succeeded"
        self._end(self.active[later.any(axis=1)], time, text, False, Ended.INTERRUPTED)

    def _end_told(self, i: int, time: float, status: int, reason: object) -> None:
        """End trial i as its skill says."""
        if wrong := unknown_end(status, reason):
            self._end_broken([Broken(i, Ended.COMMAND, wrong)], time)
            return
        self.outcomes.status[i] = status
        self._end(np.array([i]), time, str(reason) or "the skill ended", False, Ended.SKILL)

    def _end_failed(self, failed: Sequence[Broken], time: float) -> None:
        """End the trials that their actuators leave, in the sentences of these."""
        for row, code, cause in failed:
            if row in self.active:
                self._end(np.array([row]), time, cause, True, code)

    def _end(self, rows: NDArray[np.int64], time: float, reason: str, limit: bool, code: Ended) -> None:
        """Close trials: judge them as they stand now, and stop stepping them."""
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
