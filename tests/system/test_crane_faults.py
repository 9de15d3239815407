"""A crane in which something breaks ends by its own reason, and a table says so; one without a watch does harm."""

import csv
import dataclasses
import re
from pathlib import Path

import pytest
from skillframe_hydraulics.declared import noise_of, with_noise

from skillframe.cli.main import run
from skillframe.fmu.build import find_compiler
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.figures.crane_faults import KINDS, LIMIT, Struck, crane, fine, own_reason, together, verdict
from tests.fmu_cache import own_cache  # noqa: F401

pytestmark = [
    pytest.mark.slow, pytest.mark.needs_plugins, pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
]  # fmt: skip
SKILL = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "corner.skill.json"


@pytest.fixture(scope="module")
def trials():
    """Every kind once, on the way down, the cylinders in turn."""
    return list(together([(kind, i % 3, 1.2) for i, kind in enumerate(KINDS)], seed=4, seconds=2.0))


@pytest.mark.figures
def test_every_fault_ends_its_trial_within_a_fifth_of_a_second_by_its_own_reason_or_does_no_harm(trials):
    for one in trials:
        assert fine(one), one
        assert one.force <= LIMIT and not (one.success and one.ended in ("sensor", "watchdog"))
        if one.kind != "stuck":  # it goes on as it was told last, and differs only once it is told otherwise
            assert one.after <= 0.2, one


@pytest.mark.parametrize("kind", KINDS)
def test_its_reason_names_the_part_that_broke(trials, kind):
    (one,) = (each for each in trials if each.kind == kind)
    assert own_reason(one) or (kind == "stuck" and one.ended == "time"), one.reason


def test_the_rule_is_its_own_reason_within_a_fifth_of_a_second_or_limits_that_hold():
    """Of a stuck lift: named in time or late, by another part's name, unnoticed, and with what force until then."""
    told = "watchdog: the valve of {} is commanded 5.0 mm in 0.1 s, and the piston does not move (at 1.4 s)"
    cases = [
        ("watchdog", 0.2, 1e3, told.format("lift_piston"), "in time"),
        ("watchdog", 0.2, 2.0 * LIMIT, told.format("lift_piston"), "in time"),
        ("watchdog", 0.201, LIMIT, told.format("lift_piston"), "survived"),
        ("watchdog", 0.201, 1.01 * LIMIT, told.format("lift_piston"), "neither"),
        ("watchdog", 0.1, 1e3, told.format("tilt_piston"), "survived"),
        ("watchdog", 0.1, 1.01 * LIMIT, told.format("tilt_piston"), "neither"),
        ("time", 7.8, 1e3, "time limit: 9 s of simulated time are over", "survived"),
        ("force", 0.1, 0.9 * LIMIT, "force limit: 15001 N is above 15000 N", "neither"),
        ("true_force", 0.1, 0.9 * LIMIT, "true force limit: 15001 N", "neither"),
    ]
    for ended, after, force, reason, expected in cases:
        one = Struck("stuck", "lift_piston", "lift", 1.2, after, force, LIMIT, ended, False, reason)
        assert verdict(one) == expected, one
        assert fine(one) == (expected != "neither")


def test_without_a_watch_a_burst_hose_drops_the_tool_on_the_plate():
    """What the watch is worth: 0.2 s of fall would be 5 kN and more; this one hits with all it has."""
    spec = load_robot("hiab_xs031")
    blind = crane()._replace(robot=load_model(with_noise(spec, dataclasses.replace(noise_of(spec), watch=False))))
    (one,) = together([("burst a", 0, 0.5)], seed=4, seconds=1.5, machine=blind)
    assert one.ended in ("force", "true_force") and one.force > 3.0 * LIMIT
    assert not one.success


def test_a_fault_in_the_swing_ends_its_trial_there():
    (one,) = together([("runaway, retracts", 0, -5.5)], seed=4, seconds=1.0)
    assert one.ended == "watchdog" and one.after <= 0.2
    assert re.search(r"lift_piston .* \(in the swing, 5\.[34]\d\d s before the start\)$", one.reason)


CAMPAIGN = """
name = "what breaks"
seed = 3
trials = 3
robot = "hiab_xs031"
world = "pallets"
skills = ["corner.skill.json"]
duration_s = 0.6
[vary]
"fault.time" = { uniform = ["0.1 s", "300ms"] }
"fault.cylinder" = { values = [1, 2, 3] }
[set]
"sensor.pressure_frozen" = 1
"""


def test_a_campaign_draws_when_and_where_something_breaks_and_its_table_says_by_what_it_ended(tmp_path, capsys):
    (tmp_path / "corner.skill.json").write_bytes(SKILL.read_bytes())
    (tmp_path / "broken.toml").write_text(CAMPAIGN)
    assert run(["campaign", "run", str(tmp_path / "broken.toml"), "--out", str(tmp_path / "out"), "--traces", "0"]) == 0
    rows = list(csv.DictReader((tmp_path / "out" / "results.csv").read_text().splitlines()))
    for row, name in zip(rows, ("lift_piston", "tilt_piston", "extension"), strict=True):
        assert row["ended_by"] == "sensor" and row["success"] == "0"
        assert f"pressure_a of {name} repeats" in row["failure"]
        assert 0.0 <= float(row["duration_s"]) - float(row["fault.time"]) <= 0.05  # a look is due every 20 ms
    capsys.readouterr()
    words = ["run", str(SKILL), "--robot", "panda", "--world", "valley", "--set", "sensor.encoder_frozen=1"]
    assert run(words) == 2
    assert "sensor.encoder_frozen: panda has no drive with such a quantity; leave it out" in capsys.readouterr().err
