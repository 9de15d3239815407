"""`SandboxBank`: foreign FMUs, each instance in a child process with time and memory limits."""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.fmu.actuator import DISCARD, LOST, OK, STATUS_TEXT, ActuatorSpec, Capabilities, columns
from skillframe.fmu.bindings import InstanceFailed
from skillframe.fmu.child import Child, SandboxLimits, plain
from skillframe.fmu.extract import unpack
from skillframe.fmu.facts import FmuFacts
from skillframe.fmu.inspection import describe_here
from skillframe.fmu.stepper import mapping

LOADING = 2 * (os.cpu_count() or 1)
"""Children that load at once; more would count as hung."""

LONGEST_SENTENCE = 1 << 16  # bytes of text in an answer


class SandboxBank:
    """A bank of foreign FMUs (see `Actuators`), one child process per instance.

    Raises:
        InputError, UnknownName: not runnable here, or a mapping does not fit.
        InstanceFailed, ChildLost: on `start`, an FMU does not load or initialise.
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
            f"{files}: in child processes (skillframe fmu FILE --allow lets a file run inside)",
        )
        self.limits = limits or SandboxLimits()
        self._specs, self._facts = list(specs), list(facts)
        self._time = 0.0
        self._own: list[NDArray[np.int64]] = []  # columns of `y` by actuator
        for spec, fact in zip(specs, facts, strict=True):
            fact.require_runnable()
            self._own.append(np.array([self.outputs.index(name) for name in mapping(spec, fact)[1]]))
            unpack(fact.path)
        self._answers = [struct.Struct(f"q{len(own)}d") for own in self._own]
        self._children: list[Child | None] = [None] * self.count
        self._held = [0] * self.count  # bytes, at the last start
        self._problems: dict[int, str] = {}
        self._capabilities: dict[int, Capabilities] = {}

    def _kind(self, index: int) -> tuple[ActuatorSpec, FmuFacts]:
        return self._specs[index % len(self._specs)], self._facts[index % len(self._facts)]

    def _name(self, index: int) -> str:
        spec, facts = self._kind(index)
        return spec.name or facts.name  # no trial number: the same message in any bank

    def _ready(self, index: int) -> Child:
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
        """Reset, reload lost instances, and initialise at `u`. See `Actuators`."""
        self.active[:] = 1
        self.status[:] = OK
        self._problems.clear()
        self._time = time
        for first in range(0, self.count, LOADING):
            wave = range(first, min(first + LOADING, self.count))
            fresh = []
            for i in wave:
                before, now = self._children[i], self._ready(i)
                own = {**self._kind(i)[0].parameters, **(parameters[i] if parameters else {})}
                now.tell(b"s", {"time": time, "parameters": own, "u": self.u[i].tolist()})
                fresh.append(now is not before)
            for i, new in zip(wave, fresh, strict=True):
                child = self._children[i]
                assert child is not None
                try:
                    if new:
                        child.receive(self.limits.start_s, "loading")
                    answer = child.receive(self.limits.start_s, "starting", self._most(i))
                    if len(answer) < 8:
                        raise child.liar(f"{len(answer)} bytes", "starting")
                    self._held[i] = max(0, *struct.unpack_from("q", answer))
                    self._take(i, child, answer[8:], "starting")
                except SkillframeError as error:
                    self._lose(i, error)
        if self._problems and not self.active.any():
            raise InstanceFailed(next(iter(self._problems.values())))

    def step(self, time: float, step: float) -> bool:
        """See `Actuators.step`."""
        self._time = time
        head = struct.pack("dd", time, step)
        running = [(i, child) for i, child in enumerate(self._children) if self.active[i] and child is not None]
        for i, child in running:
            child.send(b"t", head + self.u[i].tobytes())
        fine, what = True, f"stepping from {time:.6g} s"
        for i, child in running:
            try:
                answer = child.receive(self.limits.step_s, what, self._most(i))
                fine &= self._take(i, child, answer, what)
            except SkillframeError as error:
                self._lose(i, error)
                fine = False
        return fine

    def _most(self, index: int) -> int:
        return self._answers[index % len(self._answers)].size + LONGEST_SENTENCE

    def _take(self, index: int, child: Child, answer: bytes, what: str) -> bool:
        """Read status and outputs from an untrusted answer. Returns True on success.

        Raises:
            ChildLost: the answer is invalid.
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
        child = self._children[index]
        if child is not None:
            child.kill()
        self._children[index] = None
        self.active[index], self.status[index], self._problems[index] = 0, LOST, str(error)

    def refresh(self) -> bool:
        """See `Actuators.refresh`."""
        return self.step(self._time, 0.0)

    def _all(self, letter: bytes, what: str) -> None:
        for i, child in enumerate(self._children):
            if self.active[i] and child is not None:
                try:
                    child.ask(letter, None, self.limits.step_s, what)
                except SkillframeError as error:
                    self._lose(i, error)

    def save(self) -> None:
        """See `Actuators.save`."""
        self._all(b"v", "saving its state")

    def restore(self) -> None:
        """See `Actuators.restore`."""
        self._all(b"w", "restoring its state")

    def capabilities(self, index: int) -> Capabilities:
        """Capabilities tested in a separate child."""
        kind = index % len(self._specs)
        if kind not in self._capabilities:
            spec, facts = self._kind(index)
            self._capabilities[kind] = probe_in_child(spec, facts, self.limits)
        return self._capabilities[kind]

    def problem(self, index: int) -> str:
        """See `Actuators.problem`."""
        return self._problems.get(index, "")

    def close(self) -> None:
        """End all children."""
        left = [child for child in self._children if child is not None]
        for child in left:
            child.release()
        for child in left:
            child.kill()
        self._children = [None] * self.count


def loading(facts: FmuFacts) -> dict[str, Any]:
    """Data with which a child loads an FMU without reading its description."""
    return {"facts": describe_here(facts), "path": str(facts.path)}


def probe_in_child(spec: ActuatorSpec, facts: FmuFacts, limits: SandboxLimits) -> Capabilities:
    """`probe` in a child process.

    Raises:
        ChildLost, InstanceFailed: the FMU fails.
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
