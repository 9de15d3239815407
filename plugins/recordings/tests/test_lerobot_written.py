"""Demonstrations as a LeRobot data set: read back, statistics, indices, and what is refused."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skillframe_recordings.formats import lerobot

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, UnknownName
from skillframe.extend.reading import check_writable, read_demonstration, write_data_set, write_demonstration

parquet = pytest.importorskip("pyarrow.parquet")
FPS = 100


def episode(count: int, seed: int, task: str = "peg") -> Demonstration:
    """Random numbers that single precision holds, on LeRobot's clock."""
    rng = np.random.default_rng(seed)
    quaternion = rng.standard_normal((count, 4)) * 0.01 + [0, 0, 0, 1]
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    single = [rng.standard_normal((count, n)).astype(np.float32).astype(float) for n in (3, 6)]
    return Demonstration(
        time=(np.arange(count) / FPS).astype(np.float32).astype(float), position=0.001 * single[0],
        quaternion=quaternion, wrench=single[1], extra={"grip": single[0][:, 0].copy()},
        meta={"task": task, "rate": 100.0, "frames": {"tip": [0.0, 0.0, 0.2]}, "robot": "panda"},
    )  # fmt: skip


@pytest.fixture
def data_set(tmp_path: Path) -> tuple[Path, list[Demonstration]]:
    made = [episode(40, 1), episode(25, 2, "valley"), episode(31, 3)]
    write_data_set(made, tmp_path / "pegs")
    return tmp_path / "pegs", made


def test_every_episode_comes_back_in_single_precision_with_its_metadata(
    data_set: tuple[Path, list[Demonstration]],
) -> None:
    folder, made = data_set
    for number, d in enumerate(made):
        found = read_demonstration(folder, episode=str(number))
        np.testing.assert_array_equal(found.time, d.time)
        np.testing.assert_array_equal(found.wrench, d.wrench)
        np.testing.assert_array_equal(found.extra["grip"], d.extra["grip"])
        np.testing.assert_array_equal(found.position, d.position.astype(np.float32))
        # the reader makes the quaternion's norm 1 again, which moves a single number by its last bit at most
        np.testing.assert_allclose(found.quaternion, d.quaternion, rtol=0, atol=2**-23)
        assert {k: found.meta[k] for k in d.meta} == d.meta
    with pytest.raises(InputError, match=r"holds 3 episodes, 0 to 2.*--set episode"):
        read_demonstration(folder)
    with pytest.raises(UnknownName, match="episode '3'"):
        read_demonstration(folder, episode="3")


def frames(folder: Path) -> dict[str, np.ndarray]:
    """Columns of all frames, by pyarrow alone."""
    table = parquet.read_table(folder / "data" / "chunk-000" / "file-000.parquet")
    return {name: np.array(table.column(name).to_pylist()) for name in table.column_names}


def test_frames_are_counted_and_an_action_is_the_next_state(data_set: tuple[Path, list[Demonstration]]) -> None:
    folder, _ = data_set
    found = frames(folder)
    info = json.loads((folder / "meta" / "info.json").read_text())
    assert set(info["features"]) == set(found) and (info["fps"], info["total_frames"]) == (FPS, 96)
    assert found["index"].tolist() == [*range(96)] and found["task_index"].tolist() == [0] * 40 + [1] * 25 + [0] * 31
    assert found["frame_index"].tolist() == [*range(40), *range(25), *range(31)]
    np.testing.assert_array_equal(found["timestamp"], (found["frame_index"] / FPS).astype(np.float32))
    for first, last in ((0, 40), (40, 65), (65, 96)):
        state, action = found["observation.state"][first:last], found["action"][first:last]
        np.testing.assert_array_equal(action, np.concatenate([state[1:], state[-1:]]))
    rows = parquet.read_table(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    assert [(r["dataset_from_index"], r["dataset_to_index"], r["length"], r["tasks"]) for r in rows] == [
        (0, 40, 40, ["peg"]), (40, 65, 25, ["valley"]), (65, 96, 31, ["peg"]),
    ]  # fmt: skip
    tasks = parquet.read_table(folder / "meta" / "tasks.parquet")
    assert tasks.to_pydict() == {"task_index": [0, 1], "task": ["peg", "valley"]}
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]  # LeRobot looks words up there


def test_statistics_are_those_of_all_frames_together(data_set: tuple[Path, list[Demonstration]]) -> None:
    folder, made = data_set
    stats = json.loads((folder / "meta" / "stats.json").read_text())
    wrench = np.concatenate([d.wrench for d in made])
    found = {name: np.array(values) for name, values in stats["observation.wrench"].items()}
    np.testing.assert_array_equal(found["min"], wrench.min(0))
    np.testing.assert_array_equal(found["max"], wrench.max(0))
    np.testing.assert_allclose(found["mean"], wrench.mean(0), rtol=0, atol=1e-14)  # rounding of another order of sums
    np.testing.assert_allclose(found["std"], wrench.std(0), rtol=1e-13)
    assert found["count"].tolist() == [96]
    rows = parquet.read_table(folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    np.testing.assert_allclose(rows[1]["stats/observation.wrench/q90"], np.quantile(made[1].wrench, 0.9, axis=0))


def test_frames_go_on_in_a_further_file_where_one_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lerobot, "DATA_MB", 1e-6)
    made = [episode(20, k) for k in range(3)]
    write_data_set(made, tmp_path / "pegs")
    assert len(list((tmp_path / "pegs" / "data" / "chunk-000").iterdir())) == 3
    np.testing.assert_array_equal(read_demonstration(tmp_path / "pegs", episode="2").wrench, made[2].wrench)


def uneven(d: Demonstration) -> Demonstration:
    time = d.time.copy()
    time[20:] += 0.002
    return dataclasses.replace(d, time=time)


@pytest.mark.parametrize(
    ("change", "said"),
    [(uneven, "one whole rate"), (lambda d: dataclasses.replace(d, extra={}), "the same columns into all")],
)
def test_what_cannot_be_one_data_set_is_refused_and_leaves_nothing(change: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        write_data_set([episode(40, 1), change(episode(40, 2))], tmp_path / "pegs")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_holds_something_is_not_written_over(data_set: tuple[Path, list[Demonstration]]) -> None:
    folder, made = data_set
    before = frames(folder)["index"]
    for write in (lambda: check_writable(folder), lambda: write_demonstration(made[0], folder)):
        with pytest.raises(InputError, match="is there already"):
            write()
    np.testing.assert_array_equal(frames(folder)["index"], before)
    assert not list(folder.parent.glob(".*"))


@pytest.mark.slow
def test_a_thousand_are_recorded_in_groups_that_change_no_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from skillframe_teaching import sessions

    from skillframe import record

    together = record("free", "free_tool", count=3, seed=2, rate_hz=50.0)
    monkeypatch.setattr(sessions, "MOST_AT_ONCE", 2)
    apart = record("free", "free_tool", count=3, seed=2, rate_hz=50.0)
    for one, other in zip(together, apart, strict=True):
        np.testing.assert_array_equal(one.wrench, other.wrench)
    assert together.rejected == apart.rejected
    (folder,) = apart.save(tmp_path / "frees")
    np.testing.assert_array_equal(read_demonstration(folder, episode="2").wrench, apart[2].wrench.astype(np.float32))


def test_a_full_disk_leaves_no_half_of_a_data_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, content: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(lerobot, "_write_json", full)
    with pytest.raises(InputError, match=r"pegs: cannot be written \(No space left on device\)"):
        write_data_set([episode(40, 1)], tmp_path / "pegs")
    assert not list(tmp_path.iterdir())
