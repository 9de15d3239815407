"""Contact that begins and ends again and again is cut where the model's phases tell nothing."""

from __future__ import annotations

import numpy as np
import pytest
from skillframe_recordings.audit import audit
from skillframe_segmenter.explained import near_cuts
from skillframe_segmenter.learning import learn

from skillframe.demonstration.record import Demonstration
from skillframe.extend import LearnOptions
from tests.sound_slides import slow_noise


def pecked(seed: int, touches: int = 8) -> Demonstration:
    """A tool that wanders about and is pressed again and again, each time as long and hard as it happens."""
    rng = np.random.default_rng([seed, 12])
    edges = np.cumsum(np.concatenate([[2.0], rng.uniform(0.8, 2.0, 2 * touches - 1), [2.0]]))
    time = np.arange(0.0, edges[-1], 0.01)
    position = np.array([0.4, 0.0, 0.3]) + 0.05 * slow_noise(rng, time, 1.0, 3)
    load = np.zeros(len(time))
    for begin, end in zip(edges[:-1:2], edges[1::2], strict=True):
        press = np.clip((time - begin) / 0.05, 0.0, 1.0) * np.clip((end - time) / 0.05, 0.0, 1.0)
        load = np.maximum(load, rng.uniform(8.0, 15.0) * press)
    force = np.outer(load, [0.0, 0.0, 1.0]) + 0.05 * rng.normal(size=(len(time), 3))
    wrench = np.concatenate([force, 0.002 * rng.normal(size=force.shape)], axis=1)
    down = np.tile([1.0, 0.0, 0.0, 0.0], (len(time), 1))
    return Demonstration(time=time, position=position, quaternion=down, wrench=wrench, source="pecks")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.slow
def test_contact_changes_are_cuts_where_the_models_phases_are_no_better_than_chance(seed: int) -> None:
    d = pecked(seed)
    moments = np.array([t for contact in audit(d).contacts for t in contact[:2]])
    assert len(moments) == 16
    found = learn([d], LearnOptions())
    (row,) = found["demonstrations"]
    inner = moments[(moments > row["start"] + 0.25) & (moments < row["end"] - 0.25)]
    assert near_cuts(inner, np.array(row["boundaries"])) >= 0.9 * len(inner)
    assert found["explained"]["p"] <= 0.05


def test_a_number_of_phases_that_is_given_is_kept() -> None:
    assert len(learn([pecked(0)], LearnOptions(settings={"phases": 1}))["phases"]) == 1
