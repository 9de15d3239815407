"""A child process with one foreign FMU, and reports of its crash, hang or lack of memory.

Messages are one letter with doubles or JSON; nothing is unpickled. A head of token, number and length reveals stray or
forged bytes. Answers are untrusted and checked.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import signal
import site
import socket
import struct
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
from skillframe.fmu.confine import EVERYTHING

HEAD = struct.Struct("<QII")


class Garbled(Exception):
    """Received bytes are no message of this channel."""


class Channel:
    """One end of a channel: a connected stream socket and a shared number below 2**64."""

    def __init__(self, end: socket.socket, token: int) -> None:
        self.end, self._token = end, token
        self._sent = self._taken = 0
        self._rest = b""

    def send(self, message: bytes, limit_s: float | None = None) -> None:
        """Send a message within a time. Raises OSError if the other end is gone or does not read."""
        self.end.settimeout(limit_s)
        self._sent = (self._sent + 1) & 0xFFFFFFFF
        self.end.sendall(HEAD.pack(self._token, self._sent, len(message)) + message)

    def receive(self, most: int, until: float | None = None) -> bytes:
        """Next message of at most `most` bytes, until a time of the monotonic clock.

        Raises:
            TimeoutError, EOFError, OSError: too late, or closed.
            Garbled: no message, or too long.
        """
        data = self._filled(self._rest, HEAD.size, until)
        token, number, length = HEAD.unpack_from(data)
        self._taken = (self._taken + 1) & 0xFFFFFFFF
        if token != self._token or number != self._taken:
            raise Garbled("stray bytes")
        if length > most:
            raise Garbled(f"a message of {length} bytes, where {most} are the most")
        end = HEAD.size + length
        data = self._filled(data, end, until)
        self._rest = data[end:]
        return data[HEAD.size : end]

    def _filled(self, data: bytes, size: int, until: float | None) -> bytes:
        if len(data) >= size:
            return data
        parts, have = [data], len(data)
        while have < size:
            if until is not None:
                self.end.settimeout(max(1e-6, until - monotonic()))
            part = self.end.recv(1 << 16)
            if not part:
                raise EOFError
            parts.append(part)
            have += len(part)
        return b"".join(parts)

    def close(self) -> None:
        """Close this end."""
        self.end.close()


try:
    import resource
except ModuleNotFoundError:  # Windows
    CONFINES = False
else:
    CONFINES = hasattr(os, "waitid")  # macOS from Python 3.13

HANDED_ON = ("PATH", "LANG", "LC_ALL", "LC_CTYPE", "TZ", "LD_LIBRARY_PATH", "PYTHONPATH", "PYTHONHOME")
"""Environment passed on; the rest may hold secrets."""
LONGEST = 16 * 1024**2
"""Largest answer in bytes; a row of 100,000 outputs needs a few million."""
SAID = 1000
"""Largest message of the FMU in characters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SandboxLimits:
    """Limits of a child.

    Attributes:
        memory_bytes: address space; disk_bytes: a file's size, and all files where the folder is in memory.
        start_s, step_s: wall time of start and step [s].
        use: parts of the system's confinement (`confine`).
    """

    memory_bytes: int = 2 * 1024**3
    disk_bytes: int = 256 * 1024**2
    start_s: float = 30.0
    step_s: float = 5.0
    use: tuple[str, ...] = EVERYTHING


class ChildLost(SkillframeError):
    """A child process crashed, hung or left."""


class Child:
    """One child process and its end of the socket.

    Raises:
        InputError: the system lacks limits for FMUs.
        MissingDependency: fmpy is not installed.
    """

    def __init__(self, path: Path, name: str, limits: SandboxLimits) -> None:
        if not CONFINES:
            raise InputError(path, "cannot be run: an FMU runs under limits that this system lacks", "use Linux")
        need("fmpy")
        self.path, self.name, self.limits = path, name, limits
        try:
            self._folder = tempfile.mkdtemp(prefix="skillframe-fmu-")
        except OSError as error:
            text = f"cannot be used: {error.strerror}"
            raise InputError("folder for temporary files", text, "set TMPDIR") from None
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
        # Until exec the child shares this process's memory, which counts in its peak.
        self._inherited_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        self._channel = Channel(ours, token)
        self._asked = monotonic()

    def send(self, letter: bytes, payload: bytes = b"") -> None:
        """Send a request. `receive` reports a lost child."""
        self._asked = monotonic()
        with suppress(OSError):
            self._channel.send(letter + payload, self.limits.start_s)

    def receive(self, limit_s: float, what: str, most: int = LONGEST) -> bytes:
        """Answer of at most `most` bytes, within a time from the last message.

        Raises:
            ChildLost: it crashed, was late, or answered nonsense.
            InstanceFailed, InputError: it reported a problem.
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
        if answer[:1] == b"!":
            raise InstanceFailed(plain(answer[1:]))
        with suppress(ValueError):
            if answer[:1] == b"?" and len(words := json.loads(answer[1:])) == 3:
                raise InputError(*(plain(str(word).encode()) for word in words))
        raise self.liar("an answer of no known kind", what)

    def liar(self, sent: str, what: str) -> ChildLost:
        """Kill a child that sent an invalid answer, and return the error."""
        self.kill()
        return ChildLost(f"{self._who()} sent {sent} instead of an answer while {what}; it was stopped")

    def tell(self, letter: bytes, value: Any) -> None:
        """Send a request with a JSON payload."""
        self.send(letter, json.dumps(value).encode())

    def ask(self, letter: bytes, value: Any, limit_s: float, what: str, most: int = LONGEST) -> Any:
        """Send a request and return its answer, both JSON. Raises as `receive`."""
        self.tell(letter, value)
        return self.heard(limit_s, what, most)

    def heard(self, limit_s: float, what: str, most: int = LONGEST) -> Any:
        """Return an answer in JSON. Raises as `receive`."""
        answer = self.receive(limit_s, what, most)
        try:
            return json.loads(answer) if answer else None
        except (ValueError, RecursionError):
            raise self.liar("what is no JSON", what) from None

    def _who(self) -> str:
        return f"{self.name} ({self.path.name})"

    def _death(self, until: float) -> str:
        if self._waited(max(2.0, until - monotonic())) is None:  # s, to end after it has closed its socket
            self.kill()
            return "closed its end of the pipe and was stopped"
        code = self._process.returncode
        self.kill()
        memory = f"having used {self._peak_kb // 1024} MB of {self.limits.memory_bytes // 1024**2} MB"
        if code == -signal.SIGXCPU:
            return "took more processor time than it may"
        if code < 0:
            worth_telling = 0.25 * self.limits.memory_bytes / 1024
            large = self._peak_kb > max(worth_telling, self._inherited_kb)
            name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
            return f"crashed ({name}{', ' + memory if large else ''})"
        return f"ran out of memory ({memory})" if code == 12 else f"left with code {code}"

    _peak_kb = 0

    def _waited(self, limit_s: float) -> int | None:
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
        """Let the keeper end all processes, without waiting."""
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()
        self._channel.close()

    def kill(self) -> None:
        """End the child and its FMU's processes at once."""
        self.release()
        if self._waited(10.0) is None:  # s, to end all processes before it is killed
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    close = kill


def _environment(folder: str) -> dict[str, str]:
    caches = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    handed = {name: os.environ[name] for name in HANDED_ON if name in os.environ}
    ours = {"HOME": folder, "TMPDIR": folder, "XDG_CACHE_HOME": caches, "PYTHONUSERBASE": site.getuserbase()}
    fixed = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    return {**handed, **ours, **fixed}


def plain(text: bytes) -> str:
    """Text of a child as one printable line of limited length."""
    words = " ".join(text[: 4 * SAID].decode("utf-8", "replace").split())
    return "".join(c if c.isprintable() else "?" for c in words)[:SAID]
