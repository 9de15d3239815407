"""Rows to compute, with all settings that determine their results."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from skillframe.config import coerce
from skillframe.errors import UnknownName
from skillframe.extend import Registry


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One row to compute.

    Attributes:
        row: its name.
        settings: all of the row's settings.
        changed: those that `--set` changed.
        seed, quick: see `RowRun`.
        version: of the distribution that provides the row.
        group: jobs of one group share a process.
    """

    row: str
    settings: Mapping[str, Any]
    changed: Mapping[str, Any]
    seed: int
    quick: bool
    version: str
    group: str

    @property
    def key(self) -> str:
        """Equal for jobs with equal results."""
        text = json.dumps(asdict(self), sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def command(self) -> str:
        """Command that computes this row again."""
        words = ["skillframe", "reproduce", self.row, "--out", "reproduce", "--seed", str(self.seed)]
        words += ["--quick"] if self.quick else []
        for key, value in sorted(self.changed.items()):
            words += ["--set", shlex.quote(f"{key}={_typed(value)}")]
        return " ".join(words)


def _typed(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def in_order(names: Sequence[str]) -> list[str]:
    """Rows by number, then other names."""
    return sorted(names, key=lambda name: (0, int(name), "") if name.isdigit() else (1, 0, name))


def jobs_of(
    registry: Registry, rows: Sequence[str], changed: Mapping[str, Any], *, seed: int, quick: bool
) -> list[Job]:
    """Jobs of the named rows, or of all, with each setting for every row that has it.

    Raises:
        UnknownName: no such row, or a setting that none of them has.
        InputError: a setting's value of the wrong type.
    """
    types = [registry.row(name) for name in in_order(list(dict.fromkeys(rows)) or registry.names("row"))]
    known = {key for row in types for key in row.settings}
    for key in changed:
        if key not in known:
            raise UnknownName("setting", key, known, "of the rows to be computed")
    jobs = []
    for row in types:
        mine = {key: value for key, value in changed.items() if key in row.settings}
        own = {key: coerce(value, type(row.settings[key]), f"--set {key}") for key, value in mine.items()}
        jobs.append(Job(
            row=row.name, settings={**row.settings, **own}, changed=own, seed=seed, quick=quick,
            version=registry.provider("row", row.name).version, group=row.group or row.name,
        ))  # fmt: skip
    return jobs
