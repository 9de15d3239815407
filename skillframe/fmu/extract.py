"""Unpacking of FMUs into a cache by content, and the list of FMUs that may run in this process.

Nothing is written outside an FMU's own folder. Own builds may run here, and those that the user has allowed by content:
one SHA-256 per line in `$XDG_CONFIG_HOME/skillframe/allowed-fmus`.
"""

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
from skillframe.files import cache_dir

LARGEST = 1_000_000_000  # bytes unpacked
THIN, DENSEST = 10_000_000, 200  # more bytes than this packed below a 200th are a zip bomb
DESCRIBED_BY = ("modelDescription.xml", "sources/buildDescription.xml")
UNPACKING = "unpacking-"
_FMI2 = re.compile(rb"<ScalarVariable\s")
_FMI3 = re.compile(rb"<(?:Float(?:32|64)|U?Int(?:8|16|32|64)|Boolean|String|Binary|Enumeration|Clock)\s")


def unpack(path: Path) -> Path:
    """Folder with the content of an FMU, unpacked on first use.

    Raises:
        InputError: not a zip, unsafe names, a link, or too much content.
    """
    folder = _place(path)
    if is_unpacked(path):
        return folder
    for left in folder.parent.glob(UNPACKING + "*"):
        with suppress(OSError):
            if time.time() - left.stat().st_mtime > 3600.0:  # an hour: left by a killed process
                shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=UNPACKING) as work:
        _extract(path, Path(work) / "fmu")
        try:
            os.replace(Path(work) / "fmu", folder)
        except OSError:
            if not is_unpacked(path):
                raise
    return folder


def is_unpacked(path: Path) -> bool:
    """Whether an FMU is in the cache."""
    return (_place(path) / "modelDescription.xml").is_file()


def forget(path: Path) -> None:
    """Remove an FMU from the cache. Call only after unpacking it, because others may run it."""
    with suppress(SkillframeError):
        shutil.rmtree(_place(path), ignore_errors=True)


def _place(path: Path) -> Path:
    return cache_dir("fmus-unpacked") / content_hash(path)[:32]


@contextmanager
def description_folder(path: Path, most: int) -> Iterator[Path]:
    """Temporary folder with only the model description of an FMU, of at most `most` variables.

    Raises:
        InputError: as `unpack`, or too many variables.
    """
    with tempfile.TemporaryDirectory() as work:
        _extract(path, Path(work), DESCRIBED_BY)
        text = (Path(work) / "modelDescription.xml").read_bytes()
        count = max(len(kind.findall(text)) for kind in (_FMI2, _FMI3))  # FMI 2 nests some tags of FMI 3
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
    """Checked names inside an FMU.

    Raises:
        InputError: as `unpack`.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            for member in members:
                name = slashed(member)
                parts = PurePosixPath(name).parts
                if ":" in name or name.startswith("/") or ".." in parts:
                    raise InputError(
                        path, f"holds {name!r}, which would be written outside its folder", "do not trust this file"
                    )
                if len(name) > 1000 or any(len(part.encode()) > 255 for part in parts):  # characters
                    raise InputError(path, f"holds a name of {len(name)} characters", "do not trust this file")
                if stat.S_ISLNK(member.external_attr >> 16):
                    raise InputError(
                        path, f"holds a link, {name!r}, which can lead outside its folder", "do not trust this file"
                    )
            total = sum(m.file_size for m in members)
            if total > LARGEST or len(members) > 20_000:
                raise InputError(path, f"unpacks to {len(members)} files of {total} bytes", "do not trust this file")
            for member in members:
                if member.file_size > max(THIN, DENSEST * member.compress_size):
                    problem = f"holds {member.orig_filename!r}, {member.compress_size} bytes that unpack to"
                    raise InputError(path, f"{problem} {member.file_size}", "do not trust this file")
            if total > max(THIN, DENSEST * sum(m.compress_size for m in members)):
                problem = f"unpacks to {total} bytes, more than {DENSEST} times what it packs them to"
                raise InputError(path, problem, "do not trust this file")
            described = sum(m.file_size for m in members if slashed(m) in DESCRIBED_BY)
            if described > 100_000_000:
                raise InputError(path, f"has a model description of {described} bytes", "100000000 are the most")
            if "modelDescription.xml" not in {slashed(m) for m in members}:
                raise InputError(path, "is a zip without modelDescription.xml, so not an FMU", "give the .fmu file")
            return [slashed(member) for member in members]
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except (zipfile.BadZipFile, NotImplementedError, UnicodeDecodeError, OSError) as error:
        raise InputError(
            path, f"is not an FMU: {error}", "give the .fmu file (a zip with a modelDescription.xml)"
        ) from None


def slashed(member: zipfile.ZipInfo) -> str:
    """Member name with slashes, which some Windows programs write as backslashes."""
    return member.orig_filename.replace("\\", "/")


def _extract(path: Path, folder: Path, only: tuple[str, ...] = ()) -> None:
    member_names(path)
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                member.filename = slashed(member)
                if not only or member.filename in only:
                    archive.extract(member, folder)
    except OSError as error:
        raise InputError(path, f"cannot be unpacked: {error.strerror}", "copy the file again") from None
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError) as error:
        raise InputError(path, f"cannot be unpacked: {error}", "copy the file again") from None
    except (RuntimeError, NotImplementedError):  # zipfile's errors for passwords and unknown methods
        raise InputError(path, "is packed with a password or in an unusual way", "pack it as a plain zip") from None


def allow_file() -> Path:
    """File of allowed hashes."""
    base = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return base / "skillframe" / "allowed-fmus"


def is_allowed(path: Path) -> bool:
    """Whether an FMU may run in this process."""
    if path.resolve().is_relative_to(cache_dir("fmus").resolve()):
        return True
    file = allow_file()
    if not file.is_file():
        return False
    digest = content_hash(path)
    return any(line.split("#")[0].strip() == digest for line in file.read_text(encoding="utf-8").splitlines())


def allow(path: Path) -> str:
    """Add an FMU's hash to the list and return it."""
    digest = content_hash(path)
    if not is_allowed(path):
        file = allow_file()
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a", encoding="utf-8") as out:
            out.write(f"{digest}  # {path.name}\n")
    return digest
