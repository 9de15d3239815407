"""The tool's pose from a bag's transforms: whole chains, clocks of their own, frames that last, and what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, UnknownName
from skillframe.extend.reading import read_demonstration
from skillframe.frames import Pose, quaternion_from_matrix, rotation_matrix, rotation_vector
from tests.unit.demonstration.conftest import make

pytest.importorskip("rosbags", reason="rosbags is not installed (pip install rosbags)")

from plugins.recordings.tests.bags_written import (
    ENDINGS,
    STORE1,
    STORE2,
    Writer1,
    Writer2,
    head,
    stamps,
    vector,
    wrenches,
)

MESSAGE = "tf2_msgs/msg/TFMessage"
DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"
Rows = Sequence[tuple[float, str, str, Pose]]
"""Time [s], parent, child, pose of the child in the parent."""


def write_tree(path: Path, moving: Rows, lasting: Rows, demo: Demonstration, zero: bool = False) -> Path:
    """A bag with `/tf`, `/tf_static` and a wrench."""
    ros1 = path.suffix == ".bag"
    store = STORE1 if ros1 else STORE2
    if ros1:
        from rosbags.typesys import get_types_from_msg

        store.register(get_types_from_msg(DEFINITION, MESSAGE))
    writer = Writer1(path) if ros1 else Writer2(path.with_suffix(""), version=9)
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    with writer:
        for topic, rows in (("/tf", moving), ("/tf_static", lasting)):
            connection = writer.add_connection(topic, MESSAGE, typestore=store)
            for row in rows:
                message = store.types[MESSAGE](transforms=[stamped(store, ros1, *row, zero)])
                writer.write(connection, stamps([row[0]])[0] + 10**9, serialize(message, MESSAGE))
        kind, messages = wrenches(demo)
        connection = writer.add_connection("/ft", kind, typestore=store)
        for stamp, fields in messages:
            header = head(store, stamp, "base", {"seq": 0} if ros1 else {})
            writer.write(connection, stamp, serialize(store.types[kind](header=header, **fields(store)), kind))
    return path if ros1 else next(path.with_suffix("").glob("*.db3"))


def stamped(store: Any, ros1: bool, time: float, parent: str, child: str, pose: Pose, zero: bool) -> Any:
    types, package = store.types, "geometry_msgs/msg"
    quaternion = vector(store, "Quaternion", quaternion_from_matrix(pose.rotation))
    turn = types[f"{package}/Transform"](translation=vector(store, "Vector3", pose.position), rotation=quaternion)
    header = head(store, 0 if zero else stamps([time])[0], parent, {"seq": 0} if ros1 else {})
    return types[f"{package}/TransformStamped"](header=header, child_frame_id=child, transform=turn)


def placed(x: float, y: float, z: float, turn: Sequence[float] = (0.0, 0.0, 0.0)) -> Pose:
    return Pose(np.array([x, y, z]), rotation_matrix(np.array(turn)))


def shoulder(time: float) -> Pose:
    return placed(0.0, 0.0, 0.3, (0.0, 0.0, 0.4 * time))  # turns steadily, so that between samples nothing is lost


def slide(time: float) -> Pose:
    return placed(0.2 + 0.1 * time, 0.0, 0.0)


MOUNT, TOOL = placed(1.0, -2.0, 0.1, (0.0, 0.0, 1.0)), placed(0.0, 0.0, 0.15, (0.0, 0.5, 0.0))
END = 2.0
LASTING = [(0.0, "world", "base", MOUNT), (0.0, "/flange", "/tool", TOOL)]


def moving(fast: float = 100.0, slow: float = 20.0, leading: str = "") -> list[tuple[float, str, str, Pose]]:
    """An arm of two joints that publish at rates of their own, and a camera that has nothing to do with it."""
    rows = [(t, f"{leading}base", f"{leading}link", shoulder(t)) for t in np.arange(round(END * fast) + 1) / fast]
    rows += [(t, "link", "flange", slide(t)) for t in np.arange(round(END * slow) + 1) / slow]
    return [*rows, *((t, "world", "camera", placed(t, 0.0, 0.0)) for t in np.arange(5.0))]


def truth(time: float) -> Pose:
    return shoulder(time).compose(slide(time)).compose(TOOL)


@pytest.fixture
def demo() -> Demonstration:
    return make(count=201, rate=100.0)


@pytest.mark.parametrize("ending", [e for e in ENDINGS if e != ".mcap"])
@pytest.mark.parametrize("leading", ["", "/"])  # names of the first version of tf begin with a slash
@pytest.mark.slow
def test_a_tool_is_seen_from_its_base_along_the_whole_chain(
    tmp_path: Path, demo: Demonstration, ending: str, leading: str
) -> None:
    path = write_tree(tmp_path / f"demo{ending}", moving(leading=leading), LASTING, demo)
    found = read_demonstration(path, pose_frames="base,tool")
    assert found.rate == pytest.approx(100.0)
    for i in (0, 57, 200):  # 57: between two samples of the slower joint, which moves linearly
        true = truth(float(found.time[i]))
        np.testing.assert_allclose(found.position[i], true.position, atol=1e-8)  # stamps of 1 ns at 0.1 m/s
        assert np.abs(rotation_vector(found.pose.rotation[i] @ true.rotation.T)).max() < 1e-7


def test_from_a_common_ancestor_the_mount_counts(tmp_path: Path, demo: Demonstration) -> None:
    path = write_tree(tmp_path / "demo.db3", moving(), LASTING, demo)
    found = read_demonstration(path, pose_frames="world,tool")
    np.testing.assert_allclose(found.position[30], MOUNT.compose(truth(float(found.time[30]))).position, atol=1e-8)


def test_base_in_tool_is_the_inverse_of_tool_in_base(tmp_path: Path, demo: Demonstration) -> None:
    path = write_tree(tmp_path / "demo.db3", moving(), LASTING, demo)
    there, back = (read_demonstration(path, pose_frames=names).pose for names in ("base,tool", "tool,base"))
    product = there.compose(back)
    np.testing.assert_allclose(product.position, 0.0, atol=1e-12)
    np.testing.assert_allclose(product.rotation, np.broadcast_to(np.eye(3), product.rotation.shape), atol=1e-12)


def test_only_the_time_that_all_transforms_cover_is_read(tmp_path: Path, demo: Demonstration) -> None:
    rows = [row for row in moving() if row[2] != "flange" or 0.5 <= row[0] <= 1.5]
    found = read_demonstration(write_tree(tmp_path / "demo.db3", rows, LASTING, demo), pose_frames="base,tool")
    assert found.duration == pytest.approx(1.0)


def test_a_transform_published_twice_counts_once(tmp_path: Path, demo: Demonstration) -> None:
    rows = [row for row in moving() for _ in range(2)]
    found = read_demonstration(write_tree(tmp_path / "demo.db3", rows, LASTING, demo), pose_frames="base,tool")
    assert len(found) == len(demo)


def test_what_cannot_be_told_is_refused_in_words(tmp_path: Path, demo: Demonstration) -> None:
    path = write_tree(tmp_path / "demo.db3", moving(), LASTING, demo)
    with pytest.raises(UnknownName, match="unknown frame 'tol'; did you mean 'tool'"):
        read_demonstration(path, pose_frames="base,tol")
    with pytest.raises(InputError, match="flange to tool: nothing between them moves"):
        read_demonstration(path, pose_frames="flange,tool")
    with pytest.raises(InputError, match="names no two frames; give base and tool"):
        read_demonstration(path, pose_frames="tool")
    with pytest.raises(InputError, match="so does --set robot; give one of them"):
        read_demonstration(path, pose_frames="base,tool", robot="panda")
    with pytest.raises(InputError, match="name base and tool with --set pose-frames"):
        read_demonstration(path)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([row for row in moving() if row[2] != "link"], "no transforms connect base and tool: .* from world, .* link"),
        ([*moving(), (0.0, "world", "link", MOUNT)], "frame link has several parents: base, world"),
        ([(row[0] + 5.0 * (row[2] == "link"), *row[1:]) for row in moving()], "no interval in common"),
        ([*moving(), (0.0, "tool", "world", MOUNT)], "is its own ancestor"),
        ([*moving(), (3.0, "base", "link", Pose(np.full(3, np.nan), np.eye(3)))], "no rigid motion"),
    ],
)
def test_a_broken_tree_is_refused_in_words(tmp_path: Path, demo: Demonstration, rows: Rows, said: str) -> None:
    path = write_tree(tmp_path / "demo.db3", rows, LASTING, demo)
    with pytest.raises(InputError, match=said):
        read_demonstration(path, pose_frames="base,tool")


def test_transforms_without_stamps_are_refused(tmp_path: Path, demo: Demonstration) -> None:
    path = write_tree(tmp_path / "demo.db3", moving(), LASTING, demo, zero=True)
    with pytest.raises(InputError, match="every header stamp is zero; record transforms with their stamps"):
        read_demonstration(path, pose_frames="base,tool")


def test_the_command_takes_frames(tmp_path: Path, demo: Demonstration, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_tree(tmp_path / "demo.db3", moving(), LASTING, demo)
    words = ["convert", str(path), "--set", "pose-frames=base,tool", "--out", str(tmp_path / "x.npz")]
    assert run(words) == 0
    assert run([*words[:3], "pose-frames=base,tule", *words[4:]]) == 2
    assert "did you mean 'tool'" in capsys.readouterr().err
