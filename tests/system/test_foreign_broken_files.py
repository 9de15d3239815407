"""Recordings broken by other means than ours: exit code 2, one sentence that names the file, nothing left behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from tests.oracle import damage
from tests.oracle.grooves import Groove, any_style, write

Read = Callable[[Path], None]
PLAIN = {
    "sign": None, "frame": None, "point": [0.0] * 3, "load": None, "flips": False, "shuffled": False, "separator": ",",
    "end": "\n", "mark": b"", "millimetres": False,
}  # fmt: skip


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One recording that can be read, as text and as npz."""
    rng, folder, recording = np.random.default_rng(0), tmp_path_factory.mktemp("sound"), Groove(3).show()[0]
    assert PLAIN.keys() <= any_style(rng).keys()
    files = {ending: write(recording, folder, "demo", {**PLAIN, "ending": ending}, rng) for ending in (".csv", ".npz")}
    for path in files.values():
        assert run(["check", str(path)]) == 0
    return files


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Read:
    """Demands the refusal of every command that reads a recording."""

    def demand(path: Path) -> None:
        out = tmp_path / "out.npz"
        commands = [
            ["check"],
            ["convert", "--out", str(out)],
            ["filter", "--out", str(out)],
        ]
        for command in commands:
            capsys.readouterr()
            assert run([*command, str(path)]) == 2
            said = capsys.readouterr().err
            assert said.startswith("error: ") and said.count("\n") == 1 and len(said) < 600, said
            assert path.stem in said
            assert not out.exists()

    return demand


def cells(path: Path) -> list[list[str]]:
    return [line.split(",") for line in path.read_text().splitlines()]


@pytest.mark.parametrize("how", damage.TEXT)
def test_a_table_damaged_in_its_cells_is_refused(
    sound: dict[str, Path], refused: Read, tmp_path: Path, how: str
) -> None:
    path = tmp_path / "demo.csv"
    path.write_text("\n".join(",".join(row) for row in damage.TEXT[how](cells(sound[".csv"]))) + "\n", encoding="utf-8")
    refused(path)


@pytest.mark.parametrize("how", damage.BYTES)
@pytest.mark.slow
def test_a_file_that_is_no_table_is_refused(sound: dict[str, Path], refused: Read, tmp_path: Path, how: str) -> None:
    path = tmp_path / "demo.csv"
    path.write_bytes(damage.BYTES[how](sound[".csv"].read_text()))
    refused(path)


@pytest.mark.parametrize("how", damage.META)
def test_metadata_that_cannot_be_are_refused(sound: dict[str, Path], refused: Read, tmp_path: Path, how: str) -> None:
    path = tmp_path / "demo.csv"
    path.write_bytes(sound[".csv"].read_bytes())
    path.with_name("demo.meta.toml").write_text(damage.META[how] + "\n")
    refused(path)


@pytest.mark.parametrize("how", damage.ARRAYS)
def test_a_native_file_with_damaged_arrays_is_refused(
    sound: dict[str, Path], refused: Read, tmp_path: Path, how: str
) -> None:
    path = tmp_path / "demo.npz"
    with np.load(sound[".npz"]) as file:
        np.savez(path, **damage.ARRAYS[how]({name: file[name] for name in file.files}))
    refused(path)


@pytest.mark.parametrize("how", damage.ARCHIVES)
def test_a_native_file_whose_archive_is_damaged_is_refused(
    sound: dict[str, Path], refused: Read, tmp_path: Path, how: str
) -> None:
    path = tmp_path / "demo.npz"
    path.write_bytes(damage.ARCHIVES[how](sound[".npz"].read_bytes()))
    refused(path)
