"""Joints that follow others: a telescope of two stages, and a linkage that a mimic tag stands for."""

import dataclasses
import re

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from skillframe_hydraulics.law.symbolic_chain import closing_function

from skillframe.errors import SkillframeError
from skillframe.extend.drives import audit
from skillframe.robot.chain import ClosedChain
from skillframe.robot.loops import followers_of
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.convert import build_spec
from skillframe.world.layout import Layout
from tests.digger import COMMON, write_digger
from tests.references import attach_payload, chain_step

LINK = '<link name="{0}"><inertial><origin xyz="0.2 0 0"/><mass value="{1}"/><inertia ixx="0.2" ixy="0" ixz="0" iyy="2"'
STAGE = (
    '<joint name="{0}" type="prismatic"><parent link="{1}"/><child link="{0}_link"/><origin xyz="0.5 0 0"/>'
    '<axis xyz="1 0 0"/><limit lower="0" upper="0.6" effort="0" velocity="1"/>{2}</joint>\n'
    + LINK.format("{0}_link", "{3}") + ' iyz="0" izz="2"/></inertial></link>\n'
)  # fmt: skip
RATIO, OFFSET = 0.8, 0.05
MIMIC = f'<mimic joint="{{}}" multiplier="{RATIO}" offset="{OFFSET}"/>'
ROCKER = (
    '<joint name="rocker" type="revolute"><parent link="stick"/><child link="rocker"/><origin xyz="0.85 0 0.03"/>'
    '<axis xyz="0 -1 0"/><limit lower="0.2" upper="2.9" effort="0" velocity="3"/>'
    '<mimic joint="bucket" multiplier="0.9" offset="1.9"/></joint>\n'
    + LINK.format("rocker", 5.0) + ' iyz="0" izz="2"/></inertial></link>\n'
)  # fmt: skip


def write_telescope(folder, leader="out", after="[home]\nout = 0.2"):
    """The digger with two stages between stick and bucket, of which a cylinder moves the first."""
    write_digger(folder)
    urdf, toml = folder / "digger.urdf", folder / "robot.toml"
    stages = STAGE.format("out", "stick", "", 30.0) + STAGE.format("further", "out_link", MIMIC.format(leader), 20.0)
    text = urdf.read_text().replace("</robot>", f"{stages}</robot>")
    for name in ("bucket", "bucket_barrel_pivot"):
        joint = f'<joint name="{name}" type="revolute"><parent link='
        text = text.replace(f'{joint}"stick"', f'{joint}"further_link"')
    urdf.write_text(text)
    figures = "bore = 0.05, rod = 0.03, dead_volume_a = 2e-4, dead_volume_b = 2e-4, rated_flow = 4.0e-4, stroke = 0.6"
    drive = f'\n[[actuation]]\njoint = "out"\nfmu = "hydraulic_cylinder"\nparameters = {{ {figures}, {COMMON} }}\n'
    toml.write_text(toml.read_text().replace("[home]", after) + drive)
    return folder


def write_rocker(folder):
    """The digger whose bucket cylinder pushes a rocker, which follows the bucket in place of a link between them."""
    write_digger(folder)
    urdf = folder / "digger.urdf"
    eye = (
        '<joint name="bucket_eye_mount" type="fixed"><parent link="{}"/><child link="bucket_eye"/><origin xyz="{} 0 {}"'
    )
    text = urdf.read_text()
    assert eye.format("bucket", 0.05, 0.2) in text
    text = text.replace(eye.format("bucket", 0.05, 0.2), eye.format("rocker", 0.22, 0))
    urdf.write_text(text.replace("</robot>", f"{ROCKER}</robot>"))
    return folder


@pytest.fixture(params=[write_telescope, write_rocker])
def chain(request, tmp_path):
    return ClosedChain(load_model(load_robot(request.param(tmp_path))))


def test_a_follower_is_a_dependent_joint_at_its_place_on_the_whole_way(chain):
    follower, leader, ratio, offset = {
        "out": ("further", "out", RATIO, OFFSET), "tool": ("rocker", "bucket", 0.9, 1.9)
    }["out" if "out" in chain.independent else "tool"]  # fmt: skip
    a, b = (chain.model.getJointId(name) - 1 for name in (follower, leader))
    assert follower not in chain.independent and leader in chain.independent
    closing = closing_function(chain)
    rng = np.random.default_rng(4)
    for _ in range(20):
        z = chain.minimal(chain.home) + rng.uniform(-0.15, 0.15, len(chain.free))
        q = chain.configuration(z)
        assert q[a] == pytest.approx(ratio * q[b] + offset, abs=1e-12)
        assert np.abs(chain.gaps(q)).max() < 1e-10
        near = chain.configuration(z + 1e-3)
        np.testing.assert_allclose(np.array(closing(z, near)[0]).ravel(), q, atol=1e-10)


def test_transmission_and_mass_matrix_are_those_of_differences_and_of_energy(chain):
    rng, h = np.random.default_rng(6), 1e-6
    z, zd = chain.minimal(chain.home), rng.uniform(-1.0, 1.0, len(chain.free))
    state = chain.at(z, zd)
    moved = [chain.configuration(z + s) - chain.configuration(z - s) for s in h * np.eye(len(z))]
    np.testing.assert_allclose(state.embedding, np.array(moved).T / (2.0 * h), atol=1e-8)
    assert 0.5 * zd @ state.mass @ zd == pytest.approx(state.energy()[0], rel=1e-12)
    along = 1e-5  # s
    before, after = (chain.at(z + s * zd, zd).embedding for s in (-along, along))
    np.testing.assert_allclose(state.drift_of(zd), (after - before) @ zd / (2.0 * along), atol=1e-6)


def test_without_loops_it_is_pinocchios_own_mimic_model(tmp_path):
    """Mass matrix and gravity of a boom with a telescope, to rounding."""
    stages = STAGE.format("out", "boom", "", 30.0) + STAGE.format("further", "out_link", MIMIC.format("out"), 20.0)
    boom = '<joint name="boom" type="revolute"><parent link="base"/><child link="boom"/><axis xyz="0 -1 0"/>'
    boom += '<limit lower="-1" upper="1" effort="0" velocity="1"/></joint>\n'
    inertia = ' iyz="0" izz="2"/></inertial></link>\n'
    text = f'<robot name="r"><link name="base"/>{boom}{LINK.format("boom", 50.0)}{inertia}{stages}</robot>'
    (tmp_path / "r.urdf").write_text(text)
    drives = "".join(f'[[actuation]]\njoint = "{joint}"\nfmu = "x"\n' for joint in ("boom", "out"))
    toml = f'urdf = "r.urdf"\n{drives}[drive]\nkind = "hydraulic"\n[[arm]]\nname = "arm"\ntool_frame = "further_link"\n'
    (tmp_path / "robot.toml").write_text(toml)
    chain = ClosedChain(load_model(load_robot(tmp_path)))
    theirs = pin.buildModelFromXML(text, mimic=True)
    data, z = theirs.createData(), np.array([0.4, 0.3])
    state = chain.at(z, np.zeros(2))
    upper = np.triu(pin.crba(theirs, data, z))
    np.testing.assert_allclose(state.mass, upper + np.triu(upper, 1).T, rtol=1e-12)
    np.testing.assert_allclose(state.gravity, pin.computeGeneralizedGravity(theirs, data, z), rtol=1e-12)


def test_a_joint_that_is_drawn_backwards_leads_and_follows_with_the_other_sign(tmp_path):
    robot = load_model(load_robot(write_telescope(tmp_path)))
    for turned, sign, shift in (((), 1, 1), (("out",), -1, 1), (("further",), -1, -1), (("out", "further"), 1, -1)):
        (found,) = followers_of(dataclasses.replace(robot, turned=turned))
        assert (found.ratio, found.offset) == (sign * RATIO, shift * OFFSET)


def test_check_finds_nothing_of_either_and_names_a_leader_that_does_not_move(chain, tmp_path):
    assert audit(chain.robot.spec).usable
    for leader, after in (("tool_mount", "[home]\nout = 0.2"), ("out", "[lock]\nout = 0.2\n[home]")):
        folder = write_telescope(tmp_path / leader, leader, after)
        text = (folder / "robot.toml").read_text()
        if leader == "out":
            (folder / "robot.toml").write_text(text[: text.rindex("[[actuation]]")])
        with pytest.raises(SkillframeError, match=re.escape(f"follows '{leader}', which does not move")):
            ClosedChain(load_model(load_robot(folder)))


def test_mujocos_constraints_move_it_as_the_reduced_equations_do(chain, scene):
    """50 ms under forces off balance, within 0.2 % of the way."""
    tool = scene("free").tool
    model = build_spec(chain.robot, scene("free")).compile()
    data, layout = mujoco.MjData(model), Layout(model)
    held = attach_payload(chain.robot.model, chain.robot.tool_frames[0], tool.mass, tool.center_of_mass, tool.inertia)
    loaded = ClosedChain(dataclasses.replace(chain.robot, model=held))
    z, zd = loaded.minimal(loaded.home), np.zeros(len(loaded.free))
    data.qpos = layout.to_mujoco(loaded.model, loaded.home[None])[0]
    force = 1.1 * loaded.at(z, zd).holding_force() + 200.0
    data.qfrc_applied[[int(model.joint(name).dofadr[0]) for name in loaded.actuated]] = force
    start = z.copy()
    for _ in range(50):
        mujoco.mj_step(model, data)
        z, zd = chain_step(loaded, z, zd, force, 0.001)
    found = loaded.minimal(layout.to_pinocchio(loaded.model, data.qpos[None])[0])
    assert np.abs(z - start).min() > 1e-4
    np.testing.assert_allclose(found, z, atol=2e-3 * np.abs(z - start).max())
