from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.frames import matrix_from_quaternion, slerp

Write = Callable[..., Path]
ORDERS = ["xyz", "zyx", "yxz", "XYZ", "ZYX", "YZX"]


def table(rows: list[list[str]], names: list[str], values: np.ndarray) -> list[list[str]]:
    """The cells with another form of attitude in place of the quaternion."""
    return [
        [*rows[0][:4], *names, *rows[0][8:]],
        *([*row[:4], *(repr(float(v)) for v in value), *row[8:]] for row, value in zip(rows[1:], values, strict=True)),
    ]


def attitudes(rows: list[list[str]]) -> Rotation:
    return Rotation.from_quat(np.array([[float(v) for v in row[4:8]] for row in rows[1:]]))


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles_are_read_as_scipy_writes_them_with_columns_by_axis(
    rows: list[list[str]], write: Write, order: str
) -> None:
    truth = attitudes(rows)
    by_axis = truth.as_euler(order, degrees=True)[:, [order.lower().index(a) for a in "xyz"]]
    demo = read_demonstration(write(table(rows, ["roll", "pitch", "yaw"], by_axis)), euler=order, units="deg")
    # 1e-12: a few roundings of sines and cosines of about 1
    assert np.abs(matrix_from_quaternion(demo.quaternion) - truth.as_matrix()).max() < 1e-12


def test_rotation_vectors_and_matrices_are_read(rows: list[list[str]], write: Write) -> None:
    truth = attitudes(rows)
    vector = read_demonstration(write(table(rows, ["rvx", "rvy", "rvz"], truth.as_rotvec())))
    names = [f"r{i}{j}" for i in "123" for j in "123"]
    matrix = read_demonstration(write(table(rows, names, truth.as_matrix().reshape(-1, 9))))
    for demo in (vector, matrix):
        assert np.abs(matrix_from_quaternion(demo.quaternion) - truth.as_matrix()).max() < 1e-12
    sheared = truth.as_matrix().reshape(-1, 9) * 1.05
    with pytest.raises(InputError, match="no rotation matrix"):
        read_demonstration(write(table(rows, names, sheared)))


@pytest.mark.parametrize("order", [None, "xyx", "xYz", "abc", "xy"])
def test_euler_angles_without_a_proper_order_are_refused(
    rows: list[list[str]], write: Write, order: str | None
) -> None:
    path = write(table(rows, ["roll", "pitch", "yaw"], attitudes(rows).as_euler("xyz")))
    with pytest.raises(InputError, match="--set euler=xyz"):
        read_demonstration(path, euler=order)


def through_gimbal_lock(count: int, rate: float) -> np.ndarray:
    """Angles (roll, pitch, yaw) about fixed axes x, y, z of a smooth turn whose pitch just misses -90 degrees."""
    s = np.arange(count) / rate
    down = Rotation.from_rotvec(-np.deg2rad(75.0 + 20.0 * s)[:, None] * np.array([0.0, 1.0, 0.0]))
    return (Rotation.from_rotvec([0.002, 0.0, 0.0]) * down).as_euler("xyz")


@pytest.mark.parametrize("rate", [50.0, 200.0, 1000.0])
def test_a_smooth_turn_through_gimbal_lock_passes_and_a_wrong_order_is_refused(write: Write, rate: float) -> None:
    count = int(1.5 * rate)
    angles = through_gimbal_lock(count, rate)
    wrench = np.random.default_rng(1).normal(size=(count, 6))
    values = np.column_stack([np.arange(count) / rate, np.zeros((count, 3)), angles, wrench])
    cells = [
        ["t", "px", "py", "pz", "roll", "pitch", "yaw", "fx", "fy", "fz", "tx", "ty", "tz"],
        *([repr(float(v)) for v in row] for row in values),
    ]
    path = write(cells)
    assert np.abs(np.diff(angles, axis=0)).max() * rate > 100.0  # rad/s: the raw angles do jump
    demo = read_demonstration(path, euler="xyz")
    assert np.rad2deg(
        Rotation.from_matrix(demo.pose.rotation[0].T @ demo.pose.rotation[-1]).magnitude()
    ) == pytest.approx(20.0 * (count - 1) / rate, abs=1e-6)
    for wrong in ("zyx", "XYZ", "yxz"):
        with pytest.raises(InputError, match="orientation jumps"):
            read_demonstration(path, euler=wrong)


def test_degrees_read_as_radians_are_refused(rows: list[list[str]], write: Write) -> None:
    angles = attitudes(rows).as_euler("xyz", degrees=True)
    path = write(table(rows, ["roll", "pitch", "yaw"], angles))
    with pytest.raises(InputError, match="--set units=deg"):
        read_demonstration(path, euler="xyz")


def test_a_lone_jump_is_refused_at_a_low_rate_and_a_turn_across_a_gap_is_not(
    rows: list[list[str]], write: Write
) -> None:
    slow = [rows[0], *([repr(10.0 * float(row[0])), *row[1:]] for row in rows[1:])]
    turn = Rotation.from_euler("z", 25.0, degrees=True)
    for row in slow[100:]:
        row[4:8] = [repr(float(v)) for v in (turn * Rotation.from_quat([float(v) for v in row[4:8]])).as_quat()]
    with pytest.raises(InputError, match="row 101: the orientation jumps"):
        read_demonstration(write(slow))
    for row in slow[100:]:
        row[0] = repr(float(row[0]) + 1.0)
    assert len(read_demonstration(write(slow))) == 200


def test_slerp_agrees_with_scipy() -> None:
    rng = np.random.default_rng(3)
    clock = np.cumsum(rng.uniform(0.5, 1.5, 20))
    quaternion = Rotation.random(20, random_state=4).as_quat() * rng.choice([-1.0, 1.0], (20, 1))
    time = rng.uniform(clock[0], clock[-1], 200)
    ours = matrix_from_quaternion(slerp(clock, quaternion, time))
    theirs = Slerp(clock, Rotation.from_quat(quaternion))(time).as_matrix()
    assert np.abs(ours - theirs).max() < 1e-9  # random neighbours come close to half turns, where logs lose digits
