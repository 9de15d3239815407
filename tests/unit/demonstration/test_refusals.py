"""Every refusal of the contract: the message names file, row or channel and what to do."""

from __future__ import annotations

import json
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError, SkillframeError, UnknownName
from skillframe.extend.reading import read_demonstration, write_demonstration

Cells = list[list[str]]
Write = Callable[..., Path]


def spoil(rows: Cells, column: str, value: str, row: int | None = None) -> Cells:
    """The cells with one value (row counted as in the file), or a whole column, replaced."""
    i = rows[0].index(column)
    for number, cells in enumerate(rows, start=1):
        if number > 1 and row in (None, number):
            cells[i] = value
    return rows


def turned(rows: Cells, row: int) -> Cells:
    """From one row on, the tool turned half about x."""
    for cells in rows[row - 1 :]:
        x, y, z, w = (float(v) for v in cells[4:8])
        cells[4:8] = [repr(v) for v in (w, -z, y, -x)]
    return rows


def drop(rows: Cells, *columns: str) -> Cells:
    keep = [i for i, name in enumerate(rows[0]) if name not in columns]
    return [[row[i] for i in keep] for row in rows]


def constant(rows: Cells, value: str) -> Cells:
    for name in ("fx", "fy", "fz", "tx", "ty", "tz"):
        spoil(rows, name, value)
    return rows


def scaled(rows: Cells, factor: float, row: int) -> Cells:
    rows[row - 1][4:8] = [repr(float(v) * factor) for v in rows[row - 1][4:8]]
    return rows


def decimal_commas(rows: Cells) -> Cells:
    """As an office of continental Europe saves a table: one cell a row, for this test's writer joins them by commas."""
    return [[";".join(rows[0])], *([";".join(row).replace(".", ",")] for row in rows[1:])]


W_FIRST = [0, 1, 2, 3, 7, 4, 5, 6, 8, 9, 10, 11, 12, 13]
CASES: dict[str, tuple[Callable[[Cells], Cells], str]] = {
    "no time column and no rate": (lambda r: drop(r, "t"), "no time column.*--set rate"),
    "time that runs back": (lambda r: spoil(r, "t", "0.005", 57), "row 57, column t: time runs back"),
    "stamps all zero": (lambda r: spoil(r, "t", "0.0"), "every time stamp is 0.*--set rate"),
    "time that is not a number": (lambda r: spoil(r, "t", "nan", 9), "row 9, column t: is not a finite"),
    "NaN": (lambda r: spoil(r, "fy", "nan", 12), "row 12, column fy: is not a finite number"),
    "infinity": (lambda r: spoil(r, "pz", "inf", 4), "row 4, column pz: is not a finite number"),
    "an empty cell": (lambda r: spoil(r, "qx", "", 5), "row 5, column qx: is not a finite number"),
    "a word": (lambda r: spoil(r, "tx", "high", 6), "row 6, column tx: is not a number .'high'.; fix that cell"),
    "commas and points": (
        lambda r: [*decimal_commas(r)[:9], [decimal_commas(r)[9][0].replace(",", ".", 1)]],
        "row 10, column 1: has a decimal point .0.08., other cells a comma.*one decimal sign",
    ),
    "a comma that parts cells and decimals": (
        lambda r: [r[0], *([*row[:-1], f"{row[-1]},5"] for row in r[1:])],
        "row 2: has 15 values, the header has 14",
    ),
    "digits of another script": (lambda r: spoil(r, "px", "\u0661\u0662", 6), "row 6, column px: is not a number"),
    "a number as Python writes it": (lambda r: spoil(r, "px", "1_0", 6), "row 6, column px: is not a number .'1_0'"),
    "a number that overflows": (lambda r: spoil(r, "fz", "1e200", 6), "row 6, column fz: is 1e.200, which nothing"),
    "a header in capitals": (
        lambda r: [[name.upper() for name in r[0]], *r[1:]],
        "no time column.*T may be t: add --layout auto",
    ),
    "a quaternion that is no rotation": (lambda r: scaled(r, 1.02, 30), "row 30: the quaternion's norm is 1.02"),
    "a zero quaternion": (lambda r: scaled(r, 0.0, 30), "row 30: the quaternion's norm is 0.0"),
    "a w-first header": (lambda r: [[row[i] for i in W_FIRST] for row in r], "w-first"),
    "a jump in orientation": (lambda r: turned(r, 101), "row 101: the orientation jumps by 179.9 degrees.*--set euler"),
    "a constant wrench": (lambda r: constant(r, "1.5"), "fx ... tz: the wrench is exactly constant"),
    "a zero wrench": (lambda r: constant(r, "0.0"), "wrench is exactly zero.*contact = false"),
    "a short row": (lambda r: [*r[:40], r[40][:-2], *r[41:]], "row 41: has 12 values, the header has 14"),
    "a long row": (lambda r: [*r[:40], [*r[40], "1"], *r[41:]], "row 41: has 15 values, the header has 14"),
    "a truncated file": (lambda r: [*r[:-1], r[-1][:3]], "row 201: has 3 values.*truncated"),
    "a header without rows": (lambda r: r[:1], "has a header but no rows"),
    "one row": (lambda r: r[:2], "only one row"),
    "no header": (lambda r: r[1:], "row 1: has no header"),
    "a wrong header": (lambda r: [[f"c{i}" for i in range(14)], *r[1:]], "no time column"),
    "a header of another tool": (
        lambda r: [["t", "x", "y", "z", *r[0][4:]], *r[1:]],
        "no position.*x may be px, .*--layout auto",
    ),
    "torques by another name": (
        lambda r: [[*r[0][:11], "mx", "my", "mz"], *r[1:]],
        "no wrench.*mx may be tx, .*--layout auto",
    ),
    "a header that repeats a name": (lambda r: [[*r[0][:-1], "fx"], *r[1:]], "column 'fx' twice"),
    "no wrench": (lambda r: drop(r, "fx", "fy", "fz", "tx", "ty", "tz"), "no wrench.*--set wrench"),
    "no orientation": (lambda r: drop(r, "qx", "qy", "qz", "qw"), "no orientation"),
}


@pytest.mark.parametrize("name", CASES)
def test_bad_rows_are_refused_with_where_and_what_to_do(rows: Cells, write: Write, name: str) -> None:
    change, message = CASES[name]
    with pytest.raises(InputError, match=message) as caught:
        read_demonstration(write(change(rows)))
    assert "demo.csv" in str(caught.value)
    assert caught.value.fix


METADATA = {
    "a quaternion order that is w-first": ('quaternion = "wxyz"', "quaternion: says that quaternions are w-first"),
    "the same, said deeper": ('[frames]\n[sensor]\nquaternion_order = "w-first"', "w-first"),
    "a flag for it": ("scalar_first = true", "w-first"),
    "TOML that is none": ("task = ", "not valid TOML"),
    "an unknown frame": ('wrench.frame = "tcp"', "wrench.frame: unknown value 'tcp'"),
    "an unknown sign": ('wrench.sign = "robot"', "wrench.sign: unknown value 'robot'"),
    "an unknown key": ('wrench.frmae = "base"', "did you mean 'frame'"),
    "a point that is none": ("wrench.point = 3", "wrench.point: is no point"),
    "frames that are no points": ("frames.hand = [0.0, 1.0]", "frames.hand: is no point"),
    "a frame that is not finite": ("frames.hand = [0.0, 0.0, nan]", "frames.hand: is no point"),
    "a hand that is a number": ("hand = 5", "hand: is no point: 5"),
    "a hand of two numbers": ("hand = [0.0, 1.0]", "hand: is no point"),
    "noise that is a word": ('sensor.force_noise = "low"', "sensor.force_noise: is no standard deviation: 'low'"),
    "noise below zero": ("sensor.torque_noise = -0.1", "sensor.torque_noise: is no standard deviation: -0.1"),
    "contact that is a word": ('contact = "no"', "contact: should be true or false"),
    "a rate that is none": ("rate = -5.0", "rate: is no sample rate"),
    "a payload that is none": (
        "wrench.includes_tool_weight = true\nwrench.tool_mass = -1.0",
        "tool_mass or tool_com",
    ),
}


@pytest.mark.parametrize("name", METADATA)
def test_bad_metadata_are_refused(rows: Cells, write: Write, name: str) -> None:
    text, message = METADATA[name]
    with pytest.raises(InputError, match=message):
        read_demonstration(write(rows, meta=text + "\n"))


def test_an_unknown_wrench_point_lists_the_points_there_are(rows: Cells, write: Write) -> None:
    with pytest.raises(UnknownName, match=r"demo\.csv: wrench\.point: unknown point 'hnad'; did you mean 'hand'"):
        read_demonstration(write(rows, meta='wrench.point = "hnad"\nframes.hand = [0.0, 0.0, 0.1]\n'))


def test_a_dead_wrench_is_fine_where_the_metadata_say_that_there_was_no_contact(rows: Cells, write: Write) -> None:
    assert len(read_demonstration(write(constant(rows, "0.0"), meta="contact = false\n"))) == 200


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"\n \n", "is empty"),
        (bytes(range(256)) * 20, "binary"),
        (b"t,px\n1,\x00\n", "binary"),
        ("t,px\n1,2\n".encode("utf-16"), "is UTF-16 text; save it as UTF-8"),
        (",".join(f"c{i}" for i in range(20_000)).encode() + b"\n" + b",".join([b"1"] * 20_000), "no time column"),
        (b"# t,px,py\n", "no rows"),
    ],
)
def test_files_that_are_no_tables_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "demo.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_demonstration(path)


@pytest.mark.parametrize("name", ["none.csv", "none.npz", "none.dat", "none.xyz"])
def test_a_missing_file_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_demonstration(tmp_path / name)


@pytest.mark.parametrize("name", ["folder.csv", "folder.npz", "folder"])
def test_a_folder_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match="is a folder"):
        read_demonstration(tmp_path / name)


def npz(path: Path, demo: Demonstration, meta: dict[str, Any] | str | None = None, **changed: Any) -> Path:
    write_demonstration(demo, path)
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    if meta is not None:
        arrays["meta"] = np.array(meta if isinstance(meta, str) else json.dumps(meta))
    arrays.update(changed)
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    return path


FORMAT = {"format": "skillframe.demonstration", "version": 1}
NATIVE: dict[str, tuple[dict[str, Any], str]] = {
    "another format": ({"meta": {"format": "skillframe.trace", "version": 1}}, "meta.format"),
    "a newer version": ({"meta": {**FORMAT, "version": 2}}, "meta.version: is 2"),
    "a version that is a word": ({"meta": {**FORMAT, "version": "1"}}, "meta.version.*store the number 1"),
    "metadata nested beyond reason": ({"meta": "[" * 100_000}, "not a JSON object"),
    "metadata that are no JSON": ({"meta": "{"}, "not a JSON object"),
    "metadata that are a list": ({"meta": "[]"}, "not a JSON object"),
    "w-first metadata": ({"meta": {**FORMAT, "quaternion": "wxyz"}}, "w-first"),
    "arrays of different length": ({"fx": np.zeros(7)}, "fx: has 7 values, t has 200"),
    "an array of another shape": ({"fx": np.zeros((200, 2))}, "fx: is float64 of shape"),
    "an array of words": ({"fx": np.array(["a"] * 200)}, "fx: is <U1"),
    "a channel with NaN": ({"fx": np.full(200, np.nan)}, "row 1, column fx"),
    "a missing channel": ({"fx": None}, "fx missing.*store them as arrays"),
    "missing metadata": ({"meta": None}, "holds no meta"),
}


@pytest.mark.parametrize("name", NATIVE)
def test_bad_native_files_are_refused(demo: Demonstration, tmp_path: Path, name: str) -> None:
    changes, message = NATIVE[name]
    path = npz(tmp_path / "demo.npz", demo, **changes) if changes.get("meta", "") is not None else None
    if path is None:
        path = npz(tmp_path / "demo.npz", demo)
        with np.load(path) as file:
            arrays = {n: file[n] for n in file.files if n != "meta"}
        np.savez(path, **arrays)
    with pytest.raises(InputError, match=message):
        read_demonstration(path)


def test_a_native_file_without_rows_is_refused(demo: Demonstration, tmp_path: Path) -> None:
    write_demonstration(demo, tmp_path / "demo.npz")
    with np.load(tmp_path / "demo.npz") as file:
        arrays = {n: file[n] if n == "meta" else file[n][:0] for n in file.files}
    np.savez(tmp_path / "demo.npz", **arrays)
    with pytest.raises(InputError, match="no rows"):
        read_demonstration(tmp_path / "demo.npz")


@pytest.mark.parametrize("kept", [0, 1, 100, 3000, -30])
def test_a_truncated_or_foreign_native_file_is_refused(demo: Demonstration, tmp_path: Path, kept: int) -> None:
    path = tmp_path / "demo.npz"
    write_demonstration(demo, path)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(InputError, match=r"demo\.npz"):
        read_demonstration(path)


def test_a_pickled_array_is_never_loaded(tmp_path: Path) -> None:
    np.savez(tmp_path / "demo.npz", t=np.array([{"a": 1}], dtype=object))
    with pytest.raises(InputError, match=r"not a readable npz.*Python objects, which are never loaded"):
        read_demonstration(tmp_path / "demo.npz")


def test_an_array_that_claims_more_rows_than_any_memory_holds_is_refused(tmp_path: Path) -> None:
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000000,), }".ljust(117) + b"\n"
    with zipfile.ZipFile(tmp_path / "demo.npz", "w") as file:
        file.writestr("t.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + header + bytes(80))
    with pytest.raises(InputError, match="not a readable npz"):
        read_demonstration(tmp_path / "demo.npz")


def test_any_binary_file_is_refused_without_advice_to_unpickle_it(tmp_path: Path) -> None:
    (tmp_path / "demo.npz").write_bytes(bytes(range(256)) * 8)
    with pytest.raises(InputError, match="not a readable npz") as refusal:
        read_demonstration(tmp_path / "demo.npz")
    assert "pickle" not in str(refusal.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"colums": "t"}, "did you mean 'columns'"),
        ({"columns": "t,px"}, "14 columns, and columns names 2"),
        ({"columns": "t=clock"}, "no column 'clock'"),
        ({"units": "furlong"}, "unknown unit 'furlong'"),
        ({"units": "mm,cm"}, "two units of length"),
        ({"rate": 0.0}, "is not a rate"),
        ({"clock": "both"}, "unknown value 'both'"),
        ({"wrench": Path("none.dat")}, "no such file"),
    ],
)
def test_wrong_reading_options_are_refused(rows: Cells, write: Write, options: dict[str, Any], message: str) -> None:
    with pytest.raises(SkillframeError, match=message):
        read_demonstration(write(rows), **options)


def of_two_arms(rows: Cells, shift: float, drift: float = 0.0) -> Cells:
    """The recording twice, each arm with its own clock. The second's is shifted and runs fast."""
    names = [f"{arm}_{name}" for arm in ("left", "right") for name in rows[0]]
    late = [repr(float(row[0]) * (1.0 + drift) + shift) for row in rows[1:]]
    return [names, *([*row, t, *row[1:]] for row, t in zip(rows[1:], late, strict=True))]


@pytest.mark.parametrize("arm", [None, "left", "right"])
@pytest.mark.parametrize(("shift", "drift", "size"), [(0.02, 0.0, "20 ms"), (0.0, 0.01, "19.9 ms")])
def test_arms_whose_clocks_differ_are_refused_whichever_is_asked_for(
    rows: Cells, write: Write, arm: str | None, shift: float, drift: float, size: str
) -> None:
    with pytest.raises(InputError, match=f"row .*clocks of the arms left and right differ by {size}.*one clock"):
        read_demonstration(write(of_two_arms(rows, shift, drift)), arm=arm)


def test_arms_whose_stamps_differ_by_less_than_a_tenth_of_a_sample_are_read(rows: Cells, write: Write) -> None:
    demo = read_demonstration(write(of_two_arms(rows, 5e-4)), arm="right")
    assert demo.time[0] == 5e-4
