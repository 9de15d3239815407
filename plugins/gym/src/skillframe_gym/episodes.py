"""Trials of a world steered from outside, a step of many ticks at a time, in the loop of `run`.

A cohort is a set of trials that began together. They tick in lock-step, and a trial's outcome does not depend, to the
last bit, on the others. A trial ends by a limit, by the clock, or at the world's goal, which is checked every 10 ms.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.execution import Loop, Setup, begin, ratio, require_starts
from skillframe.frames import Float, Pose, quaternion_from_matrix, rotation_matrix
from skillframe.skill import Command, Ended, Impedance, Observation, Skill, no_reasons
from skillframe_gym.settings import LARGEST, EnvSettings

LEVER_M = 0.1
"""Distance per angle to the goal [m/rad]: the length of a small part."""


class Seen(NamedTuple):
    """State of trials after a step, a row a trial.

    Attributes:
        observation: name to (N, ...), of `settings.observation_space`.
        distance: to the goal, the angle counted with `LEVER_M` [m].
        success: of `Result`; False while a trial runs.
        ended: the trial is over.
        by_time: it ended by the clock alone.
    """

    observation: dict[str, Float]
    distance: Float
    success: NDArray[np.bool_]
    ended: NDArray[np.bool_]
    by_time: NDArray[np.bool_]


class Steered(Skill):
    """Holds the last target, at the start the tool's pose."""

    def __init__(self, settings: EnvSettings) -> None:
        self._settings = settings

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Stand still."""
        self.seen, self._count = observation, len(rngs)
        self._still, self._running = np.zeros((self._count, 6)), np.zeros(self._count, dtype=np.int64)
        self._reasons = no_reasons(self._count)
        self.steer(np.zeros((self._count, self._settings.action_space().shape[0])))

    def steer(self, actions: Float) -> None:
        """Take actions (N, 6 or 12), between -1 and 1, relative to the last observation."""
        position, rotation = self.seen.pose
        turn = rotation_matrix(self._settings.reach_rad * actions[:, 3:6])
        self._pose = Pose(position + self._settings.reach_m * actions[:, :3], turn @ rotation)
        self._impedance = Impedance(self._settings.gains(actions))

    def step(self, observation: Observation) -> Command:
        """The command to the target."""
        self.seen = observation
        still = self._still
        return Command(self._pose, still, self._impedance, still, self._running, self._reasons)


class Cohort:
    """Trials that began together.

    Args:
        setup: robot and scene; a trial ends when the scene's goal holds.
        settings: of the environment.
        draws: quantities per trial, each (N,).
        rngs: one generator per trial.

    Raises:
        InputError: a trial begins in collision.
        SkillframeError: as `skillframe.execution.executor.simulate`.
    """

    def __init__(
        self, setup: Setup, settings: EnvSettings, draws: dict[str, Float], rngs: Sequence[np.random.Generator]
    ) -> None:
        self._skill, self._settings = Steered(settings), settings
        rate = setup.robot.spec.control.tick_hz
        self._per_step = ratio(rate, settings.rate_hz, "control", "actions")
        self._last_s = settings.duration_s * setup.pace
        self._last = round(self._last_s * rate)
        with _diverging_is_no_warning():
            self._loop: Loop = begin(self._skill, setup, draws, rngs)
            self._loop.prepare()
            require_starts(self._loop.outcomes.ended_by, self._loop.outcomes.reason)
            self._loop.tick(0)
        self._tick, self.count = 1, len(rngs)
        self._shown = self._observed()
        self._running, self._result = -1, self._loop.result()

    def step(self, actions: NDArray[Any]) -> None:
        """Tick to the next action, or to the end of the trials.

        Raises:
            InputError: an action that is not a number.
        """
        if not np.all(np.isfinite(actions)):
            raise InputError("action", "holds a value that is not finite", "give numbers between -1 and 1")
        if not len(self._loop.active):
            return
        self._skill.steer(np.clip(actions.astype(float), -1.0, 1.0))
        stop = min(self._tick + self._per_step, self._last)
        with _diverging_is_no_warning():
            while self._tick < stop and len(self._loop.active):
                running = self._loop.active
                self._loop.tick(self._tick)
                self._tick += 1
                if len(self._loop.active) < len(running):
                    self._show(np.setdiff1d(running, self._loop.active))
            self._show(self._loop.active)
            if self._tick >= self._last:
                self._loop.time_over(self._last, self._last_s)

    def see(self) -> Seen:
        """State of the trials, observed with a delay of a tick, as by a skill."""
        ended = np.ones(self.count, dtype=bool)
        ended[self._loop.active] = False
        outcomes = self._loop.outcomes
        far, turned = self._loop.setup.scene.goal_error(self._loop.plant.tip_state())
        by_time = ended & (outcomes.ended_by == Ended.TIME.value)
        if self._running != len(self._loop.active):  # sentences are made only when a trial ended
            self._running, self._result = len(self._loop.active), self._loop.result()
        return Seen(self._shown, far + LEVER_M * turned, self._result.success & ended, ended, by_time)

    def told(self, i: int) -> dict[str, Any]:
        """Outcome of the ended trial i, as of `run`."""
        result = self._result
        return {
            "is_success": bool(result.success[i]), "failure": str(result.failure[i]), "reason": str(result.reason[i]),
            "ended_by": str(result.ended_by[i]), "duration_s": float(result.duration_s[i]),
            "peak_force_n": float(result.peak_force_n[i]), "final_error_m": float(result.final_error_m[i]),
            "final_error_rad": float(result.final_error_rad[i]),
        }  # fmt: skip

    def tip(self, i: int) -> Pose:
        """Pose of trial i's tip in the true fixture frame, for pictures."""
        position, rotation = self._loop.plant.tip_state().tip
        return Pose(position[i], rotation[i])

    def _show(self, rows: NDArray[np.int64]) -> None:
        """Store the observations of some trials, while sensors of ended trials go on."""
        for name, values in self._observed().items():
            self._shown[name][rows] = values[rows]

    def _observed(self) -> dict[str, Float]:
        position, rotation = self._skill.seen.pose
        values = {
            "position": position, "quaternion": quaternion_from_matrix(rotation),
            "twist": self._skill.seen.twist, "wrench": self._skill.seen.wrench,
        }  # fmt: skip
        return {k: np.clip(np.nan_to_num(v), -LARGEST[k], LARGEST[k]) for k, v in values.items()}


def _diverging_is_no_warning() -> np.errstate:
    return np.errstate(invalid="ignore", over="ignore")
