"""What the constants of direction and axes decide: the share of outliers, the price of an axis."""

import math

import numpy as np
import pytest
import synthetic as syn
from skillframe_lmc.axes import compliant_axes, straightness
from skillframe_lmc.directions import choose
from skillframe_lmc.intervals import Motion
from skillframe_lmc.learner import learn
from skillframe_lmc.sectors import Sectors, sectors

from skillframe.extend import LearnOptions
from skillframe.frames import Float, unit

DOWN = np.array([0.0, 0.0, -1.0])


def leaning(*degrees: float) -> Float:
    """Unit vectors that lean so far from straight down, towards x."""
    angle = np.radians(degrees)
    return np.stack([np.sin(angle), np.zeros(len(angle)), -np.cos(angle)], axis=1)


def free(*degrees: float) -> Sectors:
    """Free motions, whose pyramids are cones about them."""
    return Sectors(leaning(*degrees), np.zeros((len(degrees), 3)), np.zeros(len(degrees), dtype=bool))


def test_one_interval_in_five_may_go_astray_and_two_may_not() -> None:
    """Two strays to both sides, 80 degrees off: the cone about any push that has one of them opens by 40 / 4 * 3."""
    one, two = (choose([free(*given)] * 2).direction for given in ((0, 0, 0, 0, 80), (0, 0, 0, 80, -80)))
    assert one is not None
    assert math.degrees(math.acos(one @ DOWN)) < 3.0  # the disc over which the choice is averaged
    assert two is None


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_an_axis_pays_where_the_way_along_it_exceeds_its_price(count: int) -> None:
    """n means with the same part s across the push: n s^2 / sigma^2 against ln max(n, 2) + 2."""
    sigma = 0.1
    least = sigma * math.sqrt((math.log(max(count, 2)) + 2.0) / count)
    for share, axes in ((0.99, 0), (1.01, 1)):
        means = np.tile([share * least, 0.0, -0.9], (count, 1))
        assert len(compliant_axes(means, DOWN, sigma).axes) == axes


@pytest.mark.parametrize(("length", "share"), [(0.35, 0.5), (0.7, 1.0), (0.95, 1.0)])
def test_the_noise_of_a_mean_shrinks_with_it_below_a_length_of_0_7(length: float, share: float) -> None:
    """To and fro shortens a mean direction and its noise alike. 15 mm over 60 mm halve 0.3."""
    means = np.array([[length, 0.0, 0.0], [0.0, 0.0, -length]])
    assert straightness(0.06, means) == pytest.approx(0.15 * share, rel=1e-12)


def test_of_a_turn_only_what_the_teacher_drove_and_what_was_free_has_a_sector() -> None:
    """Five intervals about z: three against a torque, one driven by it, one under too small a torque to count."""
    turned = np.tile([0.0, 0.0, 0.1], (5, 1))
    torque = np.array([[0.3, 0.0, -0.5], [0.0, 0.3, -0.5], [0.3, 0.3, -0.5], [0.4, 0.0, 0.2], [0.0, 0.0, 0.01]])
    motion = Motion(turned, torque, (turned * torque).sum(axis=1), 0.05, 0.5, 0.5, 1.0)
    assert list(sectors(motion, teacher_driven_only=True).contact) == [True, True, True, False]
    assert list(sectors(motion).contact) == [True, True, True, True, False]


def test_who_is_told_where_the_part_is_to_go_keeps_the_push_that_was_shown() -> None:
    shown = syn.pair_of_alignments(syn.Recipe(noise_m=5e-5, noise_n=0.3))
    assert learn(shown, LearnOptions(toward=(0.0, 1.0, 0.0))) == learn(shown, LearnOptions())


def test_of_a_push_that_was_told_nothing_is_said_to_be_known_from_what_was_shown() -> None:
    """Two demonstrations that went opposite ways against a force: no one push explains both."""
    ways = [np.array([x, 0.0, 0.0]) for x in (1.0, -1.0)]
    shown = [syn.straight(way, 0.05, -8.0 * way, syn.Recipe()) for way in ways]
    options = (LearnOptions(), LearnOptions(toward=(0.0, 0.0, -1.0)))
    alone, told = (learn(shown, each)["phases"][0]["translation"] for each in options)
    assert alone["desired_direction"] is None and alone["evidence"]["explained"] is not None
    assert told["desired_direction"] == DOWN.tolist() and told["evidence"]["explained"] is None
    assert "not learned, because no one push explains what was seen" in told["evidence"]["message"]


def test_of_a_part_that_is_known_to_go_straight_the_turn_is_given_way_to_and_not_made() -> None:
    """One person turns it upright from one side, which by itself is a turn on purpose."""
    shown = syn.pair_of_alignments(syn.Recipe(noise_m=5e-5, noise_n=0.3))[:1]
    alone, told = (learn(shown, each)["phases"][0] for each in (LearnOptions(), LearnOptions(straight=True)))
    assert alone["rotation"]["desired_direction"] is not None and alone["pitch"] is not None
    turn = told["rotation"]
    assert turn["desired_direction"] is None and turn["speed"] == 0.0 and not turn["fully_compliant"]
    assert abs(turn["compliant_axes"][0][1]) > 0.99  # about y, which it was turned about
    assert turn["evidence"]["message"].startswith("the part goes straight") and turn["evidence"]["explained"] is None
    assert told["translation"]["desired_direction"] == alone["translation"]["desired_direction"]
    both = syn.pair_of_alignments(syn.Recipe(noise_m=5e-5, noise_n=0.3))  # from both sides there is none to drop
    assert learn(both, LearnOptions(straight=True)) == learn(both, LearnOptions())


def slid(towards: list[float], normal: list[float], friction: float = 0.2) -> Sectors:
    """A demonstration of three intervals, slid along a direction on a face."""
    motion = unit(np.array(towards, dtype=float))
    push = unit(friction * motion - unit(np.array(normal, dtype=float)))
    return Sectors(np.tile(motion, (3, 1)), np.tile(push, (3, 1)), np.ones(3, dtype=bool))


def test_pyramids_of_both_sides_of_a_valley_share_the_middle_most_deeply() -> None:
    found = choose([slid([1, 0, -1], [1, 0, 1]), slid([-1, 0, -1], [-1, 0, 1])])
    assert found.direction is not None and found.direction @ DOWN > np.cos(np.radians(2.0))


def test_pyramids_of_opposite_pushes_share_no_direction() -> None:
    found = choose([slid([1, 0, 0], [0, 0, 1]), slid([-1, 0, 0], [0, 0, -1])])
    assert found.direction is None and found.pyramid_angle is not None and found.pyramid_angle > np.radians(25.0)
