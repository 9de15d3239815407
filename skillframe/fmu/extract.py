"""Unpack an FMU once per content, into a cache, and only what cannot leave its folder."""

from __future__ import annotations

import hashlib
import lzma
import os
import re
import shutil
import stat
import tempfile
import time
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path, PurePosixPath

from skillframe.errors import InputError, SkillframeError
from skillframe.paths import cache_dir

LARGEST = 1_000_000_000  # bytes unpacked; more is taken for a trap
LARGEST_DESCRIPTION = 100_000_000  # bytes
THIN, DENSEST = (
    10_000_000,
    200,
)  # what is above so many bytes and was packed to less than a 200th, a file or all of them, is a trap
OLD_S = 3600.0  # age of what an unpacking left that was killed
DESCRIBED_BY = ("modelDescription.xml", "sources/buildDescription.xml")
MOST_FILES = 20_000
LONGEST = 1000  # characters of a name
UNPACKING = "unpacking-"
_FMI2 = re.compile(rb"<ScalarVariable\s")
_FMI3 = re.compile(rb"<(?:Float(?:32|64)|U?Int(?:8|16|32|64)|Boolean|String|Binary|Enumeration|Clock)\s")


def unpack(path: Path) -> Path:
    """The folder that holds the content of an FMU. The first call makes it.

    Raises:
        InputError: not a zip, a name that would leave the folder, a link, or too much content.
    """
    folder = _place(path)
    if is_unpacked(path):
        return folder
    _tidy(folder.parent)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=UNPACKING) as work:
        _extract(path, Path(work) / "fmu")
        try:
            os.replace(Path(work) / "fmu", folder)
        except OSError:  # another process was first
            if not is_unpacked(path):
                raise
    return folder


def is_unpacked(path: Path) -> bool:
    """Whether the content of an FMU is in the cache."""
    return (_place(path) / "modelDescription.xml").is_file()


def forget(path: Path) -> None:
    """Remove from the cache what was unpacked of an FMU. Others may run it, so only who unpacked it calls."""
    with suppress(SkillframeError):
        shutil.rmtree(_place(path), ignore_errors=True)


def _place(path: Path) -> Path:
    return cache_dir("fmus-unpacked") / content_hash(path)[:32]


def _tidy(folder: Path) -> None:
    """Remove what an unpacking left that was killed."""
    for left in folder.glob(UNPACKING + "*"):
        with suppress(OSError):
            if time.time() - left.stat().st_mtime > OLD_S:
                shutil.rmtree(left, ignore_errors=True)


@contextmanager
def description_folder(path: Path, most: int) -> Iterator[Path]:
    """A folder with the model description of an FMU and what it refers to, nothing else. It is removed afterwards.

    Args:
        path: the FMU.
        most: variables that it may describe.

    Raises:
        InputError: as `unpack`, or a description of more variables.
    """
    with tempfile.TemporaryDirectory() as work:
        _extract(path, Path(work), DESCRIBED_BY)
        text = (Path(work) / "modelDescription.xml").read_bytes()
        count = max(len(kind.findall(text)) for kind in (_FMI2, _FMI3))  # FMI 2 nests some of FMI 3's tags in its own
        if count > most:
            raise InputError(path, f"describes {count} variables, where {most} are the most", "export fewer of them")
        yield Path(work)


def content_hash(path: Path) -> str:
    """SHA-256 of a file's content.

    Raises:
        InputError: no such file.
    """
    try:
        facts = path.stat()
    except OSError:
        raise InputError(path, "no such file", "check the path") from None
    return _hash(str(path.resolve()), facts.st_mtime_ns, facts.st_size)


@lru_cache(maxsize=256)
def _hash(path: str, modified: int, size: int) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def member_names(path: Path) -> list[str]:
    """Names inside an FMU, checked.

    Raises:
        InputError: as `unpack`.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            _check(path, archive.infolist())
            return archive.namelist()
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except (zipfile.BadZipFile, NotImplementedError, UnicodeDecodeError, OSError) as error:
        raise InputError(
            path, f"is not an FMU: {error}", "give the .fmu file (a zip with a modelDescription.xml)"
        ) from None


def _check(path: Path, members: list[zipfile.ZipInfo]) -> None:
    for member in members:
        name = member.orig_filename
        parts = PurePosixPath(name).parts
        if "\\" in name or ":" in name or name.startswith("/") or ".." in parts:
            raise InputError(
                path, f"holds {name!r}, which would be written outside its folder", "do not trust this file"
            )
        if len(name) > LONGEST or any(len(part.encode()) > 255 for part in parts):
            raise InputError(path, f"holds a name of {len(name)} characters", "do not trust this file")
        if stat.S_ISLNK(member.external_attr >> 16):
            raise InputError(
                path, f"holds a link, {name!r}, which can lead outside its folder", "do not trust this file"
            )
    total = sum(m.file_size for m in members)
    if total > LARGEST or len(members) > MOST_FILES:
        raise InputError(path, f"unpacks to {len(members)} files of {total} bytes", "do not trust this file")
    for member in members:
        if member.file_size > max(THIN, DENSEST * member.compress_size):
            problem = f"holds {member.orig_filename!r}, {member.compress_size} bytes that unpack to {member.file_size}"
            raise InputError(path, problem, "do not trust this file")
    if total > max(THIN, DENSEST * sum(m.compress_size for m in members)):
        problem = f"unpacks to {total} bytes, more than {DENSEST} times what it packs them to"
        raise InputError(path, problem, "do not trust this file")
    described = sum(m.file_size for m in members if m.filename in DESCRIBED_BY)
    if described > LARGEST_DESCRIPTION:
        raise InputError(path, f"has a model description of {described} bytes", f"{LARGEST_DESCRIPTION} are the most")
    if "modelDescription.xml" not in {m.filename for m in members}:
        raise InputError(path, "is a zip without modelDescription.xml, so not an FMU", "give the .fmu file")


def _extract(path: Path, folder: Path, only: tuple[str, ...] = ()) -> None:
    names = member_names(path)
    try:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder, [name for name in only if name in names] if only else None)
    except OSError as error:
        raise InputError(path, f"cannot be unpacked: {error.strerror}", "copy the file again") from None
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError) as error:
        raise InputError(path, f"cannot be unpacked: {error}", "copy the file again") from None
    except (RuntimeError, NotImplementedError):  # zipfile's words for a password and for a method it does not know
        raise InputError(path, "is packed with a password or in an unusual way", "pack it as a plain zip") from None
