"""What friction does to a compliant spiral: the closed form, in the simulated world, and gains that cure it."""

import numpy as np
import pytest
from skillframe_search.contact import Samples
from skillframe_search.deadband import STIFFEST, Gains, dead_band, freed, friction_of
from skillframe_search.example import searching
from skillframe_search.phase import Dither, read_phase
from skillframe_search.plan import dithered
from skillframe_search.simple import FINER, there_and_back
from test_search_in_contact import given, run

from skillframe.document.file import learned
from skillframe.extend import LearnOptions
from skillframe.extend.registry import registry

FRICTION, PUSH, STIFFNESS, SPEED, PITCH = 0.5, 10.0, 2000.0, 0.012, 0.0008
DOWN = np.array([0.0, 0.0, -1.0])


def spiral(radius, push=PUSH, stiffness=STIFFNESS, **more):
    """A spiral to a radius and no farther, on a plane without a hole in reach."""
    time = 0.5 + np.pi * radius**2 / PITCH / SPEED
    found = given("spiral", push__force=push, stiffness__translation=stiffness, path__radius=radius,
                  path__pitch=PITCH, path__speed=SPEED, stop__time_s=time, **more)  # fmt: skip
    return run(found, offset=(0.021, 0.0, 0.0), duration=time + 3.0, params={"friction": FRICTION})


def reached(result):
    position = result.traces[0].position
    return float(np.hypot(*(position - position[0])[:, :2].T).max())


@pytest.mark.slow
def test_the_tip_of_a_compliant_spiral_stays_until_the_commanded_radius_exceeds_friction_over_stiffness():
    """mu N / K is 2.5 mm. The speed that is fed forward helps by D v, 1.6 N of the 5: 2.37 mm."""
    trace = spiral(0.0036).traces[0]
    moved = np.hypot(*(trace.position - trace.position[0])[:, :2].T)
    touched = float(trace.time[np.argmax(trace.wrench[:, 2] > 3.0)])
    commanded = np.sqrt(np.maximum(trace.time - touched, 0.0) * SPEED * PITCH / np.pi)  # the length of a spiral
    assert moved[commanded < 0.0022].max() < 0.00035  # the tool bends, and moves before the push has grown
    assert moved[commanded < 0.0033].max() > 0.0005
    assert moved.max() < 0.0036 - 0.001  # and then lags behind


@pytest.mark.slow
def test_a_search_that_friction_holds_says_so():
    held = spiral(0.0021)
    assert reached(held) < 0.0005
    assert "commanded 2.1 mm, reached 0." in held.reason[0] and held.reason[0].endswith(": friction holds the tool")


@pytest.mark.slow
def test_gains_made_for_the_friction_take_the_tip_where_it_is_sent():
    gains = freed(FRICTION, Gains(PUSH, STIFFNESS), 0.0016)
    moved = spiral(0.0021, push=gains.push, stiffness=gains.stiffness)
    lag = dead_band(FRICTION, gains)
    assert reached(moved) == pytest.approx(np.sqrt(0.0021**2 - lag**2), rel=0.15)
    assert "friction holds" not in moved.reason[0]


@pytest.mark.parametrize(
    ("friction", "push", "stiffness"),
    [(0.5, 10.0, 2000.0), (0.9, 30.0, 800.0), (0.4, 9.0, 2000.0), (0.5, 60.0, 5000.0)],
)
def test_freed_gains_have_a_dead_band_of_half_a_pitch_and_no_more_force_or_less_stiffness(friction, push, stiffness):
    given_gains, pitch = Gains(push, stiffness), 0.0016
    found = freed(friction, given_gains, pitch)
    assert dead_band(friction, found) == pytest.approx(0.5 * pitch, rel=1e-12)
    assert found.push <= push and stiffness <= found.stiffness <= max(STIFFEST, stiffness)
    assert found.push == push or found.stiffness >= STIFFEST  # lighter only where stiffer is not enough


def test_gains_whose_dead_band_is_within_the_pitch_stay_as_they_are():
    for friction in (0.0, 0.2, 0.32):
        assert freed(friction, Gains(10.0, 2000.0), 0.0016) == Gains(10.0, 2000.0)


def test_friction_is_read_from_the_wrench_while_sliding_whatever_the_push():
    rng = np.random.default_rng(1)
    rate, pressed = 0.02 * rng.standard_normal((400, 6)), rng.uniform(2.0, 20.0, 400)
    rate[:, 2] = 0.0
    across = rate[:, :3] / np.linalg.norm(rate[:, :3], axis=1, keepdims=True)
    wrench = np.zeros((400, 6))
    wrench[:, :3] = -pressed[:, None] * DOWN - 0.37 * pressed[:, None] * across
    wrench[:80, :3] *= 3.0  # knocks against an edge change both alike
    assert friction_of(Samples(0.0 * rate, rate, wrench), DOWN) == pytest.approx(0.37, rel=1e-9)
    assert friction_of(Samples(0.0 * rate, 0.0 * rate, wrench), DOWN) is None  # it never slid


@pytest.mark.slow
def test_a_spiral_is_freed_of_the_friction_that_was_demonstrated_and_a_search_is_not():
    """A search exerts the friction that it has learned."""
    shown = searching(friction=0.5)
    phases = {
        algorithm: read_phase(learned(registry().skill("search"), [shown], LearnOptions(settings=settings)))
        for algorithm, friction in (("spiral", None), ("sampling", None), ("random_walk", 0.0))
        for settings in ({"algorithm": algorithm, "friction": friction},)
    }
    found = phases["spiral"]
    assert found.evidence["friction"] == pytest.approx(0.5, rel=0.1)  # bins of 40 ms, slow ones included
    assert dead_band(0.5, Gains(found.push.force, found.stiffness.translation)) < 0.001
    assert all(phases[kind].stiffness.translation == STIFFNESS for kind in ("sampling", "random_walk"))


def test_a_spiral_with_a_radius_looks_everywhere_within_it_and_each_pass_is_finer():
    pitch, radius, step = 6e-4, 4e-3, 1e-3
    for passes in (1, 2, 3):
        way = there_and_back(pitch, radius, 0.04, 0.5, passes, step)
        assert np.abs(np.hypot(*way.T).max() - radius) < 5e-5  # a step of 1 ms at 40 mm/s
        assert np.hypot(*np.diff(way, axis=0).T).max() < 1.05 * 0.04 * step + 1e-6  # chords; the passes join
        places = np.random.default_rng(0).uniform(-radius, radius, (300, 2))
        places = places[np.hypot(*places.T) < radius - pitch]
        apart = np.sqrt(((places[:, None] - way) ** 2).sum(axis=2)).min(axis=1)
        assert apart.max() < 0.55 * pitch * FINER ** (passes - 1)  # half a pitch between turns


def test_a_dither_turns_in_the_surface_and_about_its_normal():
    axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    torque = dithered(Dither(tilt_nm=0.2, tilt_hz=2.5, turn_nm=0.3, turn_hz=5.0), axes, 21)
    np.testing.assert_allclose(np.linalg.norm(torque[:, 1:], axis=1), 0.2)
    np.testing.assert_allclose(torque[0], torque[20], atol=1e-12)  # 0.4 s is a whole number of turns of both
    assert np.abs(torque[:, 0]).max() == pytest.approx(0.3, rel=0.1)  # sampled every 20 ms


def test_what_is_likelier_is_searched_out_and_in_first_and_then_all_of_it_from_the_middle():
    plain = there_and_back(6e-4, 0.005, 0.04, 0.5, 3, 1e-3)
    both = there_and_back(6e-4, 0.005, 0.04, 0.5, 3, 1e-3, inner=0.0025)
    near = there_and_back(6e-4, 0.0025, 0.04, 0.5, 2, 1e-3)
    np.testing.assert_array_equal(both[: len(near)], near)
    np.testing.assert_array_equal(both[len(near) :], plain[1:])
    middle = np.hypot(*near[-1])
    assert middle < 1e-4 and np.hypot(*np.diff(both, axis=0).T).max() < 1.01 * 0.04 * 1e-3 + middle  # and on from there
