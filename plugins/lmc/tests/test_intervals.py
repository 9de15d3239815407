"""Learning from contact alone: what came before the touch is left out, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic as syn
from skillframe_lmc.intervals import touching, track, translation
from skillframe_lmc.learner import learn
from skillframe_lmc.settings import Settings

from skillframe.demonstration.record import Demonstration
from skillframe.extend import Document, LearnOptions

ORIGIN = np.zeros(3)


def after_an_approach(slide: Demonstration, length: float = 0.05) -> Demonstration:
    """The slide, come to through the air along y, across what the push can be."""
    n = int(length / syn.Recipe().speed * syn.Recipe().rate)
    way = np.zeros((n, 3))
    way[:, 1] = np.linspace(-length, 0.0, n, endpoint=False)
    return replace(
        slide, time=np.arange(n + len(slide)) / syn.Recipe().rate,
        position=np.concatenate([slide.position[0] + way, slide.position]),
        quaternion=np.concatenate([np.tile(slide.quaternion[0], (n, 1)), slide.quaternion]),
        wrench=np.concatenate([np.zeros((n, 6)), slide.wrench]),
    )  # fmt: skip


def learned(demonstrations: list[Demonstration], **settings: object) -> Document:
    part: Document = learn(demonstrations, LearnOptions(settings=settings))["phases"][0]["translation"]
    return part


def test_what_is_left_are_the_intervals_that_bear_a_load_and_the_whole_path() -> None:
    slide = syn.slide(45.0, 0.2)
    motion = translation(track(after_an_approach(slide), ORIGIN, ORIGIN, "base"), Settings())
    left = touching(motion)
    assert 0 < len(left.work) < len(motion.work)
    assert np.all(np.linalg.norm(left.load, axis=1) >= motion.load_min)
    assert (left.path, left.duration) == (motion.path, motion.duration)
    np.testing.assert_array_equal(touching(left).displacement, left.displacement)


def test_an_approach_that_says_nothing_about_the_push_changes_nothing_once_left_out() -> None:
    slides = syn.valley(45.0, 0.2)
    plain = learned(slides)
    part = learned([after_an_approach(slide) for slide in slides], contact_only=True)
    # the interval in which contact begins mixes both motions: one of some 25
    np.testing.assert_allclose(part["desired_direction"], plain["desired_direction"], atol=np.radians(3.0))
    np.testing.assert_allclose(part["compliant_axes"], plain["compliant_axes"], atol=np.radians(6.0))
    assert part["evidence"]["explained"] == pytest.approx(plain["evidence"]["explained"], abs=0.05)


def test_a_motion_that_never_touches_is_held_where_only_contact_counts() -> None:
    air = syn.straight([0.0, 0.0, -1.0], 0.05, [0.0, 0.0, 0.0], syn.Recipe())
    part = learned([air], contact_only=True)
    assert part["desired_direction"] is None
    assert part["compliant_axes"] == []
    assert part["evidence"]["message"].startswith("touched nothing")


@pytest.mark.parametrize("unmeasured", [(), ("tx", "ty", "tz")])
def test_a_lever_makes_no_torque_where_none_was_measured(unmeasured: tuple[str, ...]) -> None:
    slide = syn.slide(45.0, 0.2)
    seen = track(
        replace(slide, meta={**slide.meta, "unmeasured": list(unmeasured)}), ORIGIN, np.array([0, 0, 0.3]), "base"
    )
    assert np.any(seen.torque) == (not unmeasured)
