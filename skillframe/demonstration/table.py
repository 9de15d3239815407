"""Delimited text as named columns of numbers, with the file's row numbers for messages.

Rows are counted from 1. Unless the separator is a comma, a comma in a number is a decimal comma; a file that has
decimal points too is refused, since one of them may separate thousands. An empty cell is no value. Dates and times
become seconds.

Clocks as text and in two columns: dates with a time, times of day, and seconds beside nanoseconds.

Date and time are separated by T, a blank, a slash, an underscore, or one of them and blanks. Both may lack separators
(ISO 8601, basic form), and seconds are optional. A date counts as seconds since 1970 in UTC, or in its zone; a double
resolves 0.24 us there. A time of day counts from midnight, and a day is added where it runs back by more than half of
one.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError
from skillframe.frames import Float

BEGINS = re.compile(r'[\s"]*[-+]?[.,]?\d')
CONTROL = [chr(code) for code in range(32) if chr(code) not in "\t\n\r\f\v"]
"""Characters that no table holds, but nearly all binary files."""
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?|[-+]?\d+,")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of one file.

    Attributes:
        source: the file.
        names: of the header, or empty.
        values: (T, C) numbers, NaN in the columns of `text`.
        rows: (T,) row numbers in the file, from 1.
        text: columns that are not numbers, by index, with the first offending row and its cell.
        stamps: (T,) seconds of those columns of `text` that hold dates or times of day.
        blank: (T, C) which cells are empty, or None.
        single: numbers that the file holds once, by name.
    """

    source: str
    names: list[str]
    values: Float
    rows: NDArray[np.int64]
    text: dict[int, tuple[int, str]]
    stamps: dict[int, Float] = field(default_factory=dict)
    blank: NDArray[np.bool_] | None = None
    single: dict[str, float] = field(default_factory=dict)


def read_text(path: Path) -> str:
    """The text of a file.

    Raises:
        InputError: missing, a folder, empty, or binary.
    """
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except IsADirectoryError:
        raise InputError(path, "is a folder", "give a file") from None
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check its permissions") from None
    if not raw.strip():
        raise InputError(path, "is empty", "give a file with a header and rows")
    if raw[:2] in [bytes([0x80, version]) for version in range(2, 6)]:
        raise InputError(
            path, "is a pickle, which can run any program while it is read, and is never opened",
            "save its arrays with numpy.savez where it was made, and give the .npz",
        )  # fmt: skip
    if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        raise InputError(path, "is UTF-16 text", "save it as UTF-8")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # an old editor's degree sign, or no text
    if any(c in text for c in CONTROL):
        raise InputError(path, "is binary, not text", "give delimited text, or name a native file .npz")
    return text


def read_table(path: Path, header: bool | None = None) -> Table:
    """Read a delimited file as a table.

    Args:
        path: the file.
        header: whether the first row is a header; None detects it.

    Raises:
        InputError: not text, no rows, or rows of different length.
    """
    lines = [(i, line.strip()) for i, line in enumerate(read_text(path).splitlines(), start=1)]
    lines = [(i, line) for i, line in lines if line]
    delimiter = _delimiter(lines[0][1], lines[-1][1])
    names: list[str] = []
    if header is None:
        lines = lines[_preamble(lines, delimiter) :]
    while lines and lines[0][1][0] in "#%" and not header and not _looks_like_header(lines, delimiter):
        lines = lines[1:]
    if lines and (header or (header is None and not _is_numeric(lines[0][1], delimiter))):
        names = [name.strip().strip('"') for name in _split(lines[0][1].lstrip("#% "), delimiter)]
        lines = lines[1:]
        for _ in range(_more_names(lines, delimiter, len(names)) if header is None else 0):
            below = _split(lines[0][1].lstrip("#% "), delimiter)
            cells = [cell.strip().strip('"') for cell in below]
            names = [f"{name} {cell}".strip() for name, cell in zip(names, cells, strict=True)]
            lines = lines[1:]
    if not lines:
        raise InputError(
            path, "has a header but no rows" if names else "has no rows", "record again, or check the export"
        )
    width = len(names) or len(_split(lines[0][1], delimiter))
    for row, line in lines:
        count = line.count(delimiter) + 1 if delimiter else len(line.split())
        if count != width:
            reference = "the header" if names else f"row {lines[0][0]}"
            raise InputError(
                f"{path}: row {row}", f"has {count} values, {reference} has {width}",
                "rows must be of one length; remove or fix that row (a last row like this is a truncated file)",
            )  # fmt: skip
    return _table(str(path), names, [line for _, line in lines], delimiter, np.array([i for i, _ in lines]))


def table_of_text(path: Path, options: Mapping[str, Any]) -> Table:
    """A delimited file as a table, for a proposal of settings. Arguments as for readers."""
    return read_table(path)


def _delimiter(first: str, row: str) -> str | None:
    """The separator of a row of data, or None for blanks and tabs.

    A cell may hold blanks (a date and its time) if the file's first row has as many cells and no number among them.
    """
    for candidate in (";", ",", "\t"):
        named = first.count(candidate) == row.count(candidate) and not _is_numeric(first, candidate)
        if candidate in row and (named or not any(len(cell.split()) > 1 for cell in row.split(candidate))):
            return candidate
    return None


def _is_data(line: str, delimiter: str | None) -> bool:
    return any(BEGINS.match(field) for field in _split(line, delimiter))


def _preamble(lines: list[tuple[int, str]], delimiter: str | None) -> int:
    """Number of rows above a header, which are shorter: version, name, or groups of columns."""
    # 40 rows are searched: motion capture writes 7 above the header, data loggers about 25
    counts = [len(_split(line, delimiter)) for _, line in lines[:42]]
    first = counts.index(counts[-1])
    header = not _is_data(lines[first][1], delimiter) and set(counts[first:]) == {counts[-1]}
    more = header and len(counts) > first + 1
    return first if more and any(_is_data(line, delimiter) for _, line in lines[first + 1 :]) else 0


def _more_names(lines: list[tuple[int, str]], delimiter: str | None, width: int) -> int:
    """Number of rows below a header that belong to it: axes below bodies, units below names."""
    for count, (_, line) in enumerate(lines):
        if _is_data(line, delimiter) or len(_split(line, delimiter)) != width or count > 3:
            return count if count <= 3 and _is_data(line, delimiter) else 0
    return 0


def _split(line: str, delimiter: str | None) -> list[str]:
    return line.split(delimiter)


def _looks_like_header(lines: list[tuple[int, str]], delimiter: str | None) -> bool:
    """Whether a commented row names the columns of the next row ("%time,x,y" of a topic's export)."""
    names = _split(lines[0][1].lstrip("#% "), delimiter)
    following = next((line for _, line in lines[1:] if line[0] not in "#%"), "")
    same = len(names) == len(_split(following, delimiter)) if following else len(names) > 1
    return same and not _is_numeric(lines[0][1].lstrip("#% "), delimiter)


def _is_numeric(line: str, delimiter: str | None) -> bool:
    return any(_number(field) is not None for field in _split(line, delimiter))


def _number(field: str) -> float | None:
    """The number in a cell, perhaps in quotes. Notation of Python alone (1_000, digits of other scripts) is none."""
    field = field.strip().strip('"')
    try:
        return float(field) if field.isascii() and "_" not in field else None
    except ValueError:
        return None


def _table(source: str, names: list[str], lines: list[str], delimiter: str | None, rows: NDArray[np.int64]) -> Table:
    """Parse rows by numpy, or column by column if that fails."""
    if all(line.isascii() and "_" not in line for line in lines):
        try:
            return Table(
                source=source, names=names, values=np.loadtxt(lines, delimiter=delimiter, comments=None, ndmin=2),
                rows=rows, text={},
            )  # fmt: skip
        except ValueError:
            pass
    cells = [
        [cell.strip().strip('"') for cell in column]
        for column in zip(*(_split(line, delimiter) for line in lines), strict=True)
    ]
    if delimiter != ",":
        cells = _with_points(source, cells, rows)
    values, text = np.empty((len(lines), len(cells))), dict[int, tuple[int, str]]()
    for j, column in enumerate(cells):
        numbers = [_number(cell) if cell else np.nan for cell in column]
        values[:, j] = [np.nan if number is None else number for number in numbers]
        if None in numbers:
            word = numbers.index(None)
            text[j] = (int(rows[word]), column[word])
    stamps = {j: found for j in text if (found := seconds(cells[j])) is not None}
    blank = np.array([[not cell for cell in column] for column in cells]).T
    return Table(
        source=source, names=names, values=values, rows=rows, text=text, stamps=stamps,
        blank=blank if blank.any() else None,
    )  # fmt: skip


def _with_points(source: str, cells: list[list[str]], rows: NDArray[np.int64]) -> list[list[str]]:
    """Columns of cells with decimal commas replaced by points.

    Raises:
        InputError: the file has numbers with commas and others with points.
    """
    commas = [[bool(DECIMAL_COMMA.fullmatch(cell)) for cell in column] for column in cells]
    if not any(map(any, commas)):
        return cells
    for j, column in enumerate(cells):
        for i, cell in enumerate(column):
            if "." in cell and _number(cell) is not None:
                raise InputError(
                    f"{source}: row {rows[i]}, column {j + 1}", f"has a decimal point ({cell}), other cells a comma",
                    "export it again with one decimal sign and without separators of thousands",
                )  # fmt: skip
    return [
        [cell.replace(",", ".") if comma else cell for cell, comma in zip(column, which, strict=True)]
        for column, which in zip(cells, commas, strict=True)
    ]


BETWEEN, CLOCK = r" ?[Tt /_,-] ?", r"(\d\d?):(\d\d)(?::(\d\d)([.,:]\d+)?)?"
ZONE = r" ?([Zz]|UTC|GMT|[-+]\d\d(?::?\d\d)?)?"
DATE = re.compile(rf"(\d{{4}})([-/._])(\d\d?)\2(\d\d?){BETWEEN}{CLOCK}{ZONE}")
BASIC = re.compile(rf"(\d{{4}})()(\d\d)(\d\d)[Tt _-](\d\d)(\d\d)(\d\d)([.,]\d+)?{ZONE}")
DAY_FIRST = re.compile(rf"(\d\d?)\.(\d\d?)\.(\d{{4}}){BETWEEN}{CLOCK}")
TIME = re.compile(CLOCK)


def seconds(cells: Sequence[str]) -> Float | None:
    """Seconds (T,) of dates or times of day, one per cell. None if one of them is neither, or no valid date."""
    try:
        found = [_second(cell) for cell in cells]
    except ValueError:
        return None
    time = np.array([second for second, _ in found])
    if any(dated for _, dated in found):
        return time if all(dated for _, dated in found) else None
    return time + 86400.0 * np.concatenate([[0.0], np.cumsum(np.diff(time) < -86400.0 / 2.0)])


def _second(cell: str) -> tuple[float, bool]:
    """Seconds of one cell, and whether it has a date. Raises `ValueError` if it is neither."""
    if match := DATE.fullmatch(cell) or BASIC.fullmatch(cell):
        year, _, month, day, hour, minute, second, part, zone = match.groups()
    elif match := DAY_FIRST.fullmatch(cell):
        (day, month, year, hour, minute, second, part), zone = match.groups(), None
    elif (match := TIME.fullmatch(cell)) and match[3]:
        return 3600.0 * int(match[1]) + 60.0 * int(match[2]) + int(match[3]) + _part(match[4]), False
    else:
        raise ValueError(cell)
    date = datetime(int(year), int(month), int(day), int(hour), int(minute), int(second or 0), tzinfo=UTC)
    return date.timestamp() - _east(zone or "") + _part(part), True


def _east(zone: str) -> float:
    digits = zone[1:].replace(":", "") if zone[:1] in ("+", "-") else ""
    if not digits:
        return 0.0
    return (-60.0 if zone[0] == "-" else 60.0) * (60 * int(digits[:2]) + int(digits[2:] or 0))


def _part(text: str | None) -> float:
    return float(f".{text[1:]}") if text else 0.0
