"""The rows of a campaign, stored so that a kill loses at most the trials then running.

One process writes `rows.jsonl`, a line per row; the rows of a chunk are written at once and synced. The first line
holds the campaign's hash; each line ends with the CRC-32 of the text before it, which detects damage but no forgery.
What rows share stands in a line before them (`packed`). Files of older versions keep their version, with rows as JSON
objects. `results.csv` is written from it as a whole, sorted by trial and skill.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

from skillframe.campaign.row_format import LAYOUT, Key, PackedRows, RowLayout, RowView, line_of, row_of
from skillframe.campaign.rows import LEFT_OUT, Row, cell_of, columns, decode, encode
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.verify import FIX, KEYS, KINDS, Line, check_rows, check_shape
from skillframe.errors import InputError
from skillframe.files import writing_whole
from skillframe.files.documents import parse_json

ROWS, RESULTS = "rows.jsonl", "results.csv"  #: files of the trials: as they end, and in order
FORMAT, VERSION = "skillframe.campaign", 1
ROWS_VERSION = 3
"""Version 1 had no checksums; 2 had a JSON object with all columns per row."""
BLOCK = 4096
"""Rows checked against the campaign's samples at a time; each check makes the Sobol sequence anew."""
RAN_ON = "ran_on"
Done = Mapping[Key, Row]
Environment = Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """Content of `rows.jsonl`.

    Attributes:
        done: the stored rows by (trial, skill).
        sessions: notes of each process that wrote here.
        unchecked: number of lines without a checksum.
        version: of the file.
        layouts: one more than the largest number of a layout.
    """

    done: PackedRows = field(default_factory=PackedRows)
    sessions: tuple[dict[str, Any], ...] = ()
    unchecked: int = 0
    version: int = ROWS_VERSION
    layouts: int = 0

    @property
    def environments(self) -> list[Environment]:
        """Where rows ran, by number."""
        return [session[RAN_ON] for session in self.sessions if RAN_ON in session]


class RowLog:
    """Context manager of a campaign's open `rows.jsonl`. Requires the folder's lock.

    Attributes:
        done, sessions, unchecked: as in `Content`.

    Raises:
        InputError: on construction, if the file is of another campaign, or its rows are not the samples of `spec`.
    """

    def __init__(self, folder: Path, campaign: str, spec: CampaignSpec | None = None) -> None:
        self._path = folder / ROWS
        repair_tail(self._path)
        found = read_content(folder, campaign, spec)
        self.done, self.sessions, self.unchecked = found.done, list(found.sessions), found.unchecked
        self._version, self._next, self._stated = found.version, found.layouts, dict[RowLayout, int]()
        self.environments = found.environments
        binary = getattr(os, "O_BINARY", 0)  # Windows would turn line ends into two bytes otherwise
        self._descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | binary, 0o666)
        if os.fstat(self._descriptor).st_size == 0:
            self._write([{"format": FORMAT, "version": ROWS_VERSION, "campaign": campaign}])

    def append(self, rows: Iterable[Row], environment: Environment | None = None) -> list[Row]:
        """Store rows and their environment. Returns the new ones. A stored trial keeps its first row."""
        fresh = [row for row in rows if (row["trial"], row["skill"]) not in self.done]
        ran_on = None
        if environment is not None and fresh:
            if environment not in self.environments:
                self.note({RAN_ON: dict(environment)})
                self.environments.append(environment)
            ran_on = self.environments.index(environment)
        self._write(self._records(fresh, ran_on))
        for row in fresh:  # before the sync, which Ctrl-C may interrupt
            self.done.add(row, ran_on)
        self._sync()
        return fresh

    def _records(self, rows: Sequence[Row], ran_on: int | None) -> Iterator[Mapping[str, Any]]:
        for row in rows:
            if self._version < 3:
                where = {} if ran_on is None else {RAN_ON: ran_on}
                yield {key: encode(value) for key, value in row.items()} | where
                continue
            layout = self.done.layout(row, ran_on)
            if layout not in self._stated:
                self._stated[layout] = self._next
                self._next += 1
                yield layout.record(self._stated[layout])
            yield line_of(self._stated[layout], layout, row)

    def note(self, session: Mapping[str, Any]) -> None:
        """Store a note about this session (environment, workers, wall time)."""
        self._write([{"session": session}])
        self.sessions.append(dict(session))
        self._sync()

    def _write(self, records: Iterable[Mapping[str, Any]]) -> None:
        """Append lines. On failure the file is restored.

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
            self._stated.clear()
            raise type(error)(error.errno, error.strerror, str(self._path)) from None

    def _sync(self) -> None:
        try:
            os.fsync(self._descriptor)
        except OSError as error:
            raise type(error)(error.errno, error.strerror, str(self._path)) from None

    def in_place(self) -> bool:
        """Whether the file is still under its name, and not moved or deleted with its folder."""
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
    """Remove a torn last line, which a killed process left."""
    with suppress(FileNotFoundError), path.open("r+b") as file:
        content = file.read()
        whole = content.rfind(b"\n") + 1
        if whole != len(content):
            file.truncate(whole)


def read_content(folder: Path, campaign: str | None = None, spec: CampaignSpec | None = None) -> Content:
    """Read `rows.jsonl`, without a torn last line.

    Args:
        folder: the campaign's folder.
        campaign: the required hash; None accepts any.
        spec: the campaign to check the rows against, or None.

    Raises:
        InputError: no campaign's rows, of another campaign, or damaged or changed before the last line.
    """
    path = folder / ROWS
    try:
        with path.open("rb") as file:
            return _Reader(path, campaign, spec).read(text[:-1] for text in file if text.endswith(b"\n"))
    except FileNotFoundError:
        return Content()


class _Reader:
    """Reads the lines of a file in blocks."""

    def __init__(self, path: Path, campaign: str | None, spec: CampaignSpec | None) -> None:
        self._path, self._campaign, self._spec = path, campaign, spec
        self._done, self._numbers = PackedRows(), list[int]()
        self._sessions: list[dict[str, Any]] = []
        self._layouts: dict[int, RowLayout] = {}
        self._early: list[tuple[int, Row]] = []
        self._block: list[Line] = []

    def read(self, texts: Iterable[bytes]) -> Content:
        """Read all lines."""
        version, unchecked = ROWS_VERSION, 0
        for number, text in enumerate(texts, start=1):
            found = re.search(rb', "crc32": "([0-9a-f]{8})"\}$', text)
            intact = None if found is None else zlib.crc32(text[: found.start()]) == int(found[1], 16)
            record = _record(self._path, number, text, intact)
            if number == 1:
                version = _check_header(self._path, record, self._campaign)
            if intact is None:
                if version >= 2:
                    raise InputError(f"{self._path}: line {number}", "has lost its checksum", FIX)
                unchecked += 1
            if number > 1:
                if "session" in record:
                    self._sessions.append(_session(self._path, number, record))
                elif LAYOUT not in record:
                    self._add(number, *_plain(self._path, number, record))
                elif "columns" in record:
                    self._state(number, record)
                elif type(record[LAYOUT]) is int and record[LAYOUT] in self._layouts:
                    self._add(number, *self._unpacked(number, record))
                else:  # the order of lines may have changed
                    self._early.append((number, record))
        for number, record in self._early:
            self._add(number, *self._unpacked(number, record))
        self._check_block()
        return Content(
            done=self._done, sessions=tuple(self._sessions), unchecked=unchecked, version=version,
            layouts=1 + max(self._layouts, default=-1),
        )  # fmt: skip

    def _state(self, number: int, record: Row) -> None:
        where, layout = f"{self._path}: line {number}", record[LAYOUT]
        if type(layout) is not int or layout < 0 or layout in self._layouts:
            raise InputError(where, f"states layout {layout!r}, which is no number or stated before", FIX)
        try:
            self._layouts[record[LAYOUT]] = RowLayout.from_record(record)
        except ValueError as error:
            raise InputError(where, str(error), FIX) from None

    def _unpacked(self, number: int, record: Row) -> tuple[Row, int | None]:
        where = f"{self._path}: line {number}"
        check_shape(where, record, {"trial": int})
        try:
            return row_of(record, self._layouts)
        except ValueError as error:
            raise InputError(where, str(error), FIX) from None

    def _add(self, number: int, row: Row, ran_on: int | None) -> None:
        where = f"{self._path}: line {number}"
        check_shape(where, row, KINDS if self._spec is not None else KEYS)
        if (row["trial"], row["skill"]) in self._done:
            first = self._numbers[list(self._done).index((row["trial"], row["skill"]))]
            problem = f"is a second row of trial {row['trial']} of {row['skill']} (the first is line {first})"
            raise InputError(where, problem, FIX)
        self._done.add(row, ran_on)
        self._numbers.append(number)
        self._block.append(Line(number, row))
        if len(self._block) == BLOCK:
            self._check_block()

    def _check_block(self) -> None:
        if self._spec is not None:
            check_rows(self._path, self._spec, self._block)
        self._block.clear()


def _line(record: Mapping[str, Any]) -> bytes:
    text = json.dumps(record, allow_nan=False, ensure_ascii=False, separators=(",", ":")).encode()[:-1]
    return b'%s, "crc32": "%08x"}\n' % (text, zlib.crc32(text))


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


def _plain(path: Path, number: int, record: Row) -> tuple[Row, int | None]:
    """A row stored before version 3, and the number of its environment."""
    ran_on = record.pop(RAN_ON, None)
    try:
        return decode(record), ran_on if isinstance(ran_on, int) else None
    except ValueError as error:
        raise InputError(f"{path}: line {number}", str(error), FIX) from None


def _session(path: Path, number: int, record: Row) -> dict[str, Any]:
    session = record["session"]
    kinds: tuple[tuple[str, Any, Any], ...] = (
        ("environment", dict, {}), (RAN_ON, dict, {}), ("wall_s", (int, float), 0.0),
    )  # fmt: skip
    if not isinstance(session, dict) or not all(isinstance(session.get(k, absent), t) for k, t, absent in kinds):
        raise InputError(f"{path}: line {number}", "is no note of a session", "delete that line")
    return session


def _check_header(path: Path, header: Row, campaign: str | None) -> int:
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
    spec: CampaignSpec, done: Done, stop_after: int | None = None, left: Mapping[str, int] | None = None
) -> Sequence[Row]:
    """Rows by trial, then by skill, up to the trial at which the campaign stopped."""
    order, gone = {label: i for i, label in enumerate(spec.labels)}, left or {}
    kept = (key for key in done if stop_after is None or key[0] <= stop_after)
    raced = (key for key in kept if key[0] < gone.get(key[1], spec.trials))

    def at(key: Key) -> Row:
        return done[key] | {LEFT_OUT: gone[key[1]]} if key[1] in gone else done[key]

    return RowView(at, sorted(raced, key=lambda key: (key[0], order[key[1]])))


def write_results(folder: Path, spec: CampaignSpec, rows: Sequence[Row]) -> None:
    """Write results.csv from ordered rows."""
    with (
        writing_whole(folder / RESULTS) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        _write_table(file, spec, rows)


def results_text(spec: CampaignSpec, rows: Sequence[Row]) -> str:
    """The content of results.csv."""
    text = io.StringIO(newline="")
    _write_table(text, spec, rows)
    return text.getvalue()


def _write_table(file: TextIO, spec: CampaignSpec, rows: Sequence[Row]) -> None:
    names = columns(spec, rows)
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([cell_of(row, name) for name in names] for row in rows)
