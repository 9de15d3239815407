"""Policy that runs phases in sequence, each a skill of its own.

A phase is followed by one that followed it in a demonstration

- when the contact wrench indicates it for two windows of 50 ms and the phase has stopped moving the tool (under 4 mm/s
  and 2 degrees/s, as a coupler that touches with one edge has the wrench of a seated one, but still turns), or after a
  second; or
- when its own skill ends with success: then by the most frequent one.

The policy ends where most demonstrations ended. After a failure (limit of force, time or travel) the phase that the
wrench indicates starts again, `recoveries` times; then the policy fails.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from skillframe.document import read_frame
from skillframe.extend import Document, registry
from skillframe.frames import Float
from skillframe.sequence import END, Composition, Moved, Part
from skillframe.skill import Command, Observation, Skill, Status
from skillframe_segmenter.document import PolicyDocument, read
from skillframe_segmenter.observer import NOBODY, Gate
from skillframe_segmenter.placed import Placed, is_placed, placement_of


def build(document: Document) -> Policy:
    """The runnable policy of a checked document."""
    policy = read(document)
    parts = [Part(f"phase {i + 1}", _placed(document, i, _maker(sub))) for i, sub in enumerate(policy.skills)]
    center = read_frame(document).center_of_compliance
    return Policy(parts, policy, None if policy.model is None else Gate(policy.model, center))


def _maker(document: Document) -> Callable[[], Skill]:
    kind = registry().skill(document["type"])
    return lambda: kind.build(document)


def _placed(document: Document, index: int, make: Callable[[], Skill]) -> Callable[[], Skill]:
    """The phase in the frame of its place, if it has one."""
    if not is_placed(document["phases"][index]):
        return make
    placement = placement_of(document, index)
    return lambda: Moved(lambda: Placed(placement, make), placement.pose)


class Policy(Composition):
    """Phases of N trials.

    Args:
        parts: the phases' skills.
        policy: successions.
        gate: of the wrench; None if phases end by themselves only.
    """

    def __init__(self, parts: Sequence[Part], policy: PolicyDocument, gate: Gate | None) -> None:
        super().__init__(parts)
        self._policy, self._gate = policy, gate

    restart = Skill.restart  # one instance a trial: the gate's windows are those of all trials

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Begin with the first phase."""
        super().start(observation, rngs)
        self._recovered = np.zeros(len(rngs), dtype=np.intp)
        self._entered = observation.time.copy()
        if self._gate is not None:
            self._gate.start(observation)

    def step(self, observation: Observation) -> Command:
        """Run the phases, and apply the gate at the end of a window."""
        command = super().step(observation)
        asked = None if self._gate is None else self._gate.look(observation)
        if asked is None:
            return command
        wanted = (asked.phase != NOBODY) & (asked.phase != self.current) & (command.status == Status.RUNNING)
        # the gate may end a phase after three windows, where the tool rests or the gate has insisted for 20 windows
        wanted &= (observation.time - self._entered >= 0.15) & (asked.still | (asked.windows >= 20))
        for i in np.flatnonzero(wanted).tolist():
            phase = int(asked.phase[i])
            pending = self._due is not None and self._due[i] != END
            if not pending and self._policy.successors[self.current[i], phase] > 0.0:
                sure = float(asked.posterior[i, phase])
                self._go(i, phase, float(observation.time[i]), f"begins, as the wrench indicates ({sure:.0%} sure)")
        return command

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The most frequent successor after a success, or the phase that the wrench indicates after a failure."""
        if status == Status.SUCCESS:
            following = int(self._policy.successors[part].argmax())
            if following == len(self.parts):
                return END, status, reason
            return following, Status.RUNNING, f"begins, as phase {part + 1} ended: {reason}"
        if self._recovered[row] < self._policy.recoveries:
            self._recovered[row] += 1
            following = part if self._gate is None else int(self._gate.posterior[row].argmax())
            return following, Status.RUNNING, f"starts again, because phase {part + 1} failed: {reason}"
        return END, status, reason

    def switch(self, row: int, part: int, time: float, why: str) -> None:
        """Enter a phase for a reason of the phases' own, and inform the gate."""
        self._go(row, part, time, why)
        if self._gate is not None:
            self._gate.believe(row, part)

    def _go(self, row: int, part: int, time: float, why: str) -> None:
        super().switch(row, part, time, why)
        self._entered[row] = time


def successor_words(successors: Float, phase: int) -> str:
    """The successors of a phase in words."""
    names = [f"phase {j + 1}" for j in range(len(successors))] + ["the end"]
    order = [j for j in np.argsort(-successors[phase]).tolist() if successors[phase, j] > 0.0]
    return " or ".join(names[j] for j in order) or "the end"
