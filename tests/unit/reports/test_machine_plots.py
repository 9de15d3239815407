"""Plots of a hydraulic machine's run: only where there is a machine, each actuator named, only what is known."""

import re
from dataclasses import replace

import numpy as np
import report_fakes

from skillframe.demonstration.record import Demonstration
from skillframe.reports.machine import machine_plots
from skillframe.reports.plots import demonstration_plots, events_of, run_plots

NAMES = ["lift_piston", "tilt_piston"]


def machine_trace(supply=True):
    trace = report_fakes.trace()
    rows = len(trace.time)
    each = np.linspace(0.0, 1.0, 2 * rows).reshape(rows, 2)
    columns = dict.fromkeys(("pressure_a", "pressure_b", "piston_force", "piston_force_true"), 1e5 * each)
    energy = {
        "energy_supply": np.linspace(0.0, 9e3, rows) if supply else np.full(rows, np.nan),
        "energy_pistons": np.linspace(0.0, 2e3, rows),
    }
    sigma = {"force_sigma": each, "force_valid": np.ones(rows)}
    return replace(
        trace, machine={**columns, "valve": each, **energy, **sigma}, meta={**trace.meta, "actuators": NAMES}
    )


def test_a_robot_without_cylinders_has_no_plots_of_them():
    assert machine_plots(report_fakes.trace()) == []


def test_every_plot_of_cylinders_names_each_of_them():
    pages = [str(plot) for plot in machine_plots(machine_trace())]
    assert len(pages) == 4
    assert all(name in page for page in pages[:3] for name in NAMES)


def test_what_the_supply_gave_is_drawn_only_where_it_is_known():
    known, unknown = (str(machine_plots(machine_trace(supply))[3]) for supply in (True, False))
    assert ">from the supply<" in known
    assert ">from the supply<" not in unknown
    assert ">by the pistons<" in unknown


def test_the_highest_force_is_called_an_estimate_where_no_sensor_measures_it():
    traces = [replace(t, meta={**t.meta, "events": []}) for t in (report_fakes.trace(), machine_trace())]
    measured, estimated = (" ".join(what for _, what in events_of(trace)) for trace in traces)
    assert "highest measured force" in measured
    assert "highest estimated force" in estimated


def test_a_machines_run_shows_no_torque_that_nobody_measures():
    assert len(run_plots(machine_trace())) == 2


def shades(page):
    """(start, width) of every shaded band [px]."""
    bands = re.findall(r'<rect x="([\d.]+)" width="([\d.]+)"[^>]*class="doubtful"', page)
    return [(float(x), float(width)) for x, width in bands]


def test_the_estimated_force_is_shaded_where_it_is_not_valid_and_nowhere_else():
    trace = machine_trace()
    assert not shades(str(run_plots(trace)[0]))
    rows, time = len(trace.time), trace.time
    valid = np.ones(rows)
    valid[2:5] = valid[-3:] = 0.0
    page = str(run_plots(replace(trace, machine={**trace.machine, "force_valid": valid}))[0])
    (first, long), (second, short) = shades(page)
    px = (second - first) / (time[-3] - time[2])  # px a second, from the two bands' beginnings
    assert np.isclose(long / px, time[5] - time[2], atol=0.1 / px)  # positions are written to 0.1 px
    assert np.isclose(short / px, time[-1] - time[-3], atol=0.1 / px)
    assert "Shaded: the estimate is not valid" in page


def test_a_recording_of_a_machine_is_shaded_by_its_own_column_and_one_of_an_arm_is_not():
    run = report_fakes.trace()
    recording = Demonstration(time=run.time, position=run.position, quaternion=run.quaternion, wrench=run.wrench)
    valid = np.ones(len(recording.time))
    valid[: len(valid) // 2] = 0.0
    said = replace(recording, extra={"force_valid": valid})
    assert len(shades(str(demonstration_plots(said)))) == 1
    assert not shades(str(demonstration_plots(recording)))
