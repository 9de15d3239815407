"""The demo's two skills on Pandas whose motors are weaker and weaker: success falls, and failures name the joint."""

from __future__ import annotations

import re
import shutil
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest
from skillframe_reports.results import Results, read_results

from skillframe.cli.demo import TASKS
from skillframe.cli.main import run
from skillframe.robot.spec import robot_names
from tests.figures.teaching import row

pytestmark = [pytest.mark.figures, pytest.mark.needs_plugins]
TRIALS, SCALES = 64, (1.0, 0.5, 0.33, 0.2, 0.1)
NAMED = re.compile(r"^motor limit: (joint\d)")


def weak_panda(folder: Path, scale: float) -> Path:
    """A copy of the shipped arm whose efforts are scaled."""
    shutil.copytree(robot_names()["panda"], folder)
    tree = ElementTree.parse(folder / "panda.urdf")
    for limit in tree.iter("limit"):
        limit.set("effort", repr(scale * float(limit.get("effort", "0"))))
    tree.write(folder / "panda.urdf")
    return folder


def proved(folder: Path, name: str, template: str, scale: float) -> Results:
    """The demo's campaign of one skill, with 64 trials and without the replay beside it, on a weaker arm."""
    robot = weak_panda(folder / f"panda_{scale:g}", scale)
    text = template.format(trials=TRIALS, robot=robot.name)
    text = re.sub(r'skills = \[("[^"]+").*\]', r"skills = [\1]", text)
    plan, out = folder / f"{name}_{scale:g}.toml", folder / f"{name}_{scale:g}"
    plan.write_text(text, encoding="utf-8")
    assert run(["campaign", "run", str(plan), "--out", str(out), "--workers", "2", "--quiet"]) == 0
    return read_results(out / "results.csv")


@pytest.mark.parametrize(("name", "world", "template", "coc"), TASKS, ids=[task[0] for task in TASKS])
def test_weaker_motors_fail_by_name_and_the_sound_arms_utilisation_stands_in_the_report(
    tmp_path: Path, name: str, world: str, template: str, coc: str | None
) -> None:
    record = ["record", "--world", world, "--robot", "panda", "--count", "2", "--seed", "1"]
    assert run([*record, "--out", str(tmp_path / f"{name}.npz")]) == 0
    demos = [str(tmp_path / f"{name}{i}.npz") for i in (1, 2)]
    assert run(["learn", *demos, "--out", str(tmp_path / f"{name}.skill.json")]) == 0
    wins, worst = {}, {}
    for scale in SCALES:
        rows = proved(tmp_path, name, template, scale).rows
        wins[scale] = sum(r.success for r in rows)
        worst[scale] = max(r.values["peak_torque_share"] for r in rows)
        joints = Counter(found[1] for r in rows if (found := NAMED.match(r.failure)))
        others = Counter(r.failure.split(":")[0] for r in rows if not r.success and not NAMED.match(r.failure))
        row(
            f"{name}, effort x {scale:g}",
            f"{wins[scale]}/{TRIALS}",
            f"{worst[scale]:.0%}",
            str(dict(joints)),
            str(dict(others)),
        )
        if scale <= 0.2:  # holding the arm up takes more than a fifth of joint 2's effort
            assert sum(joints.values()) >= 0.9 * TRIALS
    assert [wins[s] for s in SCALES] == sorted(wins.values(), reverse=True)
    assert wins[1.0] > 0.8 * TRIALS  # of the demo's valley 88 of 96 succeed on an arm without limits
    assert worst[1.0] < 1.0
    assert wins[0.2] == wins[0.1] == 0
    page = tmp_path / f"{name}.html"
    assert run(["report", str(tmp_path / f"{name}_1"), "--out", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "Load of the motors" in text
    assert f"<td>{100 * worst[1.0]:.0f} %</td>" in re.sub(r"<td[^>]*>", "<td>", text)
