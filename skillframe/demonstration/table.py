"""Delimited text as named columns of numbers, with the file's row numbers kept for messages.

Rows are counted as an editor counts lines, from 1. Commas, semicolons, tabs and blanks are told apart by the first
rows. Where cells are not separated by commas, a comma in a number is a decimal comma. A file that has decimal points
too is refused, because one of them may part thousands. An empty cell is no value. Dates and times become seconds.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.stamps import seconds
from skillframe.errors import InputError
from skillframe.frames import Float

CONTROL = [chr(code) for code in range(32) if chr(code) not in "\t\n\r\f\v"]
"""Characters that no table holds; random bytes nearly always do."""
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?|[-+]?\d+,")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of one file.

    Attributes:
        source: the file.
        names: of the header; empty where there is none.
        values: (T, C) numbers, NaN where `text` says that a column holds words.
        rows: (T,) row numbers in the file, from 1.
        text: indices of columns that are not numbers, with the first offending row and what it says.
        stamps: (T,) seconds of those columns of `text` that hold a date or a time of day in every row.
        blank: (T, C) which cells are empty; None where none is.
    """

    source: str
    names: list[str]
    values: Float
    rows: NDArray[np.int64]
    text: dict[int, tuple[int, str]]
    stamps: dict[int, Float] = field(default_factory=dict)
    blank: NDArray[np.bool_] | None = None


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
    if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        raise InputError(path, "is UTF-16 text", "save it as UTF-8")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # a degree sign of an old editor, or not text at all
    if any(c in text for c in CONTROL):
        raise InputError(path, "is binary, not text", "give delimited text, or name a native file .npz")
    return text


def read_table(path: Path, header: bool | None = None) -> Table:
    """A delimited file as a table.

    Args:
        path: the file.
        header: whether the first row is a header; None to see for itself.

    Raises:
        InputError: not text, no rows, or rows of different length.
    """
    lines = [(i, line.strip()) for i, line in enumerate(read_text(path).splitlines(), start=1)]
    lines = [(i, line) for i, line in lines if line]
    delimiter = _delimiter(lines[0][1], lines[-1][1])
    names: list[str] = []
    while lines and lines[0][1][0] in "#%" and not header and not _looks_like_header(lines, delimiter):
        lines = lines[1:]
    if lines and (header or (header is None and not _is_numeric(lines[0][1], delimiter))):
        names = [name.strip().strip('"') for name in _split(lines[0][1].lstrip("#% "), delimiter)]
        lines = lines[1:]
    if not lines:
        raise InputError(
            path, "has a header but no rows" if names else "has no rows", "record again, or check the export"
        )
    _refuse_ragged(path, names, lines, delimiter)
    return _table(str(path), names, [line for _, line in lines], delimiter, np.array([i for i, _ in lines]))


def table_of_text(path: Path, options: Mapping[str, Any]) -> Table:
    """A delimited file as a table, for what is proposed of it. Takes what readers take."""
    return read_table(path)


def _delimiter(first: str, row: str) -> str | None:
    """The separator of a row of data, or None for runs of blanks and tabs.

    A cell may hold blanks (a date and its time) where the file's first row has as many cells and no number among them.
    """
    for candidate in (";", ",", "\t"):
        named = first.count(candidate) == row.count(candidate) and not _is_numeric(first, candidate)
        if candidate in row and (named or not any(len(cell.split()) > 1 for cell in row.split(candidate))):
            return candidate
    return None


def _split(line: str, delimiter: str | None) -> list[str]:
    return line.split(delimiter)


def _looks_like_header(lines: list[tuple[int, str]], delimiter: str | None) -> bool:
    """Whether a commented row names the columns of the row after it ("%time,x,y" of a topic's export)."""
    names = _split(lines[0][1].lstrip("#% "), delimiter)
    following = next((line for _, line in lines[1:] if line[0] not in "#%"), "")
    same = len(names) == len(_split(following, delimiter)) if following else len(names) > 1
    return same and not _is_numeric(lines[0][1].lstrip("#% "), delimiter)


def _is_numeric(line: str, delimiter: str | None) -> bool:
    """Whether a row is data: at least one field of it is a number."""
    return any(_number(field) is not None for field in _split(line, delimiter))


def _number(field: str) -> float | None:
    """The number in a cell, perhaps in quotes. What only Python calls one (1_000, other scripts' digits) is none."""
    field = field.strip().strip('"')
    try:
        return float(field) if field.isascii() and "_" not in field else None
    except ValueError:
        return None


def _refuse_ragged(path: Path, names: list[str], lines: list[tuple[int, str]], delimiter: str | None) -> None:
    width = len(names) or len(_split(lines[0][1], delimiter))
    for row, line in lines:
        count = line.count(delimiter) + 1 if delimiter else len(line.split())
        if count != width:
            reference = "the header" if names else f"row {lines[0][0]}"
            raise InputError(
                f"{path}: row {row}", f"has {count} values, {reference} has {width}",
                "rows must be of one length; remove or fix that row (a last row like this is a truncated file)",
            )  # fmt: skip


def _table(source: str, names: list[str], lines: list[str], delimiter: str | None, rows: NDArray[np.int64]) -> Table:
    """The numbers, and which columns hold words: numpy's own parser first, column by column where it fails."""
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
        values[:, j], word = _column_of(column)
        if word is not None:
            text[j] = (int(rows[word]), column[word])
    stamps = {j: found for j in text if (found := seconds(cells[j])) is not None}
    blank = np.array([[not cell for cell in column] for column in cells]).T
    return Table(
        source=source, names=names, values=values, rows=rows, text=text, stamps=stamps,
        blank=blank if blank.any() else None,
    )  # fmt: skip


def _column_of(cells: Sequence[str]) -> tuple[Float, int | None]:
    """Numbers of one column, NaN where there is none, and the first cell that holds a word."""
    found = [_number(cell) if cell else np.nan for cell in cells]
    word = next((i for i, number in enumerate(found) if number is None), None)
    return np.array([np.nan if number is None else number for number in found]), word


def _with_points(source: str, cells: list[list[str]], rows: NDArray[np.int64]) -> list[list[str]]:
    """Columns of cells whose decimal commas are points.

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
