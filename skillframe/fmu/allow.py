"""Which FMUs may run inside this process: those built here from sources, and those a person has allowed by content.

Native code in the process can crash it, hang it or read what it likes, so that every other FMU runs in a child process
with limits. The list is one SHA-256 per line in `$XDG_CONFIG_HOME/skillframe/allowed-fmus`.
"""

from __future__ import annotations

import os
from pathlib import Path

from skillframe.fmu.extract import content_hash
from skillframe.paths import cache_dir


def allow_file() -> Path:
    """Where allowed hashes are kept."""
    base = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return base / "skillframe" / "allowed-fmus"


def is_allowed(path: Path) -> bool:
    """Whether an FMU may run inside this process: our own build, or listed."""
    if path.resolve().is_relative_to(cache_dir("fmus").resolve()):
        return True
    file = allow_file()
    if not file.is_file():
        return False
    digest = content_hash(path)
    return any(line.split("#")[0].strip() == digest for line in file.read_text(encoding="utf-8").splitlines())


def allow(path: Path) -> str:
    """Add an FMU's hash to the list and return it. A second call changes nothing."""
    digest = content_hash(path)
    if not is_allowed(path):
        file = allow_file()
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a", encoding="utf-8") as out:
            out.write(f"{digest}  # {path.name}\n")
    return digest
