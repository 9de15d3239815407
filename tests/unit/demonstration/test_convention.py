from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from skillframe.demonstration.convention import weight_wrench
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration
from skillframe.frames import Float, cross, norm, rotate, rotate_spatial

Write = Callable[..., Path]
SENSOR = np.array([0.01, -0.02, -0.12])
MASS, COM = 0.8, np.array([0.005, 0.01, 0.04])


def as_recorded(rows: list[list[str]], wrench: Float) -> list[list[str]]:
    return [rows[0], *([*row[:8], *(repr(float(v)) for v in w)] for row, w in zip(rows[1:], wrench, strict=True))]


def test_a_wrist_sensors_reading_becomes_the_environments_wrench_at_the_tool_point(
    demo: Demonstration, rows: list[list[str]], write: Write
) -> None:
    rotation = demo.pose.rotation
    weight = np.tile(MASS * np.array([0.0, 0.0, -9.81]), (len(demo), 1))
    at_tool = demo.wrench + np.concatenate([weight, cross(rotate(rotation, COM), weight)], axis=-1)
    arm = rotate(rotation, -SENSOR)  # from the sensor to the tool point
    at_sensor = np.concatenate([at_tool[:, :3], at_tool[:, 3:] + cross(arm, at_tool[:, :3])], axis=-1)
    in_tool_axes = rotate_spatial(np.swapaxes(rotation, -1, -2), at_sensor)
    meta = (
        'frames.sensor = [0.01, -0.02, -0.12]\n[wrench]\nframe = "tool"\npoint = "sensor"\n'
        "includes_tool_weight = true\n"
        "tool_mass = 0.8\ntool_com = [0.005, 0.01, 0.04]\n"
    )
    read = read_demonstration(write(as_recorded(rows, in_tool_axes), meta=meta))
    assert np.abs(read.wrench - demo.wrench).max() < 1e-12
    assert read.meta["wrench"]["frame"] == "base"
    assert read.meta["wrench"]["point"] == "tool"
    assert read.meta["wrench"]["includes_tool_weight"] is False


def test_the_teachers_wrench_is_turned_round_and_that_is_noted(
    demo: Demonstration, rows: list[list[str]], write: Write
) -> None:
    read = read_demonstration(write(as_recorded(rows, -demo.wrench)), wrench_sign="teacher")
    assert np.array_equal(read.wrench, demo.wrench)
    assert read.meta["wrench"]["sign"] == "environment"
    assert any("inertia" in note for note in read.meta["reading"])


def test_settings_win_over_metadata(demo: Demonstration, rows: list[list[str]], write: Write) -> None:
    path = write(rows, meta='wrench.sign = "teacher"\n')
    assert np.array_equal(read_demonstration(path, wrench_sign="environment").wrench, demo.wrench)


def test_a_converted_file_is_not_converted_again(
    demo: Demonstration, rows: list[list[str]], write: Write, tmp_path: Path
) -> None:
    from skillframe.extend.reading import write_demonstration

    first = read_demonstration(write(rows), wrench_frame="tool", wrench_point="0,0,0.1", wrench_sign="teacher")
    write_demonstration(first, tmp_path / "first.csv")
    assert np.array_equal(read_demonstration(tmp_path / "first.csv").wrench, first.wrench)


def test_weight_without_a_known_payload_stays_and_is_said(rows: list[list[str]], write: Write) -> None:
    read = read_demonstration(write(rows), wrench_includes_tool_weight=True)
    assert read.meta["wrench"]["includes_tool_weight"] is True
    assert any("skillframe filter" in note for note in read.meta["reading"])


def turning(seed: int, mass: float) -> tuple[Demonstration, Float, Float]:
    """A tool that turns by 2 rad about a tilted axis with bias and weight on its sensor: base and tool readings."""
    from skillframe.frames import quaternion_from_matrix, rotation_matrix

    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 1.0, 300)[:, None]
    rotation = rotation_matrix(2.0 * s * np.array([0.8, 0.5, 0.2]) / norm(np.array([0.8, 0.5, 0.2])))
    bias = np.array([5.0, -3.0, 8.0, 0.1, 0.2, -0.1])
    base = rotate_spatial(rotation, bias) + weight_wrench(rotation, mass, COM) + rng.normal(size=(300, 6)) * 0.05
    base[200:, 2] += 12.0  # a contact at the end
    tool = rotate_spatial(np.swapaxes(rotation, -1, -2), base)
    demo = Demonstration(
        time=np.arange(300) * 0.01, position=0.1 * np.repeat(s, 3, axis=1),
        quaternion=quaternion_from_matrix(rotation), wrench=base,
    )  # fmt: skip
    return demo, base, tool


def cells_of(demo: Demonstration, wrench: Float) -> list[list[str]]:
    header = ["t", "px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz"]
    values = np.column_stack([demo.time, demo.position, demo.quaternion, wrench])
    return [header, *([repr(float(v)) for v in row] for row in values)]


@pytest.mark.parametrize("seed", range(5))
def test_a_wrench_frame_that_weight_and_bias_on_the_turning_tool_contradict_is_refused(write: Write, seed: int) -> None:
    demo, base, tool = turning(seed, mass=0.9)
    for said, wrench, other in (("base", base, "tool"), ("tool", tool, "base")):
        assert len(read_demonstration(write(cells_of(demo, wrench)), wrench_frame=said)) == 300
        with pytest.raises(InputError, match=rf"wrench.frame: says '{other}', but weight and bias.*say '{said}'"):
            read_demonstration(write(cells_of(demo, wrench)), wrench_frame=other)
        assert len(read_demonstration(write(cells_of(demo, wrench)))) == 300  # undeclared: a warning of the audit


def test_a_weight_that_does_not_turn_with_the_tool_contradicts_tool_axes(write: Write) -> None:
    demo, _, _ = turning(0, mass=0.9)
    still = np.tile([0.0, 0.0, -8.8, 0.0, 0.0, 0.0], (300, 1)) + np.random.default_rng(0).normal(size=(300, 6)) * 0.05
    path = write(cells_of(demo, still), meta='wrench.frame = "tool"\nwrench.includes_tool_weight = true\n')
    with pytest.raises(InputError, match="does not turn with the tool"):
        read_demonstration(path)


def test_a_declared_frame_in_which_the_environment_would_push_the_tool_along_is_refused(write: Write) -> None:
    rng = np.random.default_rng(5)
    s = np.linspace(0.0, 1.0, 400)
    position = np.stack([0.2 * s, 0 * s, -0.05 * s], axis=-1)
    wrench = rng.normal(size=(400, 6)) * 0.05
    wrench[100:, :3] += [-9.0, 0.0, 4.0]  # against the motion
    demo = Demonstration(
        time=s * 4.0, position=position, quaternion=np.tile([0.0, 1.0, 0.0, 0.0], (400, 1)), wrench=wrench
    )  # turned half about y: tool axes x and z point backwards
    assert len(read_demonstration(write(cells_of(demo, wrench)), wrench_frame="base")) == 400
    with pytest.raises(InputError, match="would push the tool along"):
        read_demonstration(write(cells_of(demo, wrench)), wrench_frame="tool")


def test_a_bias_that_is_still_there_is_no_reason_to_call_the_frame_wrong(write: Write) -> None:
    rng = np.random.default_rng(6)
    s = np.linspace(0.0, 1.0, 400)
    wrench = rng.normal(size=(400, 6)) * 0.05 + [4.0, 0.0, -8.0, 0.0, 0.0, 0.0]  # of the sensor, tool axes
    wrench[100:, :3] += [9.0, 0.0, -4.0]  # against the motion, seen from the tool
    demo = Demonstration(
        time=s * 4.0, position=np.stack([0.02 * s, 0 * s, -0.2 * s], axis=-1),
        quaternion=np.tile([0.0, 1.0, 0.0, 0.0], (400, 1)), wrench=wrench,
    )  # fmt: skip
    assert len(read_demonstration(write(cells_of(demo, wrench)), wrench_frame="tool")) == 400


def test_a_contact_force_that_turns_with_the_tool_is_no_contradiction(write: Write) -> None:
    demo, _, _ = turning(0, mass=0.9)
    wiping = np.random.default_rng(2).normal(size=(300, 6)) * 0.05
    wiping[100:250, :3] += rotate(demo.pose.rotation[100:250], np.array([3.0, 0.0, 20.0]))
    for frame in ("base", "tool"):
        assert len(read_demonstration(write(cells_of(demo, wiping)), wrench_frame=frame)) == 300
