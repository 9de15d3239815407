"""The push to be expected from all groups of intervals, in place of the deepest one."""

from __future__ import annotations

import math

import numpy as np
import pytest
import synthetic as syn
from skillframe_lmc import expected, sphere
from skillframe_lmc.expected import doubt, expected_push, explained
from skillframe_lmc.sectors import Sectors
from test_modes import FIRST_PUSH, GRID, PHI, RAMP, below, humps, legs, motions, part

from skillframe.frames import Float, unit


def at(degrees_below: float, aside: float = 0.0) -> Float:
    """Directions (1, 3) below the floor and out of the plane y = 0 [degrees]."""
    a, b = math.radians(degrees_below), math.radians(aside)
    return np.array([[math.cos(a) * math.cos(b), math.sin(b), -math.sin(a) * math.cos(b)]])


def group(way: float, push: float, count: int = 10) -> Sectors:
    """Intervals alike: their way and their push edge [degrees below the floor]."""
    rows = [np.tile(at(angle), (count, 1)) for angle in (way, push)]
    return Sectors(rows[0], rows[1], np.ones(count, dtype=bool))


def test_a_push_explains_a_sector_evenly_inside_and_half_on_an_edge() -> None:
    floor = group(0.0, 84.0)
    assert explained(at(30.0), floor) == pytest.approx(explained(at(54.0), floor), rel=1e-6)
    assert explained(at(42.0), floor) == pytest.approx(1.0, abs=1e-6)
    for edge in (0.0, 84.0):
        assert explained(at(edge), floor) == pytest.approx(0.5, abs=1e-6)


def test_a_push_fifteen_degrees_out_of_the_plane_explains_it_as_a_normal_distribution_says() -> None:
    inside = explained(at(42.0, 15.0), group(0.0, 84.0))[0]
    assert inside == pytest.approx(math.exp(-0.5), rel=1e-3)


def test_one_interval_alone_says_nothing_and_ten_or_more_say_as_much_as_a_thousand() -> None:
    assert doubt(1) == 1.0
    assert doubt(4) == pytest.approx(math.exp(-1.0))
    assert doubt(10) == doubt(1000) == 0.05


@pytest.mark.parametrize("floor", [0.03, 0.07, 0.14])
def test_the_expected_push_is_the_middle_of_what_passes_however_long_the_floor(floor: float) -> None:
    push = expected_push(motions(humps(floor, floor)))
    assert math.degrees(math.atan2(-push[2], push[0])) == pytest.approx(0.5 * FIRST_PUSH, abs=GRID)


def test_friction_moves_the_expected_push_as_it_moves_the_sectors() -> None:
    """The first push edge is 90 - phi - r below the floor: half of what phi and r take goes to the middle."""
    flatter = [legs((0.0, 0.03), (RAMP - 10.0, 0.016))] * 2
    push = expected_push(motions(flatter))
    assert math.degrees(math.atan2(-push[2], push[0])) == pytest.approx(0.5 * (90.0 - PHI - RAMP + 10.0), abs=GRID)


def test_a_flight_between_two_contacts_draws_the_push_towards_its_way() -> None:
    """A hand in the air moves the tool where it pushes: here 26 below, where the middle of the sectors is 16."""
    grounded = [legs((0.0, 0.03), (RAMP, 0.016))] * 2
    flown = [legs((0.0, 0.03), (RAMP, 0.016), (-26.0, 0.012), free=2)] * 2
    assert below(part(grounded)) == pytest.approx(0.5 * FIRST_PUSH, abs=GRID)
    assert 0.5 * FIRST_PUSH + 1.0 < below(part(flown)) < 26.0
    assert below(part(flown, expected=False)) == pytest.approx(below(part(grounded, expected=False)), abs=0.1)


@pytest.mark.parametrize("air", [None, 60.0])
def test_the_push_is_the_mean_over_the_sphere_and_not_its_most_credible_point(
    monkeypatch: pytest.MonkeyPatch, air: float | None
) -> None:
    """Summed over all cells of 0.8 degrees: 4 doubtful intervals say up to 30 degrees, and 12 up to 84.

    The most credible push is 15 below the floor, the mean some 30, and farther with a flight of 60. It is told by cells
    of 1.6 degrees, of which the first and last count or not: half a degree.
    """
    given, flight = [group(0.0, 84.0, 12), group(0.0, 30.0, 4)], None if air is None else at(air)[0]
    monkeypatch.setattr(expected, "groups", lambda motions: given)
    monkeypatch.setattr(expected, "_in_air", lambda motions: flight)
    _, cells = sphere.whole(256)
    credible = np.ones(len(cells))
    for each in given:
        e = doubt(len(each.contact))
        credible *= e + (1.0 - e) * explained(cells, each)
    if flight is not None:
        off = np.degrees(np.arccos(np.clip(cells @ flight, -1.0, 1.0)))
        credible *= 0.1 + 0.9 * np.exp(-0.5 * (off / 15.0) ** 2)
    credible[credible < 0.1 * credible.max()] = 0.0
    mean = unit(credible @ cells)
    assert math.degrees(math.acos(min(1.0, float(expected_push([]) @ mean)))) < 0.5
    assert math.degrees(math.acos(float(mean @ at(15.0)[0]))) > 5.0


def test_a_small_group_that_is_no_face_has_no_veto() -> None:
    """Six intervals down 50 below the floor, which no push over the ramp explains, beside 15 and 10 of the others."""
    shown = [legs((0.0, 0.03), (RAMP, 0.020), (-50.0, 0.012))]
    assert 0.0 < below(part(shown)) < FIRST_PUSH


def test_where_modes_do_not_decide_the_deepest_push_is_kept() -> None:
    shown = syn.valley(40.0, 0.2)
    assert part(shown) == part(shown, expected=False)
