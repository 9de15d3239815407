"""Table of real trials that only grows: one row per trial and skill, in the order in which they ran.

    trial,skill,success,failure,offset_mm,source
    0,peg,1,,2.5,real
    1,peg,0,jammed,-1.0,real

The columns match a campaign's table, so reports and comparisons read both. `source` marks every row and is last, which
reveals a line torn by a power cut. Each row is on the disk before the next. Each skill's trials are numbered without
gaps, so that omitted or repeated trials are noticed.
"""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from skillframe.campaign import REAL, RESULTS, SOURCE, FolderLock, real_or_simulated
from skillframe.config import LARGEST
from skillframe.errors import InputError
from skillframe.files import sync_folder
from skillframe_certify.trials import POLICY, cells_of, success_of

HEAD = ("trial", "skill", "success", "failure")


class Real(NamedTuple):
    """A trial of a real robot.

    Attributes:
        skill: its name.
        success: whether it succeeded.
        failure: reason in the observer's words; "" if unknown.
        draws: parameters set or measured, by name.
        trial: its number; None for the skill's next.
    """

    skill: str
    success: bool
    failure: str = ""
    draws: Mapping[str, float] = {}
    trial: int | None = None


@dataclass(slots=True)
class RealTable:
    """A checked table of real trials.

    Attributes:
        path: its file, which may not exist yet.
        names: of the parameters; None before the first trial.
        rows: in the order in which they ran.
        size: of the file when it was read [bytes].
    """

    path: Path
    names: tuple[str, ...] | None = None
    rows: list[Real] = field(default_factory=list)
    size: int = 0

    def next_trial(self, skill: str) -> int:
        """Return the number of a skill's next trial."""
        own = [row.trial for row in self.rows if row.skill == skill]
        return int(own[-1] or 0) + 1 if own else self.first

    @property
    def first(self) -> int:
        """Number of each skill's first trial."""
        return int(self.rows[0].trial or 0) if self.rows else 0

    def check(self, given: Real, where: str) -> Real:
        """Return the trial with its number, if it may come next.

        Raises:
            InputError: a gap, a repeated trial, or other parameters than the table's.
        """
        expected = self.next_trial(given.skill)
        trial = expected if given.trial is None else given.trial
        begins = not self.rows and trial in (0, 1)
        if trial < expected and not begins:
            raise InputError(
                where,
                f"is trial {trial} of {given.skill}, which is there already",
                "a trial that is run again because of how it ended counts once: leave it out",
            )
        if trial > expected and not begins:
            raise InputError(
                where,
                f"is trial {trial} of {given.skill}, but trial {expected} comes next",
                "enter every trial, failed ones too: left out, they would make the skill look better",
            )
        for text in (given.skill, given.failure):
            if any(mark in text for mark in "\r\n\0") or text != text.strip():
                raise InputError(where, f"{text!r} does not fit on a line", "leave out line ends and blanks around it")
        if not given.skill:
            raise InputError(where, "names no skill", "say which skill ran")
        if given.success and given.failure:
            raise InputError(where, f"succeeded, but failed because {given.failure!r}", "give one of the two")
        names = tuple(given.draws) if self.names is None else self.names
        if set(given.draws) != set(names):
            told = ", ".join(names) or "none"
            raise InputError(where, f"gives the samples {', '.join(given.draws) or 'none'}; the table has {told}",
                             "give the same ones for every trial")  # fmt: skip
        return given._replace(trial=trial, draws={name: given.draws[name] for name in names})

    def add(self, trials: Sequence[Real], where: Sequence[str]) -> list[Real]:
        """Check trials in order and append all or none. They are on the disk on return.

        Raises:
            InputError: one of them may not come next.
            OSError: the file cannot be written.
        """
        known, after = len(self.rows), RealTable(self.path, self.names, list(self.rows))
        for given, place in zip(trials, where, strict=True):
            row = after.check(given, place)
            after.names = tuple(row.draws)
            after.rows.append(row)
        fresh = after.rows[known:]
        if fresh:
            self._append(after.names or (), fresh)
            self.names, self.rows = after.names, after.rows
        return fresh

    def _append(self, names: Sequence[str], rows: Sequence[Real]) -> None:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        new = not self.rows
        if new:
            check_names(names)
            writer.writerow([*HEAD, *names, SOURCE])
        for row in rows:
            drawn = [repr(float(row.draws[name])) for name in names]
            writer.writerow([row.trial, row.skill, int(row.success), row.failure, *drawn, REAL])
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with FolderLock(self.path.parent):
            if _size(self.path) != self.size:
                raise InputError(self.path, "was written by somebody else meanwhile", "enter the trial again")
            _repair(self.path, whole=not new)
            with self.path.open("ab") as file:
                file.write(text.getvalue().encode())
                file.flush()
                os.fsync(file.fileno())
            self.size = _size(self.path)
        if new:
            sync_folder(self.path.absolute().parent)


def check_names(names: Sequence[str]) -> None:
    """Refuse parameter names that the table reserves or that cannot be columns."""
    for name in names:
        if not name or name in (*HEAD, *POLICY, SOURCE, "stream", "seed", "reason"):
            raise InputError(
                "draws", f"{name!r} cannot be the name of a sampled value", "the table uses it; choose another"
            )


def table_path(target: Path) -> Path:
    """Return the table's path in a folder, or the file itself."""
    return target if target.suffix.lower() == ".csv" else target / RESULTS


def is_real(target: Path) -> bool:
    """Return whether a folder or file holds real trials rather than a campaign."""
    path = table_path(target)
    if not path.is_file():
        return False
    try:
        with path.open(encoding="utf-8") as file:
            head, first = (next(csv.reader([file.readline()]), []) for _ in range(2))
    except (OSError, UnicodeDecodeError, csv.Error):
        return False
    return SOURCE in head and (not first or first[-1:] == [REAL])


def open_real(target: Path) -> RealTable:
    """Return a table to append to. A torn last line is ignored, and cut off at the next write.

    Raises:
        InputError: the table is not of real trials, or has damaged rows, gaps or repeated trials.
    """
    path = table_path(target)
    if not path.is_file() or not path.stat().st_size:
        if (target / "campaign.toml").is_file() or (target / "question.json").is_file():
            raise InputError(target, "is a campaign's folder, whose trials are simulated", "enter into another folder")
        return RealTable(path)
    size = _size(path)
    start = path.read_bytes()[:200]
    if b"\n" not in start and start.startswith(",".join(HEAD).encode()[: len(start)]):
        return RealTable(path, size=size)  # a torn header, which is rewritten
    head, body, _ = cells_of(path)
    if tuple(head[: len(HEAD)]) != HEAD or head[-1] != SOURCE:
        raise InputError(path, "is no table of real trials", "enter into a new folder; other tables come in by --from")
    found = RealTable(path, tuple(head[len(HEAD) : -1]), size=size)
    if not real_or_simulated(path, head, body) and body:
        raise InputError(path, "holds simulated trials", "real ones never share a table with them: use a new folder")
    for number, cells in body:
        where = f"{path}: row {number}"
        row = dict(zip(head, cells, strict=True))
        draws = {name: number_of(where, name, row[name]) for name in found.names or ()}
        won = success_of(path, number, row["success"])
        given = Real(row["skill"], won, row["failure"], draws, whole(where, row["trial"]))
        found.rows.append(found.check(given, where))
    return found


def read_given(path: Path, skill: str | None = None) -> list[tuple[str, Real]]:
    """Return the real trials of a CSV in order, each with its place in the file.

    Args:
        path: columns `trial`, `success` and `skill` (or `policy`, `method`), optionally `failure`; the others are
            parameters.
        skill: for a file without such a column.

    Raises:
        InputError: the file is no such table, or a cell cannot be read.
    """
    head, body, _ = cells_of(path)
    for name in ("trial", "success"):
        if name not in head:
            raise InputError(path, f"has no column {name}", f"its columns are {', '.join(head)}")
    who = next((name for name in POLICY if name in head), None)
    if who is None and skill is None:
        raise InputError(path, "does not say which skill ran", "give it a column skill, or give --skill NAME")
    if body and SOURCE in head and not real_or_simulated(path, head, body):
        raise InputError(path, "holds trials that its column source does not call real", "give real trials alone")
    names = [name for name in head if name not in (*HEAD, who, SOURCE)]
    check_names(names)
    given = []
    for number, line in body:
        where, cells = f"{path}: row {number}", dict(zip(head, line, strict=True))
        draws = {name: number_of(where, name, cells[name]) for name in names}
        named = cells[who] if who else str(skill)
        won = success_of(path, number, cells["success"])
        given.append((where, Real(named, won, cells.get("failure", ""), draws, whole(where, cells["trial"]))))
    return given


def number_of(where: str, name: str, text: str) -> float:
    """Return a parameter's number.

    Raises:
        InputError: the text is not a finite number.
    """
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not math.isfinite(found) or abs(found) > LARGEST:
        raise InputError(where, f"{name} is {text!r}", "give a finite number for every sampled value of every trial")
    return found


def whole(where: str, text: str) -> int:
    """Return a trial's number.

    Raises:
        InputError: the text is not a whole number.
    """
    if not text.isdecimal() or len(text) > 9:
        raise InputError(where, f"trial is {text!r}", "number each skill's trials 0, 1, 2, ...")
    return int(text)


def _size(path: Path) -> int:
    return path.stat().st_size if path.is_file() else 0


def _repair(path: Path, whole: bool) -> None:
    """Cut off a torn last line, or complete one that only lacks its line end."""
    if not path.is_file():
        return
    if not whole:
        os.truncate(path, 0)
        return
    content = path.read_bytes()
    if not content or content.endswith(b"\n"):
        return
    begin = content.rfind(b"\n") + 1
    with path.open("r+b") as file:
        if begin and content[begin:].endswith(f",{REAL}".encode()):
            file.seek(0, os.SEEK_END)
            file.write(b"\n")
        else:
            file.truncate(begin)
