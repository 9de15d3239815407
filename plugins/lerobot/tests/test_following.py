"""A skill at a policy's rate: its push is the environment's, whatever the points, the stiffness and the reach."""

import numpy as np
import pytest
from lerobot_policy_skillframe.following import Following, Points, read_skill
from skillframe_gym.environments import WorldEnv
from skillframe_gym.settings import SOFTEST, STIFFEST, EnvSettings

from skillframe.errors import InputError
from skillframe.frames import Pose, matrix_from_quaternion, move_wrench, quaternion_from_matrix, rotation_matrix
from skillframe.skill import Command, Impedance, Skill, Status

SKILL = "plugins/baselines/comparison/straight.skill.json"  # pushes down with 1000 N/m at 20 mm/s, and turns freely
STATE = np.array([[0.4, 0.1, 0.3, 1.0, 0.0, 0.0, 0.0]])  # upside down, as tools point
NOTHING = np.zeros((1, 6))


def following(points=None, **settings):
    return Following(read_skill(SKILL), EnvSettings(**settings), points or Points(compliant="tip"))


class Wants(Skill):
    """Wants one pose with one stiffness from where it starts, and ends with a status."""

    def __init__(self, way, turn, stiffness, feedforward=None, status=Status.RUNNING):
        self.way, self.turn, self.stiffness, self.status = way, turn, stiffness, status
        self.feedforward = np.zeros(6) if feedforward is None else feedforward

    def start(self, observation, rngs):
        self.home, self.count = observation.pose, len(rngs)

    def step(self, observation):
        pose = Pose(self.home.position + self.way, rotation_matrix(self.turn) @ self.home.rotation)
        told = np.full(self.count, int(self.status)), np.full(self.count, "done" * bool(self.status), dtype=object)
        wrench = np.tile(self.feedforward, (self.count, 1))
        return Command(pose, np.zeros((self.count, 6)), Impedance(self.stiffness), wrench, *told)


def wanting(monkeypatch, skill, points=None, **settings):
    monkeypatch.setattr(Following, "_build", lambda self: skill)
    return following(points, **settings)


def test_the_push_of_a_skill_is_taken_over_in_units_of_the_reach():
    policy = following()
    assert np.array_equal(policy.act(STATE, NOTHING), np.zeros((1, 6)))  # the first desired pose is the measured one
    # 1 mm after a twentieth of a second, 1 N, of 20 N
    assert policy.act(STATE, NOTHING) == pytest.approx(np.array([[0, 0, -0.05, 0, 0, 0]]), abs=1e-12)
    policy.reset()
    assert np.array_equal(policy.act(STATE, NOTHING), np.zeros((1, 6)))


def random_case(rng):
    root = rng.normal(size=(6, 6))
    stiffness = np.diag([30.0] * 3 + [1.0] * 3) @ root @ root.T @ np.diag([30.0] * 3 + [1.0] * 3)
    turn, way = rng.uniform(-0.05, 0.05, 3), rng.uniform(-0.002, 0.002, 3)
    attitude = quaternion_from_matrix(rotation_matrix(rng.normal(size=3)))
    return stiffness, way, turn, np.concatenate([rng.normal(size=3), attitude])[None]


def test_both_laws_push_alike_at_the_observed_point_wherever_the_centre_of_compliance_is(monkeypatch):
    rng = np.random.default_rng(3)
    for _ in range(20):
        stiffness, way, turn, state = random_case(rng)
        center, feedforward = rng.uniform(-0.1, 0.1, 3), rng.uniform(-1.0, 1.0, 6)
        points = Points(observed="tip", compliant=",".join(map(str, center)))
        policy = wanting(monkeypatch, Wants(way, turn, stiffness, feedforward), points, reach_m=10.0, reach_rad=10.0)
        action = policy.act(state, NOTHING)[0]
        there = stiffness @ np.concatenate([way, turn]) + feedforward
        arm = matrix_from_quaternion(state[0, 3:]) @ (center - [0.0, 0.0, 0.2])
        pushed = np.repeat([1000.0, 50.0], 3) * 10.0 * action
        assert pushed == pytest.approx(move_wrench(there, -arm), rel=1e-9, abs=1e-9)


def test_a_stiffness_that_may_be_chosen_is_the_skill_s_diagonal_within_the_bounds(monkeypatch):
    rng = np.random.default_rng(4)
    for _ in range(20):
        stiffness, way, turn, state = random_case(rng)
        policy = wanting(monkeypatch, Wants(way, turn, stiffness), variable_stiffness=True, reach_m=1.0, reach_rad=1.0)
        action = policy.act(state, NOTHING)
        chosen = np.diagonal(policy.settings.gains(action)[0])
        assert chosen == pytest.approx(np.clip(np.diagonal(stiffness), SOFTEST, STIFFEST), rel=1e-9)
        pushed = chosen * action[0, :6]
        assert pushed == pytest.approx(stiffness @ np.concatenate([way, turn]), rel=1e-9, abs=1e-9)


def test_a_push_beyond_the_reach_is_shortened_and_keeps_its_direction(monkeypatch):
    stiffness = np.diag([1000.0] * 3 + [50.0] * 3)
    policy = wanting(monkeypatch, Wants(np.array([0.06, -0.03, 0.0]), np.array([0.0, 0.05, 0.0]), stiffness))
    assert policy.act(STATE, NOTHING)[0] == pytest.approx([1.0, -0.5, 0.0, 0.0, 0.5, 0.0], abs=1e-9)


def test_a_skill_that_has_ended_pushes_no_more_and_its_reason_stays(monkeypatch):
    skill = Wants(np.array([0.01, 0.0, 0.0]), np.zeros(3), 1000.0 * np.eye(6))
    policy = wanting(monkeypatch, skill)
    assert policy.act(STATE, NOTHING)[0, 0] == pytest.approx(0.5)
    skill.status = Status.SUCCESS
    assert np.array_equal(policy.act(STATE, NOTHING), np.zeros((1, 6)))
    skill.status = Status.RUNNING
    assert np.array_equal(policy.act(STATE, NOTHING), np.zeros((1, 6)))
    assert policy.status[0] == Status.SUCCESS and policy.reason[0] == "done"


def test_what_cannot_be_used_is_refused_in_a_sentence():
    policy = following()
    policy.act(STATE, NOTHING)
    with pytest.raises(InputError, match=r"of 2 trials, and the episode began with 1.*reset"):
        policy.act(np.repeat(STATE, 2, axis=0), np.repeat(NOTHING, 2, axis=0))
    for state, wrench, said in ((STATE[:, :6], NOTHING, "state"), (STATE, np.full((1, 6), np.nan), "wrench")):
        with pytest.raises(InputError, match=said):
            policy.act(state, wrench)
    with pytest.raises(InputError, match="skill file"):
        read_skill("")


@pytest.mark.parametrize("variable", [False, True])
@pytest.mark.slow
def test_a_push_by_hand_inserts_the_peg_through_the_environment(variable):
    env = WorldEnv("peg_in_hole", "free_tool", variable_stiffness=variable, starts="nominal", duration_s=8.0)
    policy = following(variable_stiffness=variable)
    observation, _ = env.reset(seed=1)
    over = False
    while not over:
        state = np.concatenate([observation["position"], observation["quaternion"]])[None]
        observation, _, ended, late, info = env.step(policy.act(state, observation["wrench"][None])[0])
        over = ended or late
    assert info["is_success"], info["failure"]
