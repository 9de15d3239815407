"""Tables as other tools save them: decimal commas, dates, clocks in two columns, sparse merged exports."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from skillframe.demonstration.columns import CANONICAL
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration

Cells = list[list[str]]
START = 1_700_000_000


def save(path: Path, cells: Cells, delimiter: str = ",") -> Path:
    path.write_text("\n".join(delimiter.join(row) for row in cells) + "\n")
    return path


def same(found: Demonstration, demo: Demonstration, clock: float = 0.0) -> None:
    """Equal to the last bit, but for a clock that a format rounds."""
    assert np.abs(found.time - found.time[0] - demo.time).max() <= clock
    for name in ("position", "quaternion", "wrench"):
        np.testing.assert_array_equal(getattr(found, name), getattr(demo, name))


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_a_decimal_comma_is_read_where_cells_are_not_separated_by_commas(
    tmp_path: Path, demo: Demonstration, rows: Cells, delimiter: str
) -> None:
    cells = [rows[0], *([cell.replace(".", ",") for cell in row] for row in rows[1:])]
    same(read_demonstration(save(tmp_path / "demo.csv", cells, delimiter)), demo)


@pytest.mark.parametrize(
    ("form", "zone"),
    [
        ("%Y-%m-%d %H:%M:%S.%f", ""),
        ("%Y/%m/%dT%H:%M:%S.%f", "Z"),
        ("%d.%m.%Y %H:%M:%S,%f", ""),
        ("%Y/%m/%d/%H:%M:%S.%f", ""),
        ("%Y%m%dT%H%M%S.%f", "+00:00"),
        ("%Y-%m-%d_%H:%M:%S.%f", ""),
        ("%Y-%m-%d %H:%M:%S.%f", " UTC"),
    ],
)
def test_dates_are_seconds_since_1970(tmp_path: Path, demo: Demonstration, rows: Cells, form: str, zone: str) -> None:
    moments = [datetime.fromtimestamp(START, UTC) + timedelta(milliseconds=10 * i) for i in range(len(demo))]
    cells = [rows[0], *([m.strftime(form) + zone, *row[1:]] for m, row in zip(moments, rows[1:], strict=True))]
    found = read_demonstration(save(tmp_path / "demo.csv", cells, ";"))
    same(found, demo, clock=1e-6)  # a double resolves 0.24 us at 1.7e9 s
    assert found.time[0] == START


def test_a_time_zone_counts(tmp_path: Path, rows: Cells) -> None:
    cells = [
        rows[0],
        *([f"2026-01-01T10:00:{i // 100:02d}.{i % 100:02d}+02:00", *row[1:]] for i, row in enumerate(rows[1:])),
    ]
    found = read_demonstration(save(tmp_path / "demo.csv", cells))
    assert found.time[0] == datetime(2026, 1, 1, 8, tzinfo=UTC).timestamp()


def test_a_time_of_day_goes_on_past_midnight(tmp_path: Path, demo: Demonstration, rows: Cells) -> None:
    moments = [datetime(2026, 1, 1, 23, 59, 59) + timedelta(milliseconds=10 * i) for i in range(len(demo))]
    cells = [rows[0], *([f"{m:%H:%M:%S.%f}", *row[1:]] for m, row in zip(moments, rows[1:], strict=True))]
    same(read_demonstration(save(tmp_path / "demo.csv", cells)), demo, clock=1e-9)


def test_a_day_that_no_calendar_has_is_a_word(tmp_path: Path, rows: Cells) -> None:
    cells = [rows[0], *(["2026-02-30 10:00:00", *row[1:]] for row in rows[1:])]
    with pytest.raises(InputError, match=r"row 2, column t: is not a number .'2026-02-30 10:00:00'"):
        read_demonstration(save(tmp_path / "demo.csv", cells))


def test_seconds_and_nanoseconds_in_two_columns_are_one_clock(tmp_path: Path, demo: Demonstration, rows: Cells) -> None:
    stamps = [divmod(START * 10**9 + 10_000_000 * i + 123_456_789, 10**9) for i in range(len(demo))]
    cells = [["secs", "nsecs", *rows[0][1:]]]
    cells += [[str(s), str(ns), *row[1:]] for (s, ns), row in zip(stamps, rows[1:], strict=True)]
    path = save(tmp_path / "demo.csv", cells)
    found = read_demonstration(path, columns=",".join(cells[0]))
    same(found, demo, clock=1e-6)  # a double resolves 0.24 us at 1.7e9 s
    assert found.time[0] == pytest.approx(START + 0.123456789, abs=1e-6)
    assert not found.extra


def sparse(rows: Cells, every: int) -> Cells:
    """The wrench in each row but those of the pose, which stands in some rows alone, as an export of two topics."""
    cells = [rows[0]]
    for i, row in enumerate(rows[1:]):
        cells.append([row[0], *row[1:8], *([""] * 6)] if i % every == 0 else [row[0], *([""] * 7), *row[8:]])
    return cells


def test_a_sparse_export_is_joined_on_time(tmp_path: Path, demo: Demonstration, rows: Cells) -> None:
    found = read_demonstration(save(tmp_path / "demo.csv", sparse(rows, 4)))
    inside = [i for i in range(len(demo)) if i % 4 and i < 196]  # the wrench's samples that poses surround
    np.testing.assert_array_equal(found.time, demo.time[inside])
    np.testing.assert_array_equal(found.wrench, demo.wrench[inside])
    assert np.abs(found.position - demo.position[inside]).max() < 1e-12  # the pose moves along a line
    assert "pose stands in 50 rows and wrench in 150 of 200: joined on time" in found.meta["reading"]


def test_a_cell_that_is_missing_in_a_sparse_export_is_refused(tmp_path: Path, rows: Cells) -> None:
    cells = sparse(rows, 4)
    cells[1][CANONICAL.index("pz")] = ""
    with pytest.raises(InputError, match="row 2, column pz: is empty, while other cells"):
        read_demonstration(save(tmp_path / "demo.csv", cells))


def test_the_wrench_of_one_table_is_shifted_in_time(tmp_path: Path, demo: Demonstration, rows: Cells) -> None:
    found = read_demonstration(save(tmp_path / "demo.csv", rows), wrench_shift=-0.1)
    np.testing.assert_allclose(found.wrench, demo.wrench[10:], atol=1e-9)  # ten samples of 10 ms, interpolated
    np.testing.assert_array_equal(found.position, demo.position[:-10])
