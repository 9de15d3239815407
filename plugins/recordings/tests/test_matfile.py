"""MATLAB files and npy files: what is whole is read, and what says more than it holds never reaches the library."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat, whosmat
from scipy.sparse import csc_matrix
from skillframe_recordings.formats.matfile import whole_variables
from skillframe_recordings.proposal.reading import propose_reading

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration

CONTENT: dict[str, Any] = {
    "force": np.arange(12.0).reshape(4, 3), "count": np.arange(3, dtype=np.int16), "wave": np.array([1 + 2j, 3 - 1j]),
    "word": "ü and a", "log": {"tcp": {"pose": np.eye(3)}, "note": "x", "flags": np.array([True, False])},
    "cells": np.array([np.eye(2), "text", np.zeros((0, 3))], dtype=object), "none": np.zeros((0, 0)),
}  # fmt: skip


@pytest.mark.parametrize("packed", [False, True])
def test_every_variable_that_scipy_lists_is_whole(packed: bool, tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, CONTENT, do_compression=packed)
    assert whole_variables(path.read_bytes()) == [name for name, *_ in whosmat(path)] == list(CONTENT)


def test_a_file_of_version_4_is_listed_and_sparse_matrices_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"force": np.eye(3), "wave": np.array([1j])}, format="4")
    assert whole_variables(path.read_bytes()) == ["force", "wave"]
    savemat(path, {"force": np.eye(3), "few": csc_matrix(np.eye(3))})
    assert whole_variables(path.read_bytes()) == ["force"]


def test_no_cut_of_a_file_is_called_whole() -> None:
    """But at the ends of its variables, where a shorter file is a sound one."""
    for form in ("5", "4"):
        made = io.BytesIO()
        savemat(made, {"a": np.eye(3), "b": np.arange(4.0)}, format=form)
        content, whole = made.getvalue(), 0
        for size in range(1, len(content)):
            try:
                whole_variables(content[:size])
                whole += 1
            except (ValueError, struct.error):
                pass
        assert whole <= 2  # after the header of version 5, and after the first


@pytest.mark.parametrize(
    ("at", "value", "said"),
    [
        (0xA0, 0x7FFFFFFF, "numbers"),  # rows
        (0x84, 0x7FFFFFFF, "an element of 2147483647 bytes"),  # length of the array
        (0x80, 3, "an element of type 3 where an array belongs"),
        (0xB0, 41, "bytes of type 41 for"),  # type of the numbers
    ],
)
def test_a_size_or_type_that_does_not_fit_is_one_sentence(at: int, value: int, said: str, tmp_path: Path) -> None:
    """scipy asks for that memory, or crashes."""
    path = tmp_path / "a.mat"
    savemat(path, {"f": np.arange(60.0)})
    content = bytearray(path.read_bytes())
    content[at : at + 4] = struct.pack("<I", value)
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"cannot be read as a MATLAB file \(ValueError: .*{said}"):
        read_demonstration(path)


def test_arrays_nested_without_end_are_one_sentence(tmp_path: Path) -> None:
    value: Any = np.eye(2)
    for _ in range(40):
        value = {"a": value}
    savemat(tmp_path / "a.mat", {"top": value})
    with pytest.raises(InputError, match="deep in each other"):
        read_demonstration(tmp_path / "a.mat")


@pytest.mark.parametrize("change", ["header", "shape"])
def test_an_npy_file_that_says_more_than_it_holds_asks_for_no_memory(change: str, tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((50, 14)))
    content = bytearray(path.read_bytes())
    if change == "header":
        content[6], content[8:12] = 2, struct.pack("<I", 2**30)  # version 2: four bytes of length
    else:
        content = content.replace(b"(50, 14), }     ", b"(50000000, 14)} ")
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"cannot be read as an npy file \(ValueError: (a header of|says float64)"):
        read_demonstration(path)


def test_a_list_of_nothing_in_json_is_no_array(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "log.json").write_text(json.dumps({"robot": [[]], "by": "me"}))
    assert run(["check", str(tmp_path / "log.json"), "--layout", "auto"]) == 2
    assert "holds no arrays with a row per sample; there are: robot (1, 0)" in capsys.readouterr().err


def test_a_clock_of_seconds_without_its_nanoseconds_is_proposed_without_a_crash(tmp_path: Path) -> None:
    rows = "\n".join(f"{i},{0.01 * i},0,0" for i in range(20))
    (tmp_path / "log.csv").write_text(f"sec,x,y,z\n{rows}\n")
    assert propose_reading(tmp_path / "log.csv").missing


def test_a_name_in_hdf5_that_is_no_text_is_read(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file[b"for\xffce"] = np.arange(60.0)
    with pytest.raises(InputError, match="holds for"):
        read_demonstration(tmp_path / "log.h5")
