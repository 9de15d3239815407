"""Plots of a hydraulic machine's run: only where there is a machine, each actuator named, only what is known."""

from dataclasses import replace

import numpy as np
from skillframe_hydraulics.plots import machine_plots

from tests import report_fakes

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


def test_the_columns_of_another_drive_are_not_drawn():
    trace = report_fakes.trace()
    columns = {"servo_force": np.ones((len(trace.time), 2)), "force_sigma": np.ones((len(trace.time), 2))}
    assert machine_plots(replace(trace, machine=columns)) == []


def test_every_plot_of_cylinders_names_each_of_them():
    plots = machine_plots(machine_trace())
    assert len(plots) == 4
    assert all({*NAMES} <= {curve.name for curve in plot.curves} for plot in plots[:3])


def test_what_the_supply_gave_is_drawn_only_where_it_is_known():
    known, unknown = (
        [curve.name for curve in machine_plots(machine_trace(supply))[3].curves] for supply in (True, False)
    )
    assert known == ["from the supply", "by the pistons"]
    assert unknown == ["by the pistons"]
