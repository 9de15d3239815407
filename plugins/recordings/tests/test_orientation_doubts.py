"""An order of a quaternion that the torques contradict, and a weight that was tared away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skillframe_recordings.orientation_doubts import point_residual, tared, w_first

from skillframe.demonstration.convention import weight_wrench
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, cross, matrix_from_quaternion, norm, rotate, rotate_spatial

POINT = np.array([0.03, -0.05, 0.12])


def turns(degrees: float, count: int = 800) -> Float:
    """Quaternions (T, 4) of a tool, first pointing down, that turns to and fro about two axes."""
    s = np.linspace(0.0, 1.0, count)
    angle = np.deg2rad(degrees) * np.stack([np.sin(7.0 * s), np.sin(4.0 * s + 0.3) - np.sin(0.3), 0.0 * s], -1)
    half = 0.5 * norm(angle)[:, None]
    turn = np.concatenate([angle * 0.5 * np.sinc(half / np.pi), np.cos(half)], axis=1)
    x, y, z, w = turn.T
    return np.stack([w, z, -y, -x], axis=1)  # the turn, after half a turn about x


def recording(force: Float, quaternion: Float, seed: int, torque: Float | None = None) -> Demonstration:
    rng = np.random.default_rng([5, seed])
    rotation = matrix_from_quaternion(quaternion)
    torque = cross(rotate(rotation, np.broadcast_to(POINT, force.shape)), force) if torque is None else torque
    wrench = np.concatenate([force, torque], axis=1) + rng.normal(size=(len(force), 6)) * np.repeat([0.1, 0.01], 3)
    position = np.cumsum(1e-4 * rng.normal(size=force.shape), axis=0)
    return Demonstration(time=np.arange(len(force)) / 100.0, position=position, quaternion=quaternion, wrench=wrench)


def rubbing(seed: int, count: int = 800) -> Float:
    """A contact force in base axes that presses up and rubs to and fro."""
    rng = np.random.default_rng([6, seed])
    s = np.linspace(0.0, 40.0, count)
    phase = rng.uniform(0.0, 6.0, 3)
    return np.stack(
        [6.0 * np.sin(s + phase[0]), 6.0 * np.cos(1.3 * s + phase[1]), 15.0 + 4.0 * np.sin(s + phase[2])], 1
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_other_order_is_told_by_the_torques_of_one_point_and_the_right_one_is_silent(seed: int) -> None:
    right = recording(rubbing(seed), turns(25.0), seed)
    wrong = replace(right, quaternion=right.quaternion[:, [3, 0, 1, 2]].copy())
    assert list(w_first(right)) == []
    assert "may be w-first" in next(w_first(wrong))
    assert list(w_first(replace(wrong, meta={"quaternion": "xyzw"}))) == []  # the user's word wins


def test_torques_that_no_point_explains_and_a_tool_that_hardly_turns_tell_no_order() -> None:
    rng = np.random.default_rng(1)
    free = np.cumsum(rng.normal(size=(800, 3)), axis=0) * 0.02
    for d in (recording(rubbing(0), turns(25.0), 0, torque=free), recording(rubbing(0), turns(4.0), 0)):
        assert list(w_first(d)) == []
        assert list(w_first(replace(d, quaternion=d.quaternion[:, [3, 0, 1, 2]].copy()))) == []


def test_what_one_point_leaves_is_nothing_for_its_own_torques() -> None:
    rotation = matrix_from_quaternion(turns(30.0))
    force = rubbing(3)
    torque = cross(rotate(rotation, np.broadcast_to(POINT, force.shape)), force) + np.array([0.1, -0.2, 0.3])
    assert np.abs(point_residual(np.concatenate([force, torque], axis=1), rotation)).max() < 1e-9


@pytest.mark.parametrize("mass", [0.3, 1.5])
def test_a_tared_weight_is_told_with_its_size(mass: float) -> None:
    quaternion = turns(25.0)
    rotation = matrix_from_quaternion(quaternion)
    sensor = rotate_spatial(np.swapaxes(rotation, -1, -2), weight_wrench(rotation, mass, np.array([0.0, 0.0, 0.05])))
    read = rotate_spatial(rotation, sensor - sensor[0])
    d = recording(read[:, :3], quaternion, 2, torque=read[:, 3:])
    said = next(tared(d))
    assert said.startswith("weight:")
    # 0.1 N of noise over the 25 samples of the start is 0.02 N beside 0.3 N or more, and print rounds to 0.01 kg: 0.1
    assert float(said.split("(")[1].split(" kg")[0]) == pytest.approx(mass, rel=0.1)
    assert list(tared(replace(d, meta={"wrench": {"includes_tool_weight": True}}))) == []
    # the same size of force that grows with the turning, but upwards or aside, is no weight
    for way in (-1.0 * d.wrench, d.wrench[:, [2, 0, 1, 3, 4, 5]]):
        assert list(tared(replace(d, wrench=way))) == []


def test_contact_on_a_turning_tool_is_no_tared_weight() -> None:
    for seed in range(5):
        d = recording(rubbing(seed), turns(25.0), seed)
        assert list(tared(replace(d, wrench=d.wrench - d.wrench[:1]))) == []


def test_a_tool_that_turns_by_ten_degrees_tells_no_tared_weight() -> None:
    quaternion = turns(10.0)
    rotation = matrix_from_quaternion(quaternion)
    sensor = rotate_spatial(np.swapaxes(rotation, -1, -2), weight_wrench(rotation, 1.5, np.zeros(3)))
    read = rotate_spatial(rotation, sensor - sensor[0])
    assert list(tared(recording(read[:, :3], quaternion, 2, torque=read[:, 3:]))) == []
