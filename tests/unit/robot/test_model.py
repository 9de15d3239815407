"""The nominal model: joints by name, continuous and mimic joints, free bases, payloads, overlays."""

import numpy as np
import pinocchio as pin
import pytest

from skillframe.errors import InputError, UnknownName
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.references import attach_payload


def load(path):
    return load_model(load_robot(path))


def mass_matrix(model, q):
    upper = np.triu(pin.crba(model, model.createData(), q))
    return upper + np.triu(upper, 1).T


def test_home_is_by_joint_name_although_pinocchio_sorts_joints_by_the_alphabet(save, urdf):
    text = urdf.robot(
        urdf.link("base"),
        urdf.link("right", urdf.inertial(1, 0.3)),
        urdf.link("left", urdf.inertial(1, 0.3)),
        urdf.joint("zulu", "base", "right"),
        urdf.joint("alpha", "base", "left"),
    )
    robot = load(save(text, "[home]\nzulu = 0.7\nalpha = -0.2"))
    assert list(robot.model.names)[1:] == ["alpha", "zulu"]  # the trap: not the order of the file
    np.testing.assert_array_equal(robot.home, [-0.2, 0.7])


def test_a_continuous_joint_at_home_is_its_cosine_and_sine(save, urdf):
    text = urdf.robot(
        urdf.link("a"), urdf.link("b", urdf.inertial(1, 0.3)), urdf.joint("j", "a", "b", "continuous", inside="")
    )
    robot = load(save(text, "[home]\nj = 2.5"))
    assert (robot.model.nq, robot.model.nv) == (2, 1)
    np.testing.assert_allclose(robot.home, [np.cos(2.5), np.sin(2.5)])


def test_joints_without_a_home_stand_at_neutral_or_at_the_nearest_limit(save, urdf):
    limit = '<limit lower="0.4" upper="1.5" effort="50" velocity="2"/>'
    text = urdf.robot(
        urdf.link("a"),
        urdf.link("b"),
        urdf.link("c"),
        urdf.joint("j", "a", "b", inside=limit),
        urdf.joint("k", "b", "c"),
    )
    np.testing.assert_array_equal(load(save(text)).home, [0.4, 0.0])


@pytest.mark.parametrize(
    ("toml", "sentence"),
    [
        ("[home]\nj9 = 0.0", "unknown joint 'j9'"),
        ("[home]\nj = 1.6", "outside the joint's limits"),
        ("[[arm]]\nname = 'arm'\ntool_frame = 'j'", "unknown tool_frame 'j'"),
        ("[[arm]]\nname = 'arm'\ntool_frame = 'bb'", "did you mean 'b'"),
        ("[inertia]\nc = { mass = 1, inertia = [1, 1, 1, 0, 0, 0] }", "unknown link 'c'"),
        ("[[loop]]\nframe_a = 'a'\nframe_b = 'bb'", "unknown frame 'bb'; did you mean 'b'.*\\[\\[loop"),
        ("[[actuation]]\njoint = 'jj'\nfmu = 'x'", "unknown joint 'jj'; did you mean 'j'.*\\[\\[actuation"),
    ],
)
def test_a_robot_toml_that_does_not_fit_its_urdf_is_refused(save, urdf, toml, sentence):
    text = urdf.robot(urdf.link("a"), urdf.link("b"), urdf.joint("j", "a", "b"))
    with pytest.raises((InputError, UnknownName), match=sentence):
        load(save(text, toml))


FOLLOW = '<limit lower="-3" upper="3" effort="50" velocity="2"/><mimic joint="{}" multiplier="-2" offset="0.3"/>'


def gripper(urdf, leader="j"):
    return urdf.robot(
        urdf.link("a"),
        urdf.link("b", urdf.inertial(1.0, 0.3)),
        urdf.link("c", urdf.inertial(2.0, 0.2)),
        urdf.joint("j", "a", "b"),
        urdf.joint("k", "b", "c", axis="0 1 0", inside=FOLLOW.format(leader)),
    )


def test_a_mimic_joint_follows_with_the_inertia_of_the_constrained_robot(save, urdf):
    follows, free = load(save(gripper(urdf))), load(save(gripper(urdf), "mimic = false"))
    assert (follows.model.nv, free.model.nv, follows.followers) == (1, 2, ("k",))
    coupling = np.array([[1.0], [-2.0]])
    for angle in (-0.7, 0.0, 0.9):
        whole = mass_matrix(free.model, np.array([angle, -2.0 * angle + 0.3]))
        # 1e-12: both sum the same few products of order one
        np.testing.assert_allclose(
            mass_matrix(follows.model, np.array([angle])), coupling.T @ whole @ coupling, atol=1e-12
        )


@pytest.mark.parametrize("leader", ["nobody", "k"])
def test_a_mimic_joint_that_cannot_follow_is_independent_and_says_so(save, urdf, leader):
    robot = load(save(gripper(urdf, leader)))
    assert robot.model.nv == 2
    assert robot.followers == ()
    assert robot.mimic_fallback != ""


def test_a_followers_home_is_not_for_the_user_to_set(save, urdf):
    with pytest.raises(UnknownName, match="follows another"):
        load(save(gripper(urdf), "[home]\nk = 0.1"))


def test_missing_limits_mean_unlimited_effort_and_a_wide_range(save, urdf):
    model = load(save(urdf.robot(urdf.link("a"), urdf.link("b"), urdf.joint("j", "a", "b", inside="")))).model
    assert np.isinf(model.effortLimit).all()
    assert np.isinf(model.velocityLimit).all()
    np.testing.assert_allclose([model.lowerPositionLimit[0], model.upperPositionLimit[0]], [-2 * np.pi, 2 * np.pi])


def test_two_arms_have_a_tool_frame_each(save, urdf):
    arms = "".join(f'[[arm]]\nname = "{n}"\ntool_frame = "{n}_hand"\n' for n in ("left", "right"))
    parts = [urdf.link("base")]
    for side in ("left", "right"):
        parts += [urdf.link(f"{side}_hand", urdf.inertial(1, 0.3)), urdf.joint(f"{side}_j", "base", f"{side}_hand")]
    robot = load(save(urdf.robot(*parts), arms))
    assert [robot.model.frames[f].name for f in robot.tool_frames] == ["left_hand", "right_hand"]
    assert robot.arm_index("right") == 1
    with pytest.raises(UnknownName, match="did you mean 'left'"):
        robot.arm_index("leftt")


def test_a_free_base_adds_a_free_flyer_that_carries_the_roots_inertia(save, urdf):
    text = urdf.tree(3, 4).replace('<link name="base"></link>', urdf.link("base", urdf.inertial(7.0, 1.0)))
    robot = load(save(text, 'base = "free"'))
    assert (robot.model.nq, robot.model.nv) == (7 + 4, 6 + 4)
    assert robot.model.inertias[1].mass == 7.0
    np.testing.assert_array_equal(robot.home[:7], [0, 0, 0, 0, 0, 0, 1])


def test_an_overlay_replaces_the_urdfs_inertia(save, urdf):
    text = urdf.robot(urdf.link("a"), urdf.link("b", urdf.inertial(1, 0.3)), urdf.joint("j", "a", "b"))
    robot = load(
        save(
            text, "[inertia]\nb = { mass = 3.0, com = [0, 0, 0.1], inertia = [0.02, 0.03, 0.04, 0.001, 0.002, 0.003] }"
        )
    )
    inertia = robot.model.inertias[1]
    assert inertia.mass == 3.0
    np.testing.assert_allclose(inertia.lever, [0, 0, 0.1])
    np.testing.assert_allclose(inertia.inertia, [[0.02, 0.001, 0.002], [0.001, 0.03, 0.003], [0.002, 0.003, 0.04]])


def test_a_payload_weighs_what_it_weighs_at_every_configuration_and_leaves_the_model_alone():
    robot = load("panda")
    com = np.array([0.01, -0.02, 0.15])
    loaded = attach_payload(robot.model, "flange", 1.3, com, [0.003, 0.004, 0.001])
    rng = np.random.default_rng(0)
    for _ in range(10):
        q = rng.uniform(robot.model.lowerPositionLimit, robot.model.upperPositionLimit)
        change = [pin.computeGeneralizedGravity(m, m.createData(), q) for m in (robot.model, loaded)]
        data = robot.model.createData()
        jacobian = pin.computeFrameJacobian(robot.model, data, q, robot.tool_frames[0], pin.LOCAL_WORLD_ALIGNED)
        arm = data.oMf[robot.tool_frames[0]].rotation @ com
        wrench = np.concatenate([[0, 0, -1.3 * 9.81], np.cross(arm, [0, 0, -1.3 * 9.81])])
        np.testing.assert_allclose(change[1] - change[0], -jacobian.T @ wrench, atol=1e-10)  # torques up to 20 N m
    assert sum(i.mass for i in loaded.inertias) == pytest.approx(sum(i.mass for i in robot.model.inertias) + 1.3)


def test_a_robot_with_more_joints_than_memory_is_refused(save, urdf):
    parts = [urdf.link("l0")]
    for i in range(400):
        parts += [urdf.link(f"l{i + 1}"), urdf.joint(f"j{i}", "l0", f"l{i + 1}")]
    with pytest.raises(InputError, match="400 degrees of freedom"):
        load(save(urdf.robot(*parts)))


def test_what_only_pinocchio_refuses_is_one_sentence_too(save, urdf, monkeypatch, capfd):
    monkeypatch.setattr("skillframe.robot.model._bare_tree", lambda *_: "<robot><link/></robot")
    with pytest.raises(InputError, match="refused by Pinocchio"):
        load(save(urdf.tree(0, 2)))
    assert capfd.readouterr().err == ""
