"""A slide whose force fades before it ends, and whose tool then lifts, still shows where to push."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry
from tests.sound_slides import eased

pytestmark = pytest.mark.needs_plugins


def fading_slide(seed: int, lift: float, turn: float, resolution: float) -> Demonstration:
    """Down by 120 mm, along x by 80 mm under a force of 11 N that fades before the end, and up, as it turns."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 7.5, 0.002)
    up = 0.12 * (1.0 - eased((time - 0.5) / 2.0)) + lift * eased((time - 6.0) / 1.2)
    position = np.stack([0.4 + 0.08 * eased((time - 3.0) / 3.0), 0.1 + 0.0 * time, 0.05 + up], axis=1)
    attitude = Rotation.from_rotvec(np.outer(np.radians(turn) * eased((time - 0.5) / 5.5), [0.0, 1.0, 0.3]))
    attitude *= Rotation.from_euler("x", np.pi)
    force = np.outer(np.exp(-(((time - 4.2) / 0.5) ** 2)) * ((time > 2.5) & (time < 6.0)), [-2.18, 0.7, 11.0])
    wrench = np.concatenate([force, np.cross(attitude.apply([0.0, 0.0, 0.02]), force)], axis=1)
    step = resolution * np.repeat([1.0, 0.1], 3)
    wrench = np.round((wrench + 1e-5 * rng.normal(size=wrench.shape)) / step) * step
    return Demonstration(time=time, position=position, quaternion=attitude.as_quat(), wrench=wrench, source="fading")


@pytest.mark.parametrize("resolution", [0.001, 0.009, 0.05])
@pytest.mark.parametrize(("lift", "turn"), [(0.05, 20.0), (0.05, 0.0), (0.1, 40.0)])
def test_how_a_tool_leaves_is_no_part_of_the_push(lift: float, turn: float, resolution: float) -> None:
    document = learned(registry().skill("lmc"), [fading_slide(0, lift, turn, resolution)], LearnOptions())
    part = document["phases"][0]["translation"]
    assert part["desired_direction"] is not None
    # in the sector of the slide: between its way and what was pressed. One demonstration leaves it open
    assert -part["desired_direction"][2] > 0.2
    assert np.abs(part["desired_direction"][1]) < 0.1 and part["desired_direction"][0] > 0.0
