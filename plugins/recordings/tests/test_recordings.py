"""Real recordings, where $SKILLFRAME_RECORDINGS holds them: each passes with the settings that its makers stated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skillframe_recordings.audit import audit

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration, write_demonstration
from tests.references import recordings_dir

POSE, WRENCH = "t,px,py,pz,roll,pitch,yaw", "t,fx,fy,fz,tx,ty,tz"
WIPING = "t,px,py,pz,qx,qy,qz,qw,fx,fy,fz,tx,ty,tz"
TRIALS = ("02", "10", "22")


def folder(name: str) -> Path:
    base = recordings_dir()
    if base is None or not (base / name).is_dir():
        pytest.skip(f"SKILLFRAME_RECORDINGS does not hold {name}")
    return base / name


def hiro(trial: str, wrench: str = "worldforce.dat", **options: Any) -> Demonstration:
    place = folder("hiro_snap_assembly") / trial
    settings = {"columns": POSE, "euler": "xyz", "wrench_columns": WRENCH, **options}
    return read_demonstration(place / "R_CartPos.dat", wrench=place / wrench, **settings)


@pytest.mark.parametrize("trial", TRIALS)
def test_the_snap_assembly_passes_gimbal_lock_with_the_stated_order(trial: str) -> None:
    demo = hiro(trial)
    raw = np.loadtxt(folder("hiro_snap_assembly") / trial / "R_CartPos.dat")[: len(demo)]
    assert np.abs(demo.pose.rotation - Rotation.from_euler("xyz", raw[:, 4:]).as_matrix()).max() < 1e-12
    assert demo.rate == pytest.approx(200.0)


@pytest.mark.parametrize("trial", TRIALS)
@pytest.mark.parametrize("order", ["zyx", "xzy", "yxz", "yzx", "zxy", "XYZ", "XZY", "YXZ", "YZX", "ZXY"])
def test_the_snap_assembly_is_refused_in_every_wrong_order(trial: str, order: str) -> None:
    with pytest.raises(InputError, match="orientation jumps"):
        hiro(trial, euler=order)


@pytest.mark.parametrize("trial", TRIALS)
def test_contact_is_found_where_the_snap_assemblys_controller_changed_phase(trial: str) -> None:
    states = np.loadtxt(folder("hiro_snap_assembly") / trial / "R_State.dat", ndmin=1)
    assert audit(hiro(trial)).contacts[0][0] == pytest.approx(states[1], abs=0.1)


@pytest.mark.parametrize("trial", ["02", "10"])
@pytest.mark.slow
def test_the_mislabelled_frame_of_the_snap_assemblys_torques_is_refused(trial: str) -> None:
    assert len(hiro(trial, "R_Torques.dat", wrench_frame="base")) > 4000
    with pytest.raises(InputError, match=r"wrench\.frame: says 'tool'"):
        hiro(trial, "R_Torques.dat", wrench_frame="tool")


def test_a_cut_of_the_snap_assembly_survives_both_formats(tmp_path: Path) -> None:
    demo = hiro("02", start=0.0, stop=7.07)
    for name in ("x.npz", "x.csv"):
        write_demonstration(demo, tmp_path / name)
        again = read_demonstration(tmp_path / name)
        assert np.array_equal(again.wrench, demo.wrench)
        assert np.array_equal(again.quaternion, demo.quaternion)
    assert (len(demo), demo.time[-1]) == (1415, 7.07)


@pytest.mark.parametrize(("name", "rate"), [("rim0", 103.1), ("rim1", 74.3), ("rim2", 79.9)])
def test_the_wiping_recordings_are_read_and_their_presses_found(name: str, rate: float) -> None:
    path = folder("icsc_wiping") / f"{name}.csv"
    with pytest.raises(InputError, match="x may be px, y may be py"):
        read_demonstration(path)
    found = audit(read_demonstration(path, columns=WIPING))
    labels = (folder("icsc_wiping") / f"{name}.labels.csv").read_text().split()
    wipe = [float(line.split(",")[0]) / found.rate_hz for line in labels[2:4]]
    assert found.rate_hz == pytest.approx(rate, abs=0.1)
    assert any(start <= wipe[0] + 0.6 and stop >= wipe[1] for start, stop, _ in found.contacts)


@pytest.mark.parametrize("arm", ["active", "passive"])
def test_either_arm_of_the_peeling_recording_is_read_with_its_stated_rate(arm: str) -> None:
    path = folder("icsc_peeling") / "recording2.csv"
    names = WIPING.split(",")[1:]
    columns = ",".join([*(f"active_{n}" for n in names), *(f"passive_{n}" for n in names), "label"])
    with pytest.raises(InputError, match="--set rate"):
        read_demonstration(path, columns=columns, arm=arm)
    demo = read_demonstration(path, columns=columns, arm=arm, rate=100.0)
    assert len(demo) == 7333
    assert set(demo.extra["label"]) == {1.0, 2.0, 3.0, 4.0, 5.0}


def test_orientation_and_wrench_on_their_own_microsecond_clocks_are_joined() -> None:
    place = folder("kuka_ati")
    demo = read_demonstration(
        place / "1-baseline_orientations.csv", wrench=place / "1-baseline_wrench.csv", units="us", position="0,0,0",
        wrench_frame="tool", wrench_includes_tool_weight=True, zero_time=True,
    )  # fmt: skip
    assert demo.rate == pytest.approx(698.0, abs=1.0)
    assert demo.meta["wrench"]["includes_tool_weight"] is True


@pytest.mark.parametrize("name", ["fake_joints.csv", "motor_data.csv"])
def test_tables_that_hold_no_demonstration_are_refused(name: str) -> None:
    with pytest.raises(InputError, match="no "):
        read_demonstration(folder("formats") / name, rate=100.0)


def every_recording() -> dict[str, Demonstration]:
    """All that hold a pose and a wrench, as their makers stated them."""
    found = {
        f"hiro {trial} {file}": hiro(trial, file) for trial in TRIALS for file in ("worldforce.dat", "R_Torques.dat")
    }
    for name in ("rim0", "rim1", "rim2"):
        found[name] = read_demonstration(folder("icsc_wiping") / f"{name}.csv", columns=WIPING)
    names = WIPING.split(",")[1:]
    columns = ",".join([*(f"active_{n}" for n in names), *(f"passive_{n}" for n in names), "label"])
    for arm in ("active", "passive"):
        path = folder("icsc_peeling") / "recording2.csv"
        found[f"peeling {arm}"] = read_demonstration(path, columns=columns, arm=arm, rate=100.0)
    place = folder("kuka_ati")
    for frame in ("tool", "base"):
        found[f"kuka in {frame} axes"] = read_demonstration(
            place / "1-baseline_orientations.csv", wrench=place / "1-baseline_wrench.csv", units="us",
            position="0,0,0", wrench_frame="tool" if frame == "tool" else None, zero_time=True,
        )  # fmt: skip
    return found


@pytest.mark.slow
def test_no_real_recording_is_said_to_stall() -> None:
    said = {name: audit(demo).as_json()["stalls"] for name, demo in every_recording().items()}
    assert len(said) == 13
    assert not any(said.values()), said


@pytest.mark.parametrize(("start", "length"), [(0.0, 0.3), (0.0, 0.4), (0.3, 0.1), (0.55, 0.07), (0.6, 0.3)])
@pytest.mark.slow
def test_a_stall_planted_anywhere_in_a_real_recording_is_found(start: float, length: float) -> None:
    for name, demo in every_recording().items():
        first, last = (int(share * (len(demo) - 1)) for share in (start, start + length))
        wrench = demo.wrench.copy()
        wrench[first : last + 1] = wrench[first]
        found = audit(replace(demo, wrench=wrench)).as_json()["stalls"]
        expected = [("wrench", float(demo.time[first]), float(demo.time[last]))]
        assert [(s["what"], s["start"], s["stop"]) for s in found] == expected, name
