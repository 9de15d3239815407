"""A sensor at the end of its range is told by the channel that stays there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skillframe_recordings.audit import audit

from skillframe.demonstration.record import Demonstration
from tests.unit.demonstration.conftest import make


def pressed(seed: int, most: float | None) -> Demonstration:
    """A press that rises to 20 N and falls again, cut at what the sensor shows at most, along -x and z."""
    d = make(count=400, seed=seed)
    wrench = np.array(d.wrench)
    wrench[:, 2] += 20.0 * np.sin(np.linspace(0.0, np.pi, 400)) ** 4
    wrench[:, 0] -= 15.0 * np.sin(np.linspace(0.0, np.pi, 400)) ** 4
    return replace(d, wrench=wrench if most is None else np.clip(wrench, -most, most))


def said(d: Demonstration) -> list[str]:
    return [text for text in audit(d).warnings if text.startswith("saturation:")]


@pytest.mark.parametrize("seed", range(5))
def test_a_channel_at_the_end_of_its_range_is_told_and_no_other(seed: int) -> None:
    found = said(pressed(seed, 12.0))
    assert len(found) == 2
    assert "fx stays at its least value, -12 N" in found[0] and "fz stays at its largest value, 12 N" in found[1]
    assert not said(pressed(seed, None))


def test_a_recorder_faster_than_its_sensor_does_not_saturate() -> None:
    d = pressed(0, None)
    held = np.repeat(d.wrench[::8], 8, axis=0)
    assert not said(replace(d, wrench=held))
    assert len(said(replace(d, wrench=np.clip(held, -12.0, 12.0)))) == 2
