"""A child process that holds one foreign FMU, and what is said when it crashes, hangs or runs out of memory.

Messages are bytes over a socket (`channel`): one letter, then doubles or JSON; nothing is unpickled. What comes back
is taken for the FMU's own word: it has a deadline, a largest length, and is checked before it is used.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import signal
import site
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from skillframe.errors import InputError, SkillframeError, need
from skillframe.fmu.bindings import InstanceFailed
from skillframe.fmu.channel import Channel, Garbled
from skillframe.fmu.confine import EVERYTHING

try:
    import resource
except ModuleNotFoundError:  # Windows
    CONFINES = False
else:
    CONFINES = hasattr(os, "waitid")  # macOS has it from Python 3.13 on

TELLING = 0.25
"""Share of the memory allowed from which on a crash is told with it; below, the same crash has the same words."""
HANDED_ON = ("PATH", "LANG", "LC_ALL", "LC_CTYPE", "TZ", "LD_LIBRARY_PATH", "PYTHONPATH", "PYTHONHOME")
"""All that a child is told of our environment; the rest may hold secrets."""
LONGEST = 16 * 1024**2
"""Bytes of an answer, unless the caller expects less: a row of 100,000 outputs needs a few million."""
SAID = 1000
"""Characters of a sentence of the FMU."""
LEAVING_S = 2.0
"""For a child to end after it has closed its end of the socket."""
ENDING_S = 10.0
"""For the keeper to end all that there is; after that it is killed, and takes the child with it where Linux does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SandboxLimits:
    """Limits of a child.

    Attributes:
        memory_bytes: address space; disk_bytes: a file's size, and all files where the folder is in memory.
        start_s, step_s: wall time to load and start, and of a step [s].
        use: what of the system's confinement to ask for (`confine`); less is for tests.
    """

    memory_bytes: int = 2 * 1024**3
    disk_bytes: int = 256 * 1024**2
    start_s: float = 30.0
    step_s: float = 5.0
    use: tuple[str, ...] = EVERYTHING


class ChildLost(SkillframeError):
    """A child process crashed, hung or left. The sentence says which, and how much memory it used."""


class Child:
    """One child process and its end of the socket.

    Raises:
        InputError: the system has no limits to run an FMU under.
        MissingDependency: fmpy, which the child needs, is not installed.
    """

    def __init__(self, path: Path, name: str, limits: SandboxLimits) -> None:
        if not CONFINES:
            raise InputError(path, "cannot be run: an FMU runs under limits that this system lacks", "use Linux")
        need("fmpy")
        self.path, self.name, self.limits = path, name, limits
        self._folder = _private_folder()
        token = secrets.randbits(64)
        ours, theirs = socket.socketpair()
        given = {
            "fd": theirs.fileno(), "token": token, "folder": self._folder, "use": limits.use,
            "memory_bytes": limits.memory_bytes, "disk_bytes": limits.disk_bytes,
        }  # fmt: skip
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "skillframe.fmu.keeper", json.dumps(given)],
                pass_fds=[theirs.fileno()], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL, start_new_session=True, cwd=self._folder, env=_environment(self._folder),
            )  # fmt: skip
        finally:
            theirs.close()
        # Up to its exec a child shares our memory, and Linux counts that peak as the child's own.
        self._inherited_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        self._channel = Channel(ours, token)
        self._asked = monotonic()

    def send(self, letter: bytes, payload: bytes = b"") -> None:
        """Send a request. A child that has gone or does not read is found out by `receive`."""
        self._asked = monotonic()
        with suppress(OSError):
            self._channel.send(letter + payload, self.limits.start_s)

    def receive(self, limit_s: float, what: str, most: int = LONGEST) -> bytes:
        """The child's answer of `most` bytes at most, within a time from when it was last asked or answered.

        Raises:
            ChildLost: it crashed, did not answer in time, or answered with what is no answer.
            InstanceFailed, InputError: it answered with a problem.
        """
        until = self._asked + limit_s
        try:
            answer = self._channel.receive(most, until)
            self._asked = monotonic()
        except TimeoutError:
            self.kill()
            raise ChildLost(f"{self._who()} did not answer within {limit_s:g} s while {what}; it was stopped") from None
        except Garbled as found:
            raise self.liar(str(found), what) from None
        except (EOFError, OSError):
            raise ChildLost(f"{self._who()} {self._death(until)} while {what}") from None
        if answer[:1] == b".":
            return answer[1:]
        raise self._problem(answer, what)

    def _problem(self, answer: bytes, what: str) -> SkillframeError:
        if answer[:1] == b"!":
            return InstanceFailed(plain(answer[1:]))
        with suppress(ValueError):
            if answer[:1] == b"?" and len(words := json.loads(answer[1:])) == 3:
                return InputError(*(plain(str(word).encode()) for word in words))
        return self.liar("an answer of no known kind", what)

    def liar(self, sent: str, what: str) -> ChildLost:
        """End a child that sent what is no answer. Returns the error to raise."""
        self.kill()
        return ChildLost(f"{self._who()} sent {sent} instead of an answer while {what}; it was stopped")

    def tell(self, letter: bytes, value: Any) -> None:
        """A request with a JSON payload."""
        self.send(letter, json.dumps(value).encode())

    def ask(self, letter: bytes, value: Any, limit_s: float, what: str, most: int = LONGEST) -> Any:
        """A request and its answer, both JSON. Raises as `receive`."""
        self.tell(letter, value)
        return self.heard(limit_s, what, most)

    def heard(self, limit_s: float, what: str, most: int = LONGEST) -> Any:
        """An answer in JSON. Raises as `receive`."""
        answer = self.receive(limit_s, what, most)
        try:
            return json.loads(answer) if answer else None
        except (ValueError, RecursionError):
            raise self.liar("what is no JSON", what) from None

    def _who(self) -> str:
        return f"{self.name} ({self.path.name})"

    def _death(self, until: float) -> str:
        """In words how the child ended, with the most memory it held if that may be why."""
        if self._waited(max(LEAVING_S, until - monotonic())) is None:
            self.kill()
            return "closed its end of the pipe and was stopped"
        code = self._process.returncode
        self.kill()
        memory = f"having used {self._peak_kb // 1024} MB of {self.limits.memory_bytes // 1024**2} MB"
        if code < 0:
            large = self._peak_kb > max(TELLING * self.limits.memory_bytes / 1024, self._inherited_kb)
            name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
            return f"crashed ({name}{', ' + memory if large else ''})"
        return f"ran out of memory ({memory})" if code == 12 else f"left with code {code}"

    _peak_kb = 0

    def _waited(self, limit_s: float) -> int | None:
        """Exit code of the keeper, which is the worker's, within a time, or None if it is still there."""
        until, pause = monotonic() + limit_s, 0.0005
        while self._process.returncode is None:
            try:
                pid, status, usage = os.wait4(self._process.pid, os.WNOHANG)
            except ChildProcessError:
                self._process.returncode = 0
                break
            if pid:
                self._process.returncode, self._peak_kb = os.waitstatus_to_exitcode(status), usage.ru_maxrss
            elif monotonic() > until:
                return None
            else:
                sleep(pause)
                pause = min(2 * pause, 0.02)
        return self._process.returncode

    def release(self) -> None:
        """Let the keeper end the child and all it has started, without waiting for it."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()
        self._channel.close()

    def kill(self) -> None:
        """End the child at once, and what its FMU has started."""
        self.release()
        if self._waited(ENDING_S) is None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    close = kill


def _private_folder() -> str:
    """A new folder of the child's own.

    Raises:
        InputError: the system gives none.
    """
    try:
        return tempfile.mkdtemp(prefix="skillframe-fmu-")
    except OSError as error:
        raise InputError("folder for temporary files", f"cannot be used: {error.strerror}", "set TMPDIR") from None


def _environment(folder: str) -> dict[str, str]:
    """What a child is told: where programs and libraries are, the language, and its own folder as home."""
    caches = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    handed = {name: os.environ[name] for name in HANDED_ON if name in os.environ}
    ours = {"HOME": folder, "TMPDIR": folder, "XDG_CACHE_HOME": caches, "PYTHONUSERBASE": site.getuserbase()}
    fixed = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    return {**handed, **ours, **fixed}


def plain(text: bytes) -> str:
    """What a child says as one line of characters that can be printed, not too long."""
    words = " ".join(text[: 4 * SAID].decode("utf-8", "replace").split())
    return "".join(c if c.isprintable() else "?" for c in words)[:SAID]
