import numpy as np
import pytest

from skillframe.errors import SkillframeError, UnknownName
from skillframe.frames import matrix_from_quaternion, norm, rotation_vector
from skillframe.skill import Status
from skillframe.world.quantities import SensorSettings
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import run, setup

VALLEY = impedance(free_axes="x")
DOWN = (0.0, 0.0, -1.0)


def push_down(**options):
    return Push(DOWN, VALLEY, stall=False, **options)


# --- what a run is ---


def test_a_push_slides_a_ball_to_the_bottom_of_the_valley_from_both_sides():
    result = run(push_down(), setup(), {"start.offset_x": [0.02, -0.02]}, count=2, duration_s=2.5)
    assert result.success.all()
    assert list(result.failure) == ["", ""]
    assert (result.final_error_m < 1e-3).all()
    assert ((result.peak_force_n > 5.0) & (result.peak_force_n < 60.0)).all()


def test_a_start_is_bumpless():
    """At the first tick the law asks for (almost) nothing, whatever twist and feed-forward the skill wants: gravity
    is compensated and that is all. Noise through the springs (5e-5 m x 1000 N/m, 3.5e-4 rad x 20 Nm/rad) is left."""
    eager = Push(DOWN, VALLEY, speed=0.2, stall=False)
    for sensors in (SensorSettings(), SensorSettings(force_noise=0.0, torque_noise=0.0, position_noise=0.0)):
        result = run(eager, setup("panda", sensors=sensors), duration_s=0.02, trace_hz=1000)
        first = result.traces[0].command_wrench[0]
        assert norm(first[:3]) < 0.2 + 0.1  # one tick of lead, 0.2 mm x 1000 N/m, and damping of the tare's last motion
        assert norm(first[3:]) < 0.05
    pushed = run(Hold(VALLEY, feedforward=lambda time: np.full(6, 5.0)), setup("panda"), duration_s=0.1, trace_hz=1000)
    law = pushed.traces[0].command_wrench
    np.testing.assert_allclose(law[0], 0.0, atol=1e-6)
    assert np.abs(np.diff(law, axis=0)).max() < 0.3  # 5 N over a ramp of 50 ms, and the motion it makes


@pytest.mark.parametrize("robot", ["free_tool", "panda"])
def test_a_robot_told_to_stay_stays_through_tare_and_run(robot):
    result = run(Hold(np.diag([1000.0] * 3 + [20.0] * 3)), setup(robot, "free"), duration_s=0.3, trace_hz=1000)
    trace = result.traces[0]
    assert np.abs(trace.position - trace.position[0]).max() < 1e-8
    assert np.abs(trace.command_wrench).max() < 1e-4


def test_a_step_of_the_desired_pose_is_followed_critically_damped():
    """x(t) = x_d (1 - (1 + w t) exp(-w t)), w = sqrt(k / m), of the free tool with its load at the common centre of
    mass, 2.6 kg; 1 ms of sampling is 2 % of 1/w."""
    now = setup("free_tool", "free", point=(0.0, 0.0, 0.6 * 0.1 / 2.6))
    result = run(Hold(np.diag([1000.0] * 3 + [20.0] * 3), offset=(0.01, 0.0, 0.0)), now, duration_s=0.6, trace_hz=1000)
    trace = result.traces[0]
    w = np.sqrt(1000.0 / 2.6)
    expected = 0.01 * (1.0 - (1.0 + w * trace.time) * np.exp(-w * trace.time))
    np.testing.assert_allclose(trace.position[:, 0] - trace.position[0, 0], expected, atol=0.02 * 0.01)


def test_energy_is_the_integral_of_force_times_velocity():
    result = run(push_down(), setup(), {"start.offset_x": 0.02}, duration_s=1.0, trace_hz=1000)
    trace = result.traces[0]
    assert result.energy_j[0] == pytest.approx((trace.command_wrench * trace.twist).sum() * 1e-3, rel=1e-9)


def test_peak_force_is_the_largest_true_contact_force():
    result = run(push_down(), setup(), {"start.offset_x": 0.02}, duration_s=1.0, trace_hz=1000)
    assert result.peak_force_n[0] == pytest.approx(norm(result.traces[0].wrench_true[:, :3]).max(), rel=1e-12)


def test_the_filtered_wrench_follows_the_true_one_in_steady_contact():
    result = run(push_down(), setup(sensors=SensorSettings(), world="hose_coupler"), duration_s=2.0, trace_hz=100)
    late = result.traces[0].time > 1.5
    measured, true = result.traces[0].wrench[late], result.traces[0].wrench_true[late]
    # 0.3 N of white noise through the 25 Hz corner leaves 0.1 N; the tare's mean of 100 samples errs by 0.03 N
    assert norm((measured - true)[:, :3]).max() < 0.6
    assert abs((measured - true)[:, 2].mean()) < 0.15


# --- how a run ends ---


def test_a_run_out_of_time_says_so():
    result = run(push_down(), setup(), duration_s=0.05)
    assert result.duration_s[0] == pytest.approx(0.05)
    assert result.failure[0] == "goal not reached: time limit: 0.05 s of simulated time are over"
    assert result.status[0] == Status.RUNNING


def test_a_skill_s_own_failure_is_a_failure_even_at_the_goal():
    end = (0.01, Status.FAILURE, "gave up")
    result = run(Hold(VALLEY, end=end), setup(world="free"), duration_s=0.1)
    assert not result.success[0]
    assert result.reason[0] == "gave up"
    assert result.duration_s[0] == pytest.approx(0.01)


def test_a_skill_s_success_counts_only_at_the_goal():
    end = (0.01, Status.SUCCESS, "")
    at_goal = run(Hold(VALLEY, end=end), setup(world="free"), duration_s=0.1)
    assert at_goal.success[0]
    elsewhere = run(Hold(VALLEY, end=end), setup(world="valley"), duration_s=0.1)
    assert elsewhere.failure[0] == "goal not reached: the skill ended"
    assert elsewhere.status[0] == Status.SUCCESS


def both_halves(result):
    return bool(result.goal_reached[0]), bool(result.ended_itself[0])


def test_that_the_goal_is_reached_and_that_the_skill_ended_by_itself_are_told_apart():
    """The goal of "free" holds everywhere, that of "valley" does not hold at the start."""
    said = (0.01, Status.SUCCESS, "")
    assert both_halves(run(Hold(VALLEY, end=said), setup(world="free"), duration_s=0.1)) == (True, True)
    assert both_halves(run(Hold(VALLEY, end=said), setup(world="valley"), duration_s=0.1)) == (False, True)
    assert both_halves(run(Hold(VALLEY), setup(world="free"), duration_s=0.05)) == (True, False)
    assert both_halves(run(Hold(VALLEY), setup(world="valley"), duration_s=0.05)) == (False, False)


def test_a_skill_that_gives_up_at_the_goal_is_not_said_to_have_missed_it():
    result = run(Hold(VALLEY, end=(0.01, Status.FAILURE, "gave up")), setup(world="free"), duration_s=0.1)
    assert result.failure[0] == "the skill gave up, though the goal is reached: gave up"
    assert both_halves(result) == (True, True)


def test_a_trace_says_both_halves_of_its_end():
    def meta(**end):
        return run(Hold(VALLEY, **end), setup(world="free"), duration_s=0.05, trace_hz=100).traces[0].meta

    late, ended = meta(), meta(end=(0.01, Status.SUCCESS, ""))
    assert (late["goal_reached"], late["ended_itself"]) == (True, False)
    assert (ended["goal_reached"], ended["ended_itself"]) == (True, True)


def test_stop_when_ends_a_trial_as_done_and_the_others_go_on():
    def far_right(state):
        return state.tip.position[:, 0] > 0.0105

    result = run(
        Hold(np.diag([1000.0] * 3 + [20.0] * 3), offset=(0.02, 0, 0)), setup(world="free", stop_when=far_right),
        {"start.offset_x": [0.0, -0.05]}, count=2, duration_s=0.4,
    )  # fmt: skip
    assert list(result.reason) == ["done", "time limit: 0.4 s of simulated time are over"]
    assert result.duration_s[0] < 0.3


def test_later_attempts_at_what_is_reached_end_and_earlier_ones_and_others_go_on():
    def far_right(state):
        return state.tip.position[:, 0] > 0.0105

    result = run(
        Hold(np.diag([1000.0] * 3 + [20.0] * 3), offset=(0.02, 0, 0)),
        setup(world="free", stop_when=far_right, attempts_at=(7, 7, 7, 3)),
        {"start.offset_x": [-0.05, 0.0, -0.05, -0.05]}, count=4, duration_s=0.4,
    )  # fmt: skip
    over = "time limit: 0.4 s of simulated time are over"
    assert list(result.reason) == [over, "done", "an earlier attempt at the same has succeeded", over]
    assert result.duration_s[2] == result.duration_s[1] < 0.3
    assert list(result.ended_by) == ["time", "goal", "interrupted", "time"] and not result.interrupted


def test_progress_is_told_every_ten_milliseconds_of_simulated_time():
    told = []
    run(push_down(), setup(), duration_s=0.05, progress=told.append)
    np.testing.assert_allclose(told, [0.0, 0.01, 0.02, 0.03, 0.04])


def test_an_interrupted_run_keeps_what_it_has():
    def interrupt(time):
        if time > 0.025:
            raise KeyboardInterrupt

    result = run(push_down(), setup(), duration_s=1.0, trace_hz=1000, progress=interrupt)
    assert result.interrupted
    assert not result.success[0]
    assert 25 < len(result.traces[0].time) < 40


# --- what the controller may know ---


def test_heavier_links_make_the_arm_sag_because_the_controller_is_not_told():
    stiff = np.diag([1000.0] * 3 + [50.0] * 3)
    result = run(
        Hold(stiff), setup("panda", "free", point="wrist"), {"robot.mass_scale": [1.0, 1.2]}, count=2, duration_s=1.0,
        trace_hz=100,
    )  # fmt: skip
    held, sagged = (trace.position[-1] - trace.desired_position[-1] for trace in result.traces)
    assert norm(held) < 1e-6
    assert sagged[2] < -0.001  # some newtons of unknown weight on 1000 N/m


def test_a_wrong_grasp_leaves_its_error_in_the_wrench_and_in_nothing_the_skill_sees():
    draws = {"grasp.tilt_y": [0.0, 0.2], "grasp.offset_x": [0.0, 0.01]}
    result = run(
        Hold(np.diag([1000.0] * 3 + [50.0] * 3)), setup("panda", "free"), draws, count=2, duration_s=0.05, trace_hz=100
    )
    right, wrong = result.traces
    np.testing.assert_allclose(
        wrong.position[0], right.position[0], atol=1e-3
    )  # the nominal tip: what the robot believes
    tools = [trace.body_position[0, -2] for trace in result.traces]
    assert norm(tools[1] - tools[0]) > 0.005


# --- traces and refusals ---


def test_a_trace_holds_what_happened_at_its_rate():
    result = run(push_down(), setup(), {"start.offset_x": 0.02}, duration_s=0.5, trace_hz=200)
    trace = result.traces[0]
    np.testing.assert_allclose(trace.time, np.arange(100) * 5e-3)
    rows = len(trace.time)
    for name in ("position", "quaternion", "twist", "wrench", "wrench_true", "desired_position", "command_wrench", "q"):
        assert len(getattr(trace, name)) == rows
    np.testing.assert_allclose(norm(trace.quaternion), 1.0, atol=1e-12)
    assert trace.meta["world"] == "valley"
    assert trace.meta["reason"] == result.reason[0]
    assert len(trace.meta["bodies"]) == trace.body_position.shape[1]
    velocity = np.gradient(trace.position, trace.time, axis=0)
    np.testing.assert_allclose(velocity[2:-2], trace.twist[2:-2, :3], atol=0.01)


def test_a_trace_ends_with_its_trial():
    skill = Push(DOWN, VALLEY)
    result = run(skill, setup(), {"start.offset_x": [0.0, 0.02]}, count=2, duration_s=4.0, trace_hz=100)
    for trace, duration in zip(result.traces, result.duration_s, strict=True):
        assert trace.time[-1] <= duration < trace.time[-1] + 0.0101
    assert result.duration_s[0] < result.duration_s[1]


def test_a_trace_rate_that_does_not_divide_the_control_rate_is_refused():
    with pytest.raises(SkillframeError, match="not a whole multiple"):
        run(push_down(), setup(), duration_s=0.1, trace_hz=300)


def test_a_quantity_that_nothing_reads_is_refused():
    with pytest.raises(UnknownName, match=r"world\.friction"):
        run(push_down(), setup(), {"world.frictoin": 0.2}, duration_s=0.1)


def test_the_measured_attitude_keeps_its_noise_small_and_stays_a_rotation():
    result = run(push_down(), setup(sensors=SensorSettings()), duration_s=0.3, trace_hz=1000)
    matrix = result.traces[0]
    measured = matrix_from_quaternion(matrix.quaternion)
    steps = rotation_vector(measured[1:] @ np.swapaxes(measured[:-1], -1, -2))
    # difference of two draws of 3.5e-4 rad per axis, 900 of them: known to 2.4 %
    assert steps.std() == pytest.approx(np.sqrt(2.0) * 3.5e-4, rel=0.12)
