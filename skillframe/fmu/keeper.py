"""Keeper process, which starts a worker and ends all its processes.

When the pipe on standard input closes or the worker ends, it kills the worker's descendants, removes the private folder
and exits.

    skillframe -> keeper -> first process of the namespace, reaps
                         -> worker, runs the FMU -> its children
"""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import socket
import sys
import time
from contextlib import suppress
from typing import Any, NoReturn

from skillframe.fmu import confine

with suppress(ModuleNotFoundError):
    import fcntl
    import resource

HIGH = 20_000
"""Descriptor of the worker's socket, out of an FMU's reach."""
PATIENCE_S = 5.0
"""Time for the last descendant to end without a namespace."""


def keep(given: dict[str, Any]) -> NoReturn:
    """Run the worker until it or skillframe ends. `given` comes from `Child`."""
    use = set(given["use"])
    confined: dict[str, Any] = {"namespace": confine.NAMESPACE in use and confine.own_namespaces()}
    reaper = _first(given["fd"]) if confined["namespace"] else 0
    confined["subreaper"] = not reaper and confine.SUBREAPER in use and confine.adopt_orphans()
    wake, write = os.pipe()
    os.set_blocking(wake, False)
    os.set_blocking(write, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    worker = os.fork()
    if worker == 0:
        _become_worker(given, confined)
    confine.hide_memory()
    os.close(given["fd"])
    _wait(worker, wake)
    status = _end_all(reaper, worker)
    shutil.rmtree(given["folder"], ignore_errors=True)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with suppress(OSError, ValueError):
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code & 0xFF)


def _first(fd: int) -> int:
    """First process of the namespace, with which all others end.

    It closes standard input and the socket `fd`, so that their end is seen.
    """
    pid = os.fork()
    if pid:
        return pid
    confine.hide_memory()
    confine.die_with_parent()
    os.setsid()
    os.closerange(0, fd + 1)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        signal.pause()


def _wait(worker: int, wake: int) -> None:
    poll = select.poll()
    poll.register(0, select.POLLIN)
    poll.register(wake, select.POLLIN)
    while not os.waitid(os.P_PID, worker, os.WEXITED | os.WNOHANG | os.WNOWAIT):
        if any(place == 0 for place, _ in poll.poll()):
            return
        with suppress(OSError):
            os.read(wake, 4096)


def _end_all(reaper: int, worker: int) -> int:
    for kill, pid in ((os.kill, reaper), (os.killpg, worker), (os.kill, worker)):
        with suppress(OSError):
            if pid:
                kill(pid, signal.SIGKILL)
    status = os.waitpid(worker, 0)[1]
    if reaper:
        os.waitpid(reaper, 0)
        return status
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        for pid in confine.descendants(os.getpid()):
            with suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            break  # no child is left; orphans would be children by now
        time.sleep(0.002)
    return status


def _become_worker(given: dict[str, Any], confined: dict[str, Any]) -> NoReturn:
    code = 70
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        confine.die_with_parent()
        os.setsid()
        end = socket.socket(fileno=_lifted(given["fd"]))
        folder = given["folder"]
        use = set(given["use"])
        if confine.MEMORY_FOLDER in use and confined["namespace"]:
            confined["memory_folder"] = confine.memory_folder(folder, given["disk_bytes"])
        os.chdir(folder)
        os.umask(0o077)
        confined["landlock"] = confine.write_only_below(folder) if confine.LANDLOCK in use else 0
        _limit(resource.RLIMIT_CORE, 0)
        _limit(resource.RLIMIT_FSIZE, given["disk_bytes"])
        from skillframe.fmu.child import Channel
        from skillframe.fmu.worker import Worker

        _limit(resource.RLIMIT_AS, given["memory_bytes"])
        Worker(Channel(end, given["token"]), confined).serve()
        code = 0
    finally:
        os._exit(code)  # avoids hangs in an FMU's exit handlers


def _limit(kind: int, value: int) -> None:
    with suppress(OSError, ValueError):
        resource.setrlimit(kind, (value, value))


def _lifted(fd: int) -> int:
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    most = HIGH + 1 if most == resource.RLIM_INFINITY else min(most, HIGH + 1)
    _limit(resource.RLIMIT_NOFILE, most)
    high = fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, most - 1)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nowhere, standard)
    os.closerange(3, high)
    _limit(resource.RLIMIT_NOFILE, min(512, most))  # most open files
    return high


if __name__ == "__main__":
    keep(json.loads(sys.argv[1]))
