"""Files appear whole or not at all, under names that nobody can guess, and a full disk is said with the file's name."""

from __future__ import annotations

import os
import resource
import stat
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.extend.reading import write_demonstration
from tests.unit.demonstration.conftest import make


@pytest.fixture
def files() -> Any:
    return import_module("skillframe.files")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def demo(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    write_demonstration(make(), tmp_path / "in" / "demo.csv")
    return tmp_path / "in" / "demo.csv"


def test_a_file_is_written_with_the_permissions_that_the_umask_gives(tmp_path: Path, files: Any) -> None:
    before = os.umask(0o027)
    try:
        files.write_whole(tmp_path / "new" / "a.txt", b"content")
    finally:
        os.umask(before)
    assert (tmp_path / "new" / "a.txt").read_bytes() == b"content"
    assert stat.S_IMODE((tmp_path / "new" / "a.txt").stat().st_mode) == 0o640
    assert names(tmp_path / "new") == ["a.txt"]


def test_an_error_while_writing_leaves_the_old_file_and_nothing_beside_it(tmp_path: Path, files: Any) -> None:
    (tmp_path / "a.txt").write_text("old")

    def stumble() -> None:
        with files.writing_whole(tmp_path / "a.txt") as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        stumble()
    assert names(tmp_path) == ["a.txt"] and (tmp_path / "a.txt").read_text() == "old"


def test_a_link_is_replaced_and_what_it_points_to_is_left_alone(tmp_path: Path, files: Any) -> None:
    (tmp_path / "precious").write_text("precious")
    (tmp_path / "a.txt").symlink_to("precious")
    files.write_whole(tmp_path / "a.txt", b"new")
    assert (tmp_path / "precious").read_text() == "precious" and not (tmp_path / "a.txt").is_symlink()


def test_a_name_of_255_characters_is_written(tmp_path: Path, files: Any) -> None:
    files.write_whole(tmp_path / ("a" * 255), b"new")
    assert names(tmp_path) == ["a" * 255]


def test_a_device_is_never_replaced_by_a_file(tmp_path: Path, files: Any) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="device or a pipe"):
        files.write_whole(tmp_path / "pipe", b"new")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_file_and_folder_are_synced_in_the_order_that_survives_a_power_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files: Any
) -> None:
    """Content before the rename, the folder's entry after it."""
    done: list[str] = []
    sync, rename = os.fsync, os.replace

    def synced(descriptor: int) -> None:
        done.append("folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "file")
        sync(descriptor)

    def renamed(source: Path, target: Path) -> None:
        done.append("rename")
        rename(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", renamed)
    files.write_whole(tmp_path / "a.txt", b"new")
    assert done == ["file", "rename", "folder"]


WRITERS: dict[str, Callable[[Path, Path], list[str]]] = {
    "a page": lambda demo, out: ["report", str(demo.with_name("t.npz")), "--out", f"{out}.html"],
    "a video": lambda demo, out: [*RUN, str(demo.with_name("s.json")), "--video", f"{out}.mp4"],
    "a trace": lambda demo, out: [*RUN, str(demo.with_name("s.json")), "--out", f"{out}.npz"],
}
RUN = ["run", "--world", "free", "--robot", "free_tool", "--duration", "0.05"]


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A skill and a trace, as a folder of files."""
    folder = tmp_path_factory.mktemp("sources")
    write_demonstration(make(), folder / "demo.csv")
    assert run(["learn", str(folder / "demo.csv"), "--out", str(folder / "s.json")]) == 0
    assert run([*RUN, str(folder / "s.json"), "--out", str(folder / "t.npz")]) in (0, 1)
    return folder / "demo.csv"


@pytest.mark.needs_plugins
@pytest.mark.parametrize("what", WRITERS)
@pytest.mark.slow
def test_a_link_at_a_guessable_temporary_name_leads_nowhere(sources: Path, tmp_path: Path, what: str) -> None:
    """Whoever may write into the folder could have put it there before."""
    command = WRITERS[what](sources, tmp_path / "a")
    target = Path(command[-1])
    (tmp_path / "precious").write_text("precious")
    for ending in (".tmp", ".part", "~"):
        target.with_name(target.name + ending).symlink_to("precious")
    assert run(command) in (0, 1)
    assert (tmp_path / "precious").read_text() == "precious"
    assert target.is_file() and not target.is_symlink()


def limited(arguments: list[str], size: int, stdout: str | None = None) -> subprocess.CompletedProcess[str]:
    """The command line in a process whose files can hold so many bytes: the system then answers as a full disk does.

    It writes no byte code (-B): the interpreter does not notice that a compiled file was cut, and keeps it.
    """
    code = "import sys; from skillframe.cli.main import main; main(sys.argv[1:])"
    with open(stdout or os.devnull, "w") as out:
        return subprocess.run(
            [sys.executable, "-B", "-c", code, *arguments], stdout=out, stderr=subprocess.PIPE, text=True, timeout=120,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
        )  # fmt: skip


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_a_full_disk_is_exit_2_with_the_file_s_name_and_leaves_nothing(sources: Path, tmp_path: Path) -> None:
    commands = [
        ["convert", str(sources), "--out", str(tmp_path / "a.npz")],
        ["learn", str(sources), "--out", str(tmp_path / "a.json")],
        [*RUN, str(sources.with_name("s.json")), "--out", str(tmp_path / "b.npz")],
    ]
    for command in commands:
        ended = limited(command, 1000)
        assert ended.returncode == 2, ended.stderr
        assert f"error: {command[-1]}: cannot be written (File too large); make room" in ended.stderr
        assert names(tmp_path) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_disk_behind_standard_output_is_exit_2_in_one_sentence() -> None:
    ended = limited(["robots"], resource.RLIM_INFINITY, stdout="/dev/full")
    assert ended.returncode == 2, ended.stderr
    assert ended.stderr.count("\n") == 1 and "standard output" in ended.stderr and "No space left" in ended.stderr
