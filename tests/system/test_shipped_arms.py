"""Every shipped arm is taught, learns and does peg, valley and coupler, as the commands do it."""

import json

import pytest

from skillframe.cli.main import run

pytestmark = [pytest.mark.slow, pytest.mark.needs_plugins]


WORLDS, ARMS = ("peg_in_hole", "valley", "hose_coupler"), ("ur5e", "fr3", "kuka_iiwa14")
PAIRS = [(robot, world) for robot in ARMS for world in WORLDS]


@pytest.mark.parametrize(
    ("robot", "world"), [*PAIRS, ("ur5e_torque", "hose_coupler"), ("ur5e_velocity", "peg_in_hole")]
)
@pytest.mark.figures
def test_a_shipped_arm_is_taught_and_does_what_it_was_taught(robot, world, tmp_path, capsys):
    on = ["--world", world, "--robot", robot]
    recorded = ["record", *on, "--count", "2", "--seed", "1", "--out", str(tmp_path / "d.npz")]
    assert run(recorded) == 0
    skill = tmp_path / "s.skill.json"
    files = [str(tmp_path / f"d{i}.npz") for i in (1, 2)]
    assert run(["learn", *files, "--at", "tip", "--out", str(skill)]) == 0
    capsys.readouterr()
    assert run(["run", str(skill), *on, "--coc", "tip", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["success"] is True
