"""What Linux offers to confine a process that runs foreign code, asked for by system call. Each part may be missing.

- A user and process namespace (namespaces(7)): the FMU sees no process but its own, and the kernel ends all of them
  with the first one.
- Landlock (landlock(7), Linux 5.13): files are written below one folder only; from 6.12 signals stay inside too.
- A folder in memory of limited size, so that a full disk is not reached.

Other systems have none of these: there the limits of `setrlimit` and the process group remain.
"""

from __future__ import annotations

import ctypes
import os
import signal
import struct
import sys
from contextlib import suppress
from pathlib import Path

NAMESPACE, LANDLOCK, MEMORY_FOLDER, SUBREAPER = "namespace", "landlock", "memory_folder", "subreaper"
EVERYTHING = (NAMESPACE, LANDLOCK, MEMORY_FOLDER, SUBREAPER)

_NEWNS, _NEWUSER, _NEWPID = 0x00020000, 0x10000000, 0x20000000
_PDEATHSIG, _DUMPABLE, _SUBREAPER, _NO_NEW_PRIVS = 1, 4, 36, 38
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # one number on every architecture since Linux 5.13
_WRITE_FILE, _TRUNCATE = 1 << 1, 1 << 14
_MAKE_AND_REMOVE = sum(1 << bit for bit in range(4, 13))
_REFER = 1 << 13
_SCOPES = 1 | 2  # abstract sockets, signals
_NOSUID, _NODEV = 2, 4


def _call(name: str, *arguments: object) -> int:
    """A function of the C library.

    Raises:
        OSError: it failed, or is not there.
    """
    if sys.platform != "linux":
        raise OSError("Linux only")
    function = getattr(ctypes.CDLL(None, use_errno=True), name, None)
    if function is None:
        raise OSError(name)
    result = int(function(*arguments))
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


def own_namespaces() -> bool:
    """From now on children of this process live in a process namespace. It stays outside itself. False if refused."""
    user, group = os.getuid(), os.getgid()
    try:
        _call("unshare", _NEWUSER | _NEWPID)
        for name, text in (("setgroups", "deny"), ("uid_map", f"{user} {user} 1"), ("gid_map", f"{group} {group} 1")):
            Path(f"/proc/self/{name}").write_text(text, encoding="ascii")
    except OSError:
        return False
    return True


def memory_folder(folder: str, size_bytes: int) -> bool:
    """Put a file system in memory over a folder, for this process and its children only. False if refused."""
    with suppress(OSError):
        _call("unshare", _NEWNS)
        data = f"size={size_bytes},nr_inodes=10000,mode=0700".encode()
        _call("mount", b"tmpfs", folder.encode(), b"tmpfs", ctypes.c_ulong(_NOSUID | _NODEV), data)
        return True
    return False


def landlock_version() -> int:
    """Version of Landlock that the kernel has, 0 for none."""
    with suppress(OSError):
        return _call("syscall", _CREATE_RULESET, None, ctypes.c_size_t(0), 1)
    return 0


def write_only_below(folder: str) -> int:
    """Let this process and its children write files below one folder only, for good.

    Returns:
        The version of Landlock that does it, 0 where there is none.
    """
    version = landlock_version()
    if version < 1:
        return 0
    rights = _WRITE_FILE | _MAKE_AND_REMOVE | (_REFER if version >= 2 else 0) | (_TRUNCATE if version >= 3 else 0)
    head = struct.pack("<QQQ", rights, 0, _SCOPES) if version >= 6 else struct.pack("<Q", rights)
    try:
        rules = _call("syscall", _CREATE_RULESET, head, ctypes.c_size_t(len(head)), 0)
        _add_rule(rules, folder, rights)
        _add_rule(rules, os.devnull, rights & (_WRITE_FILE | _TRUNCATE))
        _call("prctl", _NO_NEW_PRIVS, 1, 0, 0, 0)
        _call("syscall", _RESTRICT_SELF, rules, 0)
        os.close(rules)
    except OSError:
        return 0
    return version


def _add_rule(rules: int, path: str, rights: int) -> None:
    place = os.open(path, os.O_PATH | os.O_CLOEXEC)
    try:
        _call("syscall", _ADD_RULE, rules, 1, struct.pack("<Qi", rights, place), 0)
    finally:
        os.close(place)


def die_with_parent() -> None:
    """This process is killed when the thread that made it ends (Linux)."""
    with suppress(OSError):
        _call("prctl", _PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)


def hide_memory() -> None:
    """No other process may look into this one (Linux)."""
    with suppress(OSError):
        _call("prctl", _DUMPABLE, 0, 0, 0, 0)


def adopt_orphans() -> bool:
    """Processes below this one whose parents have gone become its children (Linux). Returns False where refused."""
    with suppress(OSError):
        _call("prctl", _SUBREAPER, 1, 0, 0, 0)
        return True
    return False


def descendants(root: int) -> list[int]:
    """Processes below one that are not ended, in any session (Linux; elsewhere none are found)."""
    below: dict[int, list[int]] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError, IndexError):
            state, parent = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[:2]
            if state != "Z":
                below.setdefault(int(parent), []).append(int(entry.name))
    found, todo = list[int](), [root]
    while todo:
        found += (mine := below.get(todo.pop(), []))
        todo += mine
    return found
