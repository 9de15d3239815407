"""Worker process of `keeper`: one FMU under limits, which answers over a channel.

Letters: l load, s start, t step, v save, w restore, p probe, k check, m simulate, i inspect, j judge the description, h
confinement, q leave. An answer begins with ".", "!" for a problem, or "?" for an input's.
"""

from __future__ import annotations

import json
import math
import os
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy.fmi2
import fmpy.fmi3  # noqa: F401  loaded before the memory limit holds
import numpy as np

from skillframe.errors import InputError, SkillframeError
from skillframe.fmu.actuator import DISCARD, ActuatorSpec
from skillframe.fmu.child import Channel
from skillframe.fmu.driver import FmuBank, probe, try_out
from skillframe.fmu.facts import FmuFacts
from skillframe.fmu.inspection import describe_here, facts_from, inspect_here, judge_here


class Worker:
    """A bank of one instance, on a channel and under the `confined` measures."""

    def __init__(self, channel: Channel, confined: dict[str, Any]) -> None:
        self.channel, self.confined = channel, confined
        self.bank: FmuBank | None = None
        self.calls: dict[bytes, Callable[[bytes], bytes]] = {
            b"l": self.load, b"s": self.start, b"t": self.step, b"v": self.save, b"w": self.restore,
            b"p": self.probe, b"m": self.simulate, b"k": self.check, b"i": self.inspect, b"j": self.judge,
            b"h": lambda _: json.dumps(self.confined).encode(),
        }  # fmt: skip

    def serve(self) -> None:
        """Answer requests until "q" or a lost parent."""
        while True:
            try:
                request = self.channel.receive(1 << 30)
            except (EOFError, OSError):
                return
            if request[:1] == b"q":
                return
            self.channel.send(self._answer(request))

    def _answer(self, request: bytes) -> bytes:
        try:
            return b"." + self.calls[request[:1]](request[1:])
        except MemoryError:
            os._exit(12)  # out of memory
        except InputError as error:
            return b"?" + json.dumps([error.where, error.problem, error.fix]).encode()
        except SkillframeError as error:
            return b"!" + str(error).encode()
        except Exception as error:
            return b"!" + f"{type(error).__name__}: {error}".encode()

    def load(self, payload: bytes) -> bytes:
        """Load the FMU and match the parent's columns."""
        given = json.loads(payload)
        spec = ActuatorSpec(**{**given["spec"], "name": given["name"]})
        self.bank = FmuBank([spec], [_facts(given)], compiled=False)
        self.into = [(k, self.bank.inputs.index(n)) for k, n in enumerate(given["inputs"]) if n in self.bank.inputs]
        self.out_of = [self.bank.outputs.index(name) for name in given["outputs"]]
        return b""

    @property
    def one(self) -> FmuBank:
        """The loaded bank.

        Raises:
            SkillframeError: nothing is loaded.
        """
        if self.bank is None:
            raise SkillframeError("nothing is loaded")
        return self.bank

    def _take(self, values: Any) -> None:
        for given, own in self.into:
            self.one.u[0, own] = values[given]

    def _told(self) -> bytes:
        bank = self.one
        status = int(bank.status[0])
        text = bank.problem(0) if status >= DISCARD else ""
        return struct.pack("q", status) + bank.y[0, self.out_of].tobytes() + text.encode()

    def start(self, payload: bytes) -> bytes:
        """Reset and initialise. Returns the memory in use, then the answer of a step."""
        given = json.loads(payload)
        self._take(given["u"])
        self.one.status[:] = 0
        self.one.start(given["time"], [given["parameters"]])
        try:
            resident = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])  # pages
        except (OSError, ValueError, IndexError):
            resident = 0
        return struct.pack("q", resident * os.sysconf("SC_PAGE_SIZE")) + self._told()

    def step(self, payload: bytes) -> bytes:
        """Step, or refresh for a zero step."""
        time, step = struct.unpack_from("dd", payload)
        self._take(np.frombuffer(payload[16:]))
        bank = self.one
        bank._time = time
        bank.status[0] = 0
        _ = bank.step(time, step) if step > 0.0 else bank.refresh()
        return self._told()

    def save(self, payload: bytes) -> bytes:
        """Save the state."""
        self.one.save()
        return b""

    def restore(self, payload: bytes) -> bytes:
        """Restore the state."""
        self.one.restore()
        return b""

    def probe(self, payload: bytes) -> bytes:
        """Test the capabilities."""
        given = json.loads(payload)
        return json.dumps(list(probe(_facts(given), ActuatorSpec(**given["spec"])))).encode()

    def check(self, payload: bytes) -> bytes:
        """Do a short run. Returns whether its state repeats."""
        return json.dumps(try_out(_facts(json.loads(payload)))).encode()

    def simulate(self, payload: bytes) -> bytes:
        """Simulate, sending rows and then an empty answer."""
        from skillframe.fmu.simulate import Request, run

        given = json.loads(payload)
        facts = _facts(given)
        for row in run(facts, Request(**{**given["request"], "path": facts.path})):
            self.channel.send(b"." + json.dumps(row).encode())
        return b"[]"

    def inspect(self, payload: bytes) -> bytes:
        """Facts of the file."""
        return json.dumps(describe_here(inspect_here(_at(payload)))).encode()

    def judge(self, payload: bytes) -> bytes:
        """Problems of its description."""
        return json.dumps(judge_here(_at(payload))).encode()


def _at(payload: bytes) -> Path:
    given = json.loads(payload)
    import resource

    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time()) + int(given["processor_s"]), most))
    return Path(given["path"])


def _facts(given: dict[str, Any]) -> FmuFacts:
    return facts_from(given["facts"], Path(given["path"]))
