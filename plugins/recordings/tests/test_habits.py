"""Habits of other people's exports: bags as folders, in parts or packed. Npz and CSV files that hold more than ours."""

from __future__ import annotations

import json
import re
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.demonstration.csv import demonstration_columns
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration

META = json.dumps({"format": "skillframe.demonstration", "version": 1})


def same(found: Demonstration, demo: Demonstration) -> None:
    np.testing.assert_array_equal(found.position, demo.position)
    np.testing.assert_allclose(found.wrench, demo.wrench, atol=1e-6)  # the join may interpolate 1 ns off the sample


@pytest.fixture
def bags() -> Any:
    pytest.importorskip("rosbags", reason="rosbags is not installed (pip install rosbags)")
    from plugins.recordings.tests import bags_written

    return bags_written


@pytest.mark.parametrize("ending", [".db3", ".mcap"])
def test_the_folder_of_a_bag_is_read_as_the_file_in_it_is(
    tmp_path: Path, demo: Demonstration, bags: Any, ending: str
) -> None:
    file = bags.write_bag(tmp_path / f"demo{ending}", {"/tool": bags.poses(demo), "/ft": bags.wrenches(demo)})
    same(read_demonstration(file.parent), demo)
    assert run(["check", str(file.parent)]) == 0


def test_a_bag_in_two_parts_is_read_whole_and_a_part_says_that_it_is_one(
    tmp_path: Path, demo: Demonstration, bags: Any
) -> None:
    topics = {"/tool": bags.poses(demo), "/ft": bags.wrenches(demo)}
    middle = len(demo) // 2
    parts = [
        bags.write_bag(tmp_path / f"part{i}.db3", {name: (kind, rows[cut]) for name, (kind, rows) in topics.items()})
        for i, cut in enumerate((slice(middle), slice(middle, None)))
    ]
    folder = parts[0].parent
    shutil.copy(parts[1], folder / "second.db3")
    facts = (folder / "metadata.yaml").read_text()
    facts = re.sub(r"( *- )(part0.db3)", r"\1\2\n\1second.db3", facts)
    (folder / "metadata.yaml").write_text(facts)
    same(read_demonstration(folder), demo)
    first = read_demonstration(parts[0])
    assert len(first) < 0.6 * len(demo)
    assert any("is one of 2 parts of its bag; give the folder" in note for note in first.meta["reading"])


@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
@pytest.mark.slow
def test_a_packed_bag_is_read_by_its_folder_and_its_file_names_the_folder(
    tmp_path: Path, demo: Demonstration, bags: Any, monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode

    class Packing(bags.Writer2):  # type: ignore[misc, name-defined]
        def open(self) -> None:
            self.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
            super().open()

    monkeypatch.setattr(bags, "Writer2", Packing)
    topics = {"/tool": bags.poses(demo), "/ft": bags.wrenches(demo)}
    with suppress(StopIteration):  # its file may have one more ending
        bags.write_bag(tmp_path / "demo.db3", topics)
    folder = tmp_path / "demo"
    same(read_demonstration(folder), demo)
    (file,) = folder.glob("*.db3*")
    with pytest.raises(InputError, match=f"folder, {folder}"):
        read_demonstration(file)


@pytest.mark.parametrize("meta", [META, META.encode(), np.array([META]), np.array(META)])
def test_the_metadata_of_an_npz_may_be_stored_as_numpy_stores_texts(
    tmp_path: Path, demo: Demonstration, meta: Any
) -> None:
    np.savez(tmp_path / "demo.npz", **demonstration_columns(demo), meta=meta)
    same(read_demonstration(tmp_path / "demo.npz"), demo)


def test_arrays_beside_the_channels_are_left_out_with_a_note(tmp_path: Path, demo: Demonstration) -> None:
    more = {"image": np.zeros((3, 4, 4)), "joints": np.zeros((len(demo), 7)), "operator": np.array("ü")}
    np.savez(tmp_path / "demo.npz", **demonstration_columns(demo), **more, meta=META)
    found = read_demonstration(tmp_path / "demo.npz")
    same(found, demo)
    assert [note for note in found.meta["reading"] if "was left out" in note] == [
        f"array {name}, {array.dtype} of shape {array.shape}, was left out" for name, array in more.items()
    ]


@pytest.mark.parametrize("kind", ["<f4", ">f8", "g"])
def test_numbers_of_any_width_and_order_are_numbers(tmp_path: Path, demo: Demonstration, kind: str) -> None:
    columns = {name: column.astype(kind) for name, column in demonstration_columns(demo).items()}
    np.savez(tmp_path / "demo.npz", **columns, meta=META)
    np.testing.assert_allclose(read_demonstration(tmp_path / "demo.npz").wrench, demo.wrench, rtol=1e-6, atol=1e-7)


def test_a_column_of_dates_with_blanks_in_them_does_not_hide_the_commas(
    tmp_path: Path, demo: Demonstration, rows: list[list[str]]
) -> None:
    more = [["wall clock"], *([["2026-01-01 10:00:00"]] * (len(rows) - 1))]
    text = "\n".join(",".join([*row, *extra]) for row, extra in zip(rows, more, strict=True))
    (tmp_path / "demo.csv").write_text(text + "\n")
    found = read_demonstration(tmp_path / "demo.csv")
    same(found, demo)
    assert "column wall clock holds words and was left out" in found.meta["reading"]


@pytest.mark.parametrize("order", ["zyxw", "YXZW", "x,z,y,w"])
def test_metadata_that_state_another_order_of_quaternions_are_refused(
    tmp_path: Path, demo: Demonstration, order: str
) -> None:
    meta = json.dumps({**json.loads(META), "quaternion": order})
    np.savez(tmp_path / "demo.npz", **demonstration_columns(demo), meta=meta)
    with pytest.raises(InputError, match=f"quaternions are in the order {order}"):
        read_demonstration(tmp_path / "demo.npz")


def test_an_order_of_euler_angles_for_a_file_of_quaternions_is_refused(tmp_path: Path, demo: Demonstration) -> None:
    np.savez(tmp_path / "demo.npz", **demonstration_columns(demo), meta=META)
    with pytest.raises(InputError, match="holds quaternions, no Euler angles"):
        read_demonstration(tmp_path / "demo.npz", euler="xyz")
