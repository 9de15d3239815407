import math
from collections.abc import Sequence

import numpy as np
import pytest
import synthetic as syn
from hypothesis import given
from hypothesis import strategies as st
from skillframe_lmc.directions import choose
from skillframe_lmc.heading import CAP, GAIN, NO_HEADING, Heading, doubt, heading
from skillframe_lmc.intervals import Motion, track, translation
from skillframe_lmc.sectors import sectors
from skillframe_lmc.settings import Settings

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, rotation_matrix, unit

ORIGIN = np.zeros(3)
DOWN = np.array([0.0, 0.0, -1.0])
vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


def motions(demonstrations: Sequence[Demonstration]) -> list[Motion]:
    return [translation(track(d, ORIGIN, ORIGIN, "base"), Settings()) for d in demonstrations]


def chosen(demonstrations: Sequence[Demonstration], way: Heading) -> Float:
    found = choose([sectors(m) for m in motions(demonstrations)], Settings(), way).direction
    assert found is not None
    return found


@pytest.mark.parametrize("slope", [10.0, 30.0, 55.0])
def test_demonstrations_from_both_sides_head_along_their_bisector_in_their_plane(slope: float) -> None:
    way = heading(motions(syn.valley(90.0 - slope, 0.2)))
    assert way.mean is not None and way.normal is not None
    # both slides are equally long but for a block of 20 ms (0.6 mm of 50)
    assert np.allclose(way.mean, DOWN, atol=1e-3)
    assert np.allclose(np.abs(way.normal), [0.0, 1.0, 0.0], atol=1e-3)


def test_wavering_bends_the_heading_no_more_than_its_independent_aims_allow() -> None:
    ways = [heading(motions(syn.wavering(60.0, 0.2, 8.0, seed, length=0.1))).mean for seed in range(20)]
    found = np.array([way for way in ways if way is not None])
    # 8 degrees, correlated over 15 mm: a chord of 100 mm holds 100 / 30 aims, two of them 6.7, and their mean is
    # cos 30 degrees long; the root mean square of 20 draws stays within 1.35 times its expectation (2 sigma)
    expected = math.radians(8.0) / math.sqrt(6.7) / math.cos(math.radians(30.0))
    assert len(found) == 20
    assert np.sqrt(np.mean(found[:, 1] ** 2)) < 1.35 * expected


def test_one_demonstration_has_no_heading() -> None:
    assert heading(motions([syn.slide(45, 0.2)])) == NO_HEADING


def test_demonstrations_that_nearly_oppose_each_other_have_a_plane_but_no_mean() -> None:
    way = heading(motions(syn.valley(25.0, 0.2)))  # chords 65 degrees from their mean
    assert way.mean is None
    assert way.normal is not None


@given(direction=vectors, mean=vectors, normal=vectors, turn=vectors)
def test_doubt_is_bounded_vanishes_on_the_heading_and_turns_with_it(
    direction: Float, mean: Float, normal: Float, turn: Float
) -> None:
    mean, direction = unit(mean), unit(direction)
    normal = unit(np.cross(mean, unit(normal)))
    way = Heading(mean, normal)
    value = doubt(direction[None], way)[0]
    assert 0.0 <= value <= 2.0 * GAIN * CAP + 1e-12
    assert doubt(mean[None], way)[0] == pytest.approx(0.0, abs=1e-7)  # the arc cosine is good to 1e-8 near 1
    R = rotation_matrix(turn)
    assert doubt((R @ direction)[None], Heading(R @ mean, R @ normal))[0] == pytest.approx(value, abs=1e-7)


def test_votes_of_one_slope_only_overrule_the_heading() -> None:
    both = [syn.slide(45, 0.2), syn.slide(45, 0.2, length=0.04)]
    way = heading(motions(both))
    assert way.mean is not None  # down the slope, the edge of the sectors, 39 degrees from their middle
    assert math.degrees(math.acos(np.clip(chosen(both, way) @ chosen(both, NO_HEADING), -1.0, 1.0))) < 0.5
