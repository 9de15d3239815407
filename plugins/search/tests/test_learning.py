"""What is learned from a search: where, which way, and what is felt, against made-up searches whose truth is known."""

import json

import numpy as np
import pytest
from skillframe_search.contact import in_contact, push_direction, samples, surface_axes
from skillframe_search.example import PUSH, searching
from skillframe_search.exploration import CUT, Exploration
from skillframe_search.forces import ForceModel
from skillframe_search.phase import read_phase
from skillframe_search.plan import area, exerted, keyed, plan

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import learned
from skillframe.errors import InputError, UnknownName
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry
from skillframe.frames import matrix_from_quaternion, norm, quaternion_from_matrix, rotation_matrix


def learn(demonstrations, axes="base", at=None, **settings):
    return learned(registry().skill("search"), demonstrations, LearnOptions(at=at, axes=axes, settings=settings))


def phase_of(*demonstrations, **options):
    return read_phase(learn(demonstrations, **options))


def moved(demonstration, shift=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    """The same recording in another base: turned about its origin and shifted."""
    r = rotation_matrix(np.array(turn))
    attitude = r @ matrix_from_quaternion(demonstration.quaternion)
    wrench = demonstration.wrench
    return Demonstration(
        time=demonstration.time.copy(), position=demonstration.position @ r.T + shift,
        quaternion=quaternion_from_matrix(attitude), meta=demonstration.meta,
        wrench=np.concatenate([wrench[:, :3] @ r.T, wrench[:, 3:] @ r.T], axis=1),
    )  # fmt: skip


def changed(demonstration, **fields):
    values = {
        "time": demonstration.time.copy(), "position": demonstration.position.copy(),
        "quaternion": demonstration.quaternion.copy(), "wrench": demonstration.wrench.copy(),
        "meta": demonstration.meta,
    }  # fmt: skip
    return Demonstration(**{**values, **fields})


@pytest.mark.slow
def test_the_gaussian_is_that_of_the_places_against_the_start():
    """The made-up search is scaled to its own standard deviation, so that the truth is exact up to binning."""
    given = searching(deviation=(0.006, 0.003))
    found = phase_of(given).exploration
    away = given.position[:, :2] - given.position[0, :2]
    np.testing.assert_allclose(found.mean, away.mean(axis=0), atol=5e-5)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), away.std(axis=0), rtol=0.02)


@pytest.mark.slow
def test_a_planar_search_is_learned_as_planar_and_a_turning_one_in_three_dimensions():
    flat = searching()
    assert phase_of(flat).searched == ("across_1", "across_2")
    angle = np.deg2rad(5.0) * np.sin(np.linspace(0.0, 30.0, len(flat)))
    quaternion = np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle], axis=1)  # about base z
    turning = phase_of(changed(flat, quaternion=quaternion))
    assert turning.searched == ("across_1", "across_2", "turn")
    # of a sine, whose root mean square is amplitude / sqrt 2; 5 % for the part of a period at the end
    assert np.sqrt(turning.exploration.covariance[2][2]) == pytest.approx(np.deg2rad(5.0) / np.sqrt(2.0), rel=0.05)


@pytest.mark.parametrize("shift", [(0.3, -0.2, 0.1), (-1.0, 2.0, 0.5)])
@pytest.mark.slow
def test_moving_the_whole_task_changes_nothing(shift):
    given = searching()
    one, two = phase_of(given), phase_of(moved(given, shift))
    np.testing.assert_allclose(one.exploration.mean, two.exploration.mean, atol=1e-12)
    np.testing.assert_allclose(one.exploration.covariance, two.exploration.covariance, atol=1e-14)
    np.testing.assert_allclose(one.push.direction, two.push.direction, atol=1e-12)


@pytest.mark.slow
def test_in_the_axes_of_the_start_turning_the_whole_task_changes_nothing():
    given = searching()
    one = phase_of(given, axes="phase_start")
    two = phase_of(moved(given, turn=(0.4, -0.7, 1.1)), axes="phase_start")
    np.testing.assert_allclose(one.exploration.covariance, two.exploration.covariance, atol=1e-12)
    np.testing.assert_allclose(one.push.direction, two.push.direction, atol=1e-9)


def test_it_presses_against_the_mean_force():
    """The truth is straight down. Friction of 2 N over a finite search averages out to within 2 degrees."""
    push = phase_of(searching()).push.direction
    assert np.degrees(np.arccos(-push[2])) < 2.0


def test_the_axes_along_the_surface_are_orthonormal_for_any_push():
    for push in np.random.default_rng(4).standard_normal((50, 3)):
        axes = surface_axes(push / norm(push))
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(axes[2], -push / norm(push), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1.0)


@pytest.mark.parametrize("friction", [0.1, 0.2, 0.4])
@pytest.mark.slow
def test_the_force_model_finds_coulomb_s_ratio_all_ways(friction):
    """At 15 mm/s, within the demonstrated speeds, the exerted force leads along the motion by mu times the push.

    A mixture of a few Gaussians rounds the corner of Coulomb's law; a fifth in any one direction is what that costs.
    """
    phase = phase_of(*(searching(seed, friction=friction) for seed in range(3)), push=PUSH)
    for angle in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        way = np.array([np.cos(angle), np.sin(angle)])
        wrench = exerted(phase, 0.015 * way[None])[0]
        lateral = wrench[:2] @ way
        assert lateral == pytest.approx(friction * PUSH, rel=0.2)
        assert wrench[2] == pytest.approx(-PUSH, rel=0.02)


def test_scaling_the_learned_forces_keeps_the_push_exact():
    phase = phase_of(searching(), push=6.0)
    rates = np.random.default_rng(1).normal(0.0, 0.01, (200, 2))
    np.testing.assert_allclose(exerted(phase, rates)[:, :3] @ np.array(phase.push.direction), 6.0, atol=1e-9)


def test_samples_are_never_farther_out_than_the_cut():
    found = Exploration(coordinates=("across_1", "across_2"), mean=(0.01, 0.0), covariance=((4e-6, 1e-6), (1e-6, 9e-6)))
    drawn = found.draw(np.random.default_rng(0), 2000) - found.center
    distance = np.sqrt(np.einsum("ni,ij,nj->n", drawn, np.linalg.inv(found.spread), drawn))
    assert distance.max() <= CUT + 1e-9
    # the truncated normal's covariance is (1 - c^2/2 / (exp(c^2/2) - 1)) of the full one in two dimensions
    share = 1.0 - 0.5 * CUT**2 / np.expm1(0.5 * CUT**2)
    np.testing.assert_allclose(np.cov(drawn.T), share * found.spread, atol=6e-7)


def test_samples_lean_as_the_covariance_says():
    """Correlated by 0.9. 0.02 is 4 standard errors of a correlation of 0.9 over 2000 samples."""
    given = np.array([[4e-6, 5.4e-6], [5.4e-6, 9e-6]])
    found = Exploration(coordinates=("across_1", "across_2"), mean=(0.0, 0.0), covariance=tuple(map(tuple, given)))
    drawn = found.draw(np.random.default_rng(1), 2000)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(0.9, abs=0.02)
    assert np.diag(np.cov(drawn.T)) == pytest.approx(np.diag(given), rel=0.15)  # 4 of 3.2 %


def test_a_force_is_expected_by_the_regression_of_its_equation_written_out():
    """One component: E[w | v] = m_w + S_wv S_vv^-1 (v - m_v)."""
    rng = np.random.default_rng(2)
    root, mean, rates = rng.normal(size=(8, 8)), rng.normal(size=8), rng.normal(size=(5, 2))
    whole = root @ root.T + np.eye(8)
    model = ForceModel(weights=(1.0,), means=(tuple(mean),), covariances=(tuple(map(tuple, whole)),))
    expected = mean[2:] + (rates - mean[:2]) @ np.linalg.solve(whole[:2, :2], whole[:2, 2:])
    np.testing.assert_allclose(model.wrench(rates), expected, rtol=1e-9)


def test_the_way_into_the_hole_is_cut():
    given = searching()
    position = given.position.copy()
    position[-200:, 2] -= np.linspace(0.0, 0.05, 200)
    found = samples(changed(given, position=position), np.zeros(3), False)
    push = push_direction([found], 3.0)
    kept = in_contact(found, push, 3.0)
    assert (kept.place[:, 2] > -0.0025).all()
    assert len(kept.place) > 0.8 * len(found.place)


@pytest.mark.slow
def test_a_speed_is_learned_within_reason_unless_one_is_given():
    assert 0.005 <= phase_of(searching()).path.speed <= 0.02
    assert phase_of(searching(), speed=0.013).path.speed == 0.013


@pytest.mark.slow
def test_the_area_holds_every_place_of_the_search():
    for algorithm in ("sampling", "spiral", "random_walk"):
        document = learn([searching()], algorithm=algorithm, speed=0.015, time=6.0)
        low, high = area(document)
        place = plan(keyed(read_phase(document)), 1).place[:, :3]
        # smoothing may swing out of a corner by a fraction of a millimetre
        assert (place.min(axis=0) > low - 5e-4).all() and (place.max(axis=0) < high + 5e-4).all()


def test_a_search_that_never_touches_is_refused_in_a_sentence():
    given = searching()
    hover = changed(given, wrench=np.random.default_rng(0).normal(0.0, 0.3, (len(given), 6)))
    with pytest.raises(InputError, match="never press on a surface") as caught:
        learn([hover])
    assert "\n" not in str(caught.value)


def test_a_search_that_stays_in_one_place_is_refused_in_a_sentence():
    given = searching(deviation=(0.0001, 0.0001))
    with pytest.raises(InputError, match="hold no search"):
        learn([given])


def test_unknown_settings_points_and_axes_are_refused():
    with pytest.raises(InputError, match="stiffness"):
        learn([searching()], stifness=1.0)
    with pytest.raises(UnknownName, match="tip"):
        learn([searching()], at="tipp")
    with pytest.raises(InputError, match="algorithm"):
        learn([searching()], algorithm="spirals")
    with pytest.raises(InputError, match="layers"):
        learn([searching()], algorithm="spiral", layers=3)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("push.force", -1.0, "push.force"), ("path.speed", 0.0, "path.speed"), ("stop.drop_m", -0.001, "stop.drop_m"),
        ("push.direction", [0.0, 0.0, -2.0], "unit vector"), ("path.kind", "zigzag", "zigzag"),
        ("searched", ["across_2", "across_1"], "in order"), ("exploration", None, "exploration"),
        ("stop.time_s", 1e4, "300 s"), ("path.reach", 1e-6, "reach"),
    ],
)  # fmt: skip
@pytest.mark.slow
def test_a_broken_document_is_refused_by_key(key, value, said):
    document = json.loads(json.dumps(learn([searching()])))
    place = document["phases"][0]
    *groups, last = key.split(".")
    for group in groups:
        place = place[group]
    place[last] = value
    with pytest.raises(InputError, match=said):
        registry().skill("search").check(document)
