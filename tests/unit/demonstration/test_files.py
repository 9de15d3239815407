from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from skillframe.demonstration.options import toml_text
from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.extend.reading import check_writable, read_demonstration, write_demonstration
from skillframe.extend.registry import Registry
from skillframe.frames import norm

finite = st.floats(-1e6, 1e6, allow_nan=False, width=64)
plain = st.recursive(
    st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)


def same(a: Demonstration, b: Demonstration) -> bool:
    arrays_equal = all(
        np.array_equal(getattr(a, n), getattr(b, n)) for n in ("time", "position", "quaternion", "wrench")
    )
    extra = a.extra.keys() == b.extra.keys() and all(
        np.array_equal(a.extra[k], b.extra[k], equal_nan=True) for k in a.extra
    )
    return arrays_equal and extra


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(wrench=arrays(float, (5, 6), elements=finite), position=arrays(float, (5, 3), elements=finite), label=finite)
def test_npz_and_csv_hold_the_same_numbers_bit_for_bit(
    tmp_path: Path, wrench: np.ndarray, position: np.ndarray, label: float
) -> None:
    wrench[0, 0] = 1e6 + 1.0  # never constant
    quaternion = np.tile([0.1, -0.2, 0.3, np.sqrt(0.86)], (5, 1))
    quaternion /= norm(quaternion)[:, None]
    first = Demonstration(
        time=np.array([0.1, 0.2, 0.30000000000000004, 0.4, 0.7]), position=position, quaternion=quaternion,
        wrench=wrench, extra={"label": np.array([label, np.nan, 1.0, 2.0, 1 / 3])}, meta={"task": "peg"},
    )  # fmt: skip
    write_demonstration(first, tmp_path / "a.npz")
    second = read_demonstration(tmp_path / "a.npz")
    write_demonstration(second, tmp_path / "b.csv")
    third = read_demonstration(tmp_path / "b.csv")
    assert same(first, second)
    assert same(second, third)
    assert second.meta == third.meta


@settings(max_examples=60, deadline=None)
@given(st.dictionaries(st.text(max_size=12), plain, max_size=4))
@pytest.mark.slow
def test_metadata_survive_toml(meta: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(meta)) == meta


def test_the_native_form_says_format_and_version_and_holds_one_array_per_column(
    demo: Demonstration, tmp_path: Path
) -> None:
    write_demonstration(demo, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        meta = json.loads(str(file["meta"]))
        assert {"t", "px", "qw", "fx", "tz"} <= set(file.files)
    assert (meta["format"], meta["version"]) == ("skillframe.demonstration", 1)


def test_metadata_beside_a_csv_are_read(rows: list[list[str]], write: Callable[..., Path]) -> None:
    path = write(rows, meta='task = "peg"\nteacher = "kinesthetic"\n[frames]\nhand = [0.0, 0.0, 0.2]\n')
    demo = read_demonstration(path)
    assert demo.meta["task"] == "peg"
    assert np.array_equal(demo.point("hand"), [0.0, 0.0, 0.2])


def test_further_columns_are_kept_and_words_are_noted(rows: list[list[str]], write: Callable[..., Path]) -> None:
    cells = [[*rows[0], "grip", "phase"], *([*row, str(i), "reach"] for i, row in enumerate(rows[1:]))]
    demo = read_demonstration(write(cells))
    assert np.array_equal(demo.extra["grip"], np.arange(len(demo)))
    assert "phase" not in demo.extra
    assert any("phase" in note for note in demo.meta["reading"])


def test_one_arm_is_read_from_a_file_of_two(rows: list[list[str]], write: Callable[..., Path]) -> None:
    two = [["t", *(f"{arm}_{n}" for arm in ("left", "right") for n in rows[0][1:])]]
    two += [[row[0], *row[1:], *row[1:]] for row in rows[1:]]
    path = write(two)
    with pytest.raises(InputError, match="left, right"):
        read_demonstration(path)
    demo = read_demonstration(path, arm="left")
    assert demo.position[0, 0] == float(rows[1][1])
    assert "right_fx" in demo.extra


def test_a_file_that_cannot_be_written_is_refused_and_leaves_nothing(demo: Demonstration, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError):
        write_demonstration(demo, tmp_path / "taken" / "a.npz")
    with pytest.raises(InputError, match="writes"):
        write_demonstration(demo, tmp_path / "a.dat")
    assert [p.name for p in tmp_path.iterdir()] == ["taken"]


def test_an_interrupted_write_keeps_the_old_file(
    demo: Demonstration, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.npz"
    write_demonstration(demo, path)
    before = path.read_bytes()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(InputError, match="No space"):
        write_demonstration(replace(demo, meta={"task": "other"}), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_any_ending_is_delimited_text_once_its_columns_are_named(
    rows: list[list[str]], write: Callable[..., Path]
) -> None:
    path = write([["# exported"], *rows[1:]], name="pose.log")
    assert len(read_demonstration(path, columns=",".join(rows[0]))) == len(rows) - 1
    with pytest.raises(InputError, match=r"ending in '\.log'"):
        read_demonstration(path)


@pytest.mark.parametrize("separator", [",", ";", "\t", "  "])
def test_separators_are_told_apart(rows: list[list[str]], tmp_path: Path, separator: str) -> None:
    path = tmp_path / "demo.txt"
    path.write_bytes("\r\n".join(separator.join(row) for row in rows).encode("utf-8-sig"))
    assert len(read_demonstration(path)) == len(rows) - 1


def test_numbers_may_stand_in_quotes(rows: list[list[str]], write: Callable[..., Path]) -> None:
    quoted = [[f'"{cell}"' for cell in row] for row in rows]
    assert np.array_equal(read_demonstration(write(quoted)).wrench, read_demonstration(write(rows, "plain.csv")).wrench)


def test_a_header_with_blanks_and_a_degree_sign_of_an_old_editor_is_read(rows: list[list[str]], tmp_path: Path) -> None:
    path = tmp_path / "demo.txt"
    names = ["time (s)", *rows[0][1:-1], "Tz (\N{DEGREE SIGN})"]
    path.write_bytes("\n".join("\t".join(row) for row in [names, *rows[1:]]).encode("latin-1"))
    assert len(read_demonstration(path, columns=",".join(rows[0]))) == len(rows) - 1


def test_columns_can_be_picked_by_header_and_units_scaled(rows: list[list[str]], write: Callable[..., Path]) -> None:
    cells = [["%stamp", "skip", *rows[0][1:]], *([str(int(i * 1e7)), "x1", *row[1:]] for i, row in enumerate(rows[1:]))]
    picks = ",".join(["t=stamp", *(f"{n}={n}" for n in rows[0][1:])])
    demo = read_demonstration(write(cells), columns=picks, units="ns,mm,kN,Nmm")
    assert demo.rate == pytest.approx(100.0)
    assert demo.position[0, 0] == pytest.approx(float(rows[1][1]) * 1e-3)
    assert demo.wrench[0, 0] == pytest.approx(float(rows[1][8]) * 1e3)
    assert demo.wrench[0, 3] == pytest.approx(float(rows[1][11]) * 1e-3)


def test_a_rate_stands_in_for_a_clock(rows: list[list[str]], write: Callable[..., Path]) -> None:
    bare = [row[1:] for row in rows]
    assert read_demonstration(write(bare), rate=250.0).rate == pytest.approx(250.0)
    assert read_demonstration(write(bare, "b.csv", meta="rate = 50.0\n")).rate == pytest.approx(50.0)
    zeros = [rows[0], *(["0", *row[1:]] for row in rows[1:])]
    demo = read_demonstration(write(zeros, "c.csv"), rate=250.0)
    assert demo.rate == pytest.approx(250.0)
    assert "clock was replaced" in demo.meta["reading"][0]


def test_a_cut_keeps_what_lies_within_and_does_not_judge_the_rest(
    rows: list[list[str]], write: Callable[..., Path]
) -> None:
    rows[-1][9] = "nan"
    path = write(rows)
    demo = read_demonstration(path, start=0.5, stop=1.5)
    assert (demo.time[0], demo.time[-1]) == (0.5, 1.5)
    with pytest.raises(InputError, match="no samples from 5 s"):
        read_demonstration(path, start=5.0, stop=6.0)


def test_zero_time_lets_the_clock_start_at_zero(rows: list[list[str]], write: Callable[..., Path]) -> None:
    late = [rows[0], *([repr(float(row[0]) + 1.7e9), *row[1:]] for row in rows[1:])]
    demo = read_demonstration(write(late), zero_time=True, stop=1.0)
    assert demo.time[0] == 0.0
    assert demo.time[-1] == pytest.approx(1.0, abs=1e-6)  # 1.7e9 s leaves 0.2 us in a double


def test_unit_norms_are_kept_and_others_scaled_with_a_note(rows: list[list[str]], write: Callable[..., Path]) -> None:
    off = [rows[0], *([*row[:4], *(repr(float(v) * 0.9998) for v in row[4:8]), *row[8:]] for row in rows[1:])]
    demo = read_demonstration(write(off))
    assert np.abs(norm(demo.quaternion) - 1.0).max() < 1e-12
    assert "0.9998" in demo.meta["reading"][0]


def test_a_name_that_no_format_writes_is_refused_before_the_work(tmp_path: Path) -> None:
    check_writable(tmp_path / "a.csv")
    with pytest.raises(InputError, match=r"no format writes files ending in '\.xyz'"):
        check_writable(tmp_path / "a.xyz")


@pytest.mark.parametrize("name", ["a.mat", "a.h5", "a.parquet", "a.bag", "a.mcap"])
def test_a_file_of_another_tool_is_answered_with_the_distribution_that_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_registry: None, name: str
) -> None:
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "")
    (tmp_path / name).write_bytes(b"content")
    for options in ({}, {"columns": "t,px"}):  # named columns do not make text of it
        with pytest.raises(InputError, match="skillframe-recordings does, and SKILLFRAME_PLUGINS leaves it out"):
            read_demonstration(tmp_path / name, **options)


def test_folders_foreign_arrays_and_data_sets_are_answered_so_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh_registry: None
) -> None:
    monkeypatch.setenv("SKILLFRAME_PLUGINS", "")
    np.savez(tmp_path / "a.npz", t=np.arange(3.0))
    for ask, words in (
        (lambda: read_demonstration(tmp_path), "is a folder, and nothing here reads one"),
        (lambda: read_demonstration(tmp_path / "a.npz", columns="t"), "nothing here reads other arrays"),
        (lambda: check_writable(tmp_path / "pegs"), "nothing here writes data sets"),
    ):
        with pytest.raises(InputError, match=f"{words}; skillframe-recordings does"):
            ask()


def test_what_is_not_installed_is_said_with_the_line_that_installs_it() -> None:
    said = Registry().absence("reader", "hdf5")
    assert said.startswith("skillframe-recordings does, and is not installed; type: pip install ")
    assert Registry().absence("reader", "csv") == Registry().absence("reader", "") == ""
