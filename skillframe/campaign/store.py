"""The rows of a campaign, kept so that a kill at any moment loses at most the trials then running.

`rows.jsonl` is written by one process, a line per row; the rows of a chunk go to the disk in one write and are synced
(a power cut loses no more than that chunk). Its first line names the campaign by its hash, and every line ends with the
CRC-32 of what stands before it, which catches damage and careless edits, not a forger. A torn last line is cut off
when the file is opened. `results.csv` is written from it, sorted by trial and skill, so it does not depend on the order
in which chunks end; whole or not at all.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skillframe.campaign.rows import LEFT_OUT, Row, absent, cell, columns, decode, encode
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.verify import FIX, KEYS, KINDS, Line, check_rows, check_shape
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import parse_json

ROWS, RESULTS = "rows.jsonl", "results.csv"
FORMAT, VERSION = "skillframe.campaign", 1
ROWS_VERSION = 2
BINARY = getattr(os, "O_BINARY", 0)  # Windows would turn line ends into two bytes otherwise
"""1 had no checksums; its files are read, and said to be so."""
RAN_ON = "ran_on"
"""Key of a line that says in which of the noted environments its row ran."""
Done = dict[tuple[int, str], Row]
Environment = Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """What `rows.jsonl` holds.

    Attributes:
        lines: the stored rows.
        sessions: what was noted about each process that wrote here.
        unchecked: how many lines carry no checksum, as in files of skillframe 0.1.
    """

    lines: tuple[Line, ...] = ()
    sessions: tuple[dict[str, Any], ...] = ()
    unchecked: int = 0

    @property
    def done(self) -> Done:
        """The stored rows by (trial, skill)."""
        return {(line.row["trial"], line.row["skill"]): line.row for line in self.lines}

    @property
    def environments(self) -> list[Environment]:
        """Where rows ran, by the number that their lines give."""
        return [session[RAN_ON] for session in self.sessions if RAN_ON in session]


class RowLog:
    """The open `rows.jsonl` of a campaign. Use it as a context manager, under the folder's lock.

    Attributes:
        done: the stored rows by (trial, skill).
        ran_on: the number of the environment in which a row ran, as far as it is known.
        sessions: what was noted about each process that wrote here.
        unchecked: lines without a checksum that were read.

    Raises:
        InputError: on construction, if the file is of another campaign, or its rows are not what `spec` draws.
    """

    def __init__(self, folder: Path, campaign: str, spec: CampaignSpec | None = None) -> None:
        self._path = folder / ROWS
        repair_tail(self._path)
        found = read_content(folder, campaign, spec)
        self.done, self.sessions, self.unchecked = found.done, list(found.sessions), found.unchecked
        self.ran_on = {(x.row["trial"], x.row["skill"]): x.ran_on for x in found.lines if x.ran_on is not None}
        self.environments = found.environments
        self._descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | BINARY, 0o666)
        if os.fstat(self._descriptor).st_size == 0:
            self._write([{"format": FORMAT, "version": ROWS_VERSION, "campaign": campaign}])

    def append(self, rows: Iterable[Row], environment: Environment | None = None) -> list[Row]:
        """Store rows, and where they ran. Returns those that are new (a stored trial keeps its first row)."""
        fresh = [row for row in rows if (row["trial"], row["skill"]) not in self.done]
        where = {} if environment is None or not fresh else {RAN_ON: self._number(environment)}
        self._write([{key: encode(value) for key, value in row.items()} | where for row in fresh])
        self.done |= {(row["trial"], row["skill"]): row for row in fresh}  # before the sync, where Ctrl-C may come
        if where:
            self.ran_on |= {(row["trial"], row["skill"]): where[RAN_ON] for row in fresh}
        self._sync()
        return fresh

    def _number(self, environment: Environment) -> int:
        """The number under which an environment is noted. A new one is noted now."""
        if environment not in self.environments:
            self.note({RAN_ON: dict(environment)})
            self.environments.append(environment)
        return self.environments.index(environment)

    def note(self, session: Mapping[str, Any]) -> None:
        """Store a note about this session (environment, workers, wall time)."""
        self._write([{"session": session}])
        self.sessions.append(dict(session))
        self._sync()

    def _write(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Append lines. Where that fails, the file is as it was.

        Raises:
            OSError: `filename` is the file.
        """
        content = b"".join(map(_line, records))
        size = os.fstat(self._descriptor).st_size
        try:
            written = 0
            while written < len(content):
                written += os.write(self._descriptor, content[written:])
        except OSError as error:
            with suppress(OSError):
                os.ftruncate(self._descriptor, size)
            raise type(error)(error.errno, error.strerror, str(self._path)) from None

    def _sync(self) -> None:
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            raise type(error)(error.errno, error.strerror, str(self._path)) from None

    def in_place(self) -> bool:
        """Whether the file that is written is still the one under its name: the folder was not moved or deleted."""
        with suppress(OSError):
            return os.path.samestat(os.fstat(self._descriptor), self._path.stat())
        return False

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)

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


def read_content(folder: Path, campaign: str | None = None, spec: CampaignSpec | None = None) -> Content:
    """What `rows.jsonl` holds. A torn last line is left out.

    Args:
        folder: the campaign's folder.
        campaign: the hash that the file must carry; None to take any.
        spec: the campaign that the rows are held against; None trusts them.

    Raises:
        InputError: not a campaign's rows, of another campaign, or damaged or changed before the last line.
    """
    path = folder / ROWS
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return Content()
    texts = content.split(b"\n")[:-1]
    signed = [_is_intact(text) for text in texts]
    records = [
        _record(path, number, text, intact)
        for number, (text, intact) in enumerate(zip(texts, signed, strict=True), start=1)
    ]
    if not records:
        return Content()
    unchecked = signed.count(None)
    if _check_header(path, records[0], campaign) >= ROWS_VERSION and unchecked:
        raise InputError(f"{path}: line {1 + signed.index(None)}", "has lost its checksum", FIX)
    lines = tuple(
        _row(path, n, record, spec) for n, record in enumerate(records[1:], start=2) if "session" not in record
    )
    _check_twice(path, lines)
    if spec is not None:
        check_rows(path, spec, lines)
    return Content(
        lines=lines, sessions=tuple(_session(path, n, r) for n, r in enumerate(records, 1) if "session" in r),
        unchecked=unchecked,
    )  # fmt: skip


def _line(record: Mapping[str, Any]) -> bytes:
    """A record as a line that ends with the checksum of what stands before it."""
    text = json.dumps(record, allow_nan=False, ensure_ascii=False).encode()[:-1]
    return b'%s, "crc32": "%08x"}\n' % (text, zlib.crc32(text))


def _is_intact(line: bytes) -> bool | None:
    """Whether a line is as it was written. None if it carries no checksum."""
    found = re.search(rb', "crc32": "([0-9a-f]{8})"\}$', line)
    return None if found is None else zlib.crc32(line[: found.start()]) == int(found[1], 16)


def _record(path: Path, number: int, line: bytes, intact: bool | None) -> Row:
    where, again = f"{path}: line {number}", "delete that line, its trial will run again"
    try:
        record = parse_json(line, where, again)
    except InputError as error:
        raise InputError(where, f"is damaged ({error.problem})", again) from None
    if not isinstance(record, dict):
        raise InputError(where, "is damaged", again)
    if intact is False:
        raise InputError(where, "was changed after it was written (its checksum does not fit)", FIX)
    record.pop("crc32", None)
    return record


def _row(path: Path, number: int, record: Row, spec: CampaignSpec | None) -> Line:
    ran_on = record.pop(RAN_ON, None)
    where = f"{path}: line {number}"
    try:
        row = decode(record)
    except ValueError as error:
        raise InputError(where, str(error), FIX) from None
    check_shape(where, row, KINDS if spec is not None else KEYS)
    return Line(number, row, ran_on if isinstance(ran_on, int) else None)


def _check_twice(path: Path, lines: Sequence[Line]) -> None:
    seen: dict[tuple[int, str], int] = {}
    for line in lines:
        first = seen.setdefault((line.row["trial"], line.row["skill"]), line.number)
        if first != line.number:
            problem = f"is a second row of trial {line.row['trial']} of {line.row['skill']} (the first is line {first})"
            raise InputError(f"{path}: line {line.number}", problem, FIX)


def _session(path: Path, number: int, record: Row) -> dict[str, Any]:
    session = record["session"]
    kinds: tuple[tuple[str, Any, Any], ...] = (
        ("environment", dict, {}), (RAN_ON, dict, {}), ("wall_s", (int, float), 0.0),
    )  # fmt: skip
    if not isinstance(session, dict) or not all(isinstance(session.get(k, absent), t) for k, t, absent in kinds):
        raise InputError(f"{path}: line {number}", "is no note of a session", "delete that line")
    return session


def _check_header(path: Path, header: Row, campaign: str | None) -> int:
    """The file's version."""
    version = header.get("version", 0)
    if header.get("format") != FORMAT or not isinstance(version, int):
        raise InputError(f"{path}: line 1", "is not the head of a campaign's rows", "start again in a new folder")
    if version > ROWS_VERSION:
        raise InputError(f"{path}: line 1", f"version {version} is newer than {ROWS_VERSION}", "update skillframe")
    if campaign is not None and header.get("campaign") != campaign:
        raise InputError(
            path, f"its rows are of campaign {str(header.get('campaign'))[:12]}, but the files beside it now make "
            f"{campaign[:12]}", "put campaign.toml, skills and robot back as they were, or start again with --out",
        )  # fmt: skip
    return version


def ordered(
    spec: CampaignSpec, rows: Iterable[Row], stop_after: int | None = None, left: Mapping[str, int] | None = None
) -> list[Row]:
    """Rows by trial, then by skill, without those after the trial at which the campaign stopped.

    Args:
        spec: the campaign.
        rows: all there are.
        stop_after: the last trial of a campaign that stopped early.
        left: trials of the skills that a race left out. Their rows beyond are dropped, and the others say so.
    """
    order, gone = {label: i for i, label in enumerate(spec.labels)}, left or {}
    kept = (row for row in rows if stop_after is None or row["trial"] <= stop_after)
    raced = (row for row in kept if row["trial"] < gone.get(row["skill"], spec.trials))
    marked = (row | {LEFT_OUT: gone[row["skill"]]} if row["skill"] in gone else row for row in raced)
    return sorted(marked, key=lambda row: (row["trial"], order[row["skill"]]))


def write_results(folder: Path, spec: CampaignSpec, rows: Sequence[Row]) -> None:
    """Write results.csv from ordered rows."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = columns(spec, rows)
    writer.writerow(names)
    writer.writerows([cell(row.get(name, absent(name))) for name in names] for row in rows)
    write_whole(folder / RESULTS, text.getvalue().encode())
