import math

import numpy as np
import pytest
import synthetic as syn
from hypothesis import assume, example, given
from hypothesis import strategies as st
from skillframe_lmc import sphere
from skillframe_lmc.axes import compliant_axes, straightness
from skillframe_lmc.gains import Nominal, gains
from skillframe_lmc.intervals import rotation, track, translation
from skillframe_lmc.sectors import Sectors, misses, sectors
from skillframe_lmc.settings import Settings
from skillframe_lmc.work import Work, work

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, rotation_matrix, unit

ORIGIN = np.zeros(3)
vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


def given_sectors(demonstration: Demonstration) -> Sectors:
    return sectors(translation(track(demonstration, ORIGIN, ORIGIN, "base"), Settings()))


@given(friction=st.floats(0.0, 1.5), slope=st.floats(5.0, 80.0))
def test_a_sliding_sector_is_90_degrees_minus_the_friction_angle_wide(friction: float, slope: float) -> None:
    width = given_sectors(syn.slide(slope, friction)).width
    assert np.allclose(width, math.pi / 2 - math.atan(friction), atol=1e-6)


def test_friction_narrows_the_sector_through_sensor_noise_too() -> None:
    recipe = syn.Recipe(noise_m=5e-5, noise_n=0.3)
    for friction in (0.1, 0.2, 0.4):
        width = np.degrees(given_sectors(syn.slide(45, friction, recipe)).width)
        # 2 degrees: a mean over 25 intervals of directions that position noise spreads by 1 degree each
        assert abs(width.mean() - (90.0 - math.degrees(math.atan(friction)))) < 2.0


def slow_need(D: Float, v: Float, m: Float, contact: bool) -> float:
    """The least alpha by bisection on the definition of the pyramid, written apart from the closed form."""

    def accepted(alpha: float) -> bool:
        beta = max(math.radians(5.0), alpha / 3.0)
        if not contact:
            return math.acos(np.clip(D @ v, -1.0, 1.0)) <= alpha + beta
        n = np.cross(v, m) / np.linalg.norm(np.cross(v, m))
        w = math.acos(np.clip(v @ m, -1.0, 1.0))
        ang = math.atan2(D @ np.cross(n, v), D @ v)
        between = any(-beta <= ang + turn <= w + beta for turn in (0.0, 2.0 * math.pi))  # the circle closes behind
        return abs(math.asin(np.clip(D @ n, -1.0, 1.0))) <= alpha and between

    low, high = 0.0, 12.0
    if accepted(low):
        return 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if accepted(middle) else (middle, high)
    return high


BACK = np.array([0.0, 0.0, -1.0])


@given(D=vectors, v=vectors, m=vectors, contact=st.booleans())
@example(D=np.array([0.5, 0.0, 0.866]), v=BACK, m=np.array([-1.0, 0.0, 0.0]), contact=True)  # ang: -150 degrees
@example(D=-BACK, v=BACK + np.array([5.7e-97, 0.0, 0.0]), m=np.array([-1.0, 0.0, 0.0]), contact=True)  # ang: +-pi
def test_the_closed_form_of_the_pyramid_equals_a_search_over_it(D: Float, v: Float, m: Float, contact: bool) -> None:
    D, v, m = unit(D), unit(v), unit(m)
    if np.linalg.norm(np.cross(v, m)) < 0.05:
        contact = False
    if contact:  # square to the sector's plane, a direction has no angle in it
        normal = unit(np.cross(v, m))
        assume(np.linalg.norm(D - (D @ normal) * normal) > 1e-3)
    need, _ = misses(D[None], Sectors(v[None], m[None], np.array([contact])))
    # the closed form runs in single precision, whose arc cosine is good to 1e-3 near 0 and 180 degrees
    assert need[0, 0] == pytest.approx(slow_need(D, v, m, contact), abs=5e-3)


def test_every_direction_inside_a_sector_is_accepted_without_widening() -> None:
    v, m = np.array([1.0, 0.0, 0.0]), unit(np.array([0.2, 0.0, -1.0]))
    inside = unit(np.linspace(0.0, 1.0, 11)[:, None] * v + np.linspace(1.0, 0.0, 11)[:, None] * m)
    need, depth = misses(inside, Sectors(v[None], m[None], np.array([True])))
    assert np.all(need < 1e-3)
    assert np.argmax(depth[:, 0]) in (4, 5, 6)


def test_light_touch_counts_as_free() -> None:
    assert not given_sectors(syn.slide(45, 0.2, normal_force=0.5)).contact.any()
    assert given_sectors(syn.slide(45, 0.2, normal_force=3.0)).contact.all()


def test_a_noisy_sensor_raises_what_counts_as_contact() -> None:
    quiet, noisy = (
        translation(track(syn.slide(45, 0.2, syn.Recipe(noise_n=n)), ORIGIN, ORIGIN, "base"), Settings()).load_min
        for n in (0.05, 5.0)
    )
    assert quiet == 1.0
    assert noisy > 4.0


@pytest.mark.parametrize("resolution", [8, 32])
def test_cells_have_equal_area_and_cover_the_sphere(resolution: int) -> None:
    _, centres = sphere.whole(resolution)
    assert np.allclose(np.linalg.norm(centres, axis=1), 1.0)
    assert np.allclose(centres.mean(axis=0), 0.0, atol=1e-12)
    # equal areas: the second moment of a uniform sphere is I/3, up to the size of a cell
    assert np.allclose(centres.T @ centres / len(centres), np.eye(3) / 3.0, atol=4.0 / resolution**2)
    assert sphere.solid_angle(resolution) * len(centres) == pytest.approx(4.0 * math.pi)


def test_children_lie_inside_their_parents() -> None:
    cells, parents = sphere.whole(16)
    children = sphere.centres(sphere.children(cells), 32).reshape(-1, 4, 3)
    middle = unit(children.mean(axis=1))
    # 10 degrees: a cell of this level is 14 degrees across
    assert np.degrees(np.arccos(np.clip((middle * parents).sum(-1), -1, 1))).max() < 3.0
    assert np.degrees(np.arccos(np.clip((children * parents[:, None]).sum(-1), -1, 1))).max() < 10.0


def test_knots_follow_the_path_and_not_the_clock() -> None:
    fast, slow = (
        translation(track(d, ORIGIN, ORIGIN, "base"), Settings())
        for d in (syn.slide(45, 0.2), syn.slowed(syn.slide(45, 0.2), 5.0))
    )
    for motion in (fast, slow):  # 50 mm in steps of 2 mm, which a block of 0.6 mm may overshoot
        assert 50.0 / 2.6 - 1.0 <= len(motion.displacement) <= 50.0 / 2.0
    assert fast.path == pytest.approx(0.05, abs=0.004)


def test_steps_are_halved_on_short_paths_and_grow_on_long_ones() -> None:
    def steps(length: float) -> Float:
        motion = translation(track(syn.slide(45, 0.2, length=length), ORIGIN, ORIGIN, "base"), Settings())
        result: Float = np.linalg.norm(motion.displacement, axis=1)
        return result

    assert 0.9e-3 < np.median(steps(0.012)) < 2e-3  # a block is 0.6 mm long here
    assert 2e-3 <= np.median(steps(0.06)) < 2.7e-3
    assert len(steps(1.0)) <= 80


def test_work_adds_up_to_force_times_displacement() -> None:
    motion = translation(track(syn.slide(30, 0.3, normal_force=7.0, length=0.06), ORIGIN, ORIGIN, "base"), Settings())
    done = work([motion])
    assert done.environment == 0.0
    assert done.teacher == pytest.approx(0.3 * 7.0 * motion.path, rel=1e-6)
    assert done.fraction == 0.0


def test_frictionless_sliding_is_nobodys_work() -> None:
    recipe = syn.Recipe(noise_m=5e-5, noise_n=0.3)
    assert work([translation(track(syn.slide(40, 0.0, recipe), ORIGIN, ORIGIN, "base"), Settings())]).fraction < 0.5


@given(share=st.floats(0.0, 1.0), intervals=st.integers(3, 200))
def test_only_a_surplus_beyond_chance_makes_the_environment_the_driver(share: float, intervals: int) -> None:
    ahead = round(share * intervals)
    done = Work(float(intervals - ahead), float(ahead), math.sqrt(intervals))  # intervals of one joule each
    # of n fair signs, the number of positive ones exceeds n/2 by 0.82 sqrt(n) in 5 % of the cases
    assert done.environment_drove == (ahead - intervals / 2 > 0.82 * math.sqrt(intervals))


def test_the_surplus_is_judged_from_the_intervals_themselves() -> None:
    done = work([translation(track(syn.slide(30, 0.3), ORIGIN, ORIGIN, "base"), Settings())])
    # equal intervals: the root of the sum of squares is the sum over the root of their number, 23 +- 3 of 2.2 mm
    assert done.scatter == pytest.approx(done.teacher / math.sqrt(23), rel=0.1)
    assert not done.environment_drove


def test_rotational_increments_compose_to_the_whole_turn() -> None:
    demo = syn.turning([1.0, 2.0, -0.5], 1.2, [0, 0, 0])
    motion = rotation(track(demo, ORIGIN, ORIGIN, "base"), Settings())
    axis = unit(np.array([1.0, 2.0, -0.5]))
    assert np.allclose(unit(motion.displacement), axis, atol=1e-6)
    assert motion.path == pytest.approx(1.2, abs=0.03)


@given(angle=st.floats(0.2, 1.5))
def test_balanced_sideways_means_give_one_axis_square_to_the_direction(angle: float) -> None:
    D = np.array([0.0, 0.0, -1.0])
    means = np.array([[math.sin(angle), 0.0, -math.cos(angle)], [-math.sin(angle), 0.0, -math.cos(angle)]])
    found = compliant_axes(means, D, 0.12)
    assert len(found.criterion) == 3
    wanted = 1 if 2.0 * math.sin(angle) ** 2 / 0.12**2 > math.log(2) + 2 else 0
    assert len(found.axes) == wanted
    if wanted:
        assert np.allclose(found.axes, [[1.0, 0.0, 0.0]], atol=1e-9)


def test_a_mean_direction_is_the_surer_the_longer_the_path_within_bounds() -> None:
    found = [straightness(path, np.array([[0.0, 0.0, -1.0]])) for path in (1e-4, 0.015, 0.03, 0.06, 10.0)]
    assert found == sorted(found, reverse=True)
    assert found[0] == found[1] <= 0.3
    assert found[2] / found[3] == pytest.approx(math.sqrt(2.0))
    assert found[4] == 0.1


@given(turn=st.tuples(*[st.floats(-3, 3)] * 3), free=st.integers(0, 3))
def test_stiffness_vanishes_on_compliant_axes_and_damping_nowhere(turn: tuple[float, ...], free: int) -> None:
    axes = rotation_matrix(np.array(turn))[:free]
    K, D = gains(axes, 1000.0, Nominal(2.6, 20.0))
    assert np.allclose(np.sort(np.linalg.eigvalsh(K)), np.sort([0.0] * free + [1000.0] * (3 - free)), atol=1e-6)
    assert np.allclose(K @ axes.T, 0.0, atol=1e-9)
    assert np.linalg.eigvalsh(D).min() == pytest.approx(20.0 if free else 2.0 * math.sqrt(2600.0))
    assert np.linalg.eigvalsh(D).max() == pytest.approx(20.0 if free == 3 else 2.0 * math.sqrt(2600.0))
