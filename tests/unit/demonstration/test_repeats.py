"""Rows that share a stamp, sensors of three axes, what a join leaves out, and topics whose headers have no stamps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from skillframe.demonstration.assemble import spread
from skillframe.demonstration.columns import TORQUE
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.frames import Float

Cells = list[list[str]]
Write = Callable[..., Path]


def notes(demonstration: Demonstration) -> str:
    return " | ".join(demonstration.meta.get("reading", []))


def test_a_row_that_stands_twice_is_read_once_and_counted(demo: Demonstration, rows: Cells, write: Write) -> None:
    again = [row for i, row in enumerate(rows) for _ in range(3 if i in (40, 90) else 1)]
    found = read_demonstration(write(again))
    assert "4 samples stood twice" in notes(found)
    for name in ("time", "position", "wrench"):
        np.testing.assert_array_equal(getattr(found, name), getattr(demo, name))


def test_rows_that_differ_and_share_a_stamp_are_spread_until_the_next(
    demo: Demonstration, rows: Cells, write: Write
) -> None:
    for i in (40, 90, 91, 150):
        rows[i][0] = rows[i - 1][0]
    found = read_demonstration(write(rows))
    assert "4 samples had the stamp of the one before them: up to 3 of one stamp" in notes(found)
    np.testing.assert_allclose(found.time, demo.time, atol=1e-12)
    np.testing.assert_array_equal(found.wrench, demo.wrench)


def test_a_clock_that_runs_back_is_refused_where_rows_share_stamps_too(rows: Cells, write: Write) -> None:
    rows[40][0], rows[90][0] = rows[39][0], "0.005"
    with pytest.raises(InputError, match=r"row 91, column t: time runs back .0\.005 after 0\.88.; sort or remove"):
        read_demonstration(write(rows))


@pytest.mark.parametrize(
    ("true", "seen"),
    [
        (np.arange(1000) / 1000.0, 0.01),  # a clock of 10 ms under a log at 1 kHz
        (np.arange(1000) / 100.0 + 0.37, 1.0),  # a clock of whole seconds, begun in the middle of one
        (np.arange(500) / 500.0 + 1.7e9, 0.004),
        (np.r_[np.arange(300), np.arange(800, 1000)] / 100.0, 0.02),  # with a gap of 5 s
    ],
)
def test_the_stamps_of_a_coarse_clock_come_back_to_one_sample(true: Float, seen: float) -> None:
    stamps = np.floor(true / seen + 1e-6) * seen
    found, step = spread(stamps), float(np.median(np.diff(true)))
    assert np.all(np.diff(found) > 0.0)
    assert np.abs(found - true).max() <= 1.5 * step + 1e-6  # a stamp says no more than when its first sample was
    assert np.diff(found).max() <= max(np.diff(true).max(), 2.0 * step) + 2.0 * step


def test_stamps_that_nobody_shares_stay_to_the_bit() -> None:
    time = np.cumsum(np.random.default_rng(0).uniform(1e-4, 1e-2, size=200))
    assert spread(time) is time


def test_forces_without_torques_are_read_and_said_to_be_so(rows: Cells, write: Write, tmp_path: Path) -> None:
    path = write([row[:11] for row in rows])
    found = read_demonstration(path, wrench_point="0,0,0.2")
    assert "no torque was measured" in notes(found) and set(found.meta["unmeasured"]) == set(TORQUE)
    np.testing.assert_array_equal(found.wrench[:, 3:], 0.0)  # no lever makes a torque that nobody knows
    with pytest.raises(InputError, match=r"has no wrench .tz missing"):
        read_demonstration(write([row[:13] for row in rows], name="partly.csv"))
    wrench = write([[row[0], *row[8:11]] for row in rows], name="force.csv")
    both = read_demonstration(write([row[:8] for row in rows], name="pose.csv"), wrench=wrench)
    assert "no torque was measured" in notes(both)


def test_a_join_says_how_much_of_either_file_it_leaves_out(rows: Cells, write: Write) -> None:
    wrench = write([[row[0], *row[8:]] for row in rows], name="wrench.csv")
    pose = write([row[:8] for row in rows[:51]], name="pose.csv")
    assert "1.5 of the 1.99 s of the wrench were left out" in notes(read_demonstration(pose, wrench=wrench))
    cut = read_demonstration(pose, wrench=wrench, start=0.1, stop=0.4)
    assert "left out" not in notes(cut)  # what was cut on purpose is no loss
    whole = write([row[:8] for row in rows], name="whole.csv")
    assert "left out" not in notes(read_demonstration(whole, wrench=wrench))
