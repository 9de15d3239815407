"""A child process that holds one foreign FMU, and what is said when it crashes, hangs or runs out of memory.

Messages are bytes over a socket pair: one letter, then doubles or JSON; nothing is unpickled.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from time import monotonic
from typing import Any

from skillframe.actuation.bindings import InstanceFailed
from skillframe.errors import SkillframeError

TELLING = 0.25
"""Share of the memory allowed from which on a crash is told with it; below, the same crash has the same words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SandboxLimits:
    """Limits of a child: address space [bytes], wall time to load and start [s], wall time of a step [s]."""

    memory_bytes: int = 2 * 1024**3
    start_s: float = 30.0
    step_s: float = 5.0


class ChildLost(SkillframeError):
    """A child process crashed, hung, or left; the sentence says which, and how much memory it used."""


class Child:
    """One child process and its end of the socket."""

    def __init__(self, path: Path, name: str, limits: SandboxLimits) -> None:
        self.path, self.name, self.limits = path, name, limits
        ours, theirs = socket.socketpair()
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "skillframe.actuation.worker", str(theirs.fileno()), str(limits.memory_bytes)],
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, start_new_session=True,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            )  # fmt: skip
        finally:
            theirs.close()
        # Up to its exec a child shares our memory, and Linux counts that peak as the child's own.
        self._inherited_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        self._pipe = Connection(ours.detach())
        self._asked = monotonic()

    def send(self, letter: bytes, payload: bytes = b"") -> None:
        """Send a request; a child that has gone is found out by `receive`."""
        self._asked = monotonic()
        with suppress(OSError):
            self._pipe.send_bytes(letter + payload)

    def receive(self, limit_s: float, what: str) -> bytes:
        """The child's answer, within a time from when it was last asked or answered.

        Raises:
            ChildLost: it crashed or did not answer in time.
            InstanceFailed: it answered with a problem.
        """
        try:
            if not self._pipe.poll(max(0.0, self._asked + limit_s - monotonic())):
                self.kill()
                raise ChildLost(f"{self._who()} did not answer within {limit_s:g} s while {what}; it was stopped")
            answer = self._pipe.recv_bytes()
            self._asked = monotonic()
        except (EOFError, OSError):
            raise ChildLost(f"{self._who()} {self._death()} while {what}") from None
        if answer[:1] == b"!":
            raise InstanceFailed(answer[1:].decode("utf-8", "replace"))
        return answer[1:]

    def tell(self, letter: bytes, value: Any) -> None:
        """A request with a JSON payload."""
        self.send(letter, json.dumps(value).encode())

    def ask(self, letter: bytes, value: Any, limit_s: float, what: str) -> Any:
        """A request and its answer, both JSON; raises as `receive`."""
        self.tell(letter, value)
        return self.heard(limit_s, what)

    def heard(self, limit_s: float, what: str) -> Any:
        """An answer in JSON; raises as `receive`."""
        answer = self.receive(limit_s, what)
        return json.loads(answer) if answer else None

    def resident_bytes(self) -> int:
        """Memory the child holds now, 0 where the system does not tell."""
        try:
            pages = int(Path(f"/proc/{self._process.pid}/statm").read_text(encoding="ascii").split()[1])
        except (OSError, ValueError, IndexError):
            return 0
        return pages * os.sysconf("SC_PAGE_SIZE")

    def _who(self) -> str:
        return f"{self.name} ({self.path.name})"

    def _death(self) -> str:
        """In words how the child ended, with the most memory it held if that may be why."""
        self._end_group()
        try:
            _, status, usage = os.wait4(self._process.pid, 0)
        except ChildProcessError:
            return "left"
        code = os.waitstatus_to_exitcode(status)
        self._process.returncode = code
        memory = f"having used {usage.ru_maxrss // 1024} MB of {self.limits.memory_bytes // 1024**2} MB"
        if code < 0:
            large = usage.ru_maxrss > max(TELLING * self.limits.memory_bytes / 1024, self._inherited_kb)
            name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
            return f"crashed ({name}{', ' + memory if large else ''})"
        return f"ran out of memory ({memory})" if code == 12 else f"left with code {code}"

    def _end_group(self) -> None:
        """End the child and whatever its FMU has started; before it is waited for, so that its number is still its."""
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def kill(self) -> None:
        """End the child at once, and what its FMU has started."""
        if self._process.returncode is None:
            self._end_group()
            self._process.wait()
        self._pipe.close()

    def close(self) -> None:
        """Ask the child to leave; end it if it does not."""
        if self._process.returncode is not None or self._pipe.closed:
            self.kill()
            return
        self.send(b"q")
        with suppress(OSError):
            self._pipe.poll(2.0)
        self.kill()
