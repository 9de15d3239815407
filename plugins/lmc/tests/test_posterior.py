"""The posterior over pushes against closed forms: sectors of known floors, ramps and walls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import synthetic as syn
from scipy.special import ndtr
from skillframe_lmc import intervals, posterior, sphere
from skillframe_lmc.pieces import Pieces, pushed, some, whole_witness
from skillframe_lmc.posterior import Witnesses, decide, explained, log_probability, witnesses
from skillframe_lmc.settings import LEVER_M, Settings

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, rotation_matrix, unit

MU, RAMP = 0.1, 52.0
PHI = math.degrees(math.atan(MU))
FIRST_PUSH = 90.0 - PHI - RAMP  # the ramp's push edge, below the floor
WHOLE = 0.0045
HERE = np.zeros(3)


def legs(*parts: tuple[float, float], free: Sequence[int] = (), recipe: syn.Recipe | None = None) -> Demonstration:
    """Slides in the plane y = 0 by (angle of its way above x in degrees, length in m), those in `free` in the air."""
    points, forces, here = [], [], np.array([0.4, 0.1, 0.3])
    for i, (angle, length) in enumerate(parts):
        a = math.radians(angle)
        along, normal = np.array([math.cos(a), 0.0, math.sin(a)]), np.array([-math.sin(a), 0.0, math.cos(a)])
        normal = normal if abs(angle) < 90.0 else -normal
        n = round(length / 0.03 * 500.0)
        points.append(here + np.linspace(0.0, length, n)[:, None] * along)
        forces.append(np.tile((i not in free) * 8.0 * (normal - MU * along), (n, 1)))
        here = points[-1][-1]
    force = np.concatenate(forces)
    turn = np.tile(syn.DOWN, (len(force), 1, 1))
    given = np.concatenate([force, 0.0 * force], axis=1)
    return syn.recording(np.concatenate(points), turn, given, recipe or syn.Recipe())


def pieces_of(shown: Sequence[Demonstration], *, turned_too: bool = False) -> Pieces:
    tracks = [intervals.track(each, HERE, HERE, "base") for each in shown]
    motions = [intervals.translation(track, Settings()) for track in tracks]
    return pushed(tracks, motions, Settings(), turned_too=turned_too)


def choice(shown: Sequence[Demonstration], exists: float = 0.4) -> posterior.Choice:
    return decide(witnesses(pieces_of(shown), WHOLE), exists)


def push(shown: Sequence[Demonstration]) -> Float:
    direction = choice(shown).direction
    assert direction is not None
    return direction


def below(direction: Float) -> float:
    """Angle below the floor, in the plane y = 0 [degrees]."""
    return math.degrees(math.atan2(-direction[2], direction[0]))


def apart(a: Float, b: Float) -> float:
    return math.degrees(math.acos(np.clip(a @ b, -1.0, 1.0)))


def at(degrees_below: float, aside: float = 0.0) -> Float:
    a, b = math.radians(degrees_below), math.radians(aside)
    return np.array([[math.cos(a) * math.cos(b), math.sin(b), -math.sin(a) * math.cos(b)]])


def face(way: float, edge: float, length: float = 0.05, turning: float = 0.0) -> Pieces:
    """One piece by its way and far edge [degrees below the floor]."""
    return Pieces(
        at(way), at(edge), at(edge), np.ones(1, dtype=bool), np.array([length]), np.array([turning]),
        np.zeros(1, dtype=int),
    )  # fmt: skip


def several(*each: Pieces) -> Pieces:
    return Pieces(*(np.concatenate(parts) for parts in zip(*each, strict=True)))


# --- explanation


def test_a_push_explains_a_sector_evenly_inside_and_half_on_its_far_edge() -> None:
    floor = face(0.0, 84.0)
    for angle in (0.0, 30.0, 54.0):
        assert explained(at(angle), floor)[0, 0] == pytest.approx(1.0, abs=1e-6)
    assert explained(at(84.0), floor)[0, 0] == pytest.approx(0.5, abs=1e-5)
    assert explained(at(94.0), floor)[0, 0] == pytest.approx(0.0228, abs=1e-3)  # two standard deviations


@pytest.mark.parametrize("off", [(-15.0, 0.0), (42.0, 15.0)])
def test_before_the_near_edge_and_out_of_the_plane_a_push_explains_as_an_aim_that_is_off(off) -> None:
    assert explained(at(*off), face(0.0, 84.0))[0, 0] == pytest.approx(math.exp(-0.5), rel=2e-3)


def test_where_a_piece_turned_it_is_the_push_itself_that_counts() -> None:
    for turning in (0.25, 1.0):
        inside = explained(at(74.0), face(0.0, 84.0, turning=turning))[0, 0]
        slid = explained(at(74.0), face(0.0, 84.0))[0, 0]
        assert inside == pytest.approx(slid * (1.0 - turning + turning * math.exp(-0.5)), rel=1e-3)


# --- witnesses


@pytest.mark.parametrize("length", [0.002, 0.0045, 0.02, 0.2])
def test_weights_of_a_contact_add_up_to_one_witness_however_long(length: float) -> None:
    count = 40
    each = several(*[face(0.0, 84.0, length / count)] * count)
    assert witnesses(each, WHOLE).weight.sum() == pytest.approx(1.0 - math.exp(-length / WHOLE), rel=1e-9)


def test_demonstrations_count_alike() -> None:
    other = face(-20.0, 40.0, 0.1)._replace(demonstration=np.ones(1, dtype=int))
    both = witnesses(several(face(0.0, 84.0, 0.004), other), WHOLE)
    assert both.weight[0] == pytest.approx(both.weight[1])


# --- decision


@pytest.mark.parametrize("ramp", [RAMP, RAMP - 10.0])
def test_the_push_over_a_hump_is_near_the_middle_of_what_passes(ramp: float) -> None:
    """Between the floor's way, softened by 15 degrees, and the ramp's push edge, softened by 5.

    Both sectors lie in the plane y = 0, so that the plateau P >= P_max / 10 is a double integral over the angle in it
    and the angle out of it.
    """
    first = 90.0 - PHI - ramp
    found = push([legs((0.0, 0.05), (ramp, 0.016))] * 2)
    angle, out = np.meshgrid(np.arange(-90.0, 120.0, 0.25), np.arange(-60.0, 60.0, 0.5))
    low = np.exp(-0.5 * (np.minimum(angle, 0.0) / 15.0) ** 2 - 0.5 * (out / 15.0) ** 2)
    steep = np.exp(-0.5 * (np.minimum(angle + ramp, 0.0) / 15.0) ** 2 - 0.5 * (out / 15.0) ** 2)
    logs = np.log(0.05 + 0.95 * low * ndtr((90.0 - PHI - angle) / 5.0))
    logs += np.log(0.05 + 0.95 * steep * ndtr((first - angle) / 5.0))
    p = np.where(logs >= logs.max() - math.log(10.0), np.exp(logs), 0.0) * np.cos(np.radians(out)) ** 2
    middle = math.degrees(math.atan2((p * np.sin(np.radians(angle))).sum(), (p * np.cos(np.radians(angle))).sum()))
    # the piece that lies across the corner weighs 0.27, and its near edge is 6 degrees above the floor
    assert below(found) == pytest.approx(middle, abs=1.2)
    assert 0.0 < below(found) < first and abs(found[1]) < math.sin(math.radians(1.0))


def test_the_middle_of_a_valley_is_straight_down_within_a_degree() -> None:
    for slope in (20.0, 45.0, 60.0):
        assert apart(push(syn.valley(slope, 0.2)), np.array([0.0, 0.0, -1.0])) < 1.0


def test_floors_of_12_to_110_mm_move_the_push_by_less_than_2_degrees() -> None:
    found = [push([legs((0.0, floor), (RAMP, 0.016)), legs((0.0, 1.3 * floor), (RAMP, 0.016))])
             for floor in (0.012, 0.03, 0.07, 0.110)]  # fmt: skip
    assert max(apart(a, b) for a in found for b in found) < 2.0


@pytest.mark.parametrize("slope", [30.0, 45.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_recording_played_twice_moves_the_push_by_less_than_3_degrees(slope: float, seed: int) -> None:
    shown = syn.wavering(slope, 0.2, 8.0, seed)
    assert apart(push([shown[0], *shown]), push(shown)) < 3.0


@pytest.mark.parametrize("back", [0.008, 0.03])
def test_a_loop_in_the_path_moves_the_push_by_less_than_2_degrees(back: float) -> None:
    """Half-way along the floor: back the way it came in the air, and there again."""
    plain = [legs((0.0, 0.04), (RAMP, 0.016))] * 2
    looped = [legs((0.0, 0.02), (180.0, back), (0.0, back + 0.02), (RAMP, 0.016), free=(1,))] * 2
    assert apart(push(plain), push(looped)) < 2.0


def test_a_wrong_first_try_is_a_loop_and_no_witness() -> None:
    tried = pieces_of([legs((180.0, 0.03), (0.0, 0.06), (RAMP, 0.016))])
    assert not (tried.motion[:, 0] < -0.9).any()
    assert tried.length[tried.motion[:, 2] < 0.1].sum() == pytest.approx(
        0.03, abs=0.005
    )  # the floor once, less corners


def test_a_tool_that_is_thrown_counts_the_path_of_its_time_at_typical_speed() -> None:
    """The last 20 mm at five times the speed count 4, and the floor before it its length."""
    shown = legs((0.0, 0.06), (-45.0, 0.02))
    thrown = shown.time > 2.0
    faster = replace(shown, time=np.where(thrown, 2.0 + (shown.time - 2.0) / 5.0, shown.time))
    even, uneven = pieces_of([shown]), pieces_of([faster])
    for pieces, expected in ((even, 0.02), (uneven, 0.004)):
        assert pieces.length[pieces.motion[:, 2] < -0.5].sum() == pytest.approx(expected, rel=0.15)
        assert pieces.length[pieces.motion[:, 2] > -0.1].sum() == pytest.approx(0.06, rel=0.05)


def test_a_fast_approach_does_not_make_a_throw_typical() -> None:
    """100 mm in the air at five times the speed, the floor, and 20 mm at five times the speed again, which count 4."""
    shown = legs((-30.0, 0.1), (0.0, 0.06), (-45.0, 0.02), free=(0,))
    ends = np.interp(shown.time, [0.0, 10.0 / 3.0, 16.0 / 3.0, 6.0], [0.0, 2.0 / 3.0, 8.0 / 3.0, 2.8])
    pieces = pieces_of([replace(shown, time=ends)])
    thrown = pieces.contact & (pieces.motion[:, 2] < -0.6)
    assert pieces.length[thrown].sum() == pytest.approx(0.004, rel=0.15)
    assert pieces.length[pieces.contact & (pieces.motion[:, 2] > -0.1)].sum() == pytest.approx(0.06, rel=0.05)


def test_a_flight_draws_the_push_towards_its_way() -> None:
    """A hand in the air moves the tool where it pushes."""
    grounded = push([legs((0.0, 0.03), (RAMP, 0.016))] * 2)
    flown = push([legs((0.0, 0.03), (RAMP, 0.016), (-26.0, 0.012), free=(2,))] * 2)
    assert below(grounded) + 1.0 < below(flown) < 26.0


def test_a_short_wrong_contact_has_no_veto() -> None:
    """12 mm down 50 below the floor, which no push over the ramp explains."""
    found = push([legs((0.0, 0.03), (RAMP, 0.020), (-50.0, 0.012))])
    assert 0.0 < below(found) < FIRST_PUSH


@pytest.mark.parametrize(("degrees", "found"), [(30.0, True), (60.0, False), (90.0, False), (180.0, False)])
def test_two_ways_in_the_air_have_a_push_only_where_one_aim_explains_both(degrees: float, found: bool) -> None:
    given = choice([legs((side * 0.5 * degrees, 0.05), free=(0,)) for side in (1.0, -1.0)])
    assert (given.direction is not None) == found
    assert given.explained == pytest.approx(1.0) if found else given.explained < 0.51
    assert (given.solid_angle > 0.0) == found


def test_the_plateau_of_one_free_way_is_the_cone_that_its_bell_says() -> None:
    """With one witness it ends half-way: 0.1 + 0.9 S = 1 / sqrt(10), so that angle = 15 sqrt(-2 log S)."""
    given = choice([legs((0.0, 0.1), free=(0,))])
    s = (10.0**-0.5 - 0.1) / 0.9
    opening = math.radians(15.0 * math.sqrt(-2.0 * math.log(s)))
    assert given.solid_angle == pytest.approx(2.0 * math.pi * (1.0 - math.cos(opening)), rel=0.05)  # cells on its rim
    assert given.half_width == pytest.approx(opening, abs=math.radians(1.6))


def test_the_push_is_the_mean_over_the_sphere_and_not_its_most_credible_point() -> None:
    """Summed over all cells of 0.8 degrees, beside the search from coarse to fine."""
    given = Witnesses(several(face(0.0, 84.0), face(0.0, 30.0)), np.array([1.0, 0.5]))
    _, cells = sphere.whole(256)
    logs = log_probability(cells, given)
    p = np.where(logs >= logs.max() - math.log(10.0), np.exp(logs - logs.max()), 0.0)
    found = decide(given, 0.4).direction
    assert found is not None
    assert apart(found, unit(p @ cells)) < 0.5
    assert apart(found, cells[np.argmax(logs)]) > 5.0


def test_it_turns_with_the_recording() -> None:
    shown, turn = syn.wavering(45, 0.2, 8.0, 3), rotation_matrix(np.array([0.4, -1.1, 0.7]))
    # cells of 1.6 degrees at the plateau's rim
    assert apart(turn @ push(shown), push([syn.rotated(each, turn) for each in shown])) < 1.0


# --- tools that turn


def test_a_pure_pivot_s_edge_is_square_to_its_motion() -> None:
    """A hand's torque alone swings the point c along v: a push without torque has to do that work, along v."""
    shown = [syn.levering()]
    free = pieces_of(shown)
    size = np.arccos(np.clip((free.edge * free.push).sum(axis=-1), -1.0, 1.0))
    assert np.degrees(size.max()) <= 30.0 + 1e-6


def test_without_a_turn_and_where_the_skill_turns_too_the_edge_is_the_force() -> None:
    slid = pieces_of(syn.valley(45, 0.2))
    np.testing.assert_allclose(slid.edge, slid.push, atol=1e-12)
    assert not slid.turning.any()
    tilted = syn.pair_of_alignments()
    np.testing.assert_allclose(pieces_of(tilted, turned_too=True).edge, pieces_of(tilted, turned_too=True).push)
    assert np.abs(pieces_of(tilted).edge - pieces_of(tilted).push).max() > 0.05


def test_the_edge_is_where_a_push_does_no_work_after_friction() -> None:
    """D.g = 0 with g = v - F (F.v + T.w / |F|) / |F|, F a unit vector."""
    from skillframe_lmc.pieces import _shown

    v, F, work = np.array([[0.002, 0.0, 0.0005]]), np.array([[-1.0, 0.0, 6.0]]), np.array([-0.003])
    found = _shown(v, F, work, 1.0, np.array([0.002]), 0)
    size = np.linalg.norm(F)
    g = v - F / size * ((F / size * v).sum() + work / size)
    assert (found.edge * g).sum() == pytest.approx(0.0, abs=1e-12)
    assert found.edge[0] @ found.push[0] < 1.0


def test_a_demonstration_without_a_piece_leaves_the_weights_of_the_others() -> None:
    every = pieces_of([legs((0.0, 0.03)), legs((0.0, 0.02), (RAMP, 0.01)), legs((0.0, 0.04))])
    left = some(every, every.demonstration != 1)
    numbered = left._replace(demonstration=left.demonstration // 2)
    assert np.array_equal(witnesses(left, WHOLE).weight, witnesses(numbered, WHOLE).weight)


def test_free_ways_are_one_witness_as_far_as_their_motions_agree() -> None:
    """Two long ways, 15 degrees apart: 2 / (1 + kappa) witnesses, with kappa of the motion alone."""
    free = pieces_of([legs((0.0, 0.1), (15.0, 0.1), free=(0, 1))])
    kappa = math.exp(-0.5 * (15.0 / 20.0) ** 2)
    assert witnesses(free, WHOLE).weight.sum() == pytest.approx(2.0 / (1.0 + kappa), rel=0.02)


def test_a_free_way_is_no_witness_of_a_contact() -> None:
    """A floor after a long way through the air along it: two witnesses."""
    both = pieces_of([legs((0.0, 0.1), (0.0, 0.1), free=(0,))])
    seen = witnesses(both, WHOLE)
    assert seen.weight[seen.pieces.contact].sum() == pytest.approx(1.0, abs=0.02)
    assert seen.weight[~seen.pieces.contact].sum() == pytest.approx(1.0, abs=0.02)


def test_two_slides_whose_sectors_do_not_meet_have_no_push_although_half_of_them_is_explained() -> None:
    """110 degrees apart: the plateau is over both sectors, and its middle is in neither."""
    found = choice([legs((-80.0, 0.03), (30.0, 0.03))])
    assert found.direction is None
    assert found.explained > 0.5


def test_a_contact_of_three_pieces_or_a_turn_of_four_weighs_as_much_as_its_exponential_says() -> None:
    settings = Settings()
    assert whole_witness("translation", settings) == pytest.approx(3.0 * 0.75 * settings.step_m)
    assert whole_witness("rotation", settings) == pytest.approx(4.0 * 0.5 * settings.step_m / LEVER_M)
    contact = pieces_of([legs((0.0, 0.009))])
    seen = witnesses(contact, whole_witness("translation", settings))
    assert seen.weight.sum() == pytest.approx(1.0 - math.exp(-contact.length.sum() / 0.0045), abs=0.01)
