"""The admittance law: exact solutions, a stiff wall in one dimension, and the pushes that it must not make."""

import numpy as np
import pytest
from scipy.linalg import expm

from skillframe.control.admittance import QUIET_FORCE, QUIET_TORQUE, AdmittanceLaw, Bounds, RingWatch, felt
from skillframe.errors import InputError
from skillframe.frames import Pose, rotation_matrix, rotation_vector
from skillframe.robot.interface import VIRTUAL_INERTIA, VIRTUAL_MASS
from skillframe.skill import Command, Impedance, no_reasons
from tests.oracle.stiff_wall import Loop, formula, least_damping, spectral_radius, touch_down

WIDE = Bounds((1e-6, 1e-6), (np.inf, np.inf))
K, D = np.diag([900.0, 400.0, 0.0, 20.0, 20.0, 0.0]), np.diag([300.0, 200.0, 100.0, 2.0, 3.0, 4.0])


def command(stiffness=K, damping=D, position=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0), twist=(0.0,) * 6, push=(0.0,) * 6,
            count=1):  # fmt: skip
    pose = Pose(np.tile(position, (count, 1)), np.tile(rotation_matrix(np.array(turn)), (count, 1, 1)))
    rows = [np.tile(np.array(row, dtype=float), (count, 1)) for row in (twist, push)]
    return Command(pose, rows[0], Impedance(stiffness, damping), rows[1], np.zeros(count, int), no_reasons(count))


def moved(law, wanted, wrench, seconds, dt):
    """Way (6,) after some time; small turns add up as rotation vectors about one axis do."""
    position, rotation = np.zeros((1, 3)), np.eye(3)[None]
    for _ in range(round(seconds / dt)):
        law.step(wanted, Pose(position, rotation), wrench)
        position = position + dt * law.twist[:, :3]
        rotation = rotation_matrix(dt * law.twist[:, 3:]) @ rotation
    return np.concatenate([position[0], rotation_vector(rotation)[0]])


def exact(axis, force, target, seconds):
    """Place along an axis after some time of m x'' + d x' + k (x - target) = force from rest."""
    mass = VIRTUAL_MASS if axis < 3 else VIRTUAL_INERTIA
    k, d = K[axis, axis], D[axis, axis]
    system = np.array([[0, 1, 0], [-k / mass, -d / mass, (force + k * target) / mass], [0, 0, 0]])
    return (expm(system * seconds) @ [0.0, 0.0, 1.0])[0]


@pytest.mark.parametrize(("axis", "force", "target"), [(0, 30.0, 0.0), (1, 0.0, 0.02), (2, 20.0, 0.0), (4, 1.5, 0.1)])
def test_the_law_moves_as_its_equation_says_and_twice_as_near_at_half_the_step(axis, force, target):
    wrench, goal = np.zeros((1, 6)), np.zeros(6)
    wrench[0, axis], goal[axis] = force, target
    wanted = command(position=goal[:3], turn=goal[3:])
    want = exact(axis, force, target, 0.3)
    errors = [moved(AdmittanceLaw(1, dt, WIDE), wanted, wrench, 0.3, dt)[axis] - want for dt in (2e-4, 1e-4)]
    assert abs(errors[1]) < 2e-3 * abs(want)
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)  # an implicit step is of first order


def test_a_step_meets_the_equation_with_the_velocity_at_its_own_end():
    """Implicit Euler, also in the spring: M (v' - v)/h = K (e - h v') + D (v_d - v') + f_ff + f_ext, to rounding."""
    h, mass = 8e-3, np.diag(np.repeat([VIRTUAL_MASS, VIRTUAL_INERTIA], 3))
    law = AdmittanceLaw(1, h, WIDE)
    error, twist, push = (np.array(row) for row in (
        [0.02, -0.01, 0.005, 0.0, 0.0, 0.1], [0.01, 0, 0.02, 0, 0, 0.3], [1.0, 2, 3, 0.1, 0.2, 0.3]
    ))  # fmt: skip
    law.twist[0] = before = np.array([0.1, 0.2, -0.1, 0.3, -0.2, 0.1])
    wrench = np.array([[5.0, -4, 3, 0.2, 0.1, -0.3]])
    wanted = command(position=error[:3], turn=error[3:], twist=twist, push=push)
    law.step(wanted, Pose(np.zeros((1, 3)), np.eye(3)[None]), wrench)
    after = law.twist[0]
    force = K @ (error - h * after) + D @ (twist - after) + push + wrench[0]
    np.testing.assert_allclose(mass @ (after - before) / h, force, atol=1e-10)


def test_a_step_of_eight_milliseconds_is_stable_where_an_explicit_one_would_not_be():
    """M of 5 kg and D of 1e4 Ns/m: explicitly, v would grow 15 times a step."""
    damping = np.diag([1e4] * 3 + [50.0] * 3)
    law = AdmittanceLaw(1, 8e-3, WIDE)
    wrench = np.array([[0.0, 0.0, -20.0, 0.0, 0.0, 0.0]])
    moved(law, command(np.zeros((6, 6)), damping), wrench, 0.4, 8e-3)
    assert law.twist[0, 2] == pytest.approx(-20.0 / 1e4, rel=1e-6)


def test_a_desired_twist_is_followed_without_lag():
    law, dt = AdmittanceLaw(1, 2e-3, WIDE), 2e-3
    position = np.zeros((1, 3))
    for tick in range(2000):
        goal = np.array([0.01 * tick * dt, 0.0, 0.0])
        law.step(command(position=goal, twist=(0.01, 0, 0, 0, 0, 0)), Pose(position, np.eye(3)[None]), np.zeros((1, 6)))
        position = position + dt * law.twist[:, :3]
    assert law.twist[0, 0] == pytest.approx(0.01, rel=1e-3)
    assert position[0, 0] == pytest.approx(goal[0], abs=2e-5)  # one step of 0.02 mm


def test_however_far_the_goal_and_however_fast_the_push_stays_within_its_bound():
    """Spring, desired twist and feed-forward together: 2000 Ns/m at 20 mm/s alone would be 40 N."""
    law = AdmittanceLaw(1, 2e-3, Bounds((2000.0, 5.0), (20.0, 2.0)))
    wanted = command(damping=None, position=(0.5, 0.3, 0.0), turn=(0.0, 0.9, 0.0), twist=(0.0, 0.02, 0, 0, 3.0, 0),
                     push=(0, 0, 30.0, 0, 0, 0))  # fmt: skip
    for _ in range(2000):
        law.step(wanted, Pose(np.zeros((1, 3)), np.eye(3)[None]), np.zeros((1, 6)))
    assert np.linalg.norm(law.twist[0, :3]) == pytest.approx(20.0 / 2000.0, rel=1e-6)
    assert np.linalg.norm(law.twist[0, 3:]) == pytest.approx(2.0 / 5.0, rel=1e-6)


def test_a_floor_raises_the_skills_damping_along_every_axis_and_leaves_what_is_above():
    law = AdmittanceLaw(1, 2e-3, Bounds((250.0, 3.5), (np.inf, np.inf)))
    for axis, least in enumerate([300.0, 250.0, 250.0, 3.5, 3.5, 4.0]):
        law.twist[:] = 0.0
        push = np.zeros(6)
        push[axis] = 10.0
        for _ in range(300):
            law.step(command(np.zeros((6, 6)), push=push), Pose(np.zeros((1, 3)), np.eye(3)[None]), np.zeros((1, 6)))
        assert law.twist[0, axis] == pytest.approx(10.0 / least, rel=1e-6)


def test_while_no_contact_is_felt_an_error_of_the_tare_moves_nothing_and_in_contact_nothing_is_taken_off():
    quiet = np.array([[0.9 * QUIET_FORCE, 0, 0, 0, 0.9 * QUIET_TORQUE, 0]])
    np.testing.assert_array_equal(felt(quiet), np.zeros((1, 6)))
    for touching in (np.array([[0.6, 0, 0, 0, 0, 0]]), np.array([[0, 0, 0, 0, 0.04, 0]])):
        np.testing.assert_array_equal(felt(touching), touching)


def test_a_skill_that_is_stiffer_than_arm_and_contact_together_is_refused_with_both_figures():
    law = AdmittanceLaw(1, 2e-3, Bounds((1.0, 1.0), (20.0, 2.0), 5e4))
    with pytest.raises(InputError, match=r"commands 6e\+04 N/m.*5e\+04 N/m.*cannot hold it"):
        law.step(command(np.diag([6e4, 1, 1, 1, 1, 1])), Pose(np.zeros((1, 3)), np.eye(3)[None]), np.zeros((1, 6)))


def test_an_impedance_that_changes_in_place_is_designed_for_again():
    law, stiffness, still = AdmittanceLaw(1, 2e-3, WIDE), np.zeros((6, 6)), Pose(np.zeros((1, 3)), np.eye(3)[None])
    wanted = command(stiffness, position=(0.01, 0, 0))
    law.step(wanted, still, np.zeros((1, 6)))
    assert not law.twist.any()
    stiffness[0, 0] = 1000.0
    law.step(wanted, still, np.zeros((1, 6)))
    assert law.twist[0, 0] > 0.0


def test_a_row_does_not_depend_on_its_neighbours():
    wanted = command(position=(0.01, 0.02, 0.0), count=3)
    wrench = np.array([[1.0, 2, 3, 0.1, 0.2, 0.3], [30, 0, 0, 0, 0, 0], [np.nan] * 6])
    three, one = AdmittanceLaw(3, 2e-3, WIDE), AdmittanceLaw(1, 2e-3, WIDE)
    for _ in range(20):
        three.step(wanted, Pose(np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1))), wrench)
        one.step(command(position=(0.01, 0.02, 0.0)), Pose(np.zeros((1, 3)), np.eye(3)[None]), wrench[:1])
    np.testing.assert_array_equal(three.twist[0], one.twist[0])


def test_a_pure_delays_least_damping_is_two_over_pi_times_stiffness_and_delay():
    """x' = -(k/D) x(t - T) is stable up to k T / D = pi / 2. A hold and a lag that are short count as their delay."""
    loop = Loop(rate=1000, delay=50, bandwidth=2000.0, mass=1e-6, stiffness=1e4)
    assert least_damping(loop) == pytest.approx(2.0 / np.pi * 1e4 * loop.total_delay, rel=0.01)


@pytest.mark.parametrize(
    ("loop", "damping"),
    [
        (Loop(), 1744.0), (Loop(stiffness=1e6), 16058.0), (Loop(stiffness=1e4), 216.0),
        (Loop(rate=125), 1696.0), (Loop(rate=125, delay=20), 2469.0), (Loop(delay=40, stiffness=3e5), 11038.0),
    ],
)  # fmt: skip
def test_the_least_stable_damping_is_the_published_tables_and_within_the_formulas_fifth(loop, damping):
    """The table of the design, computed by another program to whole Ns/m; the formula promises 20 %."""
    loop = loop._replace(filtered=True)
    assert least_damping(loop) == pytest.approx(damping, rel=5e-3)  # 1 in 216, and the bisections
    assert formula(loop) == pytest.approx(damping, rel=0.2)


def pressed(loop, damping, seconds, push=0.0, speed=0.0, one_side=False, watch=None):
    """Contact forces over time of this law, with the arm of the equations between it and the wall."""
    from skillframe.control.motors import InnerLoop

    arm = arm_of(loop)
    h, heavy = arm.ticks * 1e-3, 1e7  # a joint so heavy that the wall does not move it from where its servo wants it
    law = AdmittanceLaw(1, h, Bounds((damping, 1.0), (np.inf, np.inf)), watch)
    law.twist[0, 0] = speed
    place = np.array([[-speed * 0.1 if speed else 1e-4]])
    commanded, velocity = place.copy(), np.full((1, 1), speed)
    inner, forces = InnerLoop(arm, place, lambda: np.full((1, 1, 1), heavy), 1e-3), []
    wanted = command(np.zeros((6, 6)), None, push=(push, 0, 0, 0, 0, 0))
    for tick in range(round(seconds * 1000)):
        force = -loop.stiffness * (max(place[0, 0], 0.0) if one_side else place[0, 0])
        if tick % arm.ticks == 0:
            wrench = np.array([[force, 0, 0, 0, 0, 0.04]])  # the torque says that there is contact: no dead band
            law.step(wanted, Pose(np.zeros((1, 3)), np.eye(3)[None]), wrench)
            commanded = commanded + h * law.twist[:, :1]
        sent = law.twist[:, :1] if loop.velocity else commanded
        torque = inner.torque(sent, place, velocity, np.zeros((1, 1)))
        velocity = velocity + 1e-3 * torque / heavy
        place = place + 1e-3 * velocity
        forces.append(force)
    return np.array(forces)


def arm_of(loop):
    from skillframe.robot.interface import Control

    kind = "velocity" if loop.velocity else "position"
    return Control(rate_hz=loop.rate, interface=kind, delay_s=1e-3 * loop.delay, bandwidth_hz=loop.bandwidth).admittance


@pytest.mark.parametrize("loop", [Loop(), Loop(rate=125, delay=20), Loop(rate=1000, delay=20, velocity=True)])
def test_this_law_and_inner_loop_ring_down_above_the_least_damping_and_up_below_it(loop):
    """How fast says the monodromy's spectral radius. A servo that lags a tick shifts the edge by 3 %, 0.2 a second."""
    least = least_damping(loop)
    for share in (0.8, 1.25):
        forces = np.abs(pressed(loop, share * least, 2.0))
        grown = np.log(forces[1500:].max() / forces[500:1000].max())
        expected = loop.rate * np.log(spectral_radius(loop, share * least))
        assert (expected > 0.0) == (share < 1.0)
        assert grown == pytest.approx(expected, rel=0.15, abs=0.2)


@pytest.mark.parametrize(("share", "peak"), [(0.8, 1.7), (1.0, 1.5), (1.5, 1.2), (2.5, 1.0)])
@pytest.mark.parametrize("loop", [Loop(), Loop(rate=125, delay=20), Loop(rate=125, delay=40)])
def test_the_peak_at_touch_down_is_that_of_the_table_whatever_the_delay(loop, share, peak):
    """Pushed by 20 N, with D = share k T_tot; the table of the design promises 10 %."""
    damping = share * loop.stiffness * loop.total_delay
    found = touch_down(loop, damping, 20.0)
    assert found / 20.0 == pytest.approx(peak, rel=0.1)
    if loop.delay == 8:
        own = -pressed(loop, damping, 0.8, 20.0, 20.0 / damping, one_side=True).min()
        assert own == pytest.approx(found, rel=0.06)  # its servo lags a tick, in 26 ms


def watched(loop, push=20.0):
    return RingWatch(1, 1.0 / loop.rate, loop.total_delay, push)


@pytest.mark.parametrize("loop", [Loop(), Loop(rate=125, delay=20), Loop(rate=500, delay=8, velocity=True)])
def test_on_a_wall_four_times_as_stiff_as_declared_the_law_bounces_and_with_the_watch_it_comes_to_rest(loop):
    """c is 1.5 / 4 there, below the least of 0.57. While the force rings c is 1.5 again, and only the push stays."""
    damping = 1.5 * loop.stiffness / 4.0 * loop.total_delay
    speed = 20.0 / damping
    bare, calm = (
        -pressed(loop, damping, 2.5, 20.0, speed, one_side=True, watch=w)[1500:] for w in (None, watched(loop))
    )
    assert bare.min() == 0.0 and bare.max() > 50.0  # it leaves the wall and hits it at 2.5 times the push
    assert calm.min() > 10.0 and calm.max() < 30.0  # what grows again is calmed at 2 N


@pytest.mark.parametrize("loop", [Loop(), Loop(rate=125, delay=20)])
@pytest.mark.parametrize("stiffer", [1.0, 4.0])
def test_the_watch_does_not_make_a_touch_down_harder(loop, stiffer):
    """When the force is felt the peak is on its way: more damping then changes its rest by at most a tenth."""
    damping = 1.5 * loop.stiffness / stiffer * loop.total_delay
    speed = 20.0 / damping
    bare, calm = (
        -pressed(loop, damping, 0.3, 20.0, speed, one_side=True, watch=w).min() for w in (None, watched(loop))
    )
    assert calm < 1.1 * bare
