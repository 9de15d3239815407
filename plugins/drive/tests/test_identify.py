"""Identification in free air: laws in closed form, then planted values behind a link."""

from __future__ import annotations

import numpy as np
import pytest
from direct_link import DirectLink, arm
from skillframe_drive import identify as module
from skillframe_drive.cell import Cell
from skillframe_drive.fake import FakeArm
from skillframe_drive.identify import (
    Identified,
    Motions,
    fit_response,
    fit_sensor,
    identify,
    response_of,
    toml_lines,
)
from skillframe_drive.real import MOST_MISSED
from skillframe_drive.runs import load_task

from skillframe.demonstration.convention import GRAVITY
from skillframe.errors import SkillframeError
from skillframe.extend import LinkType
from skillframe.extend.registry import registry
from skillframe.frames import rotation_matrix
from skillframe.robot.interface import LOOP_DAMPING, Control

UR = Cell(robot="ur5e", link="direct_position", host="", world="valley")
TAKES = {"direct_position": "position", "direct_torque": "torque"}


@pytest.fixture(autouse=True)
def links(monkeypatch):
    records = {
        name: LinkType(name=name, summary="", takes=takes, open=lambda host: pytest.fail("not opened here"))
        for name, takes in TAKES.items()
    }
    found = registry()
    real = found.record
    monkeypatch.setattr(found, "record", lambda kind, name: records.get(name) or real(kind, name))


def identified(robot: str, fake: FakeArm, takes: str, period: float):
    link = DirectLink(fake, takes, period)
    task = load_task(Cell(robot=robot, link=f"direct_{takes}", host="", world="valley"))
    return identify(task, link, lambda text: None)


@pytest.mark.parametrize(("delay_s", "bandwidth_hz"), [(0.008, 10.0), (0.02, 5.0), (0.0, 15.0)])
def test_a_response_simulated_by_an_independent_integrator_gives_its_delay_and_bandwidth(delay_s, bandwidth_hz):
    """Sines with held commands through q'' = w^2 (c(t - T) - q) - 2 zeta w q', integrated at 50 us."""
    period, fine, w = 0.002, 5e-5, 2.0 * np.pi * bandwidth_hz
    hertz, found = (1.0, 2.0, 4.0, 6.0), []
    for each in hertz:
        time = period * np.arange(1500)
        sent = np.sin(2.0 * np.pi * each * time)
        moments = fine * np.arange(round(3.0 / fine))
        late = moments - delay_s
        held = np.where(late < 0.0, 0.0, sent[np.clip((late / period + 1e-9).astype(int), 0, len(sent) - 1)])
        place = speed = 0.0
        path = np.empty(len(moments))
        for k, command in enumerate(held):
            path[k] = place
            speed += fine * (w**2 * (command - place) - 1.6 * w * speed)
            place += fine * speed
        found.append(response_of(time, sent, path[:: round(period / fine)], each))
    response = fit_response(hertz, found, period)
    assert response.delay_s == pytest.approx(delay_s, abs=1.1e-3)
    assert response.bandwidth_hz == pytest.approx(bandwidth_hz, rel=0.05)
    declared = Control(rate_hz=500.0, interface="position", delay_s=delay_s, bandwidth_hz=bandwidth_hz)
    assert response.total_s(declared) == pytest.approx(declared.admittance.total_delay, abs=1e-3)
    assert response.residual < 0.02


def test_half_of_a_slow_period_is_no_delay_of_the_robot():
    """Equation (1) of a loop of 5 Hz and 7 ms, whose commands are held for 20 ms each."""
    turn, w = 2.0j * np.pi * np.array([1.0, 2.0, 4.0]), 10.0 * np.pi
    given = w**2 / (w**2 + turn**2 + 2.0 * LOOP_DAMPING * w * turn) * np.exp(-turn * 0.017)
    found = fit_response([1.0, 2.0, 4.0], given, 0.02)
    assert found.delay_s == pytest.approx(0.007) and found.bandwidth_hz == pytest.approx(5.0, rel=1e-3)


def test_a_response_of_another_order_is_not_taken_for_a_position_loop():
    hertz = np.array([1.0, 2.0, 4.0, 6.0])
    ringing = 1.0 / (1.0 - (hertz / 3.0) ** 2 + 0.05j * hertz)  # a resonance at 3 Hz
    assert fit_response(hertz, ringing, 0.002).residual > 0.1


def test_bias_and_missing_payload_come_out_of_five_orientations():
    rng = np.random.default_rng(0)
    turns = np.pi * np.array([1.0, 0.0, 0.0]) + np.vstack([np.zeros(3), 0.25 * rng.standard_normal((4, 3))])
    rotations = rotation_matrix(turns)
    bias, mass, center = np.array([2.0, -1.0, 3.0, 0.1, -0.2, 0.05]), 0.4, np.array([0.02, 0.0, 0.1])
    force = rotations @ bias[:3] + mass * GRAVITY
    torque = rotations @ bias[3:] + np.cross(rotations @ center, mass * GRAVITY)
    found = fit_sensor(rotations, np.hstack([force, torque]))
    assert found.bias == pytest.approx(bias, abs=1e-9)
    assert found.mass == pytest.approx(mass, abs=1e-9) and found.center == pytest.approx(center, abs=1e-9)


@pytest.mark.slow
def test_the_friction_of_a_torque_controlled_arm_is_found_in_each_joint(monkeypatch):
    monkeypatch.setattr(module, "MOTIONS", Motions(tilt_s=0.3, held_s=0.1))  # the tool's turns do not matter here
    fake = arm("fr3", start__offset_z=0.15, robot__joint_friction=0.3)
    found = identified("fr3", fake, "torque", 0.001)
    line = next(line for line in found.lines if "friction" in line.text)
    values = [float(each) for each in line.text.split(": ")[1].removesuffix(" N m").split(", ")]
    assert values == pytest.approx([0.3] * 7, abs=0.03)
    assert found.vary["robot.joint_friction"][1] == pytest.approx(0.3, abs=0.04)


def test_an_identification_that_touches_something_ends_and_stops_the_robot():
    fake = arm("ur5e")
    link = DirectLink(fake, "position", 0.002)
    read = link.read
    link.read = lambda: (state := read())._replace(wrench=state.wrench + (60.0 if link.time > 0.8 else 0.0))
    with pytest.raises(SkillframeError, match="begin in free air"):
        identify(
            load_task(Cell(robot="ur5e", link="direct_position", host="", world="valley")), link, lambda text: None
        )
    assert link.log[-1] == "halt" and link.sent < 400


def test_a_fault_of_the_link_ends_an_identification():
    link = DirectLink(arm("ur5e"), "position", 0.002)
    link.fault_after = 0.8
    with pytest.raises(SkillframeError, match="planted"):
        identify(
            load_task(Cell(robot="ur5e", link="direct_position", host="", world="valley")), link, lambda text: None
        )
    assert link.log == ["arm"]


def test_lost_states_end_an_identification_and_stop_the_robot():
    link = DirectLink(arm("ur5e"), "position", 0.002)
    link.missed = MOST_MISSED + 1
    with pytest.raises(SkillframeError, match="states of the robot were lost"):
        identify(load_task(UR), link, lambda text: None)
    assert link.log == ["arm", "halt"]


def test_lines_are_those_of_robot_toml_and_campaign_toml():
    found = Identified([], {"delay_s": 0.008}, {"robot.joint_friction": [0.0, 0.31]})
    assert toml_lines(found) == {
        "control": {"delay_s": 0.008}, "vary": {"robot.joint_friction": {"uniform": [0.0, 0.31]}},
    }  # fmt: skip
