"""The link against nodes in the same process: what it reads, what it publishes, and each fault's sentence."""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from nodes import HOST, JOINTS, Nodes
from skillframe_drive.cell import Cell
from skillframe_drive.impedance import identify_impedance
from skillframe_drive.link import Spring
from skillframe_drive.runs import load_task
from skillframe_ros2 import dds, law, messages, topics
from skillframe_ros2.link import OTHERS, Ros2Link

from skillframe.errors import SkillframeError


@pytest.fixture
def nodes():
    made = Nodes()
    yield made
    made.close()


@pytest.fixture
def link(nodes):
    made = Ros2Link(HOST)
    yield made
    made.close()


def spring(nodes, stiffness=400.0, damping=80.0, shift=(0.0, 0.0, 0.0), wrench=()):
    at = messages.pose_of(nodes.pose + np.array([*shift, 0.0, 0.0, 0.0, 0.0]))
    given = np.array(wrench or [0.0] * 6)
    return Spring(at, messages.pose_of(nodes.pose), np.zeros(6), stiffness * np.eye(6), damping * np.eye(6), given)


def until_fault(link, most_s=0.5):
    begin = time.monotonic()
    while not link.fault and time.monotonic() - begin < most_s:
        link.read()
    return time.monotonic() - begin


def test_joints_are_those_of_the_controller_in_its_order_and_the_wrench_is_in_base_axes(nodes, link):
    state = link.read()
    assert (state.position == np.arange(1.0, 8.0)).all() and (state.wrench == np.arange(6.0)).all()
    nodes.frame = "sensor"  # of the tool, which is turned by 180 degrees about x
    for _ in range(20):
        state = link.read()
    assert state.wrench == pytest.approx([0.0, -1.0, -2.0, 3.0, -4.0, -5.0]) and not link.fault


@pytest.mark.slow
def test_a_call_whose_answer_is_lost_is_made_again():
    nodes = Nodes(lost=2)
    try:
        Ros2Link(HOST).close()
        assert nodes.lost == 0
    finally:
        nodes.close()


def test_of_a_faster_robot_every_second_state_is_taken():
    nodes = Nodes(0.001)
    link = Ros2Link(HOST)
    try:
        times = [link.read().time for _ in range(40)]
        assert np.diff(times).min() > 0.0015 and len(times) / (times[-1] - times[0]) < 520
    finally:
        link.close()
        nodes.close()


@pytest.mark.parametrize(
    ("plant", "sentence"),
    [
        (lambda nodes: nodes.position.__setitem__(3, np.nan), "values in joint_states that are no numbers"),
        (lambda nodes: nodes.wrench.__setitem__(1, np.inf), "values in the wrench that are no numbers"),
        (lambda nodes: nodes.pose.__setitem__(0, np.nan), "values in current_pose that are no numbers"),
        (lambda nodes: nodes.names.__setitem__(2, "elbow"), "joint_states lacks the controller's joint joint6"),
        (lambda nodes: nodes.position.pop(), "not as many positions"),
    ],
)
def test_a_state_that_cannot_be_used_is_a_fault_and_the_last_good_one_stays(nodes, link, plant, sentence):
    good = link.read()
    plant(nodes)
    until_fault(link)
    assert sentence in link.fault
    assert np.isfinite(link.read().position).all() and (link.read().position == good.position).all()


def test_states_that_stop_are_a_fault_after_100_ms(nodes, link):
    link.read()
    nodes.published = False
    took = until_fault(link, 2.0)
    assert link.fault == "no state from the robot for 100 ms" and 0.09 < took < 0.5


def test_another_publisher_of_targets_is_refused_at_first_and_a_fault_later(nodes, link):
    at = dds.participant(HOST)
    other = dds.writer(at, topics.TARGET_POSE, messages.PoseStamped, messages.NEWEST)
    with pytest.raises(SkillframeError, match="another program publishes /target_pose"):
        Ros2Link(HOST)
    second = dds.writer(at, topics.TARGET_POSE, messages.PoseStamped, messages.NEWEST)
    until_fault(link, 1.0)
    assert link.fault == OTHERS and other is not second


def test_two_controllers_in_a_domain_are_refused_as_both_would_move(nodes):
    other = Nodes()
    try:
        with pytest.raises(SkillframeError, match=r"several nodes at .* each would follow the targets"):
            wait_for_both()
    finally:
        other.close()


def wait_for_both():
    """Connect, until both nodes are discovered."""
    for _ in range(20):
        Ros2Link(HOST).close()
        time.sleep(0.1)


def test_no_parameter_is_set_before_the_pose_that_holds_is_the_target(nodes, link, monkeypatch):
    link.read()
    monkeypatch.setattr(link, "_publish", lambda *target: None)
    link.send(spring(nodes))
    assert link.fault == "the first target was not published within 3 s" and nodes.values == {}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({}, ""),
        ({"stiffness": 6000.0}, "stiffness has 6000 to 6000 along the tool's axes, and the controller takes 0 to 5000"),
        ({"damping": 5500.0}, "damping has 5500"),
    ],
)
def test_what_the_controller_cannot_take_is_said(nodes, link, change, sentence):
    link.read()
    assert (sentence in link.refused(spring(nodes, **change))) if sentence else link.refused(spring(nodes)) == ""


def test_an_end_effector_that_is_not_the_centre_of_compliance_is_said(nodes, link):
    link.read()
    moved = spring(nodes)._replace(measured=messages.pose_of(nodes.pose + 0.0015 * np.eye(7)[2]))
    assert "frame tip is 1.5 mm and 0.000 rad" in link.refused(moved)
    turned = np.array([*nodes.pose[:3], np.cos(0.01), np.sin(0.01), 0.0, 0.0])
    assert "0.0 mm and 0.020 rad" in link.refused(spring(nodes)._replace(measured=messages.pose_of(turned)))


def newest(reader, until=lambda message: True):
    """The first message for which `until` holds, and when it came. It may come late on a busy machine."""
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        for message in dds.taken(reader):
            if until(message):
                return message, time.monotonic()
        time.sleep(2e-4)
    raise AssertionError("no such message")


@pytest.mark.slow
def test_parameters_are_set_before_the_first_target_and_the_arm_is_held_when_targets_stop(nodes, link):
    link.read()
    link.arm()
    link.send(spring(nodes, shift=(0.0, 0.0, -0.01), wrench=(5.0, 0.0, -4.0, 0.0, 0.0, 0.0)))
    assert not link.fault
    assert nodes.values["task.k_pos_x"] == 400.0 and nodes.values["task.d_rot_z"] == 80.0
    assert set(nodes.values) == set(law.parameters(np.zeros(6), np.zeros(6)))
    pose, sent = newest(nodes.targets, lambda each: each.pose.position.z < 0.295)
    assert pose.pose.position.z == pytest.approx(0.29)
    wrench, _ = newest(nodes.pushes, lambda each: each.wrench.force.x != 0.0)
    assert wrench.wrench.force.x == pytest.approx(5.0)  # K (x_d - x) = -4 N is the controller's own
    assert wrench.wrench.force.z == pytest.approx(0.0, abs=1e-9)
    held, came = newest(nodes.targets, lambda each: each.pose.position.z > 0.295)
    assert held.pose.position.z == pytest.approx(0.3) and 0.08 < came - sent < 0.4
    newest(nodes.pushes, lambda each: each.wrench.force.x == 0.0)
    time.sleep(0.5)
    link.send(spring(nodes))
    assert "the arm was commanded to hold" in link.fault


@pytest.mark.slow
def test_a_run_that_ends_holds_the_arm_where_it_is_without_wrench(nodes, link):
    link.read()
    link.arm()
    link.send(spring(nodes, shift=(0.0, 0.0, -0.01), wrench=(5.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    newest(nodes.targets, lambda each: each.pose.position.z < 0.295)
    link.halt()
    link.close()
    held, _ = newest(nodes.targets)
    push, _ = newest(nodes.pushes, lambda each: each.wrench.force.x == 0.0)
    assert held.pose.position.z == pytest.approx(0.3) and push.wrench.force.z == 0.0


def test_an_identification_at_another_centre_than_the_end_effector_s_ends_before_anything_is_published(nodes, link):
    task = load_task(Cell(robot="fr3", link="ros2", host=HOST, world="valley"))
    with pytest.raises(SkillframeError, match=r"the identification ended: the controller's frame tip is .* mm"):
        identify_impedance(task, link, print, np.zeros(3))
    assert not dds.taken(nodes.targets)


@pytest.mark.slow
def test_a_run_that_is_killed_leaves_an_arm_that_is_held(nodes):
    """In a process of its own, as kill -9 takes all of it."""
    read_end, write_end = os.pipe()
    child = os.fork()
    if not child:
        os.close(read_end)
        line = "import sys; sys.path.insert(0, sys.argv[1]); import test_link; test_link.run_alone(int(sys.argv[2]))"
        os.set_inheritable(write_end, True)
        os.execv(sys.executable, [sys.executable, "-c", line, str(Path(__file__).parent), str(write_end)])
    os.close(write_end)
    assert os.read(read_end, 1) == b"s"
    newest(nodes.targets, lambda each: each.pose.position.z < 0.295)
    os.kill(child, signal.SIGKILL)
    killed = time.monotonic()
    os.waitpid(child, 0)
    held, came = newest(nodes.targets, lambda each: each.pose.position.z > 0.295)
    assert held.pose.position.z == pytest.approx(0.3) and came - killed < 0.06
    while nodes.targets.get_matched_publications() and time.monotonic() < killed + 5.0:
        time.sleep(0.01)
    assert not nodes.targets.get_matched_publications()  # the process that held it is gone


def run_alone(told):
    """Send targets until killed."""
    link = Ros2Link(HOST)
    held = type("Still", (), {"pose": np.array([0.5, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0])})
    link.read()
    link.arm()
    link.send(spring(held, shift=(0.0, 0.0, -0.01)))
    os.write(told, b"s")
    while not link.fault:
        link.read()
        link.send(spring(held, shift=(0.0, 0.0, -0.01)))


@pytest.mark.slow
def test_a_refused_parameter_a_silent_controller_and_a_target_without_numbers_send_nothing(nodes, link):
    link.read()
    nodes.refuse = "task.k_pos_z"
    link.arm()
    link.send(spring(nodes, shift=(0.0, 0.0, -0.01)))
    assert link.fault == "the controller refuses task.k_pos_z = 400.0 (too large)"
    link.fault, nodes.refuse, nodes.answers = "", "", False
    link.send(spring(nodes, shift=(0.0, 0.0, -0.01)))
    assert "does not answer set_parameters within 100 ms" in link.fault
    link.fault, nodes.answers = "", True
    link.send(spring(nodes)._replace(desired=messages.pose_of(nodes.pose * np.nan)))
    assert link.fault == "the target is no number, and was not sent"
    time.sleep(0.1)
    assert all(each.pose.position.z == 0.3 for each in dds.taken(nodes.targets))


@pytest.mark.slow
def test_nobody_there_is_one_sentence_that_names_what_is_missing():
    with pytest.raises(
        SkillframeError, match=r"nobody serves /joint_states, /current_pose, .*set_parameters, .*ROS_DOMAIN_ID"
    ):
        Ros2Link(HOST)


@pytest.mark.parametrize("number", ["no", "-1", "233"])
def test_a_domain_that_does_not_exist_is_refused(monkeypatch, number):
    monkeypatch.setenv(dds.DOMAIN, number)
    with pytest.raises(SkillframeError, match="0 to 232"):
        dds.participant(HOST)


def test_on_loopback_nothing_leaves_the_computer_and_elsewhere_the_user_s_settings_hold(monkeypatch):
    monkeypatch.setattr(dds, "_GIVEN", "<CycloneDDS><!-- mine --></CycloneDDS>")
    assert {dds.settings(host) for host in ("127.0.0.1", "127.0.1.1", "localhost", "::1")} == {dds.LOOPBACK}
    assert "mine" in dds.settings("10.0.0.2")
    monkeypatch.setattr(dds, "_GIVEN", "")
    assert '<Peer address="10.0.0.2"/>' in dds.settings("10.0.0.2")
    assert JOINTS[0] == "joint1"
