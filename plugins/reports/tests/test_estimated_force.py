"""Plots of a run whose contact force is estimated: called so, without a torque, and shaded where it is not valid."""

import re
from dataclasses import replace

import numpy as np
from skillframe_reports.demonstration_curves import lanes_of
from skillframe_reports.plots import events_of, run_plots

from skillframe.demonstration.record import Demonstration
from tests import report_fakes


def estimated_trace():
    trace = report_fakes.trace()
    rows = len(trace.time)
    return replace(trace, machine={"force_sigma": np.ones((rows, 2)), "force_valid": np.ones(rows)})


def test_the_highest_force_is_called_an_estimate_where_no_sensor_measures_it():
    traces = [replace(t, meta={**t.meta, "events": []}) for t in (report_fakes.trace(), estimated_trace())]
    measured, estimated = (" ".join(what for _, what in events_of(trace)) for trace in traces)
    assert "highest measured force" in measured
    assert "highest estimated force" in estimated


def test_a_run_with_an_estimated_force_shows_no_torque_that_nobody_measures():
    assert len(run_plots(estimated_trace())) == 2


def shades(page):
    """(start, width) of every shaded band [px]."""
    bands = re.findall(r'<rect x="([\d.]+)" width="([\d.]+)"[^>]*class="doubtful"', page)
    return [(float(x), float(width)) for x, width in bands]


def test_the_estimated_force_is_shaded_where_it_is_not_valid_and_nowhere_else():
    trace = estimated_trace()
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


def test_a_recording_is_shaded_by_its_own_column_and_one_without_it_is_not():
    run = report_fakes.trace()
    recording = Demonstration(time=run.time, position=run.position, quaternion=run.quaternion, wrench=run.wrench)
    valid = np.ones(len(recording.time))
    valid[: len(valid) // 2] = 0.0
    said = replace(recording, extra={"force_valid": valid})
    assert [len(shades(str(lane))) for lane in lanes_of(said)] == [0, 0, 0, 1, 1]  # force and torque
    assert not any(shades(str(lane)) for lane in lanes_of(recording))


def test_the_first_contact_of_a_real_run_is_above_its_sensor_s_noise():
    trace = report_fakes.trace()
    wrench = np.zeros_like(trace.wrench_true)
    wrench[::2, 0], wrench[-3:, 0] = 1.5, 12.0
    trace = replace(trace, wrench_true=wrench, meta={**trace.meta, "events": []})
    noisy = replace(trace, meta={**trace.meta, "sensor_noise_n": 0.5})
    begins = [when for each in (trace, noisy) for when, what in events_of(each) if what == "first contact"]
    assert begins == [trace.time[0], trace.time[-3]]
