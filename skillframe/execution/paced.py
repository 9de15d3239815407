"""A skill that is asked as often as an arm takes commands, by a clock that runs as slowly as the arm has to move.

An arm that takes positions cannot push at the speed that a person showed (`skillframe.robot.interface`). A skill's time
limits, stall times and speeds belong together, so all of them are stretched at once: a second of the skill takes `pace`
seconds. The skill sees times divided by the pace and twists multiplied by it; who takes its commands divides their
twists by it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.skill import Command, Observation, Skill


class PacedSkill(Skill):
    """A skill between whose commands the loop ticks on.

    Args:
        skill: what is asked.
        every: ticks of the loop between two commands.
        pace: seconds that a second of the skill takes, 1 or more.
    """

    def __init__(self, skill: Skill, every: int, pace: float) -> None:
        self._skill, self._every, self._pace = skill, every, pace
        self._tick = 0
        self._command: Command | None = None

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """As the skill starts. The ticks are counted from here."""
        self._tick, self._command = 0, None
        self._skill.start(self._seen(observation), rngs)

    def step(self, observation: Observation) -> Command:
        """What the skill answers, or has answered last."""
        if self._command is None or self._tick % self._every == 0:
            self._command = self._skill.step(self._seen(observation))
        self._tick += 1
        return self._command

    def between(self) -> Command | None:
        """What the skill has answered last, in a tick that does not ask it. None where it has to be asked."""
        if self._command is None or self._tick % self._every == 0:
            return None
        self._tick += 1
        return self._command

    def restart(
        self, rows: NDArray[np.intp], observation: Observation, rngs: Sequence[np.random.Generator]
    ) -> None:  # fmt: skip
        """As the skill does."""
        self._skill.restart(rows, self._seen(observation), rngs)

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """The skill's, in seconds of the run."""
        return [(self._pace * time, text) for time, text in self._skill.journal(trial)]

    def _seen(self, observation: Observation) -> Observation:
        """An observation by the skill's clock."""
        twist, time = self._pace * observation.twist, observation.time / self._pace
        return Observation(time, self._every * observation.dt / self._pace, observation.pose, twist, observation.wrench)
