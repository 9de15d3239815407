"""What a hydraulic machine measures, and where it is by that."""

import numpy as np
import pytest
from skillframe_hydraulics.declared import MachineNoise
from skillframe_hydraulics.sensors import RECENT, MachineSensors

DT = 1e-3


@pytest.mark.slow
def test_every_jump_between_two_readings_is_among_the_latest_whenever_one_looks():
    """A look every `RECENT` readings: the last of one and the first of the next stand side by side in some look."""
    gauges, still = (
        MachineSensors(MachineNoise(encoder=0.0, pressure=0.0), [np.random.default_rng(0)], 1, 1, DT),
        np.zeros((1, 1)),
    )
    gauges.start(still, still, still)
    for jump in range(3 * RECENT):
        seen = []
        for k in range(3 * RECENT):
            gauges.sample(np.full((1, 1), float(k >= jump)), still, still)
            if k % RECENT == RECENT - 1:
                latest = np.roll(gauges.raw, -gauges.turn, axis=0)
                seen.append(np.abs(np.diff(latest[:, 0, 0])).max())
        assert max(seen) == 1.0


def test_a_machine_that_moves_steadily_is_known_to_be_where_it_is_and_not_where_it_was():
    """The filter of a ramp lags by 2/w and knows its rate. A sample of 1 ms is 0.08 of its 13 ms."""
    quiet = MachineNoise(encoder=0.0, pressure=0.0)
    gauges, rate, still = MachineSensors(quiet, [np.random.default_rng(0)], 3, 3, DT), 0.2, np.zeros((1, 3))
    gauges.start(still, still, still)
    for k in range(500):
        z = np.full((1, 3), rate * k * DT)
        gauges.sample(z, still, still)
    way = rate * gauges.lag
    np.testing.assert_allclose(gauges.rate, rate, rtol=1e-9)
    assert np.all(z - gauges.z > 0.9 * way)
    np.testing.assert_allclose(gauges.now, z, rtol=0, atol=0.08 * way)
