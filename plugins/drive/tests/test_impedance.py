"""What a robot that takes impedances renders: laws in closed form, then planted values behind a link."""

from __future__ import annotations

import re

import numpy as np
import pytest
from direct_link import ImpedanceDirectLink, arm
from skillframe_drive import identify as motions
from skillframe_drive import impedance
from skillframe_drive.cell import Cell
from skillframe_drive.identify import Motions
from skillframe_drive.impedance import PROBES, fit_late, fit_loop, identify_impedance
from skillframe_drive.runs import load_task

from skillframe.errors import SkillframeError
from skillframe.extend import LinkType
from skillframe.extend.registry import registry


@pytest.fixture
def task(monkeypatch):
    """A cell whose link takes impedances, and quick turns of the tool."""
    kind = LinkType(name="direct", summary="", takes="impedance", open=lambda host: pytest.fail("not opened here"))
    found = registry()
    real = found.record
    monkeypatch.setattr(found, "record", lambda what, name: kind if name == "direct" else real(what, name))
    for module in (motions, impedance):
        monkeypatch.setattr(module, "MOTIONS", Motions(tilt_s=0.5, held_s=0.2))
    return load_task(Cell(robot="fr3", link="direct", host="", world="valley"))


def test_stiffness_and_friction_are_those_of_a_loop_with_sticking_at_its_turns():
    """Equation (1) with k = 900 N/m, D = 150 Ns/m, 5 N of friction that holds, 3 N of load, and 2 rad a metre."""
    push = 30.0 * np.concatenate([np.linspace(-1.0, 1.0, 1000), np.linspace(1.0, -1.0, 1000)])
    place, at = np.empty(2000), (-30.0 + 5.0 - 3.0) / 900.0
    for k, f in enumerate(push):
        at = min(max(at, (f - 3.0 - 5.0) / 900.0), (f - 3.0 + 5.0) / 900.0)
        place[k] = at
    speed = np.gradient(place, 0.002)
    found = fit_loop(push + 150.0 * speed, place, 150.0 * speed, speed, 2.0 * np.abs(speed))
    assert found.stiffness == pytest.approx(900.0, rel=1e-3)
    assert found.friction == pytest.approx(5.0, rel=1e-2) and found.joint == pytest.approx(2.5, rel=1e-2)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.03])
def test_the_delay_is_that_of_a_response_by_the_model(delay):
    inertia, damping, stiffness = np.diag([6.0] * 6), np.diag([150.0] * 6), np.diag([1500.0] * 6)
    turn = 2.0 * np.pi * np.array([4.0, 6.0, 8.0])
    given = np.exp(-1j * turn * (delay + 0.001)) / (1500.0 + 150.0j * turn - 6.0 * turn**2)
    found = fit_late([4.0, 6.0, 8.0], given, 1, (inertia, damping, stiffness), 0.002)
    assert found.delay_s == pytest.approx(delay) and found.residual < 1e-6
    weak = fit_late([4.0, 6.0, 8.0], 0.6 * given, 1, (inertia, damping, stiffness), 0.002)
    assert weak.residual == pytest.approx(0.4, abs=0.01)  # torques that are all 40 % too small


def rendered(line: str) -> tuple[float, float]:
    """Stiffness [N/m] and friction [N] of a line."""
    return tuple(float(each) for each in re.findall(r"([\d.]+) N(?:/m where|:)", line))


@pytest.mark.slow
def test_planted_stiffness_friction_and_delay_are_found(task):
    """0.7 of the stiffness, feed-forward 12 ms late, and 0.3 Nm in each joint, which couplings blur."""
    fake = arm("fr3", start__offset_z=0.15, robot__joint_friction=0.3)
    link = ImpedanceDirectLink(fake, share=0.7, late=6)
    found = identify_impedance(task, link, lambda text: None, fake.tip)
    along = [line for line in found.lines if line.text.startswith("along")]
    assert [rendered(line.text)[0] / PROBES.stiffness[0] for line in along] == pytest.approx([0.7] * 3, rel=0.03)
    assert all("another stiffness" in line.problem for line in along)
    assert found.vary["robot.joint_friction"][1] == pytest.approx(0.3, abs=0.06)
    late = next(line for line in found.lines if "late" in line.text)
    assert float(re.findall(r"(\d+) ms late", late.text)[0]) == pytest.approx(12.0, abs=2.0)
    assert "couplings" in late.problem
    assert link.log == ["tare", "arm", "halt"]


@pytest.mark.slow
def test_a_robot_that_renders_what_it_is_sent_is_right_and_its_payload_is_found(task):
    fake = arm("fr3", start__offset_z=0.15)
    link = ImpedanceDirectLink(fake)
    read = link.read
    weight = np.array([0.0, 0.0, -0.4 * 9.81])
    link.read = lambda: (state := read())._replace(wrench=state.wrench + fake.at_origin(weight))
    found = identify_impedance(task, link, lambda text: None, fake.tip)
    wrong = [line for line in found.lines if line.problem]
    assert len(wrong) == 1 and "+0.4" in wrong[0].text and "payload" in wrong[0].problem
    assert any("feed-forward acts 0 ms late" in line.text for line in found.lines)


@pytest.mark.slow
def test_an_arm_that_does_not_yield_is_named_and_gives_neither_stiffness_nor_friction(task):
    fake = arm("fr3", start__offset_z=0.15)
    link = ImpedanceDirectLink(fake)
    link._law = lambda: fake.holding(fake.target[0], 1e4, 200.0)
    found = identify_impedance(task, link, lambda text: None, fake.tip)
    along = [line for line in found.lines if line.text.startswith("along")]
    assert len(along) == 3 and all("hardly moves" in line.text and line.problem for line in along)
    assert not any("late" in line.text for line in found.lines) and "robot.joint_friction" not in found.vary


def test_a_fault_of_the_link_ends_it(task):
    fake = arm("fr3", start__offset_z=0.15)
    link = ImpedanceDirectLink(fake)
    read = link.read

    def faulty():
        if link.time > 0.6:
            link.fault = "planted"
        return read()

    link.read = faulty
    with pytest.raises(SkillframeError, match="the identification ended: planted"):
        identify_impedance(task, link, lambda text: None, fake.tip)
    assert link.log == ["tare", "arm"]
