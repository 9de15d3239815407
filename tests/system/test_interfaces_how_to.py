"""Arms that take positions, as docs/how-to/own-robot.md shows them, are loaded, and its figures are those printed."""

import math
import re
import shutil
from pathlib import Path

import pytest

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.robot.interface import DEFAULTS, LEVER, Control
from skillframe.robot.spec import load_robot, robot_names

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "own-robot.md").read_text(encoding="utf-8")
BLOCK = next(b for b in re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL) if "interface = " in b)


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "my_arm_folder"
    shutil.copytree(robot_names()["panda"], made)
    text = (made / "robot.toml").read_text(encoding="utf-8")
    (made / "robot.toml").write_text(text.replace("[control]\nrate_hz = 1000\n", BLOCK), encoding="utf-8")
    return made


def test_the_pages_block_makes_an_arm_and_shows_the_defaults(folder):
    control = load_robot(folder).control
    assert control.interface == "position"
    shown = {name: getattr(control, name) for name in DEFAULTS if name != "push_nm"}
    assert shown == {name: value for name, value in DEFAULTS.items() if name != "push_nm"}
    assert f"`push_nm` ({DEFAULTS['push_nm']:g} Nm)" in PAGE
    assert f"{1e3 * LEVER:.0f} mm at least" in PAGE


def test_check_prints_the_pages_line(folder, capsys):
    assert run(["robots", "--check", str(folder)]) == 0
    line = capsys.readouterr().out.splitlines()[1]
    assert line.strip().startswith("takes a position") and line in PAGE


def test_the_pages_formula_gives_the_damping_that_is_used():
    arm = Control(interface="position", rate_hz=500.0).admittance
    total = 0.008 + 1 / (2 * 500) + 1.6 / (2 * math.pi * 15.0) + 10.6e-3
    assert arm.damping == pytest.approx(1.5 * 5e4 * total, rel=1e-3)  # the page rounds 10.61 ms
    soft = Control(interface="position", rate_hz=500.0, contact_stiffness=1e4).admittance
    assert f"at 1e4 N/m the same arm moves at {1e3 * soft.speed:.0f} mm/s" in " ".join(PAGE.split())


def test_an_arm_that_stands_still_is_refused_in_the_pages_words(folder):
    path = folder / "robot.toml"
    late = BLOCK.replace("0.008", "0.119").replace("15.0", "8.0").replace("5e4", "1e6")
    path.write_text(path.read_text(encoding="utf-8").replace(BLOCK, late), encoding="utf-8")
    with pytest.raises(InputError) as raised:
        load_robot(folder)
    shown = next(line for line in PAGE.splitlines() if "cannot be stable and move" in line)
    assert shown in str(raised.value)


def test_every_row_of_the_table_is_an_arm_that_can_be_declared():
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in PAGE.splitlines()
        if "(guess)" in line and "|" in line
    ]
    assert len(rows) == 6
    for name, kind, rate, delay, bandwidth, _ in rows:
        hertz = float(re.match(r"[\d.]+", bandwidth)[0])
        arm = Control(interface=kind, rate_hz=float(rate), delay_s=float(delay), bandwidth_hz=hertz).admittance
        assert arm.speed > 3e-3, name


def test_the_published_delays_are_those_of_the_rows():
    """UR: 34 ms and 35 ms from command to motion, which is the delay and the lag."""
    for delay, bandwidth, total in ((0.008, 10.0, 34e-3), (0.020, 17.0, 35e-3)):
        assert delay + 1.6 / (2 * math.pi * bandwidth) == pytest.approx(total, abs=1e-3)
