"""Repeated stamps and messages in bags, and what is proposed for tables with repeated stamps or without torques."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from skillframe_recordings.proposal.reading import propose_reading

from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import read_demonstration
from tests.unit.demonstration.conftest import make
from tests.unit.demonstration.test_repeats import Cells, Write, notes


def test_the_unit_of_a_clock_is_proposed_where_rows_share_stamps(rows: Cells, write: Write) -> None:
    cells = [["stamp", *rows[0][1:]], *([str(10 * int(i // 2 * 2)), *row[1:]] for i, row in enumerate(rows[1:]))]
    found = propose_reading(write(cells))
    assert found.settings["units"] == "ms" and found.whole


def test_a_topic_without_stamps_is_read_on_the_bags_clock_beside_one_with_stamps(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from plugins.recordings.tests.bags_written import poses, wrenches, write_bag

    demo = make(count=300)
    topics = {"/tool": poses(demo), "/ft": wrenches(demo)}
    path = write_bag(tmp_path / "demo.mcap", topics, zero={"/tool"}, uneven=1000)
    found = read_demonstration(path)
    assert "every header stamp of /tool is zero" in notes(found) and "--set rate and --set wrench-rate" in notes(found)
    assert len(found) >= len(demo) - 2  # a join may lose a sample at both ends
    row = np.searchsorted(demo.position[:, 0], found.position[:, 0] - 1e-7)
    assert np.abs(np.diff(found.time) - 0.01).max() < 1e-4 and np.all(np.diff(row) == 1)
    assert np.abs(found.wrench[:, 2] - demo.wrench[row, 2]).max() < 0.05


def test_a_message_that_a_bag_holds_twice_is_read_once(tmp_path: Path, demo: Demonstration) -> None:
    pytest.importorskip("rosbags")
    from plugins.recordings.tests.bags_written import poses, wrenches, write_bag

    kind, messages = poses(demo)
    twice = [message for i, message in enumerate(messages) for _ in range(2 if i % 50 == 7 else 1)]
    found = read_demonstration(write_bag(tmp_path / "demo.mcap", {"/tool": (kind, twice), "/ft": wrenches(demo)}))
    assert "/tool: 4 samples stood twice" in notes(found)
    np.testing.assert_array_equal(found.position, demo.position)


@pytest.mark.parametrize("sensor", ["ee_link", "sensor_link"])
def test_a_wrench_in_the_frame_whose_pose_is_read_is_in_tool_axes(tmp_path: Path, sensor: str) -> None:
    pytest.importorskip("rosbags")
    from plugins.recordings.tests.bags_written import transforms_and_wrench

    demo = make(count=100, turn=1.0)
    path = transforms_and_wrench(tmp_path / "demo.mcap", demo, child="ee_link", sensor=sensor)
    found = read_demonstration(path)
    if sensor == "ee_link":
        assert "'ee_link', whose pose was read: it is in tool axes" in notes(found)
        np.testing.assert_allclose(found.wrench, demo.wrench, atol=1e-9)
    else:
        assert "state its axes with --set wrench-frame" in notes(found)


def test_a_table_without_torques_is_proposed_with_a_word_about_them(rows: Cells, write: Write) -> None:
    proposal = propose_reading(write([row[:11] for row in rows]))
    assert proposal.whole and any(text.startswith("torque: no column") for text in proposal.undecided)
