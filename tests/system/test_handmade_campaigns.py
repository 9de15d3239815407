"""campaign.toml with what people get wrong: refused with one sentence before a folder is made."""

from __future__ import annotations

from pathlib import Path

import pytest
from skillframe_testkit.suites import example_demonstrations

from skillframe.cli.main import run
from skillframe.document.file import learned, save
from skillframe.extend.registry import registry

pytestmark = pytest.mark.needs_plugins
TEXT = """
seed = 7
trials = 4
robot = "free_tool"
world = "valley"
duration_s = 0.02
skills = ["push.skill.json"]
[vary]
"start.tilt_y" = { uniform = [-0.2, 0.2] }
"""
SLIPS = {
    "degrees": (
        "[-0.2, 0.2]",
        "[-45, 45]",
        "start.tilt_y: -45 rad is beyond -90deg to 90deg, as what leans more lies upside down; did you mean -45deg?",
    ),
    "a quantity of machines": ("start.tilt_y", "actuator.supply_pressure", "free_tool has no drive with such"),
    "a payload of none": ("start.tilt_y", "robot.payload", "free_tool declares no payload"),
    "noise below zero": ("start.tilt_y", "sensor.force_noise", "sensor.force_noise: -0.2 N is beyond 0N to 100N"),
    "beyond all machines": ("[-0.2, 0.2]", "[0, 1e9]", "start.tilt_y: 1e+09 rad is beyond -90deg to 90deg"),
    "metres": ("start.tilt_y", 'start.offset_x" = { choice = [5] }\n"start.tilt_y', "did you mean 5mm?"),
    "a wide spread": (
        "uniform = [-0.2, 0.2]",
        "normal = [0, 0.53]",  # 1.59 rad at 3 standard deviations, and 1.571 rad are allowed
        "vary.start.tilt_y.normal: reaches -1.59 at 3 standard deviations: -1.59 rad is beyond -90deg to 90deg",
    ),
    "a spread below zero": (
        '"start.tilt_y" = { uniform = [-0.2, 0.2]',
        '"world.friction" = { normal = [0.2, 0.1]',
        "vary.world.friction.normal: reaches -0.1 at 3 standard deviations: ",
    ),
    "a piece of a world": ("[vary]", "[set]\nworld.radius = 5\n[vary]", "radius: 5 m is beyond 0.1mm to 0.2m; did you"),
    "a far centre": ("seed = 7", 'seed = 7\ncoc = "10,0,0"', "point 10,0,0: x: 10 m is beyond -3m to 3m"),
    "no group": (
        "start.tilt_y",
        "tilt",
        "did you mean 'start.tilt_z'? (there are: actuator.*, fault.*, fixture.*, grasp.*, robot.*, sensor.*, start.*",
    ),
    "twice": ("[vary]", "[vary.start]\ntilt_y = { grid = [0.1, 0.2] }\n[vary]", "vary.start.tilt_y: is written twice"),
    "a skill cut off": ("push.skill", "cut.skill", "cut.skill.json: is cut off at line 1"),
    "one skill, no list": ('["push.skill.json"]', "'push.skill.json'", "campaign.skills: expected a list"),
}
MACHINE = {"free_tool": "hiab_xs031", "valley": "pallets", "start.tilt_y": "actuator.delay", "[-0.2, 0.2]": "[0, 5]"}


@pytest.fixture(scope="module")
def push(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("skill") / "push.skill.json"
    save(learned(registry().skill("lmc"), example_demonstrations()), path)
    return path.read_bytes()


@pytest.fixture
def campaign(push: bytes, tmp_path: Path) -> Path:
    (tmp_path / "push.skill.json").write_bytes(push)
    (tmp_path / "cut.skill.json").write_text('{"format": "skillframe.skill", "ver')
    return tmp_path / "c.toml"


@pytest.mark.parametrize("how", SLIPS)
def test_a_slip_is_refused_before_anything_is_made(
    campaign: Path, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    old, new, words = SLIPS[how]
    assert old in TEXT
    campaign.write_text(TEXT.replace(old, new))
    before = sorted(campaign.parent.iterdir())
    assert run(["campaign", "run", str(campaign), "--out", str(campaign.parent / "out")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ") and said.count("\n") == 1 and len(said) < 500 and words in said, said
    assert "tmp-" not in said  # the user's file, not our copy of it
    assert sorted(campaign.parent.iterdir()) == before


def test_what_is_right_runs_from_a_file_with_a_byte_order_mark(campaign: Path) -> None:
    text = TEXT.replace("uniform = [-0.2, 0.2]", "normal = [0, 0.52]")  # 1.56 rad at 3 deviations, 1.571 are allowed
    campaign.write_text("\ufeff" + text)
    assert run(["campaign", "run", str(campaign), "--out", str(campaign.parent / "out")]) == 0


def test_a_delay_in_milliseconds_is_refused_before_anything_is_made(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = TEXT
    for old, new in MACHINE.items():
        text = text.replace(old, new)
    campaign.write_text(text)
    assert run(["campaign", "run", str(campaign), "--out", str(campaign.parent / "out")]) == 2
    words = "actuator.delay: 5 s is beyond 0s to 1s, as buses and actuators take milliseconds; did you mean 5ms?"
    assert words in capsys.readouterr().err
    assert not (campaign.parent / "out").exists()
