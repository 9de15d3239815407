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
from skillframe_lmc.learner import learn
from skillframe_lmc.sectors import sectors
from skillframe_lmc.settings import Settings

from skillframe.demonstration.record import Demonstration
from skillframe.extend.records import LearnOptions
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


SWUNG_ASIDE = ((-0.9, -0.2, -0.4), (-0.5, -0.65, -0.6))  # chords of a coupler that strayed to one side both times


def swung(chords: Sequence[Sequence[float]], *forces: Sequence[float]) -> list[Motion]:
    return motions([syn.straight(c, 0.03, f, syn.Recipe()) for c, f in zip(chords, forces, strict=True)])


def test_a_point_that_the_parts_swung_heads_where_it_was_pushed_and_not_where_it_went() -> None:
    """Friction met on either side is +-0.2 of the normal force, and cancels in the mean: straight down."""
    given = swung(SWUNG_ASIDE, (1.2, 0.0, 6.0), (-1.8, 0.0, 9.0))
    way = heading(given, turned=True)
    assert way.swung and way.mean is not None and way.normal is None
    np.testing.assert_allclose(way.mean, DOWN, atol=1e-9)
    unturned = heading(given)
    assert not unturned.swung and unturned.mean is not None and unturned.mean @ DOWN < 0.6  # the chords' own


def test_pushes_that_disagree_and_chords_near_the_push_leave_the_heading_to_the_chords() -> None:
    apart = swung(SWUNG_ASIDE, (3.0, 0.0, 6.0), (-3.0, 0.0, 6.0))  # 26.6 degrees from their mean: no agreement
    assert not heading(apart, turned=True).swung
    near = swung([(0.6, 0.0, -0.8), (-0.6, 0.0, -0.8)], (0.0, 0.0, 6.0), (0.0, 0.0, 6.0))  # 37 degrees: a peg's
    assert not heading(near, turned=True).swung
    free = swung(SWUNG_ASIDE, (0.0, 0.0, 6.0), (0.0, 0.0, 0.1))  # one that touched nothing says nothing
    assert not heading(free, turned=True).swung


def test_the_whole_departure_from_a_swung_point_s_heading_is_held_against_a_push() -> None:
    off = np.array([[math.sin(0.1), 0.0, -math.cos(0.1)], [math.sin(0.3), 0.0, -math.cos(0.3)]])
    np.testing.assert_allclose(doubt(off, Heading(DOWN, None, swung=True)), [0.1, CAP], atol=1e-7)


def test_of_a_swung_point_pushes_are_chosen_among_wider_pyramids() -> None:
    """Sectors that all hold the push need no opening at all: the least one of the heading decides, then 8 degrees."""
    given = [sectors(m) for m in motions(syn.valley(45.0, 0.2))]
    wide, plain = (choose(given, Settings(), Heading(DOWN, None, swung=each)) for each in (True, False))
    assert math.degrees(wide.pyramid_angle) == pytest.approx(14.0)
    assert math.degrees(plain.pyramid_angle) == pytest.approx(8.0)
    assert wide.solid_angle > plain.solid_angle > 0.0


def test_the_learner_asks_for_a_swung_point_only_where_the_tool_turned() -> None:
    """A wrist 0.2 m behind a tip that goes 40 mm down swings by 0.2 m sin(tilt): 51 degrees aside at 14, 19 at 4."""
    openings = []
    for tilt in (14.0, 4.0):
        shown = learn(syn.pair_of_alignments(tilt=tilt), LearnOptions())["phases"][0]["translation"]
        openings.append(math.degrees(shown["evidence"]["pyramid_angle_rad"]))
    assert openings == pytest.approx([14.0, 8.0])
