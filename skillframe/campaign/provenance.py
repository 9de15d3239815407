"""What a result depends on besides the campaign: versions, processor, and hashes of everything that went in.

Rows are bit-identical on one kind of machine with one set of versions; another processor or numpy build may round
sines differently, so replays name such differences instead of blaming the trial.
"""

from __future__ import annotations

import hashlib
import json
import platform
import sys
from collections.abc import Mapping
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

LIBRARIES = ("skillframe", "numpy", "scipy", "mujoco", "pin")


def environment() -> dict[str, str]:
    """Versions of what computes, and the processor it runs on."""
    return dict(_environment(tuple(sys.path)))


@lru_cache(maxsize=8)
def _environment(path: tuple[str, ...]) -> Mapping[str, str]:
    """Read once for where modules come from: what runs stays what it was when it was imported."""
    found = {"python": platform.python_version(), "platform": platform.platform(), "processor": _processor()}
    for name in [*LIBRARIES, *sorted(_plugins() - {"skillframe"})]:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def _plugins() -> set[str]:
    return {str(point.dist.name) for point in metadata.entry_points(group="skillframe") if point.dist is not None}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def environment_differences(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """One line per version or processor that is not the same."""
    names = [name for name in {**then, **now} if then.get(name) != now.get(name)]
    return [f"{name}: {then.get(name, 'absent')} then, {now.get(name, 'absent')} now" for name in names]


def file_hash(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def file_hashes(folder: Path, parts: tuple[str, ...]) -> dict[str, str]:
    """SHA-256 of every file under some sub-folders, by path relative to the folder."""
    files = sorted(path for part in parts for path in (folder / part).rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): file_hash(path) for path in files}


def combined_hash(content: Mapping[str, Any]) -> str:
    """SHA-256 of plain values in canonical JSON."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
