"""Messages of docs/how-to/troubleshooting.md are those that the program prints, numbers left out."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import read_demonstration

pytestmark = pytest.mark.needs_plugins
PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "troubleshooting.md").read_text(encoding="utf-8")
POSE, WRENCH = "t,px,py,pz,qx,qy,qz,qw", "fx,fy,fz,tx,ty,tz"
LEARN = ["learn", "log.csv", "--out", "log.skill.json"]
CHECK = ["check", "log.csv", "--set", "euler=xyz"]
PEG = ["--world", "peg_in_hole", "--robot", "free_tool", "--coc", "tip"]
RUN = ["run", "peg.skill.json", *PEG]
BARE = '<robot name="a"><link name="b"/><link name="c"/><joint name="j" type="revolute"><parent link="b"/>'
BARE += '<child link="c"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="9" velocity="2"/></joint></robot>'
CAMPAIGN = 'seed = 1\ntrials = 1\nrobot = "free_tool"\nworld = "free"\nskills = ["peg.skill.json"]\nduration_s = 0.1\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a demonstration, a skill, a URDF without masses, a mesh that is cut off, and a campaign."""
    made = tmp_path_factory.mktemp("trouble")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        Path("bare.urdf").write_text(BARE, encoding="utf-8")
        Path("cut.stl").write_bytes(b"x")
        Path("tilt.toml").write_text(CAMPAIGN, encoding="utf-8")
        assert run(["record", *PEG[:4], "--seed", "1", "--out", "peg.npz"]) == 0
        assert run(["learn", "peg.npz", "--out", "peg.skill.json"]) == 0
        assert run(["campaign", "run", "tilt.toml", "--out", "tilt"]) == 0
    return made


def numberless(text: str) -> str:
    return re.sub(r"-?\d+(\.\d+)?", "N", " ".join(text.split()))


def printed(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What a command that does not succeed prints."""
    capsys.readouterr()
    assert run(words) != 0
    return numberless("".join(capsys.readouterr()))


def shown(message: str) -> str:
    """A message of the page."""
    assert f"`{message}`" in PAGE
    return numberless(message)


def table(header: str, *columns: np.ndarray) -> None:
    np.savetxt("log.csv", np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.17g")


def otherwise(d: Demonstration) -> dict[str, tuple[str, tuple[np.ndarray, ...], list[str]]]:
    """By message: header and columns of a table that is wrong, and the command that reads it."""
    half = len(d) // 2
    angles = 3.0 * np.column_stack([np.sin(rate * d.time) for rate in (200.0, 300.0, 100.0)])
    moved, still = d.position.copy(), d.wrench.copy()
    moved[half:, 0] += 0.05
    still[half : half + 300] = still[half]
    turned = (f"t,px,py,pz,roll,pitch,yaw,{WRENCH}", (d.time, d.position, angles, d.wrench))
    named = ("stamp,X,Y,Z,A,B,C,F,G,H,I,J,K", (d.time, d.position, angles, d.wrench))
    native = f"{POSE},{WRENCH}"
    return {
        "has no time column (t missing)": (*named, LEARN),
        "has roll, pitch, yaw without their order": (*turned, LEARN),
        "the orientation jumps by 129.5 degrees": (*turned, CHECK),
        "the tool point jumps by 50.0 mm": (native, (d.time, moved, d.quaternion, d.wrench), LEARN),
        "the wrench repeats one value bit for bit": (native, (d.time, d.position, d.quaternion, still), LEARN),
    }


def test_a_recording_that_is_wrong_is_refused_in_the_pages_words(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    for message, (header, columns, words) in otherwise(read_demonstration("peg.npz")).items():
        table(header, *columns)
        assert shown(message) in printed(words, capsys), message


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "peg.skill.json", "--world", "peg"], "unknown world 'peg'"),
        ([*RUN, "--set", "start.offset_x=5"], "5 m is beyond -3m to 3m"),
        ([*RUN, "--set", "fixture.offset_z=20mm", "--set", "fixture.offset_x=9mm"],
         "is no trial: the tool is 7.9 mm inside the fixture"),
        ([*RUN, "--duration", "0.5"], "time limit: 2 s of simulated time are over"),
        (["robots", "--check", "bare.urdf"], "fatal zero_mass_matrix at base"),
        (["run", "peg.skill.json", "--world", "free", "--robot", "bare.urdf"], "a URDF alone names no arm to run"),
        (["worlds", "new", "cut.stl", "cut.stl", "--units", "mm", "--out", "f.toml"], "is cut off: it has 1 bytes"),
        (["campaign", "run", "tilt.toml", "--out", "tilt"], "holds a campaign already"),
        (["learn", "peg.npz", "--set", "stifness_n_m=1", "--out", "x.json"], "unknown key 'stifness_n_m'"),
    ],
)  # fmt: skip
@pytest.mark.slow
def test_a_command_that_fails_says_so_in_the_pages_words(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(folder)
    assert shown(message).replace(" at base", "") in printed(words, capsys)
