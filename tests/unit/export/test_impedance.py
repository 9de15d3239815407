import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from skillframe.document.export import exported, moving_impedance, per_axis
from skillframe.errors import InputError
from skillframe.extend.builtin import skillframe_exporters
from skillframe.frames import rotation_matrix, unit

FORMATS = {each.name: each for each in skillframe_exporters()}
STOP = {"lead_force_n": 20.0, "lead_torque_nm": 2.0, "time_limit_s": 20.0}
POINT = [0.0, 0.0, 0.2]


def part(stiffness, direction=None, speed=0.0):
    k = np.asarray(stiffness, dtype=float)
    return {"stiffness": k.tolist(), "damping": (0.1 * k).tolist(), "speed": speed, "desired_direction": direction}


def document(translation, rotation, axes="base"):
    phase = {"translation": translation, "rotation": rotation, "stop": STOP}
    frame = {"work_at": POINT, "learned_at": POINT, "center_of_compliance": POINT, "axes": axes}
    return {"type": "lmc", "frame": frame, "phases": [phase]}


def tilted(angle):
    """Free along x turned by an angle about z, stiff otherwise."""
    axis = np.array([np.cos(angle), np.sin(angle), 0.0])
    return 1000.0 * (np.eye(3) - np.outer(axis, axis))


def peg(angle=0.0, axes="base"):
    return document(
        part(tilted(angle), [0.0, 0.0, -1.0], 0.02), part(np.diag([20.0, 0.0, 20.0])), axes
    )  # fmt: skip


rotations = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3).map(lambda v: rotation_matrix(np.array(v)))


@given(attitude=rotations)
def test_the_wrench_is_the_same_in_whatever_axes_it_is_computed(attitude):
    base = moving_impedance(peg(0.3), None, "base", None, "peg")
    tool = moving_impedance(peg(0.3), None, "tool", attitude, "peg")
    blocks = np.kron(np.eye(2), attitude)
    error = np.arange(1.0, 7.0)
    # rounding of three products of numbers up to 1000
    assert blocks @ tool.stiffness @ blocks.T @ error == pytest.approx(base.stiffness @ error, abs=1e-9)
    assert blocks @ tool.damping @ blocks.T @ error == pytest.approx(base.damping @ error, abs=1e-9)
    assert blocks @ tool.twist == pytest.approx(base.twist, abs=1e-12)
    back = moving_impedance(peg(0.3, "phase_start"), None, "base", attitude, "peg")
    assert blocks.T @ back.stiffness @ blocks == pytest.approx(base.stiffness, abs=1e-9)


@given(angle=st.floats(-0.7, 0.7))
def test_one_number_per_axis_is_off_by_the_angle_between_the_axes(angle):
    values, off = per_axis(tilted(angle))
    assert values == pytest.approx([0.0, 1000.0, 1000.0])
    assert off == pytest.approx(abs(angle), abs=1e-6)  # the arc sine's slope near 1 times rounding


def test_what_is_free_in_every_direction_and_what_is_stiff_in_every_one_have_no_axes():
    assert per_axis(np.zeros((3, 3)))[1] == 0.0
    assert per_axis(500.0 * np.eye(3))[1] == pytest.approx(0.0, abs=1e-9)


def test_axes_that_a_controller_of_one_number_per_axis_cannot_hold_are_refused_and_a_matrix_holds_them():
    phase = moving_impedance(peg(0.5), None, "base", None, "peg")
    with pytest.raises(InputError, match="29 degrees from the controller's"):
        exported(FORMATS["crisp"], phase, [])
    whole = yaml.safe_load(exported(FORMATS["aic_motion_update"], phase, []))
    assert np.reshape(whole["target_stiffness"], (6, 6)) == pytest.approx(phase.stiffness, abs=1e-8)  # nine decimals
    assert np.reshape(whole["target_damping"], (6, 6)) == pytest.approx(phase.damping, abs=1e-8)
    assert whole["velocity"]["linear"] == {"x": 0.0, "y": 0.0, "z": -0.02}


def test_crisp_is_told_the_gains_and_clips_the_error_to_the_lead():
    phase = moving_impedance(peg(), None, "base", None, "peg")
    text = exported(FORMATS["crisp"], phase, ["push along -z"])
    task = yaml.safe_load(text)["cartesian_controller"]["ros__parameters"]["task"]
    assert [task[f"k_pos_{a}"] for a in "xyz"] == [0.0, 1000.0, 1000.0]
    assert [task[f"k_rot_{a}"] for a in "xyz"] == [20.0, 0.0, 20.0]
    assert [task[f"d_pos_{a}"] for a in "xyz"] == [0.0, 100.0, 100.0]
    assert task["k_pos_z"] * task["error_clip"]["z"] == pytest.approx(STOP["lead_force_n"])
    assert task["k_rot_x"] * task["error_clip"]["rx"] == pytest.approx(STOP["lead_torque_nm"])
    assert "# push along -z" in text
    assert "time_limit_s 20" in text


def test_a_controller_in_tool_axes_needs_the_attitude_and_then_gets_them():
    with pytest.raises(InputError, match="give the tool's orientation"):
        moving_impedance(peg(), None, "tool", None, "peg")
    quarter = rotation_matrix(np.array([0.0, 0.0, np.pi / 2]))  # the tool's y lies along -x of base
    phase = moving_impedance(peg(), None, "tool", quarter, "peg")
    told = yaml.safe_load(exported(FORMATS["cartesian_controllers"], phase, []))
    stiffness = told["cartesian_compliance_controller"]["ros__parameters"]["stiffness"]
    assert [stiffness[f"trans_{a}"] for a in "xyz"] == [1000.0, 0.0, 1000.0]
    assert [stiffness[f"rot_{a}"] for a in "xyz"] == [0.0, 20.0, 20.0]


def test_a_skill_without_an_impedance_and_a_phase_that_is_not_there_are_refused():
    replay = {**peg(), "type": "replay", "phases": [{"mode": "shifted"}]}
    with pytest.raises(InputError, match="type replay holds no moving impedance"):
        moving_impedance(replay, None, "base", None, "replay.json")
    two = {**peg(), "phases": 2 * peg()["phases"]}
    with pytest.raises(InputError, match=r"2 phases; choose one of them with --phase"):
        moving_impedance(two, None, "base", None, "two.json")
    with pytest.raises(InputError, match="there is no phase 3"):
        moving_impedance(two, 3, "base", None, "two.json")
    assert moving_impedance(two, 2, "base", None, "two.json").twist[2] == -0.02


def test_directions_are_unit_vectors_times_the_speed():
    slanted = document(part(np.eye(3), unit(np.array([1.0, 2.0, 2.0])).tolist(), 0.03), part(np.eye(3)))
    assert moving_impedance(slanted, None, "base", None, "x").twist[:3] == pytest.approx([0.01, 0.02, 0.02])
