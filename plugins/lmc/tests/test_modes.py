"""Contact modes: an intersection knows nothing of how long each face was slid on."""

from __future__ import annotations

import math

import numpy as np
import pytest
import synthetic as syn
from skillframe_lmc.axes import compliant_axes
from skillframe_lmc.intervals import Motion, track, translation
from skillframe_lmc.learner import learn
from skillframe_lmc.modes import contact_modes, one_sided, without_wrong_try
from skillframe_lmc.settings import Settings

from skillframe.demonstration.record import Demonstration
from skillframe.extend.records import Document, LearnOptions

MU, RAMP = 0.1, 52.0
PHI = math.degrees(math.atan(MU))
FIRST_PUSH = 90.0 - PHI - RAMP  # the ramp's push edge, below the floor
GRID = 1.5  # degrees: finest cells of the search are 1.6 wide, the last step inside a disc removes most of that


def legs(*parts: tuple[float, float], free: int = -1) -> Demonstration:
    """Slides in the plane y = 0 by (angle of its way above x in degrees, length in m). One may be without contact."""
    points, forces, here = [], [], np.array([0.4, 0.1, 0.3])
    for i, (angle, length) in enumerate(parts):
        a = math.radians(angle)
        along, normal = np.array([math.cos(a), 0.0, math.sin(a)]), np.array([-math.sin(a), 0.0, math.cos(a)])
        normal = normal if abs(angle) < 90.0 else -normal
        n = round(length / 0.03 * 500.0)
        points.append(here + np.linspace(0.0, length, n)[:, None] * along)
        forces.append(np.tile((i != free) * 8.0 * (normal - MU * along), (n, 1)))
        here = points[-1][-1]
    force = np.concatenate(forces)
    turn = np.tile(syn.DOWN, (len(force), 1, 1))
    return syn.recording(np.concatenate(points), turn, np.concatenate([force, 0.0 * force], axis=1), syn.Recipe())


def humps(*floors: float, before: float = 0.0) -> list[Demonstration]:
    wrong = [(180.0, before)] if before else []
    return [legs(*wrong, (0.0, floor + before), (RAMP, 0.016)) for floor in floors]


def part(demonstrations: list[Demonstration], **settings: object) -> Document:
    document: Document = learn(demonstrations, LearnOptions(settings=settings))["phases"][0]["translation"]
    return document


def below(document: Document) -> float:
    x, _, z = document["desired_direction"]
    return math.degrees(math.atan2(-z, x))


@pytest.mark.parametrize("floor", [0.012, 0.055, 0.15])
def test_the_push_over_a_hump_does_not_depend_on_the_floor_s_length(floor: float) -> None:
    """Deepest in [0, 90 - phi - r], between the floor's motion and the ramp's push edge, is its middle."""
    found = part(humps(floor, floor, 1.3 * floor))
    assert below(found) == pytest.approx(0.5 * FIRST_PUSH, abs=GRID)
    assert len(found["compliant_axes"]) == 1


def test_votes_by_intervals_lose_the_ramp_behind_a_long_floor() -> None:
    """With 16 mm of 166 the ramp is less than the share of outliers: the push is one that the ramp stops."""
    found = part(humps(0.15, 0.15, 0.15), contact_modes=False)
    assert below(found) > FIRST_PUSH


def test_a_wrong_first_try_changes_nothing() -> None:
    assert below(part(humps(0.02, 0.03, before=0.03))) == pytest.approx(0.5 * FIRST_PUSH, abs=GRID)


def test_what_came_before_the_farthest_back_point_is_dropped() -> None:
    here = np.zeros(3)
    motion = translation(track(humps(0.02, before=0.01)[0], here, here, "base"), Settings())
    kept = without_wrong_try(motion)
    assert np.all(kept.displacement[:, 0] > 0.0)
    assert 0.01 / 0.002 - 1 <= len(motion.work) - len(kept.work) <= 0.01 / 0.002 + 1  # steps of 2 mm over 10 mm
    assert len(kept.load) == len(kept.work) == len(kept.displacement)


def motions(demonstrations: list[Demonstration]) -> list[Motion]:
    here = np.zeros(3)
    return [translation(track(d, here, here, "base"), Settings()) for d in demonstrations]


def test_modes_are_the_faces_and_rolling_over_an_edge_is_none() -> None:
    """6 mm whose way and force are those of no face: 3 intervals, fewer than a mode has."""
    shown = [legs((0.0, 0.04), (RAMP, 0.016), (0.5 * RAMP - 60.0, 0.006))]
    modes = contact_modes(motions(shown))
    assert len(modes) == 2
    assert [len(mode.contact) for mode in modes] == sorted((len(mode.contact) for mode in modes), reverse=True)
    for mode, angle in zip(modes, (0.0, RAMP), strict=True):
        ways = np.degrees(np.arctan2(mode.motion[:, 2], mode.motion[:, 0]))
        assert np.median(ways) == pytest.approx(angle, abs=0.1)  # one interval of a mode may lie across a corner


def test_faces_on_opposite_sides_of_the_push_are_not_one_sided_and_keep_their_votes() -> None:
    shown = syn.valley(40.0, 0.2)
    assert not one_sided(contact_modes(motions(shown)), np.array([0.0, 0.0, -1.0]))
    assert part(shown) == part(shown, contact_modes=False)
    floor_and_ramp = contact_modes(motions(humps(0.03, 0.04)))
    assert one_sided(floor_and_ramp, np.array([math.cos(0.25), 0.0, -math.sin(0.25)]))


def test_a_tool_that_turned_keeps_its_votes() -> None:
    """Its contacts turn with it, so that one of them would make several modes."""
    shown = syn.pair_of_alignments()
    assert part(shown) == part(shown, contact_modes=False)


def test_the_outlier_share_is_what_lets_a_short_wrong_way_be_forgotten() -> None:
    """6 of 50 mm up along a wall: without outliers no push explains it, with them it is as if it were not there."""
    shown = [legs((-40.0, 0.044), (110.0, 0.006))] * 2
    assert part(shown, contact_modes=False)["desired_direction"] is not None
    assert part(shown, contact_modes=False, quantile=1.0)["desired_direction"] is None


def test_without_the_price_of_an_axis_every_direction_across_the_push_would_give_way() -> None:
    """Means that stray by 5 degrees along y beside 45 along x: one axis pays its price, the second does not."""
    means = np.array([[0.7, 0.06, -0.7], [-0.7, -0.06, -0.7], [0.7, -0.06, -0.7]])
    found = compliant_axes(means, np.array([0.0, 0.0, -1.0]), 0.12)
    price = math.log(3.0) + 2.0
    assert len(found.axes) == 1
    assert int(np.argmin([c - d * price for d, c in enumerate(found.criterion)])) == 2
