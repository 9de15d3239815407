"""Skills made of skills: one after another, or one where another failed.

Every trial is in one part at a time; trials of a batch may be in different parts, and enter them at different times. A
part that ends is followed by the next one at the next tick, from where the tool is then. Whatever the parts say about
damping, the controller designs it (from the stiffness and the task-space inertia), so that a trial's damping cannot
depend on which parts other trials are in. "When insertion fails, search, then retry" is

    fallback(insert, sequence(search, insert)),

with `expects_travel_m` on insert: LMC and its like end where they come to rest, and coming to rest too early is the
signal of failure.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Sequence as Several
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float, Pose, norm
from skillframe.handover import ShapeCheck
from skillframe.skill import Command, Impedance, Observation, Reasons, Skill, Status, no_reasons, restartable

Rows = NDArray[np.intp]
END = -1
"""What `Composition.follows` gives where no part follows."""


class Part(NamedTuple):
    """One skill of a composition.

    Attributes:
        name: as told in words.
        make: a fresh skill.
        expects_travel_m: a success nearer than this to where the part began counts as a failure; 0 takes any.
    """

    name: str
    make: Callable[[], Skill]
    expects_travel_m: float = 0.0


class Composition(Skill):
    """N trials, each in one of several parts. What follows what is the subclass's business.

    Args:
        parts: at least one.
    """

    def __init__(self, parts: Several[Part]) -> None:
        if not parts:
            raise InputError("composition", "has no parts", "name at least one skill")
        self.parts = list(parts)

    @abstractmethod
    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """What follows in a trial when a part has ended.

        Returns:
            The part that follows, or `END`; the status of the whole; and why, in words.
        """

    def start(self, observation: Observation, rngs: Several[np.random.Generator]) -> None:
        """Every trial begins in part 0."""
        n, k = len(rngs), len(self.parts)
        self._rngs = [rng.spawn(k) for rng in rngs]
        self._children: list[Skill | None] = [None] * k
        self._checks: dict[int, ShapeCheck] = {}
        self.current: Rows = np.full(n, END)
        self._due: Rows | None = np.zeros(n, dtype=np.intp)
        self._status, self._reason = np.zeros(n, dtype=np.int64), no_reasons(n)
        self._from = observation.pose.position.copy()
        self._journal: list[list[tuple[float, str]]] = [[] for _ in rngs]
        self._shared: int | None = None
        for i in range(n):
            self._note(i, float(observation.time[i]), f"{self.parts[0].name}: begins")

    def step(self, observation: Observation) -> Command:
        """Let every trial's part answer, and look which have ended."""
        if self._due is not None:
            self._enter(observation, self._due)
            self._due = None
        command = self._ask(observation)
        if np.count_nonzero(command.status):
            command = self._after(observation, command)
        return command

    def journal(self, trial: int) -> list[tuple[float, str]]:
        """Which part ran when, and why it was left, in words."""
        return list(self._journal[trial])

    def switch(self, row: int, part: int, time: float, why: str) -> None:
        """Let a trial enter a part at the next tick."""
        if self._due is None:
            self._due = np.full(len(self.current), END)
        self._due[row] = part
        self._note(row, time, f"{self.parts[part].name}: {why}")

    def leave(self, row: int, time: float, status: int, reason: str) -> None:
        """Let a trial leave its part with a status, for what follows it, or for the end of the whole."""
        part = int(self.current[row])
        following, whole, why = self.follows(row, part, status, reason)
        if following != END:
            self.switch(row, following, time, why)
            return
        self._status[row], self._reason[row] = whole, f"{self.parts[part].name}: {why}"
        self._note(row, time, f"ended: {why}")

    def _note(self, row: int, time: float, text: str) -> None:
        self._journal[row].append((time, text))

    def _enter(self, observation: Observation, due: Rows) -> None:
        for part in np.unique(due[due != END]).tolist():
            rows = np.flatnonzero(due == part)
            self.current[rows] = part
            self._from[rows] = observation.pose.position[rows]
            child = self._children[part]
            if child is None:
                child = self._children[part] = restartable(self.parts[part].make)
                self._checks[part] = ShapeCheck(child, observation.time.shape)
                child.start(observation, [rngs[part] for rngs in self._rngs])
            else:
                child.restart(rows, observation, [self._rngs[i][part] for i in rows.tolist()])
        first = int(self.current[0])
        self._shared = first if bool((self.current == first).all()) else None
        self._current_parts: list[int] = np.unique(self.current).tolist()

    def _ask(self, observation: Observation) -> Command:
        """The command of each trial's own part."""
        if self._shared is not None:
            command = self._answer(self._shared, observation)
            return command._replace(impedance=Impedance(command.impedance.stiffness))
        answers = [(part, self._answer(part, observation)) for part in self._current_parts]
        return _picked(self.current, answers)

    def _answer(self, part: int, observation: Observation) -> Command:
        child = self._children[part]
        assert child is not None
        return self._checks[part](child.step(observation))

    def _after(self, observation: Observation, command: Command) -> Command:
        for i in np.flatnonzero((command.status != Status.RUNNING) & (self._status == Status.RUNNING)).tolist():
            status, reason = self._judged(i, int(command.status[i]), str(command.reason[i]), observation)
            self.leave(i, float(observation.time[i]), status, reason)
        return command._replace(status=self._status.copy(), reason=_told(self._status, self._reason))

    def _judged(self, row: int, status: int, reason: str, observation: Observation) -> tuple[int, str]:
        """A part's end, with the travel that was expected of it."""
        expected = self.parts[int(self.current[row])].expects_travel_m
        travel = float(norm(observation.pose.position[row] - self._from[row]))
        if status == Status.SUCCESS and travel < expected:
            return Status.FAILURE, f"{reason}; expected {1e3 * expected:.0f} mm, went {1e3 * travel:.1f} mm"
        return status, reason


class Sequence(Composition):
    """One part after another. The first failure is the whole's."""

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The next part after a success."""
        if status == Status.SUCCESS and part + 1 < len(self.parts):
            return part + 1, Status.RUNNING, f"begins, as {self.parts[part].name} ended: {reason}"
        return END, status, reason


class Fallback(Composition):
    """The first part that succeeds is enough. A part is tried when those before it have failed."""

    def follows(self, row: int, part: int, status: int, reason: str) -> tuple[int, int, str]:
        """The next part after a failure."""
        if status == Status.FAILURE and part + 1 < len(self.parts):
            return part + 1, Status.RUNNING, f"begins, as {self.parts[part].name} failed: {reason}"
        return END, status, reason


def _told(status: NDArray[np.int64], reason: Reasons) -> Reasons:
    told = reason.copy()
    told[status == Status.RUNNING] = ""
    return told


def _picked(current: Rows, answers: Several[tuple[int, Command]]) -> Command:
    """One command out of whole-batch commands, each trial's row from the part it is in."""
    _, base = answers[0]
    n = len(current)
    pose = Pose(np.array(base.pose.position), np.array(base.pose.rotation))
    stiffness: Float = np.broadcast_to(base.impedance.stiffness, (n, 6, 6)).copy()
    twist, feedforward = np.array(base.twist), np.array(base.feedforward)
    status, reason = np.array(base.status), np.array(base.reason)
    for part, other in answers[1:]:
        rows = current == part
        pose.position[rows], pose.rotation[rows] = other.pose.position[rows], other.pose.rotation[rows]
        stiffness[rows] = np.broadcast_to(other.impedance.stiffness, (n, 6, 6))[rows]
        twist[rows], feedforward[rows] = other.twist[rows], other.feedforward[rows]
        status[rows], reason[rows] = other.status[rows], other.reason[rows]
    return Command(pose, twist, Impedance(stiffness), feedforward, status, reason)
