"""The papers' concatenation: all intervals vote as those of one demonstration, however many there were."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
import synthetic as syn
from skillframe_lmc.learner import learn

from skillframe.demonstration.record import Demonstration
from skillframe.extend import LearnOptions

SLOPE, MU = 40.0, 0.2
GRID = 1.5  # degrees: finest cells of the search


def tilt(demonstrations: Sequence[Demonstration], **settings: object) -> float:
    """Of the push from straight down towards the side of the first slide [degrees]."""
    found = learn(list(demonstrations), LearnOptions(settings=settings))["phases"][0]["translation"]
    x, _, z = found["desired_direction"]
    return math.degrees(math.atan2(x, -z))


def test_a_short_demonstration_is_all_outliers_behind_a_long_one_where_both_are_concatenated():
    """12 of 162 mm are fewer than the share of outliers. By demonstration both count as much: straight down."""
    long, short = (syn.slide(SLOPE, MU, side=side, length=way) for side, way in ((1.0, 0.15), (-1.0, 0.012)))
    assert tilt([long, short]) == pytest.approx(0.0, abs=GRID)
    assert tilt([long, short], concatenated=True) > 4.0


def test_even_demonstrations_teach_the_same_either_way():
    even = syn.valley(SLOPE, MU)
    assert tilt(even, concatenated=True) == pytest.approx(tilt(even), abs=GRID)


def test_concatenated_demonstrations_vote_the_same_in_any_order():
    pair = [syn.slide(SLOPE, MU, side=side, length=way) for side, way in ((1.0, 0.06), (-1.0, 0.03))]
    assert tilt(pair, concatenated=True) == pytest.approx(tilt(pair[::-1], concatenated=True), abs=1e-6)
