"""Files as other tools' own libraries write them, read back to the last bit, and what is refused of them."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat
from skillframe_recordings.proposal.reading import propose_reading

from skillframe.demonstration.columns import CANONICAL, WRENCH
from skillframe.demonstration.csv import demonstration_columns
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, MissingDependency, UnknownName
from skillframe.extend.reading import read_demonstration

PICKS = (
    "t={t},px={p}[0],py={p}[1],pz={p}[2],qx={q}[0],qy={q}[1],qz={q}[2],qw={q}[3],"
    "fx={f}[0],fy={f}[1],fz={f}[2],tx={f}[3],ty={f}[4],tz={f}[5]"
)
Write = Callable[[Path, Demonstration], tuple[Path, dict[str, Any]]]


def parts(d: Demonstration) -> dict[str, np.ndarray]:
    return {"time": d.time, "ee_pos": d.position, "ee_quat": d.quaternion, "wrench": d.wrench}


def picks(t: str = "time", p: str = "ee_pos", q: str = "ee_quat", f: str = "wrench") -> dict[str, Any]:
    return {"columns": PICKS.format(t=t, p=p, q=q, f=f)}


def npy(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    np.save(folder / "log.npy", np.column_stack([d.time, d.position, d.quaternion, d.wrench]))
    return folder / "log.npy", {"columns": ",".join(CANONICAL)}


def structured_npy(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    columns = demonstration_columns(d)
    array = np.zeros(len(d), dtype=[(name, float) for name in columns])
    for name, column in columns.items():
        array[name] = column
    np.save(folder / "log.npy", array)
    return folder / "log.npy", {}


def npz(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    np.savez_compressed(folder / "log.npz", image=np.zeros((len(d), 8, 8, 3), dtype=np.uint8), **parts(d))
    return folder / "log.npz", picks()


def mat(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    sideways = {name: np.atleast_2d(array).T if array.ndim > 1 else array for name, array in parts(d).items()}
    savemat(folder / "log.mat", {"log": {"tcp": sideways}, "operator": "ü", "gain": 3.0})
    return folder / "log.mat", picks("log.tcp.time", "log.tcp.ee_pos", "log.tcp.ee_quat", "log.tcp.wrench")


def json_records(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    rows = [{name: array[i].tolist() for name, array in parts(d).items()} | {"note": "x"} for i in range(len(d))]
    (folder / "log.json").write_text(json.dumps(rows))
    return folder / "log.json", picks()


def json_lines(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    xyz, four = "xyz", "xyzw"
    rows = [
        {
            "stamp": d.time[i],
            "pose": {"position": dict(zip(xyz, p, strict=True)), "orientation": dict(zip(four, q, strict=True))},
            "wrench": {"force": dict(zip(xyz, w[:3], strict=True)), "torque": dict(zip(xyz, w[3:], strict=True))},
        }
        for i, (p, q, w) in enumerate(zip(d.position.tolist(), d.quaternion.tolist(), d.wrench.tolist(), strict=True))
    ]
    (folder / "log.jsonl").write_text("\n".join(map(json.dumps, rows)) + "\n")
    names = {f"p{a}": f"pose.position.{a}" for a in xyz} | {f"q{a}": f"pose.orientation.{a}" for a in four}
    names |= {f"f{a}": f"wrench.force.{a}" for a in xyz} | {f"t{a}": f"wrench.torque.{a}" for a in xyz}
    return folder / "log.jsonl", {"columns": ",".join(f"{n}={c}" for n, c in {"t": "stamp", **names}.items())}


def json_lists(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    (folder / "log.json").write_text(json.dumps({"robot": {n: a.tolist() for n, a in parts(d).items()}, "by": "me"}))
    return folder / "log.json", picks("robot.time", "robot.ee_pos", "robot.ee_quat", "robot.wrench")


def robomimic(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "low_dim.hdf5", "w") as file:
        for k in range(2):
            obs = file.create_group(f"data/demo_{k}/obs")
            obs["robot0_eef_pos"], obs["robot0_eef_quat"] = d.position + k, d.quaternion
            obs["robot0_ee_force"], obs["robot0_ee_torque"] = d.wrench[:, :3], d.wrench[:, 3:]
            obs["agentview_image"] = np.zeros((len(d), 8, 8, 3), dtype=np.uint8)
            file[f"data/demo_{k}/actions"] = np.zeros((len(d), 7))
        file["data"].attrs["total"] = 2 * len(d)
    columns = ",".join(f"p{a}=obs/robot0_eef_pos[{i}]" for i, a in enumerate("xyz"))
    columns += "," + ",".join(f"q{a}=obs/robot0_eef_quat[{i}]" for i, a in enumerate("xyzw"))
    columns += "," + ",".join(f"f{a}=obs/robot0_ee_force[{i}]" for i, a in enumerate("xyz"))
    columns += "," + ",".join(f"t{a}=obs/robot0_ee_torque[{i}]" for i, a in enumerate("xyz"))
    return folder / "low_dim.hdf5", {"columns": columns, "episode": "demo_0", "rate": 100.0}


def reassemble(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    """One recording a file, a clock per sensor, sensors of other rates beside it."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "task.h5", "w") as file:
        state = file.create_group("robot_state")
        state["pose"], state["measured_wrench"] = np.hstack([d.position, d.quaternion]), d.wrench
        file["timestamps/robot_state"] = d.time
        file["timestamps/microphone"], file["microphone"] = np.arange(5000.0), np.zeros((5000, 2))
    columns = "t=timestamps/robot_state," + ",".join(f"{n}=robot_state/pose[{i}]" for i, n in enumerate(CANONICAL[1:8]))
    columns += "," + ",".join(f"{n}=robot_state/measured_wrench[{i}]" for i, n in enumerate(WRENCH))
    return folder / "task.h5", {"columns": columns}


def lerobot_features(d: Demonstration) -> dict[str, Any]:
    names = [*"xyz", "qx", "qy", "qz", "qw"]
    state = {"dtype": "float64", "shape": [7], "names": {"motors": names}}
    return {"observation.state": state, "observation.force": {"dtype": "float64", "shape": [6], "names": [*WRENCH]}}


def lerobot(folder: Path, d: Demonstration, version: str = "v3.0") -> tuple[Path, dict[str, Any]]:
    """A data set in the layout that LeRobot documents, written by pyarrow; three episodes, the second is `d`."""
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    (folder / "set" / "meta").mkdir(parents=True)
    (folder / "set" / "data" / "chunk-000").mkdir(parents=True)
    info = {"codebase_version": version, "fps": 100, "features": lerobot_features(d)}
    (folder / "set" / "meta" / "info.json").write_text(json.dumps(info))
    tables = []
    for k in range(3):
        state = np.hstack([d.position + (k - 1), d.quaternion])
        tables.append(pa.table({
            "observation.state": pa.array(state.tolist(), pa.list_(pa.float64(), 7)),
            "observation.force": pa.array(d.wrench.tolist(), pa.list_(pa.float64())),
            "timestamp": d.time, "episode_index": np.full(len(d), k), "frame_index": np.arange(len(d)),
            "task": ["peg"] * len(d),
        }))  # fmt: skip
        if version == "v2.1":
            pq.write_table(tables[-1], folder / "set" / "data" / "chunk-000" / f"episode_{k:06d}.parquet")
    if version == "v3.0":
        pq.write_table(pa.concat_tables(tables), folder / "set" / "data" / "chunk-000" / "file-000.parquet")
    columns = "t=timestamp," + ",".join(f"p{a}=observation.state.{a}" for a in "xyz")
    columns += "," + ",".join(f"q{a}=observation.state.q{a}" for a in "xyzw")
    columns += "," + ",".join(f"{n}=observation.force.{n}" for n in WRENCH)
    return folder / "set", {"columns": columns, "episode": "1"}


def lerobot_2(folder: Path, d: Demonstration) -> tuple[Path, dict[str, Any]]:
    return lerobot(folder, d, "v2.1")


FORMATS: dict[str, Write] = {
    write.__name__: write
    for write in (
        npy, structured_npy, npz, mat, json_records, json_lines, json_lists, robomimic, reassemble, lerobot, lerobot_2,
    )
}  # fmt: skip


@pytest.mark.parametrize("form", FORMATS)
def test_a_file_of_the_formats_own_library_comes_back_to_the_last_bit(
    form: str, tmp_path: Path, demo: Demonstration
) -> None:
    path, options = FORMATS[form](tmp_path, demo)
    found = read_demonstration(path, **options)
    for name in ("time", "position", "quaternion", "wrench"):
        np.testing.assert_array_equal(getattr(found, name), getattr(demo, name))


@pytest.mark.slow
@pytest.mark.parametrize("form", [f for f in FORMATS if f not in ("npy", "structured_npy")])
def test_the_proposed_line_names_the_same_columns(form: str, tmp_path: Path, demo: Demonstration) -> None:
    path, options = FORMATS[form](tmp_path, demo)
    found = propose_reading(path, **{k: v for k, v in options.items() if k != "columns"})
    others = re.findall(r"the other order is --set columns='([^']+)'", " ".join(found.undecided))
    named = [set(columns.split(",")) for columns in (found.settings["columns"], *others)]
    assert named.index(set(options["columns"].split(","))) == (form == "mat")  # MATLAB's own functions write w first
    assert found.whole and f"--set episode={options['episode']}" in found.line if "episode" in options else found.whole


@pytest.mark.parametrize(("form", "names"), [(robomimic, "demo_0, demo_1"), (lerobot, "episodes, 0 to 2")])
def test_which_of_several_recordings_is_asked_for(form: Write, names: str, tmp_path: Path, demo: Demonstration) -> None:
    path, options = form(tmp_path, demo)
    with pytest.raises(InputError, match=rf"{names}.*choose one with --set episode"):
        read_demonstration(path, **{**options, "episode": None})
    with pytest.raises(UnknownName, match="unknown episode '7'"):
        read_demonstration(path, **{**options, "episode": "7"})


def test_what_a_file_without_force_holds_is_said(tmp_path: Path, demo: Demonstration) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "demo.h5", "w") as file:
        file["obs/eef_pos"], file["obs/eef_quat"] = demo.position, demo.quaternion
    with pytest.raises(InputError, match=r"holds obs/eef_pos\[0\].*: none is called as a demonstration's; name them"):
        read_demonstration(tmp_path / "demo.h5")
    assert any("a wrench (fx" in text for text in propose_reading(tmp_path / "demo.h5", rate=100).missing)


def test_a_parquet_file_of_words_is_refused_with_its_columns(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"name": ["a", "b"], "town": ["c", "d"]}), tmp_path / "list.parquet")
    with pytest.raises(InputError, match=r"holds no numbers; its columns are name \(string\), town"):
        read_demonstration(tmp_path / "list.parquet", columns="t=name")


@pytest.mark.parametrize("ending", [".npy", ".mat", ".json", ".jsonl", ".h5", ".parquet"])
def test_other_bytes_are_refused_in_one_sentence(ending: str, tmp_path: Path) -> None:
    for library in {".h5": ["h5py"], ".parquet": ["pyarrow"]}.get(ending, []):
        pytest.importorskip(library)
    for content in (b"\x00\x01\x02 not this kind", b"{", b"[1, 2, 3]", b"[{}]", b"\x93NUMPY\x01\x00v\x00{"):
        (tmp_path / f"log{ending}").write_bytes(content)
        with pytest.raises(InputError, match=re.escape(f"log{ending}")) as caught:
            read_demonstration(tmp_path / f"log{ending}", columns="t=a")
        assert "\n" not in str(caught.value)
    (tmp_path / f"log{ending}").write_bytes(b"")
    with pytest.raises(InputError, match="is empty"):
        read_demonstration(tmp_path / f"log{ending}")
    with pytest.raises(InputError, match="no such file"):
        read_demonstration(tmp_path / f"none{ending}")


@pytest.mark.parametrize(("ending", "library"), [(".h5", "h5py"), (".parquet", "pyarrow")])
def test_without_the_library_the_line_that_installs_it_is_said(
    ending: str, library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, library, None)
    (tmp_path / f"log{ending}").write_bytes(b"anything")
    with pytest.raises(MissingDependency, match=rf"needs {library}.*pip install 'skillframe-recordings\["):
        read_demonstration(tmp_path / f"log{ending}", columns="t=a")
