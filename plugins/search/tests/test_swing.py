"""A part that is swung to its limits in a hole shows the hole's axis, whatever its play and friction."""

from dataclasses import replace

import numpy as np
import pytest
from skillframe_search.contact import surface_axes
from skillframe_search.example import example
from skillframe_search.swing import Swing

from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.frames import Pose, cross, norm, rotate, rotation_matrix, rotation_vector
from skillframe.sequence import Part, Sequence
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe.world.placement import fixture_poses, nominal_fixture, start_poses

DOWN, DEPTH = np.array([0.0, 0.0, -1.0]), 0.020
AXES = surface_axes(DOWN)


class Pushed(Skill):
    """Pushes down with 12 N for a time, free to turn and across."""

    def start(self, observation, rngs):
        self.home = observation.pose
        self.until = observation.time + 1.5

    def step(self, observation):
        n = len(observation.time)
        wrench = np.zeros((n, 6))
        wrench[:, 2] = -12.0 - 400.0 * observation.twist[:, 2]  # 30 mm/s at most
        stiffness = np.diag([20.0, 20.0, 0.0, 0.5, 0.5, 0.5])
        status = np.where(observation.time > self.until, int(Status.SUCCESS), int(Status.RUNNING))
        return Command(self.home, np.zeros((n, 6)), Impedance(stiffness), wrench, status, no_reasons(n))


def test_what_friction_keeps_of_the_lean_about_the_other_axis_is_left_out():
    """The axis leans by 2 and -1 degrees. Turned about b the part keeps 4/5 of its last lean about a, of 2 degrees."""
    a, b, play, truth = AXES[0], AXES[1], np.radians(2.0), np.radians([2.0, -1.0])
    kept = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (-0.8, 1.0), (-0.8, -1.0), (0.0, 0.0), (0.0, 0.0)]
    swing, end = Swing(np.zeros((1, 3)), DOWN, np.eye(3)), np.array([[0.0, 0.0, 0.0]])
    for i in range(800):
        share = kept[int(swing._stage[0]) if i else 0]
        turn = (truth[0] + play * share[0]) * a + (truth[1] + play * share[1]) * b
        pose = Pose(end + 0.005 * DOWN - 0.020 * DOWN, rotation_matrix(turn[None]))
        seen = Observation(np.array([0.01 * i]), 0.01, pose, np.zeros((1, 6)), np.zeros((1, 6)))
        if not i:
            swing.start(seen, [np.random.default_rng(0)])
        command = swing.step(seen)
    assert command.status[0] == Status.SUCCESS
    wanted = truth[0] * a + truth[1] * b
    np.testing.assert_allclose(rotation_vector(swing.axes(-0.040 * DOWN + end).rotation)[0], wanted, atol=1e-3)
    np.testing.assert_allclose(rotation_vector(command.pose.rotation)[0], wanted, atol=1e-3)
    np.testing.assert_allclose(command.pose.position[0], end[0], atol=1e-9)  # down to the end, as nothing held it


def test_a_part_that_is_held_is_set_down_no_farther():
    swing, places = Swing(np.zeros((1, 3)), DOWN, np.eye(3)), []
    for i in range(600):
        pose = Pose(-0.020 * DOWN[None], np.eye(3)[None])
        wrench = np.zeros((1, 6))
        wrench[0, 2] = 10.0 * (bool(places) and places[-1] < 0.0205)
        seen = Observation(np.array([0.01 * i]), 0.01, pose, np.zeros((1, 6)), wrench)
        if not i:
            swing.start(seen, [np.random.default_rng(0)])
        command = swing.step(seen)
        places.append(float(command.pose.position[0, 2]))
        if command.status[0]:
            break
    assert command.status[0] == Status.SUCCESS
    assert max(places) == pytest.approx(0.0215) and 0.019 < places[-1] < 0.0206


def swung(count, clearance, friction=0.2, seed=0, tilt=4.0):
    """The swing of pegs in holes 20 mm deep, tilted by up to `tilt` degrees, the axes found and the true fixtures."""
    rng = np.random.default_rng(seed)
    draws = {f"fixture.tilt_{axis}": np.radians(rng.uniform(-tilt, tilt, count)) for axis in "xy"}
    draws |= {f"fixture.offset_{axis}": rng.uniform(-0.001, 0.001, count) for axis in "xy"}
    params = {"depth": DEPTH, "done_depth": DEPTH, "clearance": clearance, "friction": friction}
    robot, scene = load_robot_model("free_tool"), load_world("peg_in_hole", params)
    _, setup = prepare(robot, scene, example("spiral"), "tip")
    nominal = start_poses(robot, scene, {}, 1).rotation[0]
    entrance = nominal_fixture(robot).position
    swing = Swing(np.tile(entrance + DEPTH * DOWN, (count, 1)), DOWN, nominal)
    skill = Sequence([Part("in", Pushed), Part("swing", lambda: swing)])
    rngs = [np.random.default_rng([seed, i]) for i in range(count)]
    result = simulate(skill, replace(setup, stop_when=None), draws, rngs, duration_s=8.0, trace_hz=50.0)
    return result, swing.axes(np.tile(entrance, (count, 1))), fixture_poses(robot, draws, count), entrance


def errors(axes, true, entrance):
    """Angle between the axes found and the true ones [rad], and their distance in the plane of the entrance [m]."""
    along = [rotate(each.rotation, np.broadcast_to(DOWN, each.position.shape)) for each in (axes, true)]
    place = axes.position + rotate(axes.rotation, np.broadcast_to(entrance, axes.position.shape))
    return norm(cross(*along)), norm((place - true.position)[:, :2])


@pytest.mark.slow
def test_a_swing_shows_the_axis_of_a_hole_gently():
    """A tenth of a degree, with less than half of the force with which it was pushed in."""
    result, axes, true, entrance = swung(2, 0.00025, friction=0.5)
    angle, aside = errors(axes, true, entrance)
    assert (result.status == Status.SUCCESS).all()
    assert angle.max() < np.radians(0.3) and aside.max() < 3e-4
    for trace in result.traces:
        assert norm(trace.wrench_true[trace.time > 1.9, :3]).max() < 20.0


@pytest.mark.figures
@pytest.mark.parametrize("friction", [0.2, 0.5])
@pytest.mark.parametrize("clearance", [5e-5, 1e-4, 2.5e-4, 5e-4])
def test_the_axis_is_found_to_a_third_of_a_degree_whatever_the_play(clearance, friction):
    """Of 25 pegs each. With the least play and friction 0.5, pegs that lean by over 4.3 degrees jam on their way in."""
    _, axes, true, entrance = swung(25, clearance, friction, seed=7)
    angle, lean = errors(axes, true, entrance)[0], norm(rotation_vector(true.rotation))
    off = angle > np.radians(0.3)
    print(f"play {1e3 * clearance:g} mm, friction {friction}: {off.sum()} off, else at most "
          f"{np.degrees(angle[~off].max()):.2f} degrees")  # fmt: skip
    jam = lean > np.radians(4.3) if (clearance, friction) == (5e-5, 0.5) else np.zeros(25, dtype=bool)
    assert not np.any(off & ~jam)
