"""The rows of a campaign, kept so that a kill at any moment loses at most the trials then running.

`rows.jsonl` is written by one process, a line per row, flushed at once (a killed process loses nothing that was
flushed) and synced to disk per chunk (nor does a power cut lose more than that chunk). Its first line names the
campaign by its hash. A torn last line is cut off when the file is opened. `results.csv` is written from it, sorted by
trial and skill, so it does not depend on the order in which chunks end; whole or not at all.
"""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from skillframe.campaign.rows import Row, cell, check_row, columns, decode, encode
from skillframe.campaign.spec import CampaignSpec
from skillframe.documents import parse_json
from skillframe.errors import InputError

ROWS, RESULTS = "rows.jsonl", "results.csv"
FORMAT, VERSION = "skillframe.campaign", 1
Done = dict[tuple[int, str], Row]


class RowLog:
    """The open `rows.jsonl` of a campaign; use as a context manager, under the folder's lock.

    Attributes:
        done: the stored rows by (trial, skill).
        sessions: what was noted about each process that wrote here.

    Raises:
        InputError: on construction, if the file is of another campaign.
    """

    def __init__(self, folder: Path, campaign: str) -> None:
        path = folder / ROWS
        repair_tail(path)
        self.done, self.sessions = read_rows(folder, campaign)
        self._file: BinaryIO = path.open("ab")
        if self._file.tell() == 0:
            self._write({"format": FORMAT, "version": VERSION, "campaign": campaign})
            self._sync()

    def append(self, rows: Iterable[Row]) -> list[Row]:
        """Store rows; returns those that are new (a trial that is stored already keeps its first row)."""
        fresh = [row for row in rows if (row["trial"], row["skill"]) not in self.done]
        for row in fresh:
            self._write({key: encode(value) for key, value in row.items()})
            self.done[row["trial"], row["skill"]] = row
        self._sync()
        return fresh

    def note(self, session: Mapping[str, Any]) -> None:
        """Store a note about this session (environment, workers, wall time)."""
        self._write({"session": session})
        self.sessions.append(dict(session))
        self._sync()

    def _write(self, record: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(record, allow_nan=False, ensure_ascii=False).encode() + b"\n")
        self._file.flush()

    def _sync(self) -> None:
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> RowLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def repair_tail(path: Path) -> None:
    """Cut a file off after its last newline: what follows is the torn line of a process that was killed."""
    with suppress(FileNotFoundError), path.open("r+b") as file:
        content = file.read()
        whole = content.rfind(b"\n") + 1
        if whole != len(content):
            file.truncate(whole)


def read_rows(folder: Path, campaign: str | None = None) -> tuple[Done, list[dict[str, Any]]]:
    """Stored rows by (trial, skill), and the sessions' notes; a torn last line is left out.

    Args:
        folder: the campaign's folder.
        campaign: the hash that the file must carry; None to take any.

    Raises:
        InputError: not a campaign's rows, of another campaign, or damaged before the last line.
    """
    path = folder / ROWS
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return {}, []
    lines = content[: content.rfind(b"\n") + 1].splitlines()
    records = [_record(path, number, line) for number, line in enumerate(lines, start=1)]
    if records:
        _check_header(path, records[0], campaign)
    done: Done = {}
    for number, row in enumerate(records[1:], start=2):
        if "session" not in row:
            check_row(f"{path}: line {number}", row)
            done.setdefault((row["trial"], row["skill"]), decode(row))
    return done, [r["session"] for r in records if isinstance(r.get("session"), dict)]


def _record(path: Path, number: int, line: bytes) -> Row:
    where, again = f"{path}: line {number}", "delete that line, its trial will run again"
    try:
        record = parse_json(line, where, again)
    except InputError as error:
        raise InputError(where, f"is damaged ({error.problem})", again) from None
    if not isinstance(record, dict):
        raise InputError(where, "is damaged", again)
    return record


def _check_header(path: Path, header: Row, campaign: str | None) -> None:
    if header.get("format") != FORMAT:
        raise InputError(f"{path}: line 1", "is not the head of a campaign's rows", "start again in a new folder")
    version = header.get("version")
    if not isinstance(version, int) or version > VERSION:
        raise InputError(f"{path}: line 1", f"version {version!r:.40} is newer than {VERSION}", "update skillframe")
    if campaign is not None and header.get("campaign") != campaign:
        raise InputError(
            path, f"its rows are of campaign {str(header.get('campaign'))[:12]}, but the files beside it now make "
            f"{campaign[:12]}", "put campaign.toml, skills and robot back as they were, or start again with --out",
        )  # fmt: skip


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    with temporary.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def ordered(spec: CampaignSpec, rows: Iterable[Row], stop_after: int | None = None) -> list[Row]:
    """Rows by trial, then by skill; without those after the trial at which the campaign stopped."""
    order = {label: i for i, label in enumerate(spec.labels)}
    kept = (row for row in rows if stop_after is None or row["trial"] <= stop_after)
    return sorted(kept, key=lambda row: (row["trial"], order[row["skill"]]))


def write_results(folder: Path, spec: CampaignSpec, rows: Sequence[Row]) -> None:
    """Write results.csv from ordered rows."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = columns(spec)
    writer.writerow(names)
    writer.writerows([cell(row[name]) for name in names] for row in rows)
    write_text(folder / RESULTS, text.getvalue())
