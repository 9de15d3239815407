"""What `--layout auto` takes from headers, values and physics, and where it says that it does not know."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation
from skillframe_recordings.proposal.names import cut, groups_of, split_unit
from skillframe_recordings.proposal.reading import Proposal, propose_reading

from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration

NAMES = ["t", "px", "py", "pz", "qx", "qy", "qz", "qw", "fx", "fy", "fz", "tx", "ty", "tz"]
FREE, WHOLE = 1.0, 4.0


def slide(
    turn: float = 40.0, press: float = 12.0, friction: float = 0.3, seed: int = 0, still: bool = False
) -> tuple[np.ndarray, np.ndarray, Rotation, np.ndarray]:
    """A tool comes down, slides along x under a force while it turns, and lifts. Wrench in base axes, at 100 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, WHOLE, 0.01)
    run = np.clip((t - FREE) / 2.5, 0.0, 1.0)
    on = (t > FREE) & (t < 3.5)
    p = np.stack([0.4 + 0.1 * run, 0.1 + 0.0 * t, 0.05 + 0.1 * np.clip(1.0 - t / FREE, 0.0, 1.0)], axis=1)
    p += 1e-6 * rng.normal(size=p.shape)
    q = Rotation.from_rotvec(np.outer(np.deg2rad(turn) * run, [0.0, 1.0, 0.3])) * Rotation.from_euler("x", np.pi)
    w = np.zeros((len(t), 6))
    w[:, 0], w[:, 2] = -friction * press * on * (not still), press * on
    w[:, 3:] = np.cross(q.apply([0.0, 0.0, 0.02]), w[:, :3])
    return t, p, q, w + rng.normal(size=w.shape) * np.repeat([0.05, 0.001], 3)


def in_tool(w: np.ndarray, q: Rotation) -> np.ndarray:
    return np.concatenate([q.inv().apply(w[:, :3]), q.inv().apply(w[:, 3:])], axis=1)


def table(path: Path, names: list[str] | str, *columns: np.ndarray) -> Path:
    header = names if isinstance(names, str) else ",".join(names)
    rows = [",".join(f"{v:.9g}" for v in row) for row in np.column_stack(columns)]
    path.write_text("\n".join([*([header] if header else []), *rows]) + "\n")
    return path


def read(found: Proposal, path: Path) -> Any:
    return read_demonstration(path, **found.reading)


@pytest.mark.parametrize("turn", [10.0, 40.0, 70.0])
@pytest.mark.parametrize("frame", ["base", "tool"])
def test_work_never_tells_the_axes_of_a_slide_whose_tool_turns(frame: str, turn: float, tmp_path: Path) -> None:
    t, p, q, w = slide(turn)
    path = table(tmp_path / "a.csv", NAMES, t, p, q.as_quat(), w if frame == "base" else in_tool(w, q))
    found = propose_reading(path)
    assert found.settings.get("wrench_frame") is None
    assert not any("wrench axes" in text for text in found.because)
    said = " ".join([*found.undecided, *found.missing])
    assert f"--set wrench-frame={frame}" in said


@pytest.mark.parametrize("sign", ["environment", "teacher"])
@pytest.mark.parametrize("frame", ["base", "tool"])
@pytest.mark.parametrize("seed", range(3))
def test_the_pairs_that_work_leaves_hold_the_right_one(frame: str, sign: str, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    t, p, q, w = slide(rng.uniform(5.0, 80.0), rng.uniform(3.0, 30.0), rng.uniform(0.1, 0.6), seed)
    w = (w if frame == "base" else in_tool(w, q)) * (1.0 if sign == "environment" else -1.0)
    found = propose_reading(table(tmp_path / "a.csv", NAMES, t, p, q.as_quat(), w))
    assert found.settings.get("wrench_frame") in (None, frame) and found.settings.get("wrench_sign") in (None, sign)
    pairs = [text for text in (*found.undecided, *found.missing) if text.startswith("axes and sign")]
    assert all(f"--set wrench-frame={frame} --set wrench-sign={sign}" in text for text in pairs)


@pytest.mark.parametrize("turn", [40.0, 70.0])
def test_a_force_that_comes_after_the_start_is_no_weight(turn: float, tmp_path: Path) -> None:
    """A slide in tool axes that touches most of the time: its constant force in base axes is not the tool's weight."""
    t, p, _, w = slide(friction=0.2)
    run = np.clip((t - FREE) / 2.5, 0.0, 1.0)
    q = Rotation.from_rotvec(np.outer(np.deg2rad(turn) * run, [1.0, 0.0, 0.0]))
    q *= Rotation.from_euler("xyz", [np.pi + 0.5, 0.4, 0.2])
    rows = t >= 0.7
    values = [column[rows] for column in (t, p, q.as_quat(), in_tool(w, q))]
    found = propose_reading(table(tmp_path / "a.csv", NAMES, *values))
    assert not any(text.startswith("wrench") and "weight" in text for text in found.because)
    assert found.settings.get("wrench_sign") != "teacher" and "wrench_includes_tool_weight" not in found.settings


@pytest.mark.parametrize(("newton", "told"), [(90.0, True), (1900.0, False)])
def test_a_weight_that_no_arm_carries_is_no_weight(newton: float, told: bool, tmp_path: Path) -> None:
    t, p, q, w = slide(60.0, press=0.0)
    q = q * Rotation.from_rotvec(np.outer(np.sin(2.0 * t), [0.6, 0.0, 0.3]))  # one axis alone tells no frame
    w = in_tool(w - np.array([0.0, 0.0, newton, 0.0, 0.0, 0.0]), q)
    found = propose_reading(table(tmp_path / "a.csv", NAMES, t, p, q.as_quat(), w))
    assert any("a weight of" in text for text in found.because) == told
    assert ("wrench_frame" in found.settings) == told


def test_a_weight_that_was_tared_away_is_named_with_the_axes_that_it_needs(tmp_path: Path) -> None:
    t, p, q, w = slide(60.0)
    force = q.inv().apply(w[:, :3] * (t < 2.0)[:, None] + [0.0, 0.0, -7.8])
    found = propose_reading(table(tmp_path / "a.csv", NAMES, t, p, q.as_quat(), force - force[0], in_tool(w, q)[:, 3:]))
    assert found.settings.get("wrench_frame") in (None, "tool")
    (said,) = [text for text in (*found.undecided, *found.missing) if "axes" in text]
    assert "--set wrench-frame=tool" in said and "in tool axes, weight: " in said


@pytest.mark.parametrize("sign", ["environment", "teacher"])
def test_a_sign_is_told_where_the_other_would_push_the_tool_along_in_all_axes(sign: str, tmp_path: Path) -> None:
    t, p, q, w = slide(40.0)
    path = table(tmp_path / "a.csv", NAMES, t, p, q.as_quat(), w if sign == "environment" else -w)
    assert propose_reading(path).settings["wrench_sign"] == sign


def test_a_sign_that_was_given_leaves_no_pair_of_the_other(tmp_path: Path) -> None:
    t, p, q, w = slide(70.0)
    path = table(tmp_path / "a.csv", NAMES, t, p, q.as_quat(), w)
    found = propose_reading(path, wrench_sign="environment", wrench_frame="base")
    assert found.whole and not any("wrench" in text for text in found.undecided)


def test_forces_before_a_pose_are_no_position(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    found = propose_reading(table(tmp_path / "a.csv", "", w, p, q.as_rotvec()))
    assert found.settings["columns"] == "fx,fy,fz,tx,ty,tz,px,py,pz,rvx,rvy,rvz"
    found = propose_reading(table(tmp_path / "b.csv", "", t, p, q.as_rotvec(), w))
    assert found.settings["columns"] == "t,px,py,pz,rvx,rvy,rvz,fx,fy,fz,tx,ty,tz"


@pytest.mark.parametrize("order", ["wqp", "wpq", "pqw", "qpw", "qwp", "pwq"])
def test_blocks_beside_a_quaternion_are_told_by_an_arms_reach(order: str, tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    blocks = {"w": w, "p": p, "q": q.as_quat()}
    found = propose_reading(table(tmp_path / "a.csv", "", t, *(blocks[name] for name in order)))
    if found.whole:
        np.testing.assert_allclose(read(found, tmp_path / "a.csv").position, p, atol=1e-8)
    else:
        assert any("which of its columns" in text for text in found.missing)


def test_twelve_numbers_that_may_be_either_are_not_decided(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 2.0, 0.01)
    both = [np.cumsum(rng.normal(size=(len(t), 6)), axis=0) * 0.01 for _ in range(2)]  # both within reach, both rough
    found = propose_reading(table(tmp_path / "a.csv", "", t, *both))
    assert not found.whole and "px" not in found.settings["columns"].split(",")
    assert (
        "--set columns=t,px,py,pz,rvx,rvy,rvz,fx" in found.missing[0] and "--set columns=t,fx,fy,fz" in found.missing[0]
    )


def test_six_numbers_within_reach_are_neither_a_pose_nor_a_wrench_yet(tmp_path: Path) -> None:
    t, p, q, _ = slide(10.0)
    found = propose_reading(table(tmp_path / "a.csv", "", t, p, q.as_euler("xyz")))
    assert not found.whole and "fx" not in found.settings["columns"].split(",")


def test_positions_of_seven_are_a_machines_in_metres_or_millimetres(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    found = propose_reading(table(tmp_path / "a.csv", NAMES, t, p * 15.0, q.as_quat(), w))
    assert "units" not in found.settings
    assert any("no arm reaches 5 m" in text and "--set units=mm" in text for text in found.undecided)


def test_position_attitude_and_wrench_are_of_one_body(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    axes = ("X(m)", "Y(m)", "Z(m)", " roll(rad)", " pitch (rad)", " yaw (rad)")
    spaced = (" X (m)", " Y (m)", " Z (m)", " roll (rad)", " pitch (rad)", " yaw (rad)")
    wrench = ("Fx (N)", "Fy (N)", "Fz (N)", "Tx (N m)", "Ty (N m)", "Tz (N m)")
    names = ["time (ms)", *(f"objRight{a}" for a in axes), *(f"objLeft{a}" for a in spaced)]
    names += [f"obj{side}{a}" for side in ("Right", "Left") for a in wrench]
    left = p + np.array([0.3, 0.0, 0.1])
    path = table(
        tmp_path / "a.csv", names, t * 1e3, p, q.as_euler("xyz"), left, q.as_euler("xyz"), w, -w
    )  # fmt: skip
    found = propose_reading(path)
    assert "Left" not in found.settings["columns"] and found.settings["units"] == "ms"
    assert any("reads objRight" in text and "--set arm=objLeft" in text for text in found.undecided)
    np.testing.assert_allclose(read(found, path).wrench, w, atol=1e-6)
    other = propose_reading(path, arm="objLeft")
    assert "Right" not in other.settings["columns"]
    np.testing.assert_allclose(read(other, path).position, left, atol=1e-6)


def test_a_matrix_of_rows_and_one_of_columns_are_told_by_their_last_row(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    matrix = np.tile(np.eye(4), (len(t), 1, 1))
    matrix[:, :3, :3], matrix[:, :3, 3] = q.as_matrix(), p
    for name, values in (("rows", matrix), ("columns", np.swapaxes(matrix, 1, 2))):
        path = tmp_path / f"{name}.npz"
        np.savez(path, time=t, T_base_tool=values, wrench=w)
        found = propose_reading(path)
        np.testing.assert_allclose(read(found, path).position, p, atol=1e-12)
        np.testing.assert_allclose(read(found, path).pose.rotation, q.as_matrix(), atol=1e-9)
        assert any("last row 0 0 0 1" in text for text in found.because)
    np.savez(tmp_path / "no.npz", time=t, T_base_tool=matrix + 0.5, wrench=w)
    assert not propose_reading(tmp_path / "no.npz").whole


def test_a_unit_of_the_header_is_kept_whatever_the_rate(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    names = ["Time Elapsed (s)", "X (m)", "Y (m)", "Z (m)", "qx", "qy", "qz", "qw", "Fx (N)", "Fy (N)", "Fz (N)"]
    path = table(tmp_path / "a.csv", [*names, "Tx (Nm)", "Ty (Nm)", "Tz (Nm)"], t * 100.0, p, q.as_quat(), w)
    found = propose_reading(path)
    assert "units" not in found.settings and "clock: in s, as the header says" in found.because
    assert read(found, path).rate == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("Fx (N)", "N"), ("Tx (N m)", "Nm"), ("x [mm]", "mm"), ("Time (Seconds)", "s"), ("fz_kN", "kN"),
        ("fz [mN]", "mN"), ("wrench[4]", None), ("stamp.secs", None), ("qw", None), ("t_us", "us"),
        ("roll(deg)", "deg"),
    ],
)  # fmt: skip
def test_a_unit_stands_in_brackets_or_behind_the_axis(name: str, unit: str | None) -> None:
    assert split_unit(name)[1] == unit


def test_a_header_of_several_rows_and_names_that_differ_by_case_are_read(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    names = "Frame,Time (Seconds),g_X,g_Y,g_Z,g_w,g_x,g_y,g_z,block_X,block_Y,block_Z,Fx,Fy,Fz,Mx,My,Mz"
    block, first = np.tile([0.1, 0.2, 0.3], (len(t), 1)), q.as_quat()[:, [3, 0, 1, 2]]
    above = "Format Version,1.23,Take Name,a\n,,,Body,Body\n"
    path = table(tmp_path / "a.csv", above + names, np.arange(len(t)), t, p, first, block, w)
    found = propose_reading(path)
    np.testing.assert_allclose(read(found, path).position, p, atol=1e-8)
    np.testing.assert_allclose(read(found, path).pose.rotation, q.as_matrix(), atol=1e-7)


def test_units_below_the_names_are_part_of_the_header(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    units = "[ms],[mm],[mm],[mm],,,,,[N],[N],[N],[Nm],[Nm],[Nm]"
    path = table(tmp_path / "a.csv", ",".join(NAMES) + "\n" + units, t * 1e3, p * 1e3, q.as_quat(), w)
    found = propose_reading(path)
    assert set(found.settings["units"].split(",")) == {"ms", "mm"}
    np.testing.assert_allclose(read(found, path).position, p, atol=1e-8)


def test_a_header_that_is_short_is_still_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,px,py\n0,1,2,3\n1,2,3,4\n")
    with pytest.raises(InputError, match="row 2: has 4 values, the header has 3"):
        read_demonstration(path)


def test_numbered_quaternions_are_undecided_and_no_header_is_named(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    names = ["t", "x", "y", "z", "q0", "q1", "q2", "q3", "fx", "fy", "fz", "tx", "ty", "tz"]
    found = propose_reading(table(tmp_path / "a.csv", names, t, p, q.as_quat()[:, [3, 0, 1, 2]], w))
    (said,) = [text for text in found.undecided if text.startswith("quaternion")]
    assert "wrench_sign" not in found.settings  # without an attitude nothing is known of a force in tool axes
    assert "header" not in said and "qw=q0" in found.settings["columns"] and "qw=q3" in said


def test_a_frame_id_states_the_axes_of_its_wrench(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    path = table(tmp_path / "a.csv", NAMES, t, p, q.as_quat(), in_tool(w, q))
    lines = path.read_text().splitlines()
    rows = [lines[0] + ",wrench.header.frame_id", *(line + ",tool0" for line in lines[1:])]
    path.write_text("\n".join(rows) + "\n")
    found = propose_reading(path)
    assert found.settings["wrench_frame"] == "tool"
    assert "wrench axes: tool, since its frame_id says tool0" in found.because


def test_arrays_that_are_named_decide_how_long_the_table_is(tmp_path: Path) -> None:
    t, p, q, w = slide(10.0)
    path, first = tmp_path / "a.mat", q.as_quat()[:, [3, 0, 1, 2]]
    content = {"plog": p, "Qlog": first, "f_log": w, "tlog": t[:, None], "K_log": np.tile(np.eye(6), (len(t), 1))}
    savemat(path, content)
    found = propose_reading(path)
    assert found.whole
    np.testing.assert_allclose(read(found, path).pose.rotation, q.as_matrix(), atol=1e-9)
    savemat(path, {**{f"K{i}": content["K_log"] for i in range(5)}, "aa1": t, "bb": p, "cc": first, "dd": w})
    spec = "t=aa1,px=bb[0],py=bb[1],pz=bb[2],qw=cc[0],qx=cc[1],qy=cc[2],qz=cc[3]"
    spec += "".join(f",{name}=dd[{i}]" for i, name in enumerate(NAMES[8:]))
    np.testing.assert_allclose(read_demonstration(path, columns=spec).position, p)


def test_a_cell_of_structs_is_several_recordings_with_samples_along_columns(tmp_path: Path) -> None:
    _, p, q, w = slide(10.0)
    cell, path = np.empty((2, 1), dtype=object), tmp_path / "a.mat"
    for i in range(2):
        cell[i, 0] = {"X": np.concatenate([p + i, q.as_quat()[:, [3, 0, 1, 2]], w], axis=1).T, "dt": 0.01}
    savemat(path, {"proc_data": cell})
    with pytest.raises(InputError, match="proc_data: holds 2 recordings; choose one with --set episode, 0 to 1"):
        propose_reading(path)
    with pytest.raises(InputError, match="choose a number from 0 to 1"):
        propose_reading(path, episode="2")
    found = propose_reading(path, episode="1")
    assert found.whole and "clock: 100 Hz, since the file says proc_data.dt = 0.01" in found.because
    np.testing.assert_allclose(read(found, path).position, p + 1)
    np.testing.assert_allclose(read(found, path).pose.rotation, q.as_matrix(), atol=1e-9)  # as MATLAB writes them
    assert any("quaternion: wxyz is assumed" in text and "the other order is" in text for text in found.undecided)


def test_a_pickle_is_refused_in_words(tmp_path: Path) -> None:
    import pickle

    for name in ("a.pkl", "a.dat"):
        (tmp_path / name).write_bytes(pickle.dumps({"a": [1.0]}))
        with pytest.raises(InputError, match="is a pickle, which can run any program"):
            read_demonstration(tmp_path / name)
    np.save(tmp_path / "a.npy", np.array([{"a": 1}], dtype=object))
    with pytest.raises(InputError, match="Python objects, which are never loaded"):
        read_demonstration(tmp_path / "a.npy")


def test_words_that_mean_nothing_in_a_recording_name_the_body() -> None:
    assert cut("objRightX(m)") == (("obj", "right"), "x") and cut("plog[2]") == (("p",), "2")
    assert [g.body for g in groups_of(["left_px", "left_fx", "actual_TCP_pose_0"])] == [("left",), ("left",), ()]
