"""One writer per campaign folder: a lock file that says who, and that a killed writer cannot leave behind.

The file holds pid and host; the operating system's advisory lock on it (`flock`) ends with the process, however that
ends. So a file that is not locked is stale if it names this host, and is taken over. On another host (a shared file
system) nobody can tell, so it is refused with the sentence that says what to do.

Windows has no `flock`. There the file itself is the lock, and that of a killed writer has to be deleted by hand.
"""

from __future__ import annotations

import errno
import json
import os
import socket
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from skillframe.errors import InputError

try:
    import fcntl
except ModuleNotFoundError:  # Windows
    ADVISORY = False
else:
    ADVISORY = True

NAME = "lock"
NO_LINK = getattr(os, "O_NOFOLLOW", 0)  # 0: Windows, which has none


class FolderLock:
    """Context manager that holds a campaign folder's lock.

    Raises:
        InputError: on entry, if another process holds it or a process on another host may.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._descriptor = -1

    def __enter__(self) -> FolderLock:
        self._descriptor = self._acquire()
        os.ftruncate(self._descriptor, 0)
        os.lseek(self._descriptor, 0, os.SEEK_SET)
        os.write(self._descriptor, json.dumps({"pid": os.getpid(), "host": socket.gethostname()}).encode())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if not ADVISORY:  # Windows removes no file that is open
            os.close(self._descriptor)
        with suppress(FileNotFoundError):
            self._path.unlink()
        if ADVISORY:
            os.close(self._descriptor)

    def _acquire(self) -> int:
        if not ADVISORY:
            return self._acquire_by_name()
        while True:
            descriptor = self._open()
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._refuse_other_host(descriptor)
            except BlockingIOError:
                pid, host = _owner(descriptor)
                os.close(descriptor)
                fix = "wait until it ends, or stop it"
                raise InputError(self._path, f"process {pid} on {host} is writing into this folder", fix) from None
            except BaseException:
                os.close(descriptor)
                raise
            if self._is_current(descriptor):
                return descriptor
            os.close(descriptor)  # its owner removed it between our opening and locking it

    def _acquire_by_name(self) -> int:
        """The file, if this process is the one that makes it."""
        try:
            return os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
        except FileExistsError:
            pid, host = holder(self._path.parent) or (0, "")
            raise _may_be_writing(self._path, pid, host) from None

    def _open(self) -> int:
        """The file, made if need be, and never through a link."""
        try:
            return os.open(self._path, os.O_RDWR | os.O_CREAT | NO_LINK, 0o644)
        except OSError as error:
            if error.errno == errno.ELOOP:
                raise InputError(self._path, "is a link, and no lock of a campaign", "delete it") from None
            raise

    def _is_current(self, descriptor: int) -> bool:
        with suppress(FileNotFoundError):
            return os.path.samestat(os.fstat(descriptor), self._path.stat())
        return False

    def _refuse_other_host(self, descriptor: int) -> None:
        pid, host = _owner(descriptor)
        if host not in ("", socket.gethostname()):
            raise _may_be_writing(self._path, pid, host)


def _may_be_writing(path: Path, pid: int, host: str) -> InputError:
    fix = f"make sure that it has ended there, then delete {path}"
    return InputError(path, f"process {pid} on {host} may be writing into this folder", fix)


def _owner(descriptor: int) -> tuple[int, str]:
    """Pid and host in a lock file. 0 and "" where it is empty or damaged."""
    try:
        os.lseek(descriptor, 0, os.SEEK_SET)
        content = json.loads(os.read(descriptor, 4096))
        return int(content["pid"]), str(content["host"])
    except (ValueError, KeyError, TypeError):
        return 0, ""


def holder(folder: Path) -> tuple[int, str] | None:
    """Pid and host of the process that is writing a campaign, or None. On Windows it may have been killed."""
    try:
        descriptor = os.open(folder / NAME, os.O_RDONLY)
    except FileNotFoundError:
        return None
    try:
        if not ADVISORY:
            return _owner(descriptor)
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return None
    except BlockingIOError:
        return _owner(descriptor)
    finally:
        os.close(descriptor)
