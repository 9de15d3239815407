import numpy as np
import pytest
from skillframe_reports.convergence import cell_map, edges_of, influence, rate_curves, shade
from skillframe_reports.quantities import quantity
from skillframe_reports.results import read_results
from skillframe_reports.svg import Axes, envelope, ticks
from skillframe_reports.theory import boundary, regions

from skillframe.campaign.statistics import Plan
from tests.report_fakes import rows, write_csv

COLUMNS = ["trial", "skill", "seed", "fixture.tilt_y", "fixture.offset_x", "world.friction", "success", "failure",
           "duration_s", "peak_force_n", "final_error_m", "final_error_rad"]  # fmt: skip
PLAN = Plan(trials=200, skills=2)


@pytest.fixture
def results(tmp_path):
    write_csv(tmp_path / "results.csv", rows(200, axes=3), COLUMNS)
    return read_results(tmp_path / "results.csv", ["world.friction", "fixture.tilt_y", "fixture.offset_x"], PLAN)


def test_the_quantity_without_influence_ranks_last(results):
    assert influence(results)[-1] == "world.friction"


@pytest.mark.parametrize("value", ["nan", "0.1"])
def test_a_quantity_with_fewer_than_two_values_in_the_table_is_not_drawn(tmp_path, value):
    same = [[*row[:3], value, *row[4:]] for row in rows(40, axes=3)]
    write_csv(tmp_path / "results.csv", same, COLUMNS)
    varied = ["world.friction", "fixture.tilt_y", "fixture.offset_x"]
    assert set(influence(read_results(tmp_path / "results.csv", varied, PLAN))) == set(varied) - {"fixture.tilt_y"}


def test_every_trial_is_in_one_cell_and_one_point(results):
    names = ["fixture.tilt_y", "fixture.offset_x"]
    drawn = cell_map(results, "peg.skill.json", names, [])
    counts = [part.split("<")[0] for part in drawn.split('class="count"')[1:]]
    assert sum(int(c.split("/")[1]) for c in counts) == 200
    whole = results.rate("peg.skill.json")
    assert sum(int(c.split(">")[1].split("/")[0]) for c in counts) == whole.successes
    assert (
        f"{whole.successes} of 200 trials succeeded: {results.said(whole)}." in drawn and "confidence interval" in drawn
    )
    points = [part.split("<")[0] for part in rate_curves(results, names[0], []).split("<title>")[2:]]
    assert sum(int(p.split(" of ")[1].split(",")[0]) for p in points) == 2 * 200


def test_few_values_get_a_cell_each():
    assert edges_of(np.array([0.1, 0.2, 0.4, 0.2]), 100) == pytest.approx([0.05, 0.15, 0.3, 0.5])
    assert len(edges_of(np.linspace(0, 1, 100), 100)) % 2 == 0


def test_colours_go_from_orange_over_pale_to_blue():
    reds, blues = zip(*((int(shade(s)[1:3], 16), int(shade(s)[5:7], 16)) for s in (0.0, 0.5, 1.0)), strict=True)
    assert reds[0] > blues[0]
    assert reds[2] < blues[2]
    assert min(reds[1], blues[1]) > 220


def test_theory_is_a_curve_where_it_depends_on_the_other_quantity_and_lines_elsewhere():
    scene = {"analytic": {"largest_tilt_rad": 0.5, "other": "text"},
             "analytic_over": {"world.friction": {"values": [0.1, 0.5], "largest_tilt_rad": [0.6, 0.2]}}}  # fmt: skip
    varied = ["fixture.tilt_y", "world.friction"]
    (region,) = regions(scene, varied)
    axes = Axes(x=(-60.0, 60.0), y=(0.0, 0.6))
    assert boundary(axes, (quantity(varied[0]), quantity(varied[1])), region).count("<path") == 2
    (straight,) = regions({"analytic": scene["analytic"]}, varied)
    assert boundary(axes, (quantity(varied[0]), quantity(varied[1])), straight).count("<line") == 2
    assert regions(scene, ["start.offset_x"]) == []
    assert regions({"analytic": "broken"}, varied) == []


@pytest.mark.parametrize(
    ("name", "axis"),
    [
        ("fixture.tilt_y", "fixture tilt about y [°]"),
        ("start.offset_x", "start offset along x [mm]"),
        ("world.friction", "friction"),
        ("world.clearance", "clearance [mm]"),
        ("sensor.force_noise", "sensor force noise [N]"),
        ("actuator.supply_pressure", "actuator supply pressure [bar]"),
        ("actuator.friction_scale", "actuator friction scale"),
        ("actuator.delay", "actuator delay [ms]"),
        ("robot.payload", "robot payload [kg]"),
        ("robot.mass_scale", "robot mass scale"),
    ],
)
def test_quantities_are_named_in_words_with_their_unit(name, axis):
    assert quantity(name).axis == axis


def test_ticks_are_round_inside_and_not_too_many():
    for low, high in ((0.0, 1.0), (-17.3, 16.9), (1e-6, 3e-6), (5.0, 5000.0)):
        found = ticks(low, high, 6)
        assert 2 <= len(found) <= 6
        assert low <= found[0] <= found[-1] <= high * (1 + 1e-9)


def test_thinning_a_curve_keeps_its_peak():
    y = np.zeros(100_000)
    y[54_321], y[777] = 9.0, -3.0
    x, thin = envelope(np.arange(100_000.0), y)
    assert len(x) <= 2 * 260 + 2
    assert (thin.max(), thin.min()) == (9.0, -3.0)
    assert x[np.argmax(thin)] == 54_321.0
