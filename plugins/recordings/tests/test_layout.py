"""A layout file: `--layout auto` writes it, and every command that reads recordings takes it, for many files."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from plugins.recordings.tests.test_proposed_layouts import slide, table
from skillframe.cli.main import run
from skillframe.demonstration.columns import WRENCH
from skillframe.errors import InputError
from skillframe.extend.reading import read_demonstration

FOREIGN = ["stamp", "x", "y", "z", "q_x", "q_y", "q_z", "q_w", "f_x", "f_y", "f_z", "m_x", "m_y", "m_z"]


def logs(folder: Path, count: int = 2) -> list[Path]:
    """Recordings of one logger, in millimetres and milliseconds."""
    found = []
    for seed in range(count):
        t, p, q, w = slide(10.0, seed=seed)
        found.append(table(folder / f"log{seed}.csv", FOREIGN, t * 1e3, p * 1e3, q.as_quat(), w))
    return found


def made(folder: Path) -> tuple[list[Path], Path]:
    files, layout = logs(folder), folder / "layout.toml"
    words = ["check", *map(str, files), "--layout", "auto", "--write-layout", str(layout)]
    assert run(words) == 0
    return files, layout


def test_auto_writes_a_layout_and_the_lines_that_use_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files, layout = made(tmp_path)
    said = capsys.readouterr().out
    lines = [line.split(None, 1)[1] for line in said.splitlines() if f"--layout {layout}" in line]
    assert len(lines) == 2
    assert "# undecided: " in layout.read_text() and 'units = "ms,mm"' in layout.read_text()
    for line in lines:
        words = shlex.split(line)[1:]
        words = [str(tmp_path / "demos") + "/" if word == "demos/" else word for word in words]
        assert run(words) == 0, line
    for seed, file in enumerate(files):
        found = read_demonstration(tmp_path / "demos" / f"{file.stem}.npz")
        np.testing.assert_allclose(found.position, slide(10.0, seed=seed)[1], atol=1e-8)


@pytest.mark.needs_plugins
def test_every_command_that_reads_recordings_takes_a_layout(tmp_path: Path) -> None:
    files, layout = made(tmp_path)
    both, with_layout = [*map(str, files)], ["--layout", str(layout)]
    assert run(["learn", *both, *with_layout, "--out", str(tmp_path / "a.skill.json")]) == 0
    assert run(["filter", both[0], *with_layout, "--out", str(tmp_path / "a.npz")]) == 0
    assert run(["learn", both[0], "--out", str(tmp_path / "b.skill.json")]) == 2  # without it, they are refused


@pytest.mark.needs_plugins
@pytest.mark.slow
def test_segment_takes_a_layout(tmp_path: Path) -> None:
    files, layout = made(tmp_path)
    words = ["segment", *map(str, files), "--phases", "2", "--out", str(tmp_path / "a.policy.json")]
    assert run(words) == 2
    assert run([*words, "--layout", str(layout)]) == 0


def test_what_is_typed_goes_before_the_layout(tmp_path: Path) -> None:
    files, layout = made(tmp_path)
    assert read_demonstration(files[0], layout=layout, rate=50.0).rate == pytest.approx(50.0)
    assert read_demonstration(files[0], layout=layout).rate == pytest.approx(100.0)


def test_recordings_of_two_layouts_are_not_written_as_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (file,), layout = logs(tmp_path, 1), tmp_path / "layout.toml"
    t, p, q, w = slide(10.0)
    other = table(tmp_path / "other.csv", [*FOREIGN[:1], *"xyz", *FOREIGN[4:]], t, p, q.as_quat(), w)
    words = ["check", str(file), str(other), "--layout", "auto", "--write-layout", str(layout)]
    assert run(words) == 2 and not layout.exists()
    assert "has no units, and" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("colums = 't'", "layout.toml: .*colums"), ("rate = -1", "is not a rate"), ("euler = [1]", "layout.toml"),
        ("rate = ", "layout.toml"),
    ],
)  # fmt: skip
def test_a_bad_layout_is_refused_with_its_name(text: str, message: str, tmp_path: Path) -> None:
    (file,) = logs(tmp_path, 1)
    (tmp_path / "layout.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        read_demonstration(file, layout=tmp_path / "layout.toml")


def test_one_file_cannot_take_many_recordings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files, layout = made(tmp_path)
    words = ["convert", *map(str, files), "--layout", str(layout)]
    assert run([*words, "--out", str(tmp_path / "demo.npz")]) == 2
    assert "is one file, and 2 recordings are given; give a folder" in capsys.readouterr().err


def test_nothing_is_written_if_one_of_many_is_bad(tmp_path: Path) -> None:
    files, layout = made(tmp_path)
    files[1].write_text(files[1].read_text().replace("\n", "\nword,", 1))
    words = ["convert", *map(str, files), "--layout", str(layout), "--out", f"{tmp_path}/demos/"]
    assert run(words) == 2 and not (tmp_path / "demos").exists()


def test_recordings_of_one_name_keep_their_folders_name(tmp_path: Path) -> None:
    files, layout = made(tmp_path)
    for name, file in zip("ab", files, strict=True):
        (tmp_path / name).mkdir()
        file.rename(tmp_path / name / "log.csv")
    places = [str(tmp_path / name / "log.csv") for name in "ab"]
    words = ["convert", *places, "--layout", str(layout), "--out", f"{tmp_path}/demos/"]
    assert run(words) == 0
    assert sorted(path.name for path in (tmp_path / "demos").iterdir()) == ["a_log.npz", "b_log.npz"]


def test_poses_at_rest_get_a_layout_for_calibrate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    q = Rotation.random(24, random_state=4)
    force = q.inv().apply([0.0, 0.0, -9.81 * 0.8]) * -1.0 + [1.0, 2.0, 3.0]
    torque = np.cross([0.0, 0.0, 0.06], force)
    path = table(tmp_path / "poses.csv", ["qx", "qy", "qz", "qw", *FOREIGN[8:]], q.as_quat(), force, torque)
    tool, layout = str(tmp_path / "tool.json"), tmp_path / "poses.toml"
    assert run(["calibrate", str(path), "--out", tool]) == 2
    assert run(["check", str(path), "--layout", "auto", "--write-layout", str(layout)]) == 0
    assert "taken as poses at rest" in capsys.readouterr().out
    assert 'position = "0,0,0"' in layout.read_text() and "rate = 1" in layout.read_text()
    assert run(["calibrate", str(path), "--layout", str(layout), "--out", tool]) == 0


def test_what_is_typed_is_kept_as_a_layout_without_what_is_of_one_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file,), layout = logs(tmp_path, 1), tmp_path / "deep" / "layout.toml"
    layout.parent.mkdir()
    own = ["t", "px", "py", "pz", "qx", "qy", "qz", "qw", *WRENCH]
    columns = ",".join(f"{name}={title}" for name, title in zip(own, FOREIGN, strict=True))
    words = [
        "check",
        str(file),
        "--set",
        f"columns={columns}",
        "--set",
        "units=mm,ms",
        "--set",
        "from=1",
        "--write-layout",
        str(layout),
    ]
    assert run(words) == 0
    assert "without from" in capsys.readouterr().err and "from" not in layout.read_text().partition("\n")[2]
    read = read_demonstration(file, layout=layout)
    np.testing.assert_allclose(read.position, slide(10.0, seed=0)[1], atol=1e-8)


def test_convert_gets_a_line_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (file,) = logs(tmp_path, 1)
    capsys.readouterr()
    words = ["convert", str(file), "--out", str(tmp_path / "a.npz"), "--layout", "auto", "--json"]
    assert run(words) == 1 and not (tmp_path / "a.npz").exists()
    (said,) = json.loads(capsys.readouterr().out)
    assert run(shlex.split(said["line"])[1:]) == 0 and (tmp_path / "a.npz").exists()
