"""Confinement of processes with foreign code on Linux. Each part may be missing.

- A user and process namespace (namespaces(7)): the FMU sees only its processes, which end with the first one.
- Landlock (landlock(7), Linux 5.13): writes only below one folder; from 6.12 signals stay inside too.
- A folder in memory of limited size.
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
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # same number on every architecture
_WRITE_FILE, _TRUNCATE = 1 << 1, 1 << 14
_MAKE_AND_REMOVE = sum(1 << bit for bit in range(4, 13))
_REFER = 1 << 13
_SCOPES = 1 | 2  # abstract sockets, signals
_NOSUID, _NODEV = 2, 4


def _call(name: str, *arguments: object) -> int:
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
    """Put future children of this process into a new process namespace. False if refused."""
    user, group = os.getuid(), os.getgid()
    try:
        _call("unshare", _NEWUSER | _NEWPID)
        for name, text in (("setgroups", "deny"), ("uid_map", f"{user} {user} 1"), ("gid_map", f"{group} {group} 1")):
            Path(f"/proc/self/{name}").write_text(text, encoding="ascii")
    except OSError:
        return False
    return True


def memory_folder(folder: str, size_bytes: int) -> bool:
    """Mount a file system in memory on a folder for this process and its children. False if refused."""
    with suppress(OSError):
        _call("unshare", _NEWNS)
        data = f"size={size_bytes},nr_inodes=10000,mode=0700".encode()
        _call("mount", b"tmpfs", folder.encode(), b"tmpfs", ctypes.c_ulong(_NOSUID | _NODEV), data)
        return True
    return False


def landlock_version() -> int:
    """Landlock version of the kernel, or 0."""
    with suppress(OSError):
        return _call("syscall", _CREATE_RULESET, None, ctypes.c_size_t(0), 1)
    return 0


def write_only_below(folder: str) -> int:
    """Restrict writes of this process and its children to one folder.

    Returns:
        The Landlock version, or 0.
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
    """Kill this process when its parent thread ends (Linux)."""
    with suppress(OSError):
        _call("prctl", _PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)


def hide_memory() -> None:
    """Hide this process's memory from others (Linux)."""
    with suppress(OSError):
        _call("prctl", _DUMPABLE, 0, 0, 0, 0)


def adopt_orphans() -> bool:
    """Adopt orphaned descendants (Linux). False if refused."""
    with suppress(OSError):
        _call("prctl", _SUBREAPER, 1, 0, 0, 0)
        return True
    return False


def descendants(root: int) -> list[int]:
    """Running descendants of a process, in any session (Linux only)."""
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
