"""The published insertions: what joint friction decides, and what the relative task changes."""

from functools import cache

import numpy as np
import pytest
from skillframe_dualarm.dual_peg import DualPegParams, build
from skillframe_papers.published import INSERTION
from skillframe_papers.rows.insertion import PUBLISHED, insert, largest, posed
from skillframe_papers.rows.sweep import phase_of

from skillframe.errors import UnknownName
from skillframe.execution.prepare import load_robot_model

SCENE = build(DualPegParams())

TILTS = [4.0, 6.0, 8.0, 10.0, 12.0, 14.0]
BOTH = [sign * tilt for sign in (1.0, -1.0) for tilt in TILTS]


@cache
def robot():
    return load_robot_model("dual_panda")


def outcomes(name, tilts, frictions, **options):
    """Insertions of a configuration. "E*" is the relative task of E."""
    return insert(robot(), SCENE, phase_of(name, SCENE.tool.frames, INSERTION), tilts, frictions, **options)


def test_an_unknown_posture_is_refused():
    with pytest.raises(UnknownName, match="posture"):
        posed(robot(), SCENE, "sideways")


@pytest.mark.slow
@pytest.mark.parametrize("name", "ABCD")
def test_without_joint_friction_every_published_configuration_succeeds_at_12_degrees_of_both_signs(name):
    assert [row.outcome for row in outcomes(name, [12.0, -12.0], [0.0])] == ["success"] * 2


@pytest.mark.slow
def test_joint_friction_in_the_slave_makes_c_fail_at_8_degrees():
    free, stiff = outcomes("C", [8.0], [0.0, 0.5])
    assert free.outcome == "success"
    assert stiff.outcome == "jam"


@pytest.mark.slow
@pytest.mark.figures
def test_with_joint_friction_c_is_worst_then_d_then_b():
    found = {name: largest(outcomes(name, TILTS, [0.5]), 1, 0.5) for name in "BCD"}
    assert found["C"] <= 6.0 and 6.0 <= found["D"] <= 10.0 and found["B"] >= 12.0
    assert found["C"] < found["D"] < found["B"]


@pytest.mark.slow
def test_the_relative_task_lowers_forces_and_paths_on_the_same_starts():
    tilts = [8.0, 10.0, 12.0, -8.0, -10.0, -12.0]
    alone, together = (outcomes(name, tilts, [0.0]) for name in ("E", "E*"))
    assert {row.outcome for row in [*alone, *together]} == {"success"}
    assert all(t.force_n <= a.force_n + 0.5 for a, t in zip(alone, together, strict=True))  # noise of 0.3 N
    assert np.mean([t.force_n for t in together]) < 0.9 * np.mean([a.force_n for a in alone])
    assert np.mean([sum(t.joint_path_rad) for t in together]) < 0.8 * np.mean([sum(a.joint_path_rad) for a in alone])


@pytest.mark.slow
@pytest.mark.figures
def test_the_relative_task_inserts_where_independent_arms_turn_or_jam():
    tilts = [8.0, 10.0, -8.0, -10.0]
    alone, together = (outcomes(name, tilts, [0.25]) for name in ("E", "E*"))
    assert {row.outcome for row in together} == {"success"}
    assert "success" not in {row.outcome for row in alone}


@pytest.mark.slow
@pytest.mark.figures
def test_two_compliant_arms_fail_in_ways_of_their_own():
    found = {row.outcome for row in outcomes("E", [8.0, 10.0, 12.0, -8.0, -10.0, -12.0], [0.5])}
    assert found & {"common rotation", "turned away"}


@pytest.mark.figures
@pytest.mark.parametrize("posture", ["upright", "mirrored"])
def test_table_of_configurations_signs_postures_and_friction(posture):
    """The table of the dual-arm page."""
    print(f"\n{posture}: largest tilt [deg] +/-; at 8 degrees + and -: outcome, time [s], force [N], joint path [rad]")
    for name in ("A", "B", "C", "D", "E", "E*"):
        rows = outcomes(name, BOTH, [0.0, 0.5], posture=posture)
        for friction in (0.0, 0.5):
            reach = "/".join(f"{largest(rows, sign, friction):g}" for sign in (1, -1))
            at_8 = [r for r in rows if abs(r.tilt_deg) == 8.0 and r.joint_friction == friction]
            text = "; ".join(
                f"{r.outcome} {r.time_s:.1f} {r.force_n:.0f} {r.joint_path_rad[0]:.2f}+{r.joint_path_rad[1]:.2f}"
                for r in at_8
            )
            print(f"  {name:2} friction {friction}: {reach:7} (published {PUBLISHED[name[0]]})  {text}", flush=True)
        if name in "ABCD":  # the thresholds
            assert all(largest(rows, sign, 0.0) >= 12.0 for sign in (1, -1))


@pytest.mark.figures
@pytest.mark.parametrize("posture", ["upright", "mirrored"])
def test_table_of_forces_when_the_skill_goes_on_to_the_bottom(posture):
    """The dual-arm page's table of impacts."""
    print(f"\n{posture}, 8 degrees + and -, to the bottom: outcome, force [N]")
    for name in ("A", "B", "C", "D", "E", "E*"):
        rows = outcomes(name, [8.0, -8.0], [0.0, 0.5], posture=posture, to_the_bottom=True)
        print(name, "; ".join(f"{r.joint_friction:g} Nm: {r.outcome} {r.force_n:.0f} ({r.reason[:40]})" for r in rows))
        assert all(r.force_n >= 25.0 for r in rows), "nobody ends before the push of 30 N has grown"


@pytest.mark.slow
@pytest.mark.figures
def test_a_pair_that_comes_free_hits_the_bottom_harder_than_it_was_pushed():
    cut, whole = (outcomes("B", [8.0], [0.5], to_the_bottom=on) for on in (False, True))
    assert cut[0].outcome == "success" and cut[0].force_n < 40.0  # the lead's 30 N and a third
    assert whole[0].force_n > 150.0, "the table that is cut at the goal hides the impact"
