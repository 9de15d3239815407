"""Worlds as Gymnasium environments: the interface, seeds, bits, and the verdict of `run`."""

import warnings

import gymnasium
import numpy as np
import pytest
import skillframe_gym
from gymnasium.utils.env_checker import check_env
from skillframe_gym.environments import WorldEnv, WorldVectorEnv

from skillframe.api.inputs import robot_of, scene_of
from skillframe.errors import InputError, SkillframeError
from skillframe.execution.executor import Setup, simulate
from skillframe.frames import Pose, rotation_matrix
from skillframe.skill import Command, Impedance, Skill, no_reasons

PEG = "skillframe/peg_in_hole-v0"
CHEAP = {"robot": "free_tool", "duration_s": 0.5}
WIDE = {"fixture.offset_x": {"uniform": [-0.002, 0.002]}}
MACHINES = {"skillframe/pallets-v0"}


def check(name, **settings):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name, **settings).unwrapped)


def rollout(env, steps, seed, actions):
    """Observations, rewards and ends of an environment under the same actions."""
    seen = [env.reset(seed=seed)[0]]
    rest = []
    for k in range(steps):
        observation, *more = env.step(actions[k])
        seen.append(observation)
        rest.append(more[:3])
    return seen, rest


@pytest.mark.slow
def test_the_peg_passes_the_checker():
    check(PEG, robot="free_tool", rate_hz=100.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*skillframe_gym.names()} - MACHINES - {PEG}))
@pytest.mark.figures
def test_every_world_passes_the_checker(name):
    check(name, rate_hz=100.0)


@pytest.mark.figures
@pytest.mark.parametrize("name", sorted(MACHINES))
def test_a_machine_in_its_world_passes_the_checker(name):
    check(name, rate_hz=100.0)


@pytest.mark.slow
def test_a_vector_environment_is_as_many_single_ones_to_the_last_bit_also_after_some_began_again():
    count, steps = 3, 14  # 10 actions an episode; the first to end is ended by the force that its push meets
    rng = np.random.default_rng(5)
    actions = rng.uniform(-1, 1, (steps, count, 12)).astype(np.float32)
    actions[:, 1:, :6] *= 0.1
    actions[:, 0, 2], actions[:, 0, 6:] = -1.0, 1.0
    settings = {**CHEAP, "vary": WIDE, "variable_stiffness": True, "reach_m": 0.05}
    many = gymnasium.make_vec(PEG, num_envs=count, **settings)
    assert isinstance(many, WorldVectorEnv)
    seen, rest = rollout(many, steps, 3, actions)
    over = np.array([ended | late for _, ended, late in rest])
    assert over[:9, 0].any() and not over[:9, 1].any()  # so that they tick in different batches from then on
    for i in range(count):
        env = WorldEnv("peg_in_hole", **settings)
        single, _ = env.reset(seed=3 + i)
        done = False
        for k in range(steps + 1):
            assert all(np.array_equal(single[name], seen[k][name][i]) for name in single), (i, k)
            if k == steps:
                break
            if done:
                (single, _), told = env.reset(), [0.0, False, False]
            else:
                single, *told, _ = env.step(actions[k, i])
            assert [float(told[0]), *told[1:]] == [float(part[i]) for part in rest[k][:1]] + [
                bool(part[i]) for part in rest[k][1:]
            ]
            done = told[1] or told[2]
    with pytest.raises(SkillframeError, match="reset"):
        WorldEnv("free", "free_tool").step(np.zeros(6, np.float32))


@pytest.mark.slow
def test_a_picture_is_drawn_where_it_is_asked_for_and_shows_the_tool_where_it_is():
    env = WorldEnv("peg_in_hole", **CHEAP, render_mode="rgb_array")
    with pytest.raises(SkillframeError, match="reset"):
        env.render()
    env.reset(seed=1)
    first = env.render()
    assert first.shape == (240, 320, 3) and first.dtype == np.uint8 and np.array_equal(first, env.render())
    env.step(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    changed = np.any(env.render() != first, axis=-1)
    assert 0.001 < changed.mean() < 0.5  # the tool has sunk, and the camera stays
    assert WorldEnv("peg_in_hole", **CHEAP).render() is None
    with pytest.raises(SkillframeError, match="human"):
        WorldEnv("peg_in_hole", **CHEAP, render_mode="human")


def test_the_same_seed_is_the_same_episode_and_another_is_another():
    env = WorldEnv("peg_in_hole", **CHEAP, vary=WIDE)
    actions = np.zeros((2, 6), np.float32)
    first, again, other = (rollout(env, 2, seed, actions)[0] for seed in (4, 4, 5))
    assert all(np.array_equal(a[name], b[name]) for a, b in zip(first, again, strict=True) for name in a)
    assert not np.array_equal(first[-1]["wrench"], other[-1]["wrench"])  # noise of its sensor, tilt of its start


class Scripted(Skill):
    """Does in `run`'s loop what the environment does with a list of actions: a target every 50 ticks."""

    def __init__(self, actions):
        self.actions, self.tick = actions, 0

    def start(self, observation, rngs):
        self.seen = observation

    def step(self, observation):
        if self.tick == 0 or self.tick % 50 == 1:
            position, rotation = self.seen.pose
            action = np.zeros(6) if self.tick == 0 else self.actions[self.tick // 50]
            turn = rotation_matrix(0.1 * action[None, 3:])
            self.target = Pose(position + 0.1 * action[:3], turn @ rotation)
        self.seen, self.tick, still = observation, self.tick + 1, np.zeros((1, 6))
        stiff = Impedance(np.broadcast_to(np.diag([1000.0] * 3 + [50.0] * 3), (1, 6, 6)))
        return Command(self.target, still, stiff, still, np.zeros(1, np.int64), no_reasons(1))


@pytest.mark.parametrize(
    ("push", "world", "ended"), [(-1.0, "peg_in_hole", "force"), (0.0, "peg_in_hole", "time"), (0.0, "free", "goal")]
)
def test_an_episode_has_the_verdict_of_run(push, world, ended):
    given = {"start.offset_x": 0.01} if push else {}  # beside the hole, so that the push meets the face
    env = WorldEnv(world, robot="free_tool", duration_s=0.5, set=given, starts="nominal", reach_m=0.1)
    actions = np.zeros((10, 6))
    actions[:, 2], actions[:, 4] = push, 0.1
    env.reset(seed=1)
    for action in actions:
        _, reward, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            break
    scene, robot = scene_of(world, None, depth=1)[0], robot_of("free_tool")
    setup = Setup(
        robot=robot, scene=scene, center_of_compliance=np.array(scene.tool.frames["tip"]), stop_when=scene.goal
    )
    rng = np.random.default_rng(1).spawn(1)[0].spawn(2)[1]
    draws = {name: np.array([value]) for name, value in given.items()}
    result = simulate(Scripted(actions), setup, draws, [rng], duration_s=0.5)
    assert info["ended_by"] == ended == result.ended_by[0]
    assert (info["is_success"], info["failure"]) == (bool(result.success[0]), result.failure[0])
    assert info["peak_force_n"] == result.peak_force_n[0] and info["duration_s"] == result.duration_s[0]
    assert (info["final_error_m"], info["final_error_rad"]) == (result.final_error_m[0], result.final_error_rad[0])
    assert (terminated, truncated) == (ended != "time", ended == "time")
    assert reward == pytest.approx({"force": -10.0, "time": 0.0, "goal": 10.0}[ended], abs=1.0)  # and the last way


def test_an_episode_that_begins_inside_the_fixture_is_refused_and_not_drawn_again():
    inside = {"fixture.offset_x": 0.02, "fixture.offset_z": 0.002}
    with pytest.raises(InputError, match=r"is no trial: the tool is [\d.]+ mm inside the fixture"):
        WorldEnv("peg_in_hole", **CHEAP, set=inside).reset(seed=1)
    with pytest.raises(InputError, match=r"is no trial: the tool is [\d.]+ mm inside the fixture"):
        WorldVectorEnv(2, "peg_in_hole", **CHEAP, set=inside).reset(seed=1)
    WorldEnv("peg_in_hole", **CHEAP, set={**inside, "fixture.offset_z": 0.00105}).reset(seed=1)
