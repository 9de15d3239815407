from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.frames import norm, rotation_vector

Write = Callable[..., Path]
POSE, WRENCH = "t,px,py,pz,qx,qy,qz,qw", "t,fx,fy,fz,tx,ty,tz"


def cells(names: str, values: np.ndarray) -> list[list[str]]:
    return [names.split(","), *([repr(float(v)) for v in row] for row in values)]


def pose_file(write: Write, time: np.ndarray, name: str = "pose.csv") -> Path:
    half = 0.1 * time
    columns = [time, 0.1 * time, 2 + 0 * time, -time, np.sin(half), 0 * time, 0 * time, np.cos(half)]
    return write(cells(POSE, np.column_stack(columns)), name)


def wrench_file(write: Write, time: np.ndarray, name: str = "wrench.csv") -> Path:
    return write(cells(WRENCH, np.column_stack([time, *((i + 1.0) * time for i in range(6))])), name)


@pytest.mark.parametrize(("pose_rate", "wrench_rate"), [(100.0, 100.0), (100.0, 698.0), (500.0, 90.0)])
def test_what_is_linear_in_time_is_joined_exactly_on_the_faster_clock(
    write: Write, pose_rate: float, wrench_rate: float
) -> None:
    pose_time, wrench_time = np.arange(0.0, 2.0, 1 / pose_rate), np.arange(0.3, 2.5, 1 / wrench_rate)
    demo = read_demonstration(pose_file(write, pose_time), wrench=wrench_file(write, wrench_time))
    assert demo.rate == pytest.approx(max(pose_rate, wrench_rate), rel=1e-6)
    assert demo.time[0] >= 0.3
    assert demo.time[-1] <= pose_time[-1]
    # 1e-12: interpolation between exact values of a line rounds a few times
    assert np.abs(demo.position[:, 2] + demo.time).max() < 1e-12
    assert np.abs(demo.wrench - demo.time[:, None] * np.arange(1.0, 7.0)).max() < 1e-12
    angle = norm(rotation_vector(demo.pose.rotation))
    assert np.abs(angle - 0.2 * demo.time).max() < 1e-9  # a constant rate of turning is what slerp reproduces
    assert "joined on the clock of the" in demo.meta["reading"][0]


def test_the_clock_that_is_kept_can_be_chosen(write: Write) -> None:
    pose, wrench = pose_file(write, np.arange(0.0, 2.0, 0.01)), wrench_file(write, np.arange(0.0, 2.0, 0.001))
    assert read_demonstration(pose, wrench=wrench, clock="pose").rate == pytest.approx(100.0)
    assert read_demonstration(pose, wrench=wrench, clock="wrench").rate == pytest.approx(1000.0)


def test_clocks_without_a_common_interval_are_refused_unless_shifted(write: Write) -> None:
    pose, wrench = pose_file(write, np.arange(0.0, 2.0, 0.01)), wrench_file(write, 1e6 * np.arange(3.0, 5.0, 0.01))
    with pytest.raises(InputError, match=r"wrench\.csv.*no interval in common.*--set wrench-units"):
        read_demonstration(pose, wrench=wrench)
    demo = read_demonstration(pose, wrench=wrench, wrench_units="us", wrench_shift=-3.0)
    assert demo.wrench[-1, 0] == pytest.approx(1e6 * (demo.time[-1] + 3.0))


def test_zero_time_moves_both_clocks_together(write: Write) -> None:
    pose = pose_file(write, np.arange(0.0, 2.0, 0.01))
    late = write(cells(WRENCH, np.column_stack([np.arange(0.5, 2.0, 0.01), *([np.arange(150.0)] * 6)])), "late.csv")
    assert read_demonstration(pose, wrench=late, zero_time=True).time[0] == pytest.approx(0.5)


@pytest.mark.parametrize(
    "columns",
    [
        {"columns": POSE, "wrench_columns": WRENCH},
        {"columns": f"{POSE},fx,fy,fz,tx,ty,tz"},
        {"columns": POSE},
    ],
)
def test_files_without_headers_are_named_together_or_one_by_one(write: Write, columns: dict[str, str]) -> None:
    time = np.arange(0.0, 2.0, 0.01)
    pose, wrench = pose_file(write, time), wrench_file(write, time)
    for path in (pose, wrench):
        path.write_text("\n".join(path.read_text().splitlines()[1:]))
    assert len(read_demonstration(pose, wrench=wrench, **columns)) == 200


def test_files_of_one_rate_without_clocks_are_paired_from_their_starts(write: Write) -> None:
    time = np.arange(0.0, 2.0, 0.01)
    pose, wrench = pose_file(write, time), wrench_file(write, time[:150])
    for path in (pose, wrench):
        path.write_text("\n".join(line.split(",", 1)[1] for line in path.read_text().splitlines()))
    with pytest.raises(InputError, match="no time column"):
        read_demonstration(pose, wrench=wrench)
    demo = read_demonstration(pose, wrench=wrench, rate=100.0)
    assert len(demo) == 150
    assert "0.5 of the 1.99 s of the pose were left out: the other file lasts no longer" in demo.meta["reading"]


def test_a_bad_row_of_the_wrench_file_is_named_in_that_file(write: Write) -> None:
    time = np.arange(0.0, 2.0, 0.01)
    pose, wrench = pose_file(write, time), wrench_file(write, time)
    lines = wrench.read_text().splitlines()
    lines[41] = lines[41].replace(lines[41].split(",")[2], "nan")
    wrench.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"wrench\.csv: row 42, column fy"):
        read_demonstration(pose, wrench=wrench)


def test_labels_are_held_and_a_gap_that_was_bridged_is_noted(write: Write) -> None:
    time = np.arange(0.0, 2.0, 0.02)
    pose = pose_file(write, time)
    lines = [f"{line},{'label' if i == 0 else (i - 1) // 30}" for i, line in enumerate(pose.read_text().splitlines())]
    pose.write_text("\n".join(lines[:50] + lines[60:]))
    demo = read_demonstration(pose, wrench=wrench_file(write, np.arange(0.0, 2.0, 0.003)))
    assert set(demo.extra["label"]) <= {0.0, 1.0, 2.0, 3.0}
    assert any("1 gaps of up to 0.22 s" in note for note in demo.meta["reading"])
