"""What `robots check` says of a machine with loops, and that `robots show` closes them."""

import shutil

import numpy as np
import pytest

from skillframe.robot.audit import audit
from skillframe.robot.describe import as_json, describe
from skillframe.robot.loops import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names


@pytest.fixture
def changed(tmp_path):
    """The shipped crane with robot.toml changed: (old, new), each old text occurs."""

    def change(*pairs):
        folder = tmp_path / "crane"
        shutil.copytree(robot_names()["hiab_xs031"], folder, dirs_exist_ok=True)
        text = (folder / "robot.toml").read_text(encoding="utf-8")
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new)
        (folder / "robot.toml").write_text(text, encoding="utf-8")
        return load_model(load_robot(folder))

    return change


def warnings(robot):
    result = audit(robot)
    assert result.usable
    return {problem.code: problem.message for problem in result.problems}


def test_nothing_is_wrong_with_the_shipped_crane(changed):
    assert warnings(changed()) == {}


def test_loops_that_leave_more_freedoms_than_actuators_are_named(changed):
    robot = changed(('frame_b = "tilt_rod_eye"', 'frame_b = "lift_rod_eye"'))
    assert "3 actuators for 5 freedoms" in warnings(robot)["cannot_run"]
    assert "loop: tilt_eye meets lift_rod_eye" in describe(robot)


def test_a_home_that_the_supply_cannot_hold_is_named_with_both_forces(changed):
    found = warnings(changed(("supply_pressure = 190e5", "supply_pressure = 60e5")))
    assert "piston would have to push" in found["impossible_home"]


def test_the_limits_of_an_arm_are_named_on_a_machine(changed):
    found = warnings(changed(("force_n = 15000.0", ""), ("torque_rate_nm_s = 1e7", "")))
    assert set(found) == {"arm_limits"}


def test_show_closes_the_loops_whatever_home_says_of_their_rods(changed):
    given = changed()
    robot = changed(
        ("lift_piston = 0.33", "lift_piston = 0.03"), ("tilt_barrel_pivot = -0.27", "tilt_barrel_pivot = 0.27")
    )
    homes = [joint["home"] for joint in as_json(robot)["joints"]]
    assert np.abs(ClosedChain(robot).gaps(np.array(homes))).max() < 1e-12  # as closed as `configuration` makes them
    np.testing.assert_allclose(homes, given.home, atol=1e-9)
    assert "payload 475 kg in 'end_object', rated for 475 kg" in describe(robot)
