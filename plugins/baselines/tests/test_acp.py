"""`acp`: soft along the demonstrated force, stiff across it, drawn to a virtual target."""

import copy

import numpy as np
import pytest
from skillframe_baselines.acp import Estimator
from skillframe_testkit.suites import SkillConformance, play

from plugins.baselines.tests.demonstrations import GOAL, approach, both_sides
from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.errors import InputError
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import Pose, norm
from skillframe.skill import Observation, Status


@pytest.mark.slow  # simulated runs of seconds, as for every kind of skill
class TestAcpConforms(SkillConformance):
    skill_type = "acp"

    @property
    def document(self):
        return learn()


def learn(demonstrations=None, **settings):
    return learned(registry().skill("acp"), demonstrations or both_sides(), LearnOptions(settings=settings))


def played(document, times, side=1.0):
    pose, zero = approach(side).pose, np.zeros((1, 6))
    there = Pose(pose.position[:1], pose.rotation[:1])
    seen = [Observation(np.array([t]), 1e-3, there, zero, zero) for t in times]
    return play(registry().skill("acp").build(document), seen, [0])


def test_the_stiffness_is_low_along_the_force_and_high_square_to_it():
    rng = np.random.default_rng(0)
    force = rng.normal(size=(50, 3)) * rng.uniform(0.1, 20.0, (50, 1))
    stiffness, k = Estimator(2000.0, 200.0, 0.5, 5.0, True).stiffness(force)
    along, aside = force / norm(force)[:, None], np.cross(force, rng.normal(size=(50, 3)))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", stiffness, along), k[:, None] * along, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", stiffness, aside), 2000.0 * aside, rtol=1e-9, atol=1e-7)


def test_between_the_two_forces_the_stiffness_falls_on_a_line():
    force = np.outer([0.0, 0.5, 2.75, 5.0, 50.0], [0.0, 0.6, 0.8])
    _, k = Estimator(2000.0, 200.0, 0.5, 5.0, True).stiffness(force)
    np.testing.assert_allclose(k, [2000.0, 2000.0, 1100.0, 200.0, 200.0], rtol=1e-9)  # 2.75 N is half way


def test_a_robot_that_stands_at_the_reference_exerts_the_demonstrated_force():
    force = np.random.default_rng(1).normal(size=(50, 3)) * 6.0
    estimator = Estimator(2000.0, 200.0, 0.5, 5.0, True)
    stiffness, k = estimator.stiffness(force)
    drawn = np.einsum("nij,nj->ni", stiffness, estimator.ahead(force, k, np.zeros_like(force)))
    np.testing.assert_allclose(drawn, force, rtol=1e-9)


def test_a_moving_reference_is_not_drawn_along_its_way_unless_asked():
    force, velocity = np.array([[3.0, 0.0, -8.0]]), np.array([[0.02, 0.0, 0.0]])
    for kept, wanted in ((True, [0.0, 0.0, -0.04]), (False, [0.015, 0.0, -0.04])):
        estimator = Estimator(2000.0, 200.0, 0.5, 5.0, kept)
        np.testing.assert_allclose(estimator.ahead(force, np.array([200.0]), velocity)[0], wanted, atol=1e-12)


def test_at_the_end_it_presses_as_the_demonstrations_did():
    last = played(learn(), [0.0, 2.29])[-1]  # they last 2.3 s in the mean, and stand still at the end
    # 8 N +- .05 N of noise, averaged, over 200 N/m: 40 mm below the goal; the mean motion ends within 1 mm
    assert last.pose.position[0, 2] - GOAL[2] == pytest.approx(-0.04, abs=1.5e-3)
    stiffness = last.impedance.stiffness[0]
    # the noise tips the force by 0.05 / 8 rad, and 2000 N/m times its square is far below 1 N/m
    assert stiffness[2, 2] == pytest.approx(200.0, abs=1.0) and stiffness[0, 0] == pytest.approx(2000.0, abs=1.0)
    assert not last.feedforward.any()


def test_the_force_is_the_mean_of_the_demonstrations():
    hard, other = both_sides()
    soft = Demonstration(
        time=other.time, position=other.position, quaternion=other.quaternion, wrench=0.25 * other.wrench
    )
    last = played(learn([hard, soft]), [0.0, 2.29])[-1]
    # (8 + 2) / 2 = 5 N over 200 N/m, as above
    assert last.pose.position[0, 2] - GOAL[2] == pytest.approx(-0.025, abs=1.5e-3)


def test_before_contact_it_is_a_stiff_motion_that_starts_where_the_tool_is():
    first = played(learn(), [0.0], side=-1.0)[0]
    np.testing.assert_allclose(first.pose.position[0], approach(-1.0).position[0], atol=1e-4)  # 0.2 N / 2000 N/m
    np.testing.assert_allclose(first.impedance.stiffness[0, :3, :3], 2000.0 * np.eye(3), atol=1e-9)


def test_it_ends_when_the_demonstrations_clock_is_over():
    assert [c.status[0] for c in played(learn(), [0.0, 2.0, 2.7])] == [Status.RUNNING, Status.RUNNING, Status.SUCCESS]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"soft": 3000.0}, "0 < soft <= 2000"), ({"soft": 0.0}, "0 < soft"), ({"force_low": 6.0}, "force_low"),
        ({"stifness": 1.0}, "stiffness"), ({"blend": 0.0}, "must be positive"),
    ],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused(settings, said):
    with pytest.raises(InputError, match=said):
        learn(**settings)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["model"].pop("states"), "states"),
        (lambda d: d["model"].update(duration=0.0), "duration"),
        (lambda d: d["model"].update(soft=-1.0), "soft"),
        (lambda d: d["phases"][0].update(name="gmr"), "gmr"),
    ],
)
def test_a_damaged_document_is_refused_by_its_key(change, said):
    document = copy.deepcopy(learn())
    change(document)
    with pytest.raises(InputError, match=said):
        registry().skill("acp").check(document)


def test_it_is_described_by_what_it_does():
    said = " ".join(registry().skill("acp").describe(learn()))
    assert "soft along the force (200 N/m from 5 N on)" in said and "largest 8 N" in said
