"""The worker of `keeper`: one FMU under limits, answering over a channel.

Letters: l load, s start, t step, v save, w restore, p probe, k check, m simulate, i inspect, j judge the description,
h how confined, q leave. An answer begins with "." or, for a problem in words, with "!" or "?" (an input's).
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy.fmi2
import fmpy.fmi3  # noqa: F401  loaded before the memory limit holds
import numpy as np

from skillframe.errors import InputError, SkillframeError
from skillframe.fmu.actuator import DISCARD, ActuatorSpec
from skillframe.fmu.channel import Channel
from skillframe.fmu.driver import FmuBank
from skillframe.fmu.inspection import FmuFacts, describe_here, facts_from, inspect_here, judge_here
from skillframe.fmu.probe import probe, try_out

OUT_OF_MEMORY = 12
LARGEST_REQUEST = 1 << 30


class Worker:
    """State of the child: a bank of one.

    Args:
        channel: to skillframe.
        confined: what of the system's confinement holds.
    """

    def __init__(self, channel: Channel, confined: dict[str, Any]) -> None:
        self.channel, self.confined = channel, confined
        self.bank: FmuBank | None = None
        self.calls: dict[bytes, Callable[[bytes], bytes]] = {
            b"l": self.load, b"s": self.start, b"t": self.step, b"v": self.save, b"w": self.restore,
            b"p": self.probe, b"m": self.simulate, b"k": self.check, b"i": self.inspect, b"j": self.judge,
            b"h": lambda _: json.dumps(self.confined).encode(),
        }  # fmt: skip

    def serve(self) -> None:
        """Answer until told to leave or the parent is gone."""
        while True:
            try:
                request = self.channel.receive(LARGEST_REQUEST)
            except (EOFError, OSError):
                return
            if request[:1] == b"q":
                return
            self.channel.send(self._answer(request))

    def _answer(self, request: bytes) -> bytes:
        try:
            return b"." + self.calls[request[:1]](request[1:])
        except MemoryError:
            os._exit(OUT_OF_MEMORY)
        except InputError as error:
            return b"?" + json.dumps([error.where, error.problem, error.fix]).encode()
        except SkillframeError as error:
            return b"!" + str(error).encode()
        except Exception as error:
            return b"!" + f"{type(error).__name__}: {error}".encode()

    def load(self, payload: bytes) -> bytes:
        """Load the FMU. Columns of the parent's arrays may be more than ours."""
        given = json.loads(payload)
        spec = ActuatorSpec(**{**given["spec"], "name": given["name"]})
        self.bank = FmuBank([spec], [_facts(given)], compiled=False)
        self.into = [(k, self.bank.inputs.index(n)) for k, n in enumerate(given["inputs"]) if n in self.bank.inputs]
        self.out_of = [self.bank.outputs.index(name) for name in given["outputs"]]
        return b""

    @property
    def one(self) -> FmuBank:
        """The bank.

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
        """Status, the outputs that were asked for, and a problem in words."""
        bank = self.one
        status = int(bank.status[0])
        text = bank.problem(0) if status >= DISCARD else ""
        return struct.pack("q", status) + bank.y[0, self.out_of].tobytes() + text.encode()

    def start(self, payload: bytes) -> bytes:
        """Reset and initialise. Returns the memory held, then the same as a step."""
        given = json.loads(payload)
        self._take(given["u"])
        self.one.status[:] = 0
        self.one.start(given["time"], [given["parameters"]])
        return struct.pack("q", _resident()) + self._told()

    def step(self, payload: bytes) -> bytes:
        """Step, or refresh for a step of zero."""
        time, step = struct.unpack_from("dd", payload)
        self._take(np.frombuffer(payload[16:]))
        bank = self.one
        bank._time = time
        bank.status[0] = 0
        _ = bank.step(time, step) if step > 0.0 else bank.refresh()
        return self._told()

    def save(self, payload: bytes) -> bytes:
        """Remember the state."""
        self.one.save()
        return b""

    def restore(self, payload: bytes) -> bytes:
        """Return to it."""
        self.one.restore()
        return b""

    def probe(self, payload: bytes) -> bytes:
        """Try out capabilities."""
        given = json.loads(payload)
        return json.dumps(list(probe(_facts(given), ActuatorSpec(**given["spec"])))).encode()

    def check(self, payload: bytes) -> bytes:
        """A short trial with inputs at their start values. Returns whether its state repeats."""
        return json.dumps(try_out(_facts(json.loads(payload)))).encode()

    def simulate(self, payload: bytes) -> bytes:
        """Simulate on its own, sending rows as they come. The last answer is empty."""
        from skillframe.fmu.simulate import Request, run

        given = json.loads(payload)
        facts = _facts(given)
        for row in run(facts, Request(**{**given["request"], "path": facts.path})):
            self.channel.send(b"." + json.dumps(row).encode())
        return b"[]"

    def inspect(self, payload: bytes) -> bytes:
        """What the file says."""
        return json.dumps(describe_here(inspect_here(Path(json.loads(payload)["path"])))).encode()

    def judge(self, payload: bytes) -> bytes:
        """What is wrong with its description."""
        return json.dumps(judge_here(Path(json.loads(payload)["path"]))).encode()


def _facts(given: dict[str, Any]) -> FmuFacts:
    return facts_from(given["facts"], Path(given["path"]))


def _resident() -> int:
    """Memory held now [bytes], 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0
