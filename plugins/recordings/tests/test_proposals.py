"""`--layout auto`: its line reads a foreign table as what it is, and it says what the data cannot tell."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skillframe_recordings.proposal.reading import propose_reading

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.frames import rotate

Layout = Callable[[Demonstration], tuple[list[str], np.ndarray]]
WEIGHT = np.array([0.0, 0.0, -9.0])


def recorded(weight: bool = True, seed: int = 0, turn: float = 1.3, count: int = 301) -> Demonstration:
    """Three seconds of turning in free air, then a slide over a table with 10 N and friction. Wrench in base axes."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 3.0, count)
    free = s < 2.0
    bend = np.minimum(s, 2.0) / 2.0
    rotation = Rotation.from_euler(
        "ZYX", np.stack([2.4 * bend, turn * np.sin(np.pi * bend), 2.9 - turn * bend], axis=1)
    )
    position = np.stack([0.4 + 0.1 * np.maximum(s - 2.0, 0.0), 0.1 + 0.05 * s, 0.3 - 0.05 * np.minimum(s, 2.0)], axis=1)
    wrench = rng.normal(scale=np.repeat([0.05, 0.005], 3), size=(count, 6))
    way = np.array([0.1, 0.05, 0.0]) / np.linalg.norm([0.1, 0.05, 0.0])
    wrench[~free, :3] += np.array([0.0, 0.0, 10.0]) - 8.0 * way
    if weight:
        wrench[:, :3] += WEIGHT
    return Demonstration(time=s, position=position, quaternion=rotation.as_quat(), wrench=wrench)


def in_tool(d: Demonstration) -> np.ndarray:
    """The wrench in tool axes with a bias, as a sensor on the tool gives it."""
    back = np.swapaxes(d.pose.rotation, -1, -2)
    bias = np.array([2.0, -1.0, 3.0, 0.1, 0.0, -0.1])
    return np.concatenate([rotate(back, d.wrench[:, :3]), rotate(back, d.wrench[:, 3:])], axis=1) + bias


def ur(d: Demonstration) -> tuple[list[str], np.ndarray]:
    vector = Rotation.from_quat(d.quaternion).as_rotvec()
    names = ["timestamp", *(f"actual_q_{i}" for i in range(6)), *(f"actual_TCP_pose_{i}" for i in range(6))]
    names += [f"actual_TCP_force_{i}" for i in range(6)]
    return names, np.column_stack([d.time, np.zeros((len(d), 6)), d.position, vector, d.wrench])


def franka(d: Demonstration) -> tuple[list[str], np.ndarray]:
    matrix = np.tile(np.eye(4), (len(d), 1, 1))
    matrix[:, :3, :3], matrix[:, :3, 3] = d.pose.rotation, d.position
    columns = np.swapaxes(matrix, 1, 2).reshape(-1, 16)
    names = ["time", *(f"O_T_EE_d[{i}]" for i in range(16)), *(f"O_T_EE[{i}]" for i in range(16))]
    names += [f"O_F_ext_hat_K[{i}]" for i in range(6)] + [f"K_F_ext_hat_K[{i}]" for i in range(6)]
    return names, np.column_stack([d.time, np.roll(columns, 9, axis=0), columns, d.wrench, in_tool(d)])


def kuka(d: Demonstration) -> tuple[list[str], np.ndarray]:
    angles = np.rad2deg(Rotation.from_quat(d.quaternion).as_euler("ZYX"))
    names = ["Time [ms]", "X", "Y", "Z", "A", "B", "C", "Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    return names, np.column_stack([1e3 * d.time, 1e3 * d.position, angles, in_tool(d)])


def matrices(d: Demonstration) -> tuple[list[str], np.ndarray]:
    names = ["t_us", *(f"pos_{axis}" for axis in "xyz"), *(f"R{i}{j}" for i in range(3) for j in range(3))]
    names[0] = "time"
    names += [f"ft_{i}" for i in range(6)]
    return names, np.column_stack([1e6 * d.time, d.position, d.pose.rotation.reshape(-1, 9), in_tool(d)])


def w_first(d: Demonstration) -> tuple[list[str], np.ndarray]:
    names = ["stamp.secs", "stamp.nsecs", *(f"pose.orientation.{a}" for a in "wxyz")]
    names += [*(f"pose.position.{a}" for a in "xyz"), *(f"wrench.force.{a}" for a in "xyz")]
    names += [f"wrench.torque.{a}" for a in "xyz"]
    nanos = np.round(d.time * 1e9)
    return names, np.column_stack([nanos // 1e9, nanos % 1e9, d.quaternion[:, [3, 0, 1, 2]], d.position, in_tool(d)])


LAYOUTS: dict[str, tuple[Layout, str, str]] = {
    "UR": (ur, ",", "base"), "Franka": (franka, ",", "tool"), "KUKA": (kuka, ";", "tool"),
    "matrices": (matrices, "\t", "tool"), "w first": (w_first, ",", "tool"),
}  # fmt: skip


def save(path: Path, names: list[str], values: np.ndarray, delimiter: str = ",") -> Path:
    rows = [delimiter.join(repr(float(v)) for v in row) for row in values]
    path.write_text("\n".join([*([delimiter.join(names)] if names else []), *rows]) + "\n")
    return path


@pytest.mark.parametrize("name", ["KUKA", *(pytest.param(n, marks=pytest.mark.slow) for n in LAYOUTS if n != "KUKA")])
def test_the_proposed_line_reads_a_robots_own_layout_as_what_it_is(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layout, delimiter, frame = LAYOUTS[name]
    demo = recorded()
    path = save(tmp_path / "log file.csv", *layout(demo), delimiter)
    assert run(["check", str(path), "--layout", "auto", "--json"]) == 0
    (said,) = json.loads(capsys.readouterr().out)
    assert said["settings"]["wrench_frame"] == frame and said["settings"]["wrench_sign"] == "environment"
    words = shlex.split(said["line"])
    assert run([*words[1:], "--json"]) == 0  # the line as typed
    found = read_demonstration(path, **{k: v or True for k, v in said["settings"].items()})
    np.testing.assert_allclose(found.time, demo.time, atol=1e-9)
    np.testing.assert_allclose(found.position, demo.position, atol=1e-12)
    np.testing.assert_allclose(found.pose.rotation, demo.pose.rotation, atol=1e-9)  # angles and matrices and back
    free = found.time < 1.9
    bias = 0.0 if frame == "base" else rotate(demo.pose.rotation, np.array([2.0, -1.0, 3.0]))
    np.testing.assert_allclose(found.wrench[free, :3], (demo.wrench[:, :3] + bias)[free], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
def test_the_order_of_euler_angles_is_that_which_the_motion_bears_out(order: str, tmp_path: Path) -> None:
    demo = recorded()
    angles = Rotation.from_quat(demo.quaternion).as_euler(order)
    columns = [angles[:, order.index(axis)] for axis in "XYZ"]
    names = ["t", "x", "y", "z", "roll", "pitch", "yaw", "fx", "fy", "fz", "tx", "ty", "tz"]
    path = save(tmp_path / "log.csv", names, np.column_stack([demo.time, demo.position, *columns, in_tool(demo)]))
    assert propose_reading(path).settings["euler"] == order


@pytest.mark.parametrize("first", ["x", "w"])
def test_a_quaternion_under_the_wrong_header_is_told_by_the_sensors_weight(first: str, tmp_path: Path) -> None:
    demo = recorded()
    numbers = demo.quaternion if first == "x" else demo.quaternion[:, [3, 0, 1, 2]]
    names = ["t", "px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz"]
    path = save(tmp_path / "log.csv", names, np.column_stack([demo.time, demo.position, numbers, in_tool(demo)]))
    found = propose_reading(path)
    assert ("columns" in found.settings) == (first == "w")  # the contract's own header needs no columns
    settings = {k: v or True for k, v in found.settings.items()}
    np.testing.assert_allclose(read_demonstration(path, **settings).pose.rotation, demo.pose.rotation, atol=1e-9)
    assert any("weight and bias of the turning sensor" in text for text in found.because)


def test_an_angular_velocity_tells_the_order_without_any_force(tmp_path: Path) -> None:
    demo = recorded(weight=False)
    spin = np.gradient(Rotation.from_quat(demo.quaternion).as_rotvec(), demo.time, axis=0)
    turn = Rotation.from_quat(demo.quaternion)
    spin[:-1] = (turn[1:] * turn[:-1].inv()).as_rotvec() / np.diff(demo.time)[:, None]
    names = ["t", "x", "y", "z", "q0", "q1", "q2", "q3", "wx", "wy", "wz", "fx", "fy", "fz", "tx", "ty", "tz"]
    values = [demo.time, demo.position, demo.quaternion[:, [3, 0, 1, 2]], spin, 0.0 * demo.wrench + 1e-3]
    found = propose_reading(save(tmp_path / "log.csv", names, np.column_stack(values)))
    assert "qw=q0" in found.settings["columns"]
    assert any("angular velocity" in text for text in found.because)


def test_velocities_tell_the_unit_of_positions(tmp_path: Path) -> None:
    demo = recorded()
    speed = np.gradient(demo.position, demo.time, axis=0)
    names = ["t", "x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "fx", "fy", "fz", "tx", "ty", "tz"]
    near = demo.position - demo.position.mean(axis=0)  # less than 20 in millimetres too, at a tenth of the size
    values = [demo.time, 100.0 * near, demo.quaternion, 0.1 * speed, in_tool(demo)]
    found = propose_reading(save(tmp_path / "log.csv", names, np.column_stack(values)))
    assert found.settings["units"] == "mm"
    assert any("dp/dt is 1000 times the velocity" in text for text in found.because)


def test_a_table_without_a_header_is_told_by_its_values(tmp_path: Path) -> None:
    demo = recorded()
    values = np.column_stack([1e3 * demo.time, demo.position, demo.quaternion, in_tool(demo)])
    found = propose_reading(save(tmp_path / "log.txt", [], values, " "))
    assert found.settings["columns"] == "t,px,py,pz,qx,qy,qz,qw,fx,fy,fz,tx,ty,tz"
    assert found.settings["units"] == "ms" and found.whole


@pytest.mark.parametrize("sign", [pytest.param(1.0, marks=pytest.mark.slow), -1.0])
def test_the_sign_of_a_sensor_is_that_of_its_weight(sign: float, tmp_path: Path) -> None:
    demo = recorded()
    names = ["t", "px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz"]
    values = np.column_stack([demo.time, demo.position, demo.quaternion, sign * in_tool(demo)])
    found = propose_reading(save(tmp_path / "log.csv", names, values))
    assert found.settings["wrench_sign"] == ("environment" if sign > 0 else "teacher")


def test_what_the_data_cannot_tell_is_said_and_not_decided(tmp_path: Path) -> None:
    demo = recorded(weight=False, turn=0.0)
    names = ["t", "px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz"]
    still = np.tile([0.5, 0.5, 0.5, 0.5], (len(demo), 1)) + 0.0
    still[:, 3] = 0.5
    quiet = 1e-2 * np.random.default_rng(1).normal(size=(len(demo), 6))
    found = propose_reading(
        save(tmp_path / "log.csv", names, np.column_stack([demo.time, demo.position, still, quiet]))
    )
    assert not {"wrench_frame", "wrench_sign"} & found.settings.keys()
    assert any("the wrench's axes" in text for text in found.undecided)
    assert any("whose force it is" in text for text in found.undecided)


def test_what_was_not_found_is_missing_and_the_answer_is_no(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    demo = recorded()
    path = save(
        tmp_path / "log.csv", ["x", "y", "z", "fx", "fy", "fz"], np.column_stack([demo.position, in_tool(demo)[:, :3]])
    )
    assert run(["check", str(path), "--layout", "auto"]) == 1
    said = capsys.readouterr().out
    assert "missing   a clock: add --set rate=HZ" in said and "missing   an orientation" in said
    assert "undecided torque: no column is called so, and forces alone are read" in said


def test_a_table_of_something_else_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "log.csv", ["t", "voltage", "torque"], np.ones((5, 3)))
    with pytest.raises(InputError, match="shows no pose and no wrench; its header is t, voltage, torque"):
        propose_reading(path)


def test_nothing_is_read_or_written_with_auto(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = save(tmp_path / "log.csv", *ur(recorded())), tmp_path / "demo.npz"
    with pytest.raises(InputError, match="proposes settings and reads nothing; type skillframe check"):
        read_demonstration(path, layout="auto")
    assert run(["convert", str(path), "--layout", "auto", "--out", str(out)]) == 1
    assert "type      skillframe convert" in capsys.readouterr().out and not out.exists()
