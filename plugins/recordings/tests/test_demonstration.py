from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import read_demonstration, write_demonstration
from skillframe.frames import quaternion_from_matrix, rotation_matrix

HEADER = "t,px,py,pz,qx,qy,qz,qw,fx,fy,fz,tx,ty,tz"


@pytest.fixture
def demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Demonstration:
    """A press after a free descent, written as demo.csv into the working folder."""
    monkeypatch.chdir(tmp_path)
    s = np.linspace(0.0, 1.0, 200)
    wrench = np.random.default_rng(0).normal(size=(200, 6)) * np.repeat([0.05, 0.005], 3)
    wrench[100:, 2] += 10.0
    demo = Demonstration(
        time=np.arange(200) / 100.0, position=np.stack([0 * s, 0 * s, 0.3 - 0.1 * s], axis=-1),
        quaternion=quaternion_from_matrix(rotation_matrix(0.3 * s[:, None] * np.array([1.0, 0, 0]))), wrench=wrench,
    )  # fmt: skip
    write_demonstration(demo, "demo.csv")
    return demo


def two_files(demo: Demonstration) -> None:
    """The same as pose.dat (Euler angles) and force.dat, without headers, the second longer and denser."""
    roll = 0.3 * np.linspace(0.0, 1.0, 200)
    pose = np.column_stack([demo.time, demo.position, roll, 0 * roll, 0 * roll])
    time = np.arange(-20, 500) / 200.0
    force = np.column_stack([time, *(np.interp(time, demo.time, w) for w in demo.wrench.T)])
    np.savetxt("pose.dat", pose, delimiter="\t")
    np.savetxt("force.dat", force, delimiter=" ")


def test_convert_writes_what_read_then_gives_back(demo: Demonstration, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["convert", "demo.csv", "--out", "new/demo.npz"]) == 0
    again = read_demonstration("new/demo.npz")
    assert np.array_equal(again.wrench, demo.wrench)
    assert "200 samples" in capsys.readouterr().out


NAMES = "t,px,py,pz,roll,pitch,yaw"


@pytest.mark.parametrize(
    "columns",
    [
        ["--set", f"columns={NAMES}", "--set", "wrench-columns=t,fx,fy,fz,tx,ty,tz"],
        ["--set", f"columns={NAMES},fx,fy,fz,tx,ty,tz"],
        ["--set", f"columns={NAMES}"],
        ["--set", "columns=time,x,y,z,roll,pitch,yaw", "--set", "wrench-columns=t fx fy fz mx my mz"],
    ],
)
def test_pose_and_wrench_are_joined_however_their_columns_are_named(demo: Demonstration, columns: list[str]) -> None:
    two_files(demo)
    command = ["convert", "--set", "wrench=force.dat", *columns, "--set", "euler=xyz", "--set", "from=0.2"]
    assert run([*command, "--set", "to=1.5", "--out", "x.npz", "pose.dat"]) == 0
    joined = read_demonstration("x.npz")
    assert (joined.time[0], joined.time[-1]) == (0.2, 1.5)
    assert joined.rate == pytest.approx(200.0)
    at = np.searchsorted(joined.time, 1.0)
    assert joined.wrench[at] == pytest.approx(demo.wrench[100])


def test_check_lists_figures_and_warnings_and_exits_0(demo: Demonstration, capsys: pytest.CaptureFixture[str]) -> None:
    write_demonstration(demo, "demo.npz")
    assert run(["check", "demo.csv", "demo.npz"]) == 0
    out = capsys.readouterr().out
    assert "100 Hz" in out
    assert "1.00-1.99 s" in out


def test_check_as_json_is_a_list_alone_on_stdout(demo: Demonstration, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "demo.csv", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert rows[0]["file"] == "demo.csv"
    assert rows[0]["usable"] is True


def test_check_answers_no_where_nothing_moves(demo: Demonstration) -> None:
    still = Demonstration(
        time=demo.time, position=np.zeros((200, 3)), quaternion=np.tile([0.0, 0, 0, 1], (200, 1)), wrench=demo.wrench
    )
    write_demonstration(still, "still.npz")
    assert run(["check", "still.npz"]) == 1


def test_a_bad_file_among_others_is_named_and_the_others_are_still_audited(
    demo: Demonstration, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["check", "none.csv", "demo.csv", "--json"]) == 2
    printed = capsys.readouterr()
    assert [row["file"] for row in json.loads(printed.out)] == ["demo.csv"]
    assert "none.csv: no such file" in printed.err


SPOILED = {
    "nan": lambda lines: [*lines[:5], lines[5].replace(lines[5].split(",")[9], "nan"), *lines[6:]],
    "truncated": lambda lines: [*lines[:50], lines[50][:40]],
    "no rows": lambda lines: lines[:1],
    "no header": lambda lines: lines[1:],
    "w-first": lambda lines: [HEADER.replace("qx,qy,qz,qw", "qw,qx,qy,qz"), *lines[1:]],
    "empty": lambda lines: [],
    "time": lambda lines: [*lines[:9], lines[4], *lines[9:]],
}


@pytest.mark.parametrize("name", SPOILED)
@pytest.mark.parametrize("command", ["check", "convert", "filter"])
def test_bad_input_exits_2_with_one_sentence_and_leaves_no_output(
    demo: Demonstration, capsys: pytest.CaptureFixture[str], name: str, command: str
) -> None:
    bad = Path("bad.csv")
    bad.write_text("\n".join(SPOILED[name](Path("demo.csv").read_text().splitlines())))
    Path("demo.meta.toml").unlink()
    out = [] if command == "check" else ["--out", "out.csv"]
    before = sorted(p.name for p in Path().iterdir())
    assert run([command, "bad.csv", *out]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("error: bad.csv")
    assert printed.err.count("\n") == 1
    assert sorted(p.name for p in Path().iterdir()) == before


@pytest.mark.parametrize(
    "arguments",
    [
        ["convert", "demo.csv"],
        ["convert", "demo.csv", "--out", "x.npz", "--set", "columns=a"],
        ["convert", "demo.csv", "--out", "x.npz", "--set", "from=nan"],
        ["convert", "demo.csv", "--out", "x.npz", "--set", "from=9"],
        ["convert", "demo.csv", "--out", "x.xyz"],
        ["convert", "demo.csv", "--out", "x.npz", "--set", "wrench-frame=tcp"],
        ["convert", "demo.csv", "--out", "x.npz", "--set", "rate=-1"],
        ["convert", "none.csv", "--out", "x.npz"],
        ["check"],
        ["chekc", "demo.csv"],
    ],
)
def test_wrong_usage_exits_2_and_writes_nothing(demo: Demonstration, arguments: list[str]) -> None:
    assert run(arguments) == 2
    assert not Path("x.npz").exists()


def test_the_override_that_the_weight_is_gone_reaches_the_reader(demo: Demonstration) -> None:
    Path("demo.meta.toml").write_text("wrench.includes_tool_weight = true\n")
    command = ["convert", "demo.csv", "--out", "x.npz"]
    assert run(command) == 0
    assert read_demonstration("x.npz").meta["wrench"]["includes_tool_weight"] is True
    assert run([*command, "--set", "wrench-includes-tool-weight=false"]) == 0
    assert read_demonstration("x.npz").meta["wrench"]["includes_tool_weight"] is False


@pytest.mark.parametrize(
    "words", [["check"], ["convert", "--out", "right.npz", "--set", "arm=right"], ["convert", "--out", "right.npz"]]
)
def test_arms_whose_clocks_differ_are_refused_by_every_command_in_a_sentence(
    demo: Demonstration, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    rows = [line.split(",") for line in Path("demo.csv").read_text().splitlines()]
    names = [f"{arm}_{name}" for arm in ("left", "right") for name in rows[0]]
    late = [[*row, repr(float(row[0]) + 0.02), *row[1:]] for row in rows[1:]]
    Path("both.csv").write_text("\n".join(",".join(row) for row in [names, *late]))
    verb, *options = words
    assert run([verb, "both.csv", *options]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert "both.csv" in said and "row " in said
    assert "the clocks of the arms left and right differ by 20 ms; resample the arms onto one clock" in said
    assert not Path("right.npz").exists()
