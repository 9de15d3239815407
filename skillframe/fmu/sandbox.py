"""`SandboxBank`: FMUs of other makers, each instance in its own child process with time and memory limits.

A crash, a hang or a leak then ends one trial with a sentence. All children of a bank step at the same time.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.fmu.actuator import DISCARD, LOST, OK, STATUS_TEXT, ActuatorSpec, Capabilities
from skillframe.fmu.bindings import InstanceFailed
from skillframe.fmu.child import Child, SandboxLimits, plain
from skillframe.fmu.extract import unpack
from skillframe.fmu.inspection import FmuFacts, describe_here
from skillframe.fmu.wiring import columns, mapping

LOADING = 2 * (os.cpu_count() or 1)
"""Children that load at the same time: more of them would wait for each other and be taken for hung."""

LONGEST_SENTENCE = 1 << 16  # bytes of words in an answer to a start or a step


class SandboxBank:
    """A bank of foreign FMUs (see `Actuators`), one child process per instance.

    Raises:
        InputError, UnknownName: not runnable here, or a mapping that does not fit.
        InstanceFailed, ChildLost: on `start`, an FMU that does not load or initialise.
    """

    def __init__(
        self, specs: Sequence[ActuatorSpec], facts: Sequence[FmuFacts], trials: int = 1,
        limits: SandboxLimits | None = None,
    ) -> None:  # fmt: skip
        self.inputs, self.outputs = columns(specs)
        self.count = trials * len(specs)
        self.u = np.zeros((self.count, len(self.inputs)))
        self.y = np.full((self.count, len(self.outputs)), np.nan)
        self.active, self.status = np.ones(self.count, np.uint8), np.zeros(self.count, np.int64)
        files = ", ".join(dict.fromkeys(fact.path.name for fact in facts))
        self.notes: tuple[str, ...] = (
            f"{files}: in child processes (skillframe fmu check FILE --allow lets a file run inside)",
        )
        self.limits = limits or SandboxLimits()
        self._specs, self._facts = list(specs), list(facts)
        self._time = 0.0
        self._own: list[NDArray[np.int64]] = []  # columns of `y` that each actuator has, in its answers' order
        for spec, fact in zip(specs, facts, strict=True):
            fact.require_runnable()
            self._own.append(np.array([self.outputs.index(name) for name in mapping(spec, fact)[1]]))
            unpack(fact.path)  # a child can write nothing
        self._answers = [struct.Struct(f"q{len(own)}d") for own in self._own]
        self._children: list[Child | None] = [None] * self.count
        self._held = [0] * self.count  # bytes, as each said at its last start
        self._problems: dict[int, str] = {}
        self._capabilities: dict[int, Capabilities] = {}

    def _kind(self, index: int) -> tuple[ActuatorSpec, FmuFacts]:
        return self._specs[index % len(self._specs)], self._facts[index % len(self._facts)]

    def _name(self, index: int) -> str:
        spec, facts = self._kind(index)
        return spec.name or facts.name  # not which trial of the bank: a trial fails in the same words in any bank

    def _ready(self, index: int) -> Child:
        """The child of an instance. A new one if there is none or the old one uses too much memory."""
        child = self._children[index]
        if child is not None and self._held[index] <= self.limits.memory_bytes // 2:
            return child
        if child is not None:
            child.close()
        spec, facts = self._kind(index)
        new = Child(facts.path, self._name(index), self.limits)
        self._held[index] = 0
        given = {**loading(facts), "spec": asdict(spec), "name": self._name(index), "inputs": self.inputs}
        new.tell(b"l", {**given, "outputs": [self.outputs[k] for k in self._own[index % len(self._own)]]})
        self._children[index] = new
        return new

    def start(self, time: float = 0.0, parameters: Sequence[Mapping[str, Any]] | None = None) -> None:
        """Reset every instance, load those that were lost, and initialise at `u`. See `Actuators`."""
        self.active[:] = 1
        self.status[:] = OK
        self._problems.clear()
        self._time = time
        for first in range(0, self.count, LOADING):
            wave = range(first, min(first + LOADING, self.count))
            fresh = [self._tell_start(i, time, parameters[i] if parameters else {}) for i in wave]
            for i, new in zip(wave, fresh, strict=True):
                self._hear_start(i, new)
        if self._problems and not self.active.any():
            raise InstanceFailed(next(iter(self._problems.values())))

    def _tell_start(self, index: int, time: float, extra: Mapping[str, Any]) -> bool:
        """Ask an instance to start. Returns whether its child is new and has to load the FMU first."""
        before, now = self._children[index], self._ready(index)
        own = {**self._kind(index)[0].parameters, **extra}
        now.tell(b"s", {"time": time, "parameters": own, "u": self.u[index].tolist()})
        return now is not before

    def _hear_start(self, index: int, new: bool) -> None:
        child = self._children[index]
        assert child is not None
        try:
            if new:
                child.receive(self.limits.start_s, "loading")
            answer = child.receive(self.limits.start_s, "starting", self._most(index))
            if len(answer) < 8:
                raise child.liar(f"{len(answer)} bytes", "starting")
            self._held[index] = max(0, *struct.unpack_from("q", answer))
            self._take(index, child, answer[8:], "starting")
        except SkillframeError as error:
            self._lose(index, error)

    def step(self, time: float, step: float) -> bool:
        """Advance from `time` by `step` [s] with inputs `u`. Returns True if every active instance went well."""
        self._time = time
        head = struct.pack("dd", time, step)
        running = [(i, child) for i, child in enumerate(self._children) if self.active[i] and child is not None]
        for i, child in running:
            child.send(b"t", head + self.u[i].tobytes())
        fine = True
        for i, child in running:
            fine &= self._collect(i, child)
        return fine

    def _most(self, index: int) -> int:
        """Bytes of an answer: numbers and a sentence."""
        return self._answers[index % len(self._answers)].size + LONGEST_SENTENCE

    def _collect(self, index: int, child: Child) -> bool:
        what = f"stepping from {self._time:.6g} s"
        try:
            answer = child.receive(self.limits.step_s, what, self._most(index))
            return self._take(index, child, answer, what)
        except SkillframeError as error:
            self._lose(index, error)
            return False

    def _take(self, index: int, child: Child, answer: bytes, what: str) -> bool:
        """Status and outputs out of an answer, which is checked as if the FMU had written it. True if all went well.

        Raises:
            ChildLost: it is no answer to this question.
        """
        kind = index % len(self._own)
        form = self._answers[kind]
        if len(answer) < form.size:
            raise child.liar(f"{len(answer)} bytes where {form.size} are due", what)
        status, *values = form.unpack_from(answer)
        if not OK <= status < LOST:
            raise child.liar(f"status {status}", what)
        self.y[index, self._own[kind]] = values
        self.status[index] = status
        if status < DISCARD:
            total = sum(values)
            if total - total != 0.0 and not np.isfinite(values).all():
                raise child.liar("outputs that are no finite numbers", what)
            return True
        self._problems[index] = plain(answer[form.size :]) or STATUS_TEXT[status]
        self.active[index] = status == DISCARD
        return False

    def _lose(self, index: int, error: SkillframeError) -> None:
        """End an instance's child and keep why."""
        child = self._children[index]
        if child is not None:
            child.kill()
        self._children[index] = None
        self.active[index], self.status[index], self._problems[index] = 0, LOST, str(error)

    def refresh(self) -> bool:
        """Outputs at the present inputs. No time passes."""
        return self.step(self._time, 0.0)

    def _all(self, letter: bytes, what: str) -> None:
        for i, child in enumerate(self._children):
            if self.active[i] and child is not None:
                try:
                    child.ask(letter, None, self.limits.step_s, what)
                except SkillframeError as error:
                    self._lose(i, error)

    def save(self) -> None:
        """Remember the state of every active instance."""
        self._all(b"v", "saving its state")

    def restore(self) -> None:
        """Return to the last `save`."""
        self._all(b"w", "restoring its state")

    def capabilities(self, index: int) -> Capabilities:
        """What one instance can do, tried out in a child of its own."""
        kind = index % len(self._specs)
        if kind not in self._capabilities:
            spec, facts = self._kind(index)
            self._capabilities[kind] = probe_in_child(spec, facts, self.limits)
        return self._capabilities[kind]

    def problem(self, index: int) -> str:
        """Why an instance failed, one sentence, or empty if it did not."""
        return self._problems.get(index, "")

    def close(self) -> None:
        """End every child."""
        left = [child for child in self._children if child is not None]
        for child in left:
            child.release()
        for child in left:
            child.kill()
        self._children = [None] * self.count


def loading(facts: FmuFacts) -> dict[str, Any]:
    """What a child is told to load an FMU. It reads no description itself."""
    return {"facts": describe_here(facts), "path": str(facts.path)}


def probe_in_child(spec: ActuatorSpec, facts: FmuFacts, limits: SandboxLimits) -> Capabilities:
    """`probe` in a child process.

    Raises:
        ChildLost, InstanceFailed: the FMU does not survive it.
    """
    what = "its capabilities were tried out"
    child = Child(facts.path, spec.name or facts.name, limits)
    try:
        found = child.ask(b"p", {**loading(facts), "spec": asdict(spec)}, limits.start_s, what, LONGEST_SENTENCE)
        if not isinstance(found, list) or [type(x) for x in found] != [bool] * len(Capabilities._fields):
            raise child.liar("what are no capabilities", what)
        return Capabilities(*found)
    finally:
        child.close()
