import copy
import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import synthetic as syn
from hypothesis import given, settings
from hypothesis import strategies as st
from skillframe_lmc.learner import learn
from skillframe_lmc.phase import speed
from skillframe_lmc.runtime import build

from skillframe.errors import InputError
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float, Pose, norm, rotation_matrix, rotation_vector, unit
from skillframe.skill import Command, Observation, Skill, Status

DT = 1e-3


def part(direction: list[float] | None, speed: float, axes: list[list[float]], k: float) -> Document:
    u = np.array(axes).reshape(-1, 3)
    gain = k * (np.eye(3) - u.T @ u)
    return {
        "desired_direction": direction, "speed": speed, "compliant_axes": axes, "fully_compliant": False,
        "stiffness": gain.tolist(), "damping": (20.0 * np.eye(3)).tolist(), "evidence": {},
    }  # fmt: skip


def document(*, turn: bool = False, axes: str = "base", **stop: float) -> Document:
    rotation = part([0.0, 1.0, 0.0] if turn else None, 0.05 if turn else 0.0, [] if turn else [[0.0, 1.0, 0.0]], 20.0)
    phase = {
        "translation": part([0.0, 0.0, -1.0], 0.02, [[1.0, 0.0, 0.0]], 1000.0),
        "rotation": rotation,
        "pitch": 0.4 if turn else None,
        "stop": stop,
    }
    points = {key: [0.0, 0.0, 0.0] for key in ("work_at", "learned_at", "center_of_compliance")}
    return {"frame": {**points, "axes": axes}, "phases": [phase]}


def observe(time: float, position: Float, rotation: Float | None = None, force: float = 0.0) -> Observation:
    n = len(position)
    rotation = np.broadcast_to(np.eye(3), (n, 3, 3)) if rotation is None else rotation
    wrench = np.zeros((n, 6))
    wrench[:, 2] = force
    return Observation(np.full(n, time), DT, Pose(position, rotation), np.zeros((n, 6)), wrench)


def run(skill: Skill, observations: Iterator[Observation]) -> Iterator[tuple[Observation, Command]]:
    for k, observation in enumerate(observations):
        if k == 0:
            skill.start(observation, [np.random.default_rng(i) for i in range(len(observation.time))])
        yield observation, skill.step(observation)


def still(seconds: float, force: float = 5.0) -> Iterator[Observation]:
    return (observe(k * DT, np.zeros((1, 3)), force=force) for k in range(int(seconds / DT)))


@settings(max_examples=6, deadline=None)  # of four trials with 1500 steps each, any of which breaks a wrong limit
@given(seed=st.integers(0, 10_000), turn=st.booleans())
def test_the_desired_pose_never_leads_by_more_than_the_limit(seed: int, turn: bool) -> None:
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.normal(0.0, 2e-4, (1500, 4, 3)), axis=0)
    spin = np.cumsum(rng.normal(0.0, 1e-3, (1500, 4, 3)), axis=0)
    stream = (observe(k * DT, walk[k], rotation_matrix(spin[k])) for k in range(1500))
    for observation, command in run(build(document(turn=turn, travel_limit_m=10.0)), stream):
        lead = (command.pose.position - observation.pose.position) @ np.array([0.0, 0.0, -1.0])
        assert lead.max() <= 20.0 / 1000.0 + 1e-9
        if turn:
            error = rotation_vector(command.pose.rotation @ np.swapaxes(observation.pose.rotation, -1, -2))
            # moving back by the excess about the axis removes it up to second order in the other axes' errors
            assert (error @ np.array([0.0, 1.0, 0.0])).max() <= 2.0 / 20.0 + 5e-3


@given(seed=st.integers(0, 10_000), axes=st.sampled_from(["base", "phase_start"]))
def test_the_first_desired_pose_is_the_measured_one(seed: int, axes: str) -> None:
    rng = np.random.default_rng(seed)
    position, rotation = rng.normal(size=(5, 3)), rotation_matrix(rng.normal(size=(5, 3)))
    ((observation, command),) = run(build(document(turn=True, axes=axes)), iter([observe(3.0, position, rotation)]))
    assert np.array_equal(command.pose.position, observation.pose.position)
    assert np.allclose(command.pose.rotation, observation.pose.rotation, atol=1e-15)
    assert not np.any(command.feedforward)


def test_a_tool_that_follows_moves_at_the_learned_speed() -> None:
    skill, position = build(document(travel_limit_m=10.0)), np.zeros((1, 3))
    skill.start(observe(0.0, position), [np.random.default_rng(0)])
    for k in range(1001):
        command = skill.step(observe(k * DT, position))
        position = command.pose.position
    assert np.allclose(position, [[0.0, 0.0, -0.02]], atol=1e-12)
    assert np.allclose(command.twist, [[0, 0, -0.02, 0, 0, 0]])


def test_a_slow_arm_is_told_the_speed_of_the_push_and_nothing_where_there_is_none() -> None:
    pushing, turning = document(), document(turn=True)
    pushing["phases"][0]["translation"]["speed"] = 0.013
    turning["phases"][0]["translation"] = part(None, 0.0, [], 1000.0)
    assert (speed(pushing), speed(turning)) == (0.013, None)
    pushing["type"] = "lmc"
    _, setup = prepare(load_robot_model("ur5e"), load_world("valley", {}), pushing, "tip")
    assert setup.skill_speed == 0.013
    assert setup.pace == pytest.approx(0.013 / setup.robot.spec.control.admittance.speed)


def test_a_turn_advances_about_its_axis_at_the_learned_speed() -> None:
    skill, rotation = build(document(turn=True)), rotation_matrix(np.array([[0.3, -0.2, 0.9]]))
    home = rotation.copy()
    skill.start(observe(0.0, np.zeros((1, 3)), rotation), [np.random.default_rng(0)])
    for k in range(1001):
        command = skill.step(observe(k * DT, np.zeros((1, 3)), rotation))
        rotation = command.pose.rotation
    assert np.allclose(rotation_vector(rotation @ np.swapaxes(home, -1, -2)), [[0.0, 0.05, 0.0]], atol=1e-9)


def test_it_comes_to_rest_where_it_stalls_while_pushing() -> None:
    status = [int(command.status[0]) for _, command in run(build(document()), still(3.0))]
    ended = status.index(Status.SUCCESS) * DT
    # half of the 20 mm lead is reached after 0.5 s; resting counts from then on
    assert 0.95 <= ended <= 1.1
    last = [command for _, command in run(build(document()), still(3.0))][-1]
    assert last.reason[0].startswith("came to rest while pushing")


def test_sensor_noise_does_not_hide_a_stall() -> None:
    rng = np.random.default_rng(0)
    stream = (
        observe(k * DT, rng.normal(0, 5e-5, (8, 3)), rotation_matrix(rng.normal(0, 3.5e-4, (8, 3))))
        for k in range(3000)
    )
    last = [command for _, command in run(build(document()), stream)][-1]
    assert np.all(last.status == Status.SUCCESS)


def test_creeping_is_not_a_stall() -> None:
    creep = (observe(k * DT, np.array([[0.0, 0.0, -1e-3 * k * DT]])) for k in range(3000))
    last = [command for _, command in run(build(document()), creep)][-1]
    assert last.status[0] == Status.RUNNING


@pytest.mark.slow
def test_sliding_sideways_or_turning_is_not_a_stall() -> None:
    slide = (observe(k * DT, np.array([[1e-3 * k * DT, 0.0, 0.0]])) for k in range(3000))
    spin = (
        observe(k * DT, np.zeros((1, 3)), rotation_matrix(np.array([[0.0, 0.01 * k * DT, 0.0]]))) for k in range(3000)
    )
    for stream in (slide, spin):
        assert [command for _, command in run(build(document()), stream)][-1].status[0] == Status.RUNNING


@pytest.mark.parametrize(
    ("stop", "force", "reason"),
    [
        ({"force_limit_n": 30.0}, 31.0, "contact force 31 N above the limit of 30 N"),
        ({"time_limit_s": 0.3}, 5.0, "still under way after the time limit of 0.3 s"),
    ],
)
def test_a_limit_ends_the_phase_as_a_failure_with_its_reason(stop: dict[str, float], force: float, reason: str) -> None:
    last = [command for _, command in run(build(document(**stop)), still(0.4, force))][-1]
    assert last.status[0] == Status.FAILURE
    assert last.reason[0] == reason


def test_just_below_the_force_limit_it_goes_on() -> None:
    last = [command for _, command in run(build(document(force_limit_n=30.0)), still(0.3, 29.9))][-1]
    assert last.status[0] == Status.RUNNING


@pytest.mark.parametrize(("far", "status"), [(0.101, Status.FAILURE), (0.099, Status.RUNNING)])
def test_travelling_beyond_the_limit_is_a_failure(far: float, status: Status) -> None:
    stream = (observe(k * DT, np.array([[0.0, 0.0, -far * k / 100.0]])) for k in range(101))
    last = [command for _, command in run(build(document(travel_limit_m=0.1)), stream)][-1]
    assert last.status[0] == status


def test_the_first_reason_stays() -> None:
    stream = (observe(k * DT, np.zeros((1, 3)), force=50.0 if k == 10 else 0.0) for k in range(3000))
    commands = [command for _, command in run(build(document(force_limit_n=30.0)), stream)]
    assert commands[9].status[0] == Status.RUNNING
    assert {c.reason[0] for c in commands[10:]} == {"contact force 50 N above the limit of 30 N"}


def test_without_a_direction_it_holds_for_the_demonstrated_time() -> None:
    lonely = document(time_limit_s=0.2)
    lonely["phases"][0]["translation"] = part(None, 0.0, [], 1000.0)
    commands = [command for _, command in run(build(lonely), still(0.5))]
    assert commands[-1].status[0] == Status.SUCCESS
    assert np.array_equal(commands[-1].pose.position, np.zeros((1, 3)))
    assert commands[-1].reason[0] == "held for 0.2 s, there being no direction to push in"


def test_stiffness_is_zero_along_compliant_axes_and_damping_is_left_to_the_controller() -> None:
    ((_, command),) = run(build(document()), still(DT))
    assert command.impedance.damping is None
    assert np.array_equal(command.impedance.stiffness, np.diag([0.0, 1000.0, 1000.0, 20.0, 0.0, 20.0]))


def test_axes_of_the_start_turn_with_the_tool_and_stay() -> None:
    rotation = rotation_matrix(np.array([[0.0, 0.0, 0.0], [0.5, 0.2, -1.0]]))
    skill = build(document(axes="phase_start"))
    skill.start(observe(0.0, np.zeros((2, 3)), rotation), [np.random.default_rng(i) for i in range(2)])
    skill.step(observe(0.0, np.zeros((2, 3)), rotation))
    later = rotation_matrix(np.array([[0.1, 0.0, 0.0], [0.0, 0.2, 0.0]]))
    command = skill.step(observe(DT, np.zeros((2, 3)), later))
    assert np.allclose(unit(command.pose.position), rotation @ np.array([0.0, 0.0, -1.0]), atol=1e-12)
    free = rotation @ np.array([1.0, 0.0, 0.0])
    assert np.abs(command.impedance.stiffness[:, :3, :3] @ free[..., None]).max() < 1e-9


def fields(command: Command) -> list[Any]:
    return [*command.pose, command.twist, command.status, command.reason]


@pytest.mark.parametrize("axes", ["base", "phase_start"])
@pytest.mark.parametrize("turn", [False, True])
def test_a_row_is_the_same_to_the_last_bit_alone_and_in_any_company(turn: bool, axes: str) -> None:
    rng = np.random.default_rng(5)
    walk = np.cumsum(rng.normal(0.0, 3e-4, (400, 9, 3)), axis=0)
    spin = rotation_matrix(np.cumsum(rng.normal(0.0, 1e-3, (400, 9, 3)), axis=0))

    def commands(rows: list[int]) -> list[Command]:
        stream = (observe(k * DT, walk[k][rows], spin[k][rows]) for k in range(400))
        return [copy.deepcopy(c) for _, c in run(build(document(turn=turn, axes=axes, travel_limit_m=0.01)), stream)]

    together, alone, shuffled = commands(list(range(9))), commands([4]), commands([7, 4, 0])
    for a, b, c in zip(together, alone, shuffled, strict=True):
        for x, y, z in zip(*(fields(command) for command in (a, b, c)), strict=True):
            assert np.array_equal(x[4], y[0])
            assert np.array_equal(x[4], z[1])


def test_a_learned_document_survives_json_and_runs_the_same() -> None:
    body = learn(syn.wavering(45, 0.2, 8.0, 1), LearnOptions())
    back = json.loads(json.dumps(body, allow_nan=False))
    assert back == body
    a, b = ([c for _, c in run(build(d), still(0.3))][-1] for d in (body, back))
    assert np.array_equal(a.pose.position, b.pose.position)
    assert norm(a.pose.position).max() > 0.0


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("translation",), None, r"phases\[0\]\.translation: expected"),
        (("translation", "desired_direction"), [0.0, 0.0], "expected 3 values"),
        (("translation", "desired_direction"), [0.0, 0.0, -2.0], "should be a unit vector"),
        (("translation", "speed"), -0.1, "should not be negative"),
        (("translation", "speed"), "fast", "expected a number"),
        (("rotation", "compliant_axes"), [[0.0, 0.0, 0.0]], r"compliant_axes\[0\]: should be a unit vector"),
        (("rotation", "stiffness"), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]], "positive semi-definite"),
        (("rotation", "stiffness"), [[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "symmetric"),
        (("stop", "stal_s"), 1.0, "did you mean 'stall_s'"),
        (("stop", "stall_s"), 0.0, "should be positive"),
    ],
)
def test_a_damaged_phase_is_refused_with_its_key(path: tuple[str, ...], value: Any, message: str) -> None:
    damaged = document()
    spot = damaged["phases"][0]
    for key in path[:-1]:
        spot = spot[key]
    spot[path[-1]] = value
    with pytest.raises(InputError, match=message):
        build(damaged)


@pytest.mark.parametrize("key", ["translation", "rotation", "pitch", "stop"])
def test_a_missing_key_of_the_phase_is_named(key: str) -> None:
    damaged = document()
    del damaged["phases"][0][key]
    with pytest.raises(InputError, match=f"lacks the key '{key}'"):
        build(damaged)


def test_an_lmc_skill_has_exactly_one_phase() -> None:
    damaged = document()
    damaged["phases"] *= 2
    with pytest.raises(InputError, match="has one phase, this has 2"):
        build(damaged)


def test_the_force_limit_leaves_room_above_the_push() -> None:
    stop = learn([syn.stronger(d, 20.0) for d in syn.valley(45, 0.2)], LearnOptions())["phases"][0]["stop"]
    assert stop["lead_force_n"] == pytest.approx(20.0 * 8.0 * math.sqrt(1.04), rel=0.01)
    assert stop["force_limit_n"] >= 4.0 * stop["lead_force_n"] - 1e-9
