"""Opening of a valve over its travel by points of a data sheet: closed forms, the inverse, refusals, and a machine."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from skillframe_hydraulics.cylinder.reference import ReferenceBank
from skillframe_hydraulics.described import write_out
from skillframe_hydraulics.opening import ACROSS, opened, openings, overlap, travel

from plugins.hydraulics.tests.test_open_centre import run_line
from skillframe.errors import InputError
from skillframe.extend.drives import audit
from skillframe.fmu.actuator import OUTPUTS, ActuatorSpec
from skillframe.fmu.bindings import InstanceFailed
from skillframe.fmu.build import fmu_folders
from skillframe.fmu.driver import FmuBank
from skillframe.fmu.table import read_table
from skillframe.robot.spec import Actuation, load_robot
from tests.excavator import write_excavator

FINE = [[0.1, 0.0], [0.5, 0.12], [1.0, 1.0]]
FULL = [[0.0, 0.0], [0.1, 0.01], [0.3, 0.05], [0.5, 0.12], [0.6, 0.2], [0.8, 0.5], [0.9, 0.7], [1.0, 1.0]]


def figures(points):
    """Parameters, as a [[cylinder]] on a joint gives them."""
    written = write_out({"cylinder": [{"joint": "boom", "opening": points}]}, Path("robot.toml"))
    return written["actuation"][0]["parameters"]


def banks(cylinder, sets):
    outputs = {name: name for name in (*OUTPUTS, "flow_a", "flow_b", "flow_supply", "spool")}
    specs = [ActuatorSpec(fmu="hydraulic_cylinder", parameters=p, inputs={}, outputs=outputs) for p in sets]
    table = read_table(fmu_folders()["hydraulic_cylinder"])
    yield FmuBank(specs, [cylinder] * len(sets))
    yield ReferenceBank(specs, table)
    yield ReferenceBank(specs, table, symbolic=False)


@pytest.mark.parametrize("points", [FINE, FULL, [[0.2, 0.0], [1.0, 1.0]]])
def test_flow_is_the_rated_one_times_the_interpolated_share_in_both_directions(cylinder2, points):
    """30 bar in both chambers, 190 before and 10 behind the edges; a laminar pressure of 1 kPa takes 6e-8."""
    commands = np.array([-1.0, -0.55, -0.3, -0.05, 0.0, 0.05, 0.1, 0.3, 0.55, 0.95, 1.0])
    held = {"initial_pressure": 30e5, "initial_force": np.pi / 4 * 0.045**2 * 30e5}
    own = figures(points) | held | {"laminar_pressure": 1e3}
    share = np.interp(np.abs(commands), *np.transpose(points))
    rated = 100.0 / 6e4 / np.sqrt(70e5)
    for b in banks(cylinder2, [own] * len(commands)):
        b.u[:, 0], b.u[:, 1] = commands, 0.3
        b.start()
        taken, *into = (b.y[:, b.outputs.index(f"flow_{name}")] for name in ("supply", "a", "b"))
        np.testing.assert_allclose(taken, rated * share * np.sqrt(160e5), rtol=1e-6, atol=1e-18)
        drained = np.where(commands > 0.0, *reversed(into))
        np.testing.assert_allclose(drained, -rated * share * np.sqrt(20e5), rtol=1e-6, atol=1e-18)
        b.close()


def test_the_reference_cylinder_opens_as_the_fmu_does_and_one_without_points_beside_it_stays_as_it_is(cylinder2):
    sets, found = [{**own, "spool_slew": 0.0} for own in (figures(FINE), {"deadband": 0.05}, figures(FULL))], []
    for b in banks(cylinder2, sets):
        b.u[:, 1] = 0.3
        b.start()
        rows = []
        for i in range(300):
            b.u[:, 0] = np.sin(0.03 * i)
            b.u[:, 1:4] = 0.3 + 1e-3 * np.sin(0.1 * i), 0.1 * np.cos(0.1 * i), 0.0
            assert b.step(1e-3 * i, 1e-3)
            rows.append(b.y.copy())
        found.append(np.array(rows))
        names = list(b.outputs)
        b.close()
    off = np.abs(found[1] - found[0])  # two rules of integration, across kinks
    assert off[..., [names.index("pressure_a"), names.index("pressure_b")]].max() < 1000.0
    assert off[..., names.index("force")].max() < 6.0
    assert np.all(np.abs(found[2] - found[1]) < 1e-11 * np.abs(found[1]).max(axis=(0, 1)))
    alone = next(banks(cylinder2, sets[1:2]))
    alone.u[:, 1] = 0.3
    alone.start()
    alone.u[:, :4] = 0.0, 0.3, 0.1, 0.0
    assert alone.step(0.0, 1e-3)
    np.testing.assert_array_equal(alone.y[0], found[0][0, 1])
    alone.close()


def test_the_inverse_gives_the_opening_back_beyond_the_overlap_and_knows_valves_without_points():
    rows = [Actuation(joint="j", fmu="hydraulic_cylinder", parameters=p) for p in (figures(FINE), {}, figures(FULL))]
    o = openings(rows)
    y = np.concatenate([-np.geomspace(1e-4, 1.0, 60)[::-1], [0.0], np.geomspace(1e-4, 1.0, 60)])[:, None] * np.ones(3)
    x = travel(o, y)
    for i, points in ((0, FINE), (2, FULL)):
        xs, ys = np.transpose(points)
        back = np.interp(np.abs(x[:, i]), xs, ys) * np.sign(x[:, i])
        far = np.abs(y[:, i]) > 20.0 * ACROSS
        np.testing.assert_allclose(back[far], y[far, i], rtol=1e-12)
        np.testing.assert_allclose(opened(o, x)[:, i], back, atol=1e-15)
    np.testing.assert_array_equal(x[:, 1], y[:, 1])
    assert np.all(np.diff(x, axis=0) > 0.0)
    np.testing.assert_allclose(travel(o, 3.0 * np.sign(y)), np.sign(y) * [1.0, 3.0, 1.0])
    np.testing.assert_array_equal(overlap(o, np.full(3, 0.02)), [0.1, 0.02, 0.0])
    symbol = ca.SX.sym("y", 3)
    function = ca.Function("f", [symbol], [travel(o, symbol), opened(o, symbol)])
    for row in y[::7]:
        for found, expected in zip(function(row), (travel(o, row), opened(o, row)), strict=True):
            np.testing.assert_allclose(np.array(found).ravel(), expected, rtol=1e-14)
    assert openings(rows[1:2]) is None


@pytest.mark.parametrize(
    ("points", "more", "said"),
    [
        (0.1, {}, "is 0.1"),
        ([], {}, "is []"),
        ([[0.1, 0.0], [1.0]], {}, "is [[0.1, 0.0], [1.0]]"),
        ([[0.1, 0.0], [1.0, "1"]], {}, "is [[0.1, 0.0], [1.0, '1']]"),
        ([[1.0, 1.0]], {}, "has 1 points, and a valve has 2 to 8"),
        ([[0.1 * i, 0.1 * i] for i in range(9)], {}, "has 9 points, and a valve has 2 to 8"),
        ([[0.1, 0.1], [1.0, 1.0]], {}, "goes from [0.1, 0.1] to [1.0, 1.0], and not from the overlap with a flow of 0"),
        ([[0.1, 0.0], [0.9, 1.0]], {}, "goes from [0.1, 0.0] to [0.9, 1.0], and not"),
        ([[0.1, 0.0], [0.5, 0.2], [0.4, 0.3], [1.0, 1.0]], {}, "does not rise from [0.5, 0.2] to [0.4, 0.3]"),
        ([[0.1, 0.0], [0.5, 0.0], [1.0, 1.0]], {}, "does not rise from [0.1, 0.0] to [0.5, 0.0]"),
        (FINE, {"deadband": 0.05}, "stands beside a deadband, whose place the first point takes"),
    ],
)  # fmt: skip
def test_a_table_that_is_none_of_a_valve_is_refused_with_what_to_write(points, more, said):
    with pytest.raises(InputError) as refused:
        write_out({"motor": [{"joint": "slew", "displacement": 1e-4, "opening": points, **more}]}, Path("robot.toml"))
    assert str(refused.value).startswith(f"robot.toml: motor on slew.opening: {said}")
    assert "; write shares of the travel and of the rated flow, such as opening = [[0.1, 0.0], " in str(refused.value)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"opening_points": 9}, "parameter opening_points is 9; it must be 0, or 2 to 8"),
        ({"opening_points": 2.5}, "parameter opening_points is 2.5; it must be 0, or 2 to 8"),
        ({"deadband": 0.1}, "parameter deadband is 0.1; it must be 0 beside opening_points"),
        ({"travel_2": 0.05}, "parameter travel_2 is 0.05; it must be above that of the point before"),
        ({"opening_3": 0.9}, "parameter opening_3 is 0.9; it must be 1 at the last point"),
    ],
)
def test_the_fmu_refuses_points_that_cannot_be(cylinder2, wrong, said):
    b = next(banks(cylinder2, [figures(FINE) | wrong]))
    with pytest.raises(InstanceFailed, match=said):
        b.start()
    b.close()


def with_points(folder, points):
    """The excavator whose valves open along these points: its folder."""
    file = write_excavator(folder) / "robot.toml"
    own = ", ".join(f"{name} = {value}" for name, value in figures(points).items())
    file.write_text(file.read_text(encoding="utf-8").replace("leakage =", f"{own}, leakage ="), encoding="utf-8")
    return folder


def test_points_in_the_parameters_of_an_actuation_are_checked_too(tmp_path):
    file = with_points(tmp_path / "bad", FINE) / "robot.toml"
    file.write_text(file.read_text(encoding="utf-8").replace("travel_2 = 0.5", "travel_2 = 0.05"), encoding="utf-8")
    with_points(tmp_path / "good", FINE)
    for folder, count in (("good", 0), ("bad", 1)):
        messages = [each.message for each in audit(load_robot(tmp_path / folder)).problems]
        assert sum("opening of the cylinder on boom_left_piston does not rise from" in one for one in messages) == count


@pytest.mark.slow
@pytest.mark.parametrize(
    ("points", "most"),
    [
        ([[0.0, 0.0], [1.0, 1.0]], 3e-3),
        ([[0.0, 0.0], [0.5, 0.12], [1.0, 1.0]], 3e-3),
        pytest.param(FINE, 10e-3, marks=pytest.mark.figures),
    ],
)
def test_a_machine_with_fine_metering_follows_a_line_as_well_as_with_a_straight_opening(tmp_path, points, most):
    """A spool that changes sides across an overlap of 10 % is late, however it opens beyond."""
    found, off = run_line(with_points(tmp_path / "excavator", points))
    print(f"{points}: {1e3 * off.max():.1f} ({1e3 * np.sqrt(np.mean(off**2)):.1f}) mm")
    assert found.reason[0].startswith("time limit")
    assert off.max() < most
