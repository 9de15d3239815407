"""Demonstrations as MCAP: what the format's own library and ROS's reader find, and back to the last bit."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from plugins.recordings.tests.bags_written import START
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration, write_demonstration

mcap = pytest.importorskip("mcap")
pytest.importorskip("rosbags")


def shown(count: int = 60) -> Demonstration:
    """A tool on a random path that turns about y, at uneven stamps that no whole nanosecond holds."""
    rng = np.random.default_rng(4)
    half = 0.001 * np.arange(count)
    return Demonstration(
        time=np.cumsum(rng.uniform(0.001, 0.004, count)), position=rng.standard_normal((count, 3)) * 1e-3,
        quaternion=np.stack([0.0 * half, np.sin(half), 0.0 * half, np.cos(half)], axis=1),
        wrench=rng.standard_normal((count, 6)),
        extra={"grip": rng.standard_normal(count), "deep": np.arange(count) / 7},
        meta={"task": "peg", "frames": {"tip": [0.0, 0.0, 0.2]}, "robot": "panda", "rate": 400.0},
    )  # fmt: skip


@pytest.fixture
def written(tmp_path: Path) -> Path:
    write_demonstration(shown(), tmp_path / "peg.mcap")
    return tmp_path / "peg.mcap"


def test_it_comes_back_to_the_last_bit_with_its_metadata(written: Path) -> None:
    d, found = shown(), read_demonstration(written)
    for name in ("time", "position", "wrench"):
        np.testing.assert_array_equal(getattr(found, name), getattr(d, name))
    np.testing.assert_allclose(found.quaternion, d.quaternion, rtol=0, atol=2**-53)  # the reader makes its norm 1 again
    assert {name: column.tolist() for name, column in found.extra.items()} == {
        name: column.tolist() for name, column in d.extra.items()
    }
    assert {key: found.meta[key] for key in d.meta} == d.meta


def test_the_formats_own_library_reads_it_and_its_checksums_fit(written: Path) -> None:
    from mcap.reader import make_reader

    with written.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert reader.get_header().profile == "ros2"
        assert all(chunk.compression == "lz4" for chunk in summary.chunk_indexes)
        count = len(shown())
        assert {
            summary.channels[i].topic: (number, summary.schemas[summary.channels[i].schema_id].name)
            for i, number in summary.statistics.channel_message_counts.items()
        } == {
            "/tool_pose": (count, "geometry_msgs/msg/PoseStamped"),
            "/wrench": (count, "geometry_msgs/msg/WrenchStamped"),
            "/skillframe/extra": (count, "std_msgs/msg/Float64MultiArray"),
        }  # fmt: skip
        assert len(list(reader.iter_messages())) == 3 * count


def test_another_reader_of_bags_finds_pose_wrench_and_stamps(written: Path) -> None:
    d = shown()
    found = read_demonstration(written, pose_topic="/tool_pose", wrench_topic="/wrench")  # as any bag, by its topics
    assert found.meta["header_stamp_start_ns"] == round(float(d.time[0]) * 1e9)
    np.testing.assert_allclose(found.time, d.time - d.time[0], rtol=0, atol=1.1e-9)  # whole nanoseconds
    np.testing.assert_array_equal(found.position, d.position)
    np.testing.assert_allclose(found.wrench, d.wrench, rtol=0, atol=1e-12)  # joined on two equal clocks


def test_a_bags_stamps_are_kept(tmp_path: Path) -> None:
    d = shown()
    write_demonstration(replace(d, meta={**d.meta, "header_stamp_start_ns": START}), tmp_path / "d.mcap")
    found = read_demonstration(tmp_path / "d.mcap", pose_topic="/tool_pose", wrench_topic="/wrench")
    assert found.meta["header_stamp_start_ns"] == START + round(float(d.time[0]) * 1e9)
    assert read_demonstration(tmp_path / "d.mcap").time.tolist() == d.time.tolist()


def test_stamps_that_no_message_can_hold_are_refused(tmp_path: Path) -> None:
    d = shown()
    with pytest.raises(InputError, match=r"stamps that ROS cannot hold; read it with zero-time = true in a layout"):
        write_demonstration(replace(d, time=d.time - 1.0), tmp_path / "d.mcap")
    with pytest.raises(InputError, match=r"two samples with one stamp of ROS; write \.npz"):
        write_demonstration(replace(d, time=d.time * 1e-8), tmp_path / "d.mcap")
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match=r"no format writes files ending in '\.db3'"):
        write_demonstration(d, tmp_path / "d.db3")


@pytest.mark.parametrize("place", [0.2, 0.5, 0.8])
def test_a_flipped_bit_is_noticed(written: Path, place: float) -> None:
    content = bytearray(written.read_bytes())
    content[int(place * len(content))] ^= 4
    written.write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        read_demonstration(written)


@pytest.mark.parametrize(("text", "said"), [
    ('{"format": "skillframe.demonstration", "version": 7, "meta": {}}', "of version 1; update skillframe"),
    ('{"format": "skillframe.demonstration", "version": 1, "meta": {}, "columns": ["t"]}', "lacks /tool_pose"),
])  # fmt: skip
def test_a_file_that_says_it_is_ours_and_is_not_is_refused(tmp_path: Path, text: str, said: str) -> None:
    from mcap.writer import Writer

    buffer = io.BytesIO()
    writer = Writer(buffer)
    writer.start(profile="ros2", library="other")
    writer.add_metadata("skillframe", {"skillframe": text})
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    writer.add_message(writer.register_channel("/a", "cdr", schema), 1, b"\0\1\0\0\1\0\0\0\0", 1)
    writer.finish()
    (tmp_path / "d.mcap").write_bytes(buffer.getvalue())
    with pytest.raises(InputError, match=said):
        read_demonstration(tmp_path / "d.mcap")
