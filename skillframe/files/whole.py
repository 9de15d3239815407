"""Files that appear complete or not at all: written under a name that nobody can guess, synced, then renamed.

The temporary file lies in the folder of its target, because a rename is atomic within one file system only. It is
created with O_EXCL, which follows no link and opens nothing that was there before. The file is synced before the
rename and the folder after it, so that a power cut leaves the old content or the new one.
"""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from skillframe.errors import InputError

LONGEST = 40
"""Characters of the target's name within the temporary name, which file systems limit to 255 bytes."""
RANDOM_BYTES = 8
_TEMPORARY = re.compile(rf"\..+\.[0-9a-f]{{{2 * RANDOM_BYTES}}}")


def write_whole(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all. Its folder is created if need be.

    Args:
        path: the file; one that is there is replaced, a link is replaced and not followed.
        content: all of it.

    Raises:
        InputError: the place cannot be written to, or is full; names the file.
    """
    with writing_whole(path) as temporary, temporary.open("r+b") as file:
        file.write(content)


@contextmanager
def writing_whole(path: Path) -> Iterator[Path]:
    """An empty temporary file, to be filled by its path. It takes the target's place when the block ends without error.

    Raises:
        InputError: the place cannot be written to, or is full; names the target.
    """
    try:
        _refuse_other_kinds(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = _created_beside(path)
    except OSError as error:
        raise not_written(path, error) from None
    try:
        yield temporary
        _sync(temporary, os.O_RDWR)  # Windows flushes no file that is open for reading only
        os.replace(temporary, path)
        sync_folder(path.parent)
    except OSError as error:
        raise not_written(path, error) from None
    finally:
        temporary.unlink(missing_ok=True)


def sync_folder(folder: Path) -> None:
    """Make the names in a folder last over a power cut. A file system that cannot is left as it is."""
    with suppress(OSError):
        _sync(folder, os.O_RDONLY)


def remove_temporary(folder: Path) -> None:
    """Remove the temporary files that killed processes left in a folder. Only where nobody writes."""
    for path in folder.glob(".*"):
        if _TEMPORARY.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)


def not_written(path: Path, error: OSError) -> InputError:
    """What the system said of a file that could not be written, as one sentence."""
    said = error.strerror or str(error) or type(error).__name__
    return InputError(path, f"cannot be written ({said})", "make room there, or choose another place for the output")


def make_folder(path: Path) -> None:
    """Create a folder for output, with those above it, if it is not there.

    Raises:
        InputError: the place cannot be written to; names the folder.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(path, error) from None


def _refuse_other_kinds(path: Path) -> None:
    """A rename would put a file in the place of a device or pipe."""
    if path.is_dir():
        raise InputError(path, "cannot be written (it is a folder)", "give the name of a file")
    if path.exists() and not path.is_file():
        raise InputError(path, "cannot be written (it is a device or a pipe)", "give the name of a file")


def _created_beside(path: Path) -> Path:
    # not `tempfile.mkstemp`: its files are their owner's only, whatever the umask
    temporary = path.with_name(f".{path.name[:LONGEST]}.{secrets.token_hex(RANDOM_BYTES)}")
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    return temporary


def _sync(path: Path, mode: int) -> None:
    descriptor = os.open(path, mode)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
