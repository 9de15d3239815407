"""Ways in which a breaking point is looked for: how far they go, and how far apart they are."""

from itertools import islice

import numpy as np
import pytest
from skillframe_certify import breaking_point


def test_a_ray_ends_where_the_ranges_do():
    assert breaking_point.reach(np.array([0.5, 0.0]), np.array([1.0, 0.0])) == pytest.approx(0.5)
    assert breaking_point.reach(np.array([0.0, 0.0]), np.array([0.6, -0.8])) == pytest.approx(1.25)


def test_ways_are_as_far_apart_as_can_be_and_begin_with_a_longest_ray():
    """In the plane: a corner, the opposite one, the two others, then the middles, to the pool's grain."""
    ways = np.array(list(islice(breaking_point.spread(np.zeros(2)), 8)))
    diagonals = np.abs(ways[:4, 0] * ways[:4, 1])
    assert diagonals == pytest.approx(0.5, abs=1e-3)
    assert ways[0] == pytest.approx(-ways[1], abs=0.01)
    assert np.sort(np.abs(ways[4:]).max(axis=1)) == pytest.approx(1.0, abs=1e-3)


def test_sixty_four_ways_in_six_quantities_are_further_apart_than_even_ones():
    def nearest(ways):
        return (ways @ ways.T - 2.0 * np.eye(len(ways))).max()

    ways = np.array(list(islice(breaking_point.spread(np.zeros(6)), 64)))
    assert nearest(ways) < np.cos(np.radians(40.0)) < nearest(breaking_point.directions(6)[:64])


def test_ways_from_a_corner_lead_into_the_ranges_and_in_one_quantity_they_take_turns():
    corner = np.array([1.0, 1.0, -1.0])
    ways = np.array(list(islice(breaking_point.spread(corner), 40)))
    assert np.all(ways * corner < 0.0)
    assert np.sum(list(islice(breaking_point.spread(np.zeros(1)), 32))) == 0.0
