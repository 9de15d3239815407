import numpy as np

from skillframe.execution import recorder as recorder_module
from skillframe.execution.recorder import Recorder
from tests.laws.pushing import Push, impedance
from tests.laws.runs import run, setup


def push():
    return Push((0.0, 0.0, -1.0), impedance(free_axes="x"), stall=False)


def small(monkeypatch, capacity, first=16):
    class Small(Recorder):
        def __init__(self, plant, every, point):
            super().__init__(plant, every, point, capacity)

    monkeypatch.setattr("skillframe.execution.drives.torque.Recorder", Small)
    monkeypatch.setattr(recorder_module, "FIRST", first)


def test_a_full_recording_drops_every_other_sample_and_goes_on_at_half_the_rate(monkeypatch):
    whole = run(push(), setup(), duration_s=0.5, trace_hz=1000).traces[0]
    small(monkeypatch, capacity=64)
    short = run(push(), setup(), duration_s=0.5, trace_hz=1000).traces[0]
    assert len(short.time) <= 64
    np.testing.assert_allclose(np.diff(short.time), 0.008)  # 500 samples into 64: halved three times
    np.testing.assert_array_equal(short.position, whole.position[::8])
    np.testing.assert_array_equal(short.wrench, whole.wrench[::8])


def test_a_recording_that_grows_loses_nothing(monkeypatch):
    whole = run(push(), setup(), duration_s=0.2, trace_hz=1000).traces[0]
    small(monkeypatch, capacity=1000)
    grown = run(push(), setup(), duration_s=0.2, trace_hz=1000).traces[0]
    np.testing.assert_array_equal(grown.time, whole.time)
    np.testing.assert_array_equal(grown.body_position, whole.body_position)


def test_a_trial_that_ends_before_the_rate_is_halved_keeps_its_own_length(monkeypatch):
    small(monkeypatch, capacity=64)
    skill = Push((0.0, 0.0, -1.0), impedance(free_axes="x"))
    result = run(skill, setup(), {"start.offset_x": [0.0, 0.02]}, count=2, duration_s=4.0, trace_hz=100)
    for trace, duration in zip(result.traces, result.duration_s, strict=True):
        spacing = trace.time[1] - trace.time[0]
        assert trace.time[-1] <= duration < trace.time[-1] + spacing + 1e-9
