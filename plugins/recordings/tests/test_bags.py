"""ROS bags, written by the tests with rosbags' own writers: stamps of headers, two clocks, joint states, damage."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from skillframe_recordings.formats import bags
from skillframe_recordings.formats.bags import STAMP_START
from skillframe_testkit.suites import ReaderConformance

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, MissingDependency, UnknownName
from skillframe.extend.reading import read_demonstration
from skillframe.frames import rotation_vector
from tests.references import recordings_dir
from tests.unit.demonstration.conftest import make

rosbags = pytest.importorskip("rosbags", reason="rosbags is not installed (pip install rosbags)")

from plugins.recordings.tests.bags_written import (  # noqa: E402
    ENDINGS,
    START,
    STORE1,
    Writer1,
    head,
    joints,
    poses,
    wrenches,
    write_bag,
)


class TestRosbagReaderConforms(ReaderConformance):
    reader = "rosbag"


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("kind", ["PoseStamped", "PoseWithCovarianceStamped", "TransformStamped", "Odometry"])
@pytest.mark.slow
def test_what_was_written_is_read_on_the_clock_of_the_headers(
    tmp_path: Path, demo: Demonstration, ending: str, kind: str
) -> None:
    path = write_bag(tmp_path / f"demo{ending}", {"/tool": poses(demo, kind), "/ft": wrenches(demo)})
    found = read_demonstration(path)
    # stamps hold nanoseconds; the quaternion of a bag is read as it stands
    np.testing.assert_allclose(found.time, demo.time, atol=1e-9)
    np.testing.assert_array_equal(found.position, demo.position)
    np.testing.assert_allclose(found.quaternion, demo.quaternion, atol=1e-12)
    np.testing.assert_allclose(found.wrench, demo.wrench, atol=1e-6)  # the join may interpolate 1 ns off the sample
    assert found.meta[STAMP_START] == START


@pytest.mark.parametrize("ending", ENDINGS)
def test_topics_of_different_rates_are_joined_on_time(tmp_path: Path, ending: str) -> None:
    slow, fast = make(count=100, rate=50.0), make(count=1000, rate=500.0)
    path = write_bag(tmp_path / f"demo{ending}", {"/tool": poses(slow), "/ft": wrenches(fast)})
    found = read_demonstration(path)
    assert found.rate == pytest.approx(500.0, rel=1e-6)
    # the faster clock is kept, and the pose is a straight line in time, which interpolation keeps
    s = found.time / slow.time[-1]
    np.testing.assert_allclose(found.position[:, 2], 0.3 - 0.1 * s, atol=1e-9)
    np.testing.assert_allclose(found.wrench, fast.wrench[: len(found)], atol=1e-9)
    cut = read_demonstration(path, start=0.5, stop=1.0, clock="pose")
    assert cut.rate == pytest.approx(50.0, rel=1e-6)
    assert (cut.time[0], cut.time[-1]) == pytest.approx((0.5, 1.0))


def test_joint_states_become_tool_poses_by_the_robots_kinematics(tmp_path: Path) -> None:
    import pinocchio as pin

    from skillframe.execution.prepare import load_robot_model

    robot = load_robot_model("panda")
    names = [str(n) for n in robot.model.names[1:]]
    time = np.arange(100) / 100.0
    angles = robot.home + 0.1 * np.sin(time)[:, None] * np.linspace(-1.0, 1.0, len(robot.home))
    order = np.random.default_rng(0).permutation(len(names))  # joint states come in any order
    shuffled = joints(time, [*(names[i] for i in order), "gripper"], np.column_stack([angles[:, order], 0 * time]))
    path = write_bag(tmp_path / "demo.mcap", {"/joint_states": shuffled, "/ft": wrenches(make(count=100))})
    found = read_demonstration(path, robot="panda")
    data = robot.model.createData()
    for i in (0, 40, 99):
        pin.framesForwardKinematics(robot.model, data, angles[i])
        tool = data.oMf[robot.tool_frames[0]]
        np.testing.assert_allclose(found.position[i], tool.translation, atol=1e-8)  # 1 ns of the joint clock
        assert np.abs(rotation_vector(found.pose.rotation[i] @ tool.rotation.T)).max() < 1e-7
    with pytest.raises(InputError, match="name the robot"):
        read_demonstration(path, pose_topic="/joint_states")
    with pytest.raises(InputError, match="free base"):
        read_demonstration(path, robot="free_tool")


def test_a_robot_whose_joints_were_not_recorded_is_refused(tmp_path: Path) -> None:
    time = np.arange(50) / 100.0
    topics = {"/j": joints(time, ["shoulder"], time[:, None]), "/ft": wrenches(make(count=50))}
    path = write_bag(tmp_path / "demo.bag", topics)
    with pytest.raises(InputError, match=r"needs the joints .*; recorded are shoulder"):
        read_demonstration(path, robot="panda")


@pytest.mark.parametrize("option", ["pose_topic", "wrench_topic"])
def test_an_unknown_topic_is_answered_with_the_bags_topics_and_their_types(
    tmp_path: Path, demo: Demonstration, option: str
) -> None:
    path = write_bag(tmp_path / "demo.db3", {"/tool": poses(demo), "/wrench": wrenches(demo)})
    with pytest.raises(UnknownName, match="/tool") as caught:
        read_demonstration(path, **{option: "/wrnch"})
    said = str(caught.value)
    assert "did you mean '/wrench'?" in said and "/tool (geometry_msgs/msg/PoseStamped)" in said


def test_where_a_bag_leaves_a_choice_it_is_asked_for(tmp_path: Path, demo: Demonstration) -> None:
    both = {"/flange": poses(demo), "/tool": poses(demo), "/ft": wrenches(demo)}
    path = write_bag(tmp_path / "demo.mcap", both)
    with pytest.raises(InputError, match="several pose topics: /flange, /tool; choose one with --set pose-topic"):
        read_demonstration(path)
    assert len(read_demonstration(path, pose_topic="/tool")) == len(demo)
    with pytest.raises(InputError, match="/ft: is a geometry_msgs/msg/WrenchStamped, no pose"):
        read_demonstration(path, pose_topic="/ft")


def test_a_wrench_in_a_frame_of_its_own_is_noted_until_its_axes_are_stated(tmp_path: Path, demo: Demonstration) -> None:
    path = write_bag(tmp_path / "a.bag", {"/tool": poses(demo), "/ft": wrenches(demo)}, frame="ft_sensor")
    assert not any("frame" in note for note in read_demonstration(path).meta.get("reading", []))
    topics = {"/tool": poses(demo)}
    # the pose in base, the wrench in the sensor's frame: written as two bags' worth of headers
    mixed = tmp_path / "mixed.bag"
    with Writer1(mixed) as writer:
        for topic, (kind, messages), frame in (
            ("/tool", topics["/tool"], "base"),
            ("/ft", wrenches(demo), "ft_sensor"),
        ):
            connection = writer.add_connection(topic, kind, typestore=STORE1)
            for i, (stamp, fields) in enumerate(messages):
                message = STORE1.types[kind](header=head(STORE1, stamp, frame, {"seq": i}), **fields(STORE1))
                writer.write(connection, stamp, STORE1.serialize_ros1(message, kind))
    assert any("'ft_sensor'" in note for note in read_demonstration(mixed).meta["reading"])
    stated = read_demonstration(mixed, wrench_frame="base")
    assert not any("'ft_sensor'" in note for note in stated.meta.get("reading", []))


def test_messages_that_came_late_are_sorted_by_their_stamps(tmp_path: Path, demo: Demonstration) -> None:
    kind, messages = poses(demo)
    swapped = [*messages[:50], messages[51], messages[50], *messages[52:]]
    path = write_bag(tmp_path / "demo.mcap", {"/tool": (kind, swapped), "/ft": wrenches(demo)})
    found = read_demonstration(path)
    np.testing.assert_array_equal(found.position, demo.position)
    assert any("sorted by header stamp" in note for note in found.meta["reading"])


@pytest.mark.parametrize("ending", ENDINGS)
def test_topics_without_stamps_are_read_by_receive_times_until_a_rate_is_given(
    tmp_path: Path, demo: Demonstration, ending: str
) -> None:
    topics = {"/tool": poses(demo), "/ft": wrenches(demo)}
    path = write_bag(tmp_path / f"demo{ending}", topics, zero=topics, uneven=1000)
    found = read_demonstration(path)
    assert any(
        "stamp of /tool and /ft is zero" in note and "--set wrench-rate" in note for note in found.meta["reading"]
    )
    assert found.duration == pytest.approx(demo.duration, abs=0.021)  # a join may lose a sample at both ends
    assert read_demonstration(path, rate=100.0, wrench_rate=100.0).rate == pytest.approx(100.0)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("share", [0.0005, 0.3, 0.6, 0.95])
def test_a_bag_cut_off_anywhere_is_refused_in_one_sentence_with_exit_2(
    tmp_path: Path, demo: Demonstration, capsys: pytest.CaptureFixture[str], ending: str, share: float
) -> None:
    path = write_bag(tmp_path / f"demo{ending}", {"/tool": poses(demo), "/ft": wrenches(demo)})
    content = path.read_bytes()
    path.write_bytes(content[: max(int(share * len(content)), 20)])
    assert run(["convert", str(path), "--out", str(tmp_path / "x.npz")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ") and path.name in said and said.strip().count("\n") == 0
    assert not (tmp_path / "x.npz").exists()


@pytest.mark.parametrize(
    ("field", "damaged"),
    [
        (b"Point position", b"Point posjtion"),
        (b"Vector3 force", b"Vector3 fo_ce"),
        (b"uint32 nanosec", b"uint32 nan_sec"),
    ],
)
def test_messages_whose_definition_in_the_bag_is_damaged_are_refused(
    tmp_path: Path, demo: Demonstration, field: bytes, damaged: bytes
) -> None:
    """An mcap brings its definitions as text; with another name of a field the rest still reads."""
    path = write_bag(tmp_path / "demo.mcap", {"/tool": poses(demo), "/ft": wrenches(demo)})
    content = path.read_bytes()
    assert field in content
    path.write_bytes(content.replace(field, damaged))
    with pytest.raises(InputError, match=r"its messages are no .* as ROS defines it|cannot be read as a ROS bag"):
        read_demonstration(path)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_bag_without_messages_is_refused(tmp_path: Path, demo: Demonstration, ending: str) -> None:
    kinds = {"/tool": (poses(demo)[0], []), "/ft": (wrenches(demo)[0], [])}
    path = write_bag(tmp_path / f"demo{ending}", kinds)
    with pytest.raises(InputError, match="holds no messages"):
        read_demonstration(path)


def test_a_topic_without_messages_is_refused_by_its_name(tmp_path: Path, demo: Demonstration) -> None:
    path = write_bag(tmp_path / "demo.mcap", {"/tool": poses(demo), "/ft": (wrenches(demo)[0], [])})
    with pytest.raises(InputError, match="/ft: holds no messages"):
        read_demonstration(path)


def test_a_bag_without_a_wrench_needs_the_word_that_nothing_was_touched(tmp_path: Path, demo: Demonstration) -> None:
    path = write_bag(tmp_path / "demo.bag", {"/tool": poses(demo)})
    with pytest.raises(InputError, match=r"no wrench topic \(WrenchStamped\); it holds /tool .* contact = false"):
        read_demonstration(path)
    path.with_name("demo.meta.toml").write_text("contact = false\n")
    assert not np.any(read_demonstration(path).wrench)


def test_settings_of_the_other_kind_of_file_are_refused(tmp_path: Path, demo: Demonstration) -> None:
    path = write_bag(tmp_path / "demo.bag", {"/tool": poses(demo), "/ft": wrenches(demo)})
    with pytest.raises(InputError, match="columns is for text files"):
        read_demonstration(path, columns="t,px")
    text = tmp_path / "demo.csv"
    text.write_text("t\n")
    with pytest.raises(InputError, match="is no ROS bag; leave pose-topic out"):
        read_demonstration(text, pose_topic="/tool")


def test_without_rosbags_the_command_that_installs_it_is_said(
    tmp_path: Path, demo: Demonstration, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_bag(tmp_path / "demo.bag", {"/tool": poses(demo), "/ft": wrenches(demo)})
    for name in [n for n in sys.modules if n.split(".")[0] == "rosbags"]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingDependency, match=r"pip install 'skillframe-recordings\[ros\]'"):
        read_demonstration(path)


def test_a_recorded_bag_of_another_makers_is_opened_and_judged(tmp_path: Path) -> None:
    base = recordings_dir()
    if base is None or not (base / "formats" / "rosbag2_pose_stamped").is_dir():
        pytest.skip("SKILLFRAME_RECORDINGS does not hold formats/rosbag2_pose_stamped")
    path = base / "formats" / "rosbag2_pose_stamped" / "rosbag2_test_0.db3"
    with pytest.raises(InputError, match=r"no wrench topic .*/imu \(sensor_msgs/msg/Imu\)"):
        read_demonstration(path)
    copy = tmp_path / path.name
    shutil.copyfile(path, copy)
    copy.with_name(f"{copy.stem}.meta.toml").write_text("contact = false\n")
    with pytest.raises(InputError, match=r"/pose: row 1: the quaternion's norm is 13\.19"):  # it holds no rotations
        read_demonstration(copy)


def test_a_wrench_in_a_type_that_is_not_read_is_pointed_out() -> None:
    said = bags._remedy(
        "wrench", {"/state": "franka_msgs/msg/FrankaRobotState", "/tool": "geometry_msgs/msg/PoseStamped"}
    )
    assert said.startswith("/state may hold one in a type that is not read") and "--layout auto" in said
    assert bags._remedy("wrench", {"/tool": "geometry_msgs/msg/PoseStamped"}).startswith("record the wrench too")
