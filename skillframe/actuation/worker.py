"""The child process of `sandbox`: one FMU under limits, answering over a socket. Started as a module, never imported.

Letters: l load, s start, t step, v save, w restore, p probe, k check, m simulate, q leave. An answer begins with "."
or, for a problem in words, "!".
"""

from __future__ import annotations

import ctypes
import json
import os
import struct
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.actuation.actuator import DISCARD, ActuatorSpec
from skillframe.actuation.driver import FmuBank
from skillframe.actuation.inspection import inspect_fmu
from skillframe.actuation.probe import probe, try_out
from skillframe.errors import SkillframeError

OUT_OF_MEMORY = 12


class Worker:
    """State of the child: a bank of one."""

    def __init__(self, pipe: Connection) -> None:
        self.pipe, self.bank = pipe, None  # type: Connection, FmuBank | None
        self.columns: list[int] = []
        self.calls: dict[bytes, Callable[[bytes], bytes]] = {
            b"l": self.load, b"s": self.start, b"t": self.step, b"v": self.save, b"w": self.restore,
            b"p": self.probe, b"m": self.simulate, b"k": self.check,
        }  # fmt: skip

    def serve(self) -> None:
        """Answer until told to leave or the parent is gone."""
        while True:
            try:
                request = self.pipe.recv_bytes()
            except (EOFError, OSError):
                return
            if request[:1] == b"q":
                return
            try:
                answer = b"." + self.calls[request[:1]](request[1:])
            except MemoryError:
                os._exit(OUT_OF_MEMORY)
            except SkillframeError as error:
                answer = b"!" + str(error).encode()
            except Exception as error:
                answer = b"!" + f"{type(error).__name__}: {error}".encode()
            self.pipe.send_bytes(answer)

    def load(self, payload: bytes) -> bytes:
        """Load the FMU; columns of the parent's arrays may be more than ours."""
        given = json.loads(payload)
        spec = ActuatorSpec(**{**given["spec"], "name": given["name"]})
        self.bank = FmuBank([spec], [inspect_fmu(Path(given["path"]))], compiled=False)
        self.given_in, self.given_out = given["inputs"], given["outputs"]
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
        for name, value in zip(self.given_in, values, strict=True):
            if name in self.one.inputs:
                self.one.u[0, self.one.inputs.index(name)] = value

    def _row(self) -> bytes:
        row = np.full(len(self.given_out), np.nan)
        for k, name in enumerate(self.given_out):
            if name in self.one.outputs:
                row[k] = self.one.y[0, self.one.outputs.index(name)]
        return row.tobytes()

    def start(self, payload: bytes) -> bytes:
        """Reset and initialise."""
        given = json.loads(payload)
        self._take(given["u"])
        self.one.start(given["time"], [given["parameters"]])
        return self._row()

    def step(self, payload: bytes) -> bytes:
        """Step, or refresh for a step of zero."""
        time, step = struct.unpack_from("dd", payload)
        self._take(np.frombuffer(payload[16:]))
        bank = self.one
        bank._time = time
        fine = bank.step(time, step) if step > 0.0 else bank.refresh()
        status = 0 if fine else int(bank.status[0])
        text = bank.problem(0) if status >= DISCARD else ""
        return struct.pack("q", status) + self._row() + text.encode()

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
        return json.dumps(list(probe(inspect_fmu(Path(given["path"])), ActuatorSpec(**given["spec"])))).encode()

    def check(self, payload: bytes) -> bytes:
        """A short trial with inputs at their start values; whether its state repeats."""
        return json.dumps(try_out(inspect_fmu(Path(json.loads(payload)["path"])))).encode()

    def simulate(self, payload: bytes) -> bytes:
        """Simulate on its own, sending rows as they come; the last answer is empty."""
        from skillframe.actuation.simulate import Request, run

        given = json.loads(payload)
        request = Request(**{**given, "path": Path(given["path"])})
        for row in run(request):
            self.pipe.send_bytes(b"." + json.dumps(row).encode())
        return b"[]"


def limit(memory_bytes: int) -> None:
    """Limits of this process, and its end when the parent ends (Linux)."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        ctypes.CDLL(None).prctl(1, 9)  # PR_SET_PDEATHSIG, SIGKILL
    except (ImportError, OSError, ValueError, AttributeError):
        pass


if __name__ == "__main__":
    import fmpy.fmi2
    import fmpy.fmi3  # noqa: F401  loaded before the memory limit holds

    connection = Connection(int(sys.argv[1]))
    limit(int(sys.argv[2]))
    Worker(connection).serve()
    os._exit(0)  # an FMU's own clean-up at exit has hung before
