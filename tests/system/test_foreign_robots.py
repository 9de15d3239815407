"""URDFs of others go through `robots --check`: counted, weighed, warned about where due, cured where they can be."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from skillframe.cli.main import run
from tests.oracle.urdfs import Robot


def check(path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict]:
    code = run(["robots", "--check", str(path), "--json"])
    shown = capsys.readouterr()
    assert shown.err == ""
    return code, json.loads(shown.out)


@pytest.mark.parametrize("seed", [*range(12), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(12, 40))])
def test_a_robot_of_any_make_is_counted_weighed_and_judged(
    seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = Robot(seed)
    path = tmp_path / "made.urdf"
    path.write_text(robot.text, encoding="utf-8")
    code, said = check(path, capsys)
    assert (said["nq"], said["nv"]) == (robot.nq, robot.nv)
    assert said["mass_kg"] == pytest.approx(robot.mass)
    assert robot.codes <= {problem["code"] for problem in said["problems"]}
    moving = robot.nv > 0
    assert code == (1 if robot.massless and moving else 0), said["problems"]
    if robot.massless and moving:
        assert cured(said, tmp_path, capsys)
    assert run(["robots", str(path)]) == 0


def cured(said: dict, folder: Path, capsys: pytest.CaptureFixture[str]) -> bool:
    """Whether the lines that `robots --check` prints, put into a robot.toml, make the robot usable."""
    lines = {line.strip() for p in said["problems"] for line in p["fix"].splitlines() if re.search(r"= \{ ?mass", line)}
    text = "\n".join(['urdf = "made.urdf"', "[inertia]", *sorted(lines), ""])
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return check(folder / "robot.toml", capsys)[0] == 0
