"""Reach and largest force of machines, against data sheets, sampling and the balance of moments."""

import json
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from skillframe_hydraulics.checks.feasibility import areas, capacity, moved_by, problems
from skillframe_hydraulics.checks.working_range import largest_forces, working_range
from skillframe_hydraulics.faults import moved_joints
from skillframe_hydraulics.law.hydraulic import tool_task

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.extend.drives import audit
from skillframe.robot import ClosedChain, load_model, load_robot

MACHINES = Path(__file__).parent / "machines"


class Published(NamedTuple):
    """A published figure, whose source robot.toml names [m], which of ours it is, and the frame if not the tool."""

    metres: float
    figure: str = "reach"
    frame: str = ""


PUBLISHED = {
    "kubota_u17": Published(3.90),
    "cat_320": Published(9.86),  # at ground level, as the next two
    "cat_336": Published(11.05),
    "jcb_3cx": Published(6.52),
    "palfinger_pk15500": Published(12.2),
    "john_deere_cf7": Published(10.0),
    "jcb_535_95": Published(6.5),
    "komatsu_wa380": Published(4.1, "highest", "pin"),  # height of the hinge pin
    "bobcat_s570": Published(3.02, "highest", "pin"),
    "husqvarna_dxr310": Published(5.5),
}


def chain_of(name):
    return ClosedChain(load_model(load_robot(MACHINES / name)))


@pytest.fixture
def changed(tmp_path):
    """A machine with lines of its robot.toml changed."""

    def write(name, *changes):
        folder = shutil.copytree(MACHINES / name, tmp_path / name)
        text = (folder / "robot.toml").read_text()
        for old, new in changes:
            assert text.count(old) == 1, (old, text.count(old))
            text = text.replace(old, new)
        (folder / "robot.toml").write_text(text)
        return folder

    return write


def warnings(folder):
    return {p.code: p.message for p in audit(load_robot(folder)).problems if p.severity != "info"}


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_machine_of_fewer_than_eighty_lines_reaches_as_far_as_its_data_sheet_says(name):
    assert len((MACHINES / name / "robot.toml").read_text().splitlines()) < 80
    found = audit(load_robot(MACHINES / name)).problems
    assert {p.code for p in found} <= {"static_friction", "working_range", "largest_force"}
    metres, figure, frame = PUBLISHED[name]
    told = next(p.figures for p in found if p.code == "working_range")
    ours = getattr(working_range(chain_of(name), frame), figure) if frame else told[f"{figure}_m"]
    assert ours == pytest.approx(metres, rel=0.05)


def test_a_dead_centre_is_a_moment_arm_below_a_sixth_of_a_short_stroke():
    chain, arms = chain_of("kubota_u17"), []
    home, bucket = chain.minimal(chain.home), chain.actuated.index("bucket_rod")
    for turn in np.linspace(-0.9, 1.2, 43):
        try:
            z = chain.settled(home + np.array([0.0, 0.0, 0.0, turn]))
        except InputError:
            continue
        arms.append(float(np.abs(chain.at(z, 0.0 * z).arms[bucket]).max()))
        said = any("bucket_rod is near its dead centre" in text for text in problems(chain, z))
        assert said == (arms[-1] < 0.4 / 6.0), arms[-1]
    assert any(arm < 0.06 for arm in arms) and any(0.07 < arm < 0.1 for arm in arms)


def test_no_sampled_configuration_lies_outside_the_working_range():
    chain = chain_of("kubota_u17")
    found, rng, places = working_range(chain), np.random.default_rng(0), []
    for z in rng.uniform([0.0, -1.2, 0.4, -0.5], [0.0, 0.9, 2.6, 2.2], (500, 4)):
        try:
            q = chain.configuration(z)
        except InputError:
            continue
        if np.all(q <= chain.model.upperPositionLimit) and np.all(q >= chain.model.lowerPositionLimit):
            state = chain.at(z, np.zeros(4))
            places.append(np.array(state.data.oMf[chain.robot.tool_frames[0]].translation))
    places = np.array(places)
    assert len(places) > 100
    farthest = np.array([np.hypot(*places.T[:2]).max(), places[:, 2].max(), -places[:, 2].min()])
    ours = np.array([found.reach, found.highest, -found.lowest])
    assert np.all(farthest < ours + 0.01)
    np.testing.assert_allclose(farthest, ours, atol=0.7)


def test_at_the_largest_force_one_cylinder_gives_all_it_can_and_none_more():
    chain = chain_of("kubota_u17")
    z, limits = chain.minimal(chain.home), [capacity(each) for each in chain.robot.spec.actuation]
    state, forces = chain.at(z, 0.0 * z), largest_forces(chain)
    assert list(forces) == ["+x", "-x", "+y", "-y", "+z", "-z"]
    for way, force in forces.items():
        push = force * (1.0 if way[0] == "+" else -1.0) * np.eye(3)["xyz".index(way[1])]
        lever = state.jacobian(chain.robot.tool_frames[0])[:3]
        given = np.linalg.solve(state.arms.T, state.gravity + lever.T @ push)
        used = [f / (one.push if f > 0.0 else one.pull) for f, one in zip(given, limits, strict=True)]
        assert max(np.abs(used)) == pytest.approx(1.0, abs=1e-6)


def test_a_machine_in_its_plane_has_no_force_across_it():
    assert list(largest_forces(chain_of("bobcat_s570"))) == ["+x", "-x", "+z", "-z"]


def test_check_states_both_in_sentences_and_in_json(capsys):
    assert run(["robots", str(MACHINES / "cat_320"), "--check"]) == 0
    said = capsys.readouterr().out
    assert "the tool reaches 10.01 m from the base's vertical axis, and from -6.71" in said
    assert "at home the tool pushes with at most 40.2 kN along +x" in said
    assert run(["robots", str(MACHINES / "cat_320"), "--check", "--json"]) == 0
    figures = {each["code"]: each["figures"] for each in json.loads(capsys.readouterr().out)["problems"]}
    assert figures["working_range"]["reach_m"] == pytest.approx(10.01, abs=0.005)
    assert figures["largest_force"]["-z"] == pytest.approx(76.4e3, rel=0.01)


def test_check_says_what_a_run_would_refuse(changed):
    found = warnings(changed("jcb_535_95", ('bore = "160 mm"', 'bore = "106 mm"')))
    assert "at home boom_rod needs" in found["little_force_left"]


def test_a_load_heavier_than_its_link_names_the_links_mass(changed):
    folder = changed("kubota_u17", ('mass = "50 kg"', 'mass = "500 kg"'), ('rating = "50 kg"', 'rating = "500 kg"'))
    fixes = [p.fix for p in audit(load_robot(folder)).problems if p.severity == "fatal"]
    assert fixes[0].startswith("add the load to the mass of that link in the URDF")


def test_a_start_out_of_reach_says_so_and_no_joint_turns_around():
    chain = chain_of("bobcat_s570")
    task, home = tool_task(chain), chain.minimal(chain.home)
    with pytest.raises(InputError, match=r"the machine does not reach \(9\.000, 1\.000\)"):
        task.solve(chain, np.array([9.0, 1.0]), home)
    z = task.solve(chain, np.array([2.5, 1.3]), home)
    assert not problems(chain, z)
    assert len(areas(chain.robot.spec.actuation)) == 4


def test_a_bucket_cylinder_on_a_loaders_frame_moves_the_bucket_and_has_its_dead_centre_there():
    """It turns with the arm, too, and more so. With the arm held, its motion over the bucket's is that."""
    chain = chain_of("komatsu_wa380")
    assert [chain.independent[j] for j in moved_joints(chain)] == ["arm", "arm", "bucket"]
    at, rod = np.array([0.526, -1.402]), int(chain.model.joints[chain.model.getJointId("tilt_rod")].idx_q)
    ahead, behind = (chain.configuration(at + np.array([0.0, step]))[rod] for step in (1e-5, -1e-5))
    own = (ahead - behind) / 2e-5
    arms = chain.at(at, np.zeros(2)).arms[2]
    assert arms[1] == pytest.approx(own, abs=1e-6) and abs(arms[0]) > 10.0 * abs(own)
    assert f"tilt_rod is near its dead centre: its moment arm is {abs(own):.3f} m" in " ".join(problems(chain, at))
    assert moved_by(np.diag([1.0, 2.0])[[0, 1, 1]]).tolist() == [0, 1, 1]  # one of twins beside the other
