"""Between skillframe and a worker: holds the worker's processes, and ends all of them. Started as a module.

The keeper runs no foreign code. Its standard input is a pipe whose other end only skillframe holds: when that closes,
by intent or because skillframe was killed, the keeper ends the worker and everything below it, removes the private
folder, and leaves. When the worker ends, it does the same and ends as the worker did.

    skillframe -> keeper -> first process of the namespace, reaps
                         -> worker, runs the FMU -> what the FMU starts
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

with suppress(ModuleNotFoundError):  # Windows, where `Child` starts no keeper
    import fcntl
    import resource

HIGH = 20_000
"""Descriptor of the worker's socket, where the system allows as many: what an FMU writes to small numbers misses it."""
OPEN = 512
"""Most open files of a worker; also what an FMU is told if it asks how many there can be."""
PATIENCE_S = 5.0
"""For the last descendant to go, where there is no namespace."""


def keep(given: dict[str, Any]) -> NoReturn:
    """Start the worker, wait for its end or ours. `given` is what `Child` wrote."""
    use = set(given["use"])
    confined: dict[str, Any] = {"namespace": confine.NAMESPACE in use and confine.own_namespaces()}
    reaper = _first(given["fd"]) if confined["namespace"] else 0
    confined["subreaper"] = not reaper and confine.SUBREAPER in use and confine.adopt_orphans()
    wake = _waker()
    worker = os.fork()
    if worker == 0:
        _become_worker(given, confined)
    confine.hide_memory()
    os.close(given["fd"])
    _wait(worker, wake)
    status = _end_all(reaper, worker)
    shutil.rmtree(given["folder"], ignore_errors=True)
    _leave_as(status)


def _first(fd: int) -> int:
    """The first process of the namespace: it reaps what is left to it, and with it all others end.

    It holds neither our input nor the worker's socket `fd`, whose end would not be seen otherwise.
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


def _waker() -> int:
    """A descriptor that can be read when a child ends."""
    read, write = os.pipe()
    os.set_blocking(read, False)
    os.set_blocking(write, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    return read


def _wait(worker: int, wake: int) -> None:
    """Return when the worker has ended, or skillframe has closed its end."""
    poll = select.poll()
    poll.register(0, select.POLLIN)
    poll.register(wake, select.POLLIN)
    while not os.waitid(os.P_PID, worker, os.WEXITED | os.WNOHANG | os.WNOWAIT):
        if any(place == 0 for place, _ in poll.poll()):
            return
        with suppress(OSError):
            os.read(wake, 4096)


def _end_all(reaper: int, worker: int) -> int:
    """Kill the worker, its group, and whatever it has started, until nothing is left. Returns its wait status."""
    for kill, pid in ((os.kill, reaper), (os.killpg, worker), (os.kill, worker)):
        with suppress(OSError):
            if pid:
                kill(pid, signal.SIGKILL)
    status = os.waitpid(worker, 0)[1]
    if reaper:
        os.waitpid(reaper, 0)  # the kernel has ended the namespace by then
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
            break  # none is left: a list may miss one that loses its parent meanwhile, and that one is our child by now
        time.sleep(0.002)
    return status


def _leave_as(status: int) -> NoReturn:
    """End as the worker did."""
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        with suppress(OSError, ValueError):
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code & 0xFF)


def _become_worker(given: dict[str, Any], confined: dict[str, Any]) -> NoReturn:
    """Confine this process, then load what runs an FMU, and serve."""
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
        _load_and_serve(end, given, confined)
        code = 0
    finally:
        os._exit(code)  # an FMU's own clean-up at exit has hung before


def _load_and_serve(end: socket.socket, given: dict[str, Any], confined: dict[str, Any]) -> None:
    from skillframe.fmu.channel import Channel
    from skillframe.fmu.worker import Worker

    _limit(resource.RLIMIT_AS, given["memory_bytes"])
    Worker(Channel(end, given["token"]), confined).serve()


def _limit(kind: int, value: int) -> None:
    with suppress(OSError, ValueError):
        resource.setrlimit(kind, (value, value))


def _lifted(fd: int) -> int:
    """The socket on a high descriptor. All others are closed, and 0, 1 and 2 lead nowhere."""
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    most = HIGH + 1 if most == resource.RLIM_INFINITY else min(most, HIGH + 1)
    _limit(resource.RLIMIT_NOFILE, most)
    high = fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, most - 1)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nowhere, standard)
    os.closerange(3, high)
    _limit(resource.RLIMIT_NOFILE, min(OPEN, most))
    return high


if __name__ == "__main__":
    keep(json.loads(sys.argv[1]))
