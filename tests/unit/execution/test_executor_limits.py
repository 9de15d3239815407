"""For each limit, a run that trips it with the right reason and one just below that does not."""

import numpy as np
import pytest

from skillframe.frames import norm
from skillframe.robot.kinematics import at
from skillframe.robot.spec import Limits
from skillframe.skill import Status
from skillframe.world.placement import start_configurations
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import run, setup

VALLEY = impedance(free_axes="x")
DOWN = (0.0, 0.0, -1.0)


def push_down(**options):
    return Push(DOWN, VALLEY, stall=False, **options)


def limited(skill_of, limits, setting, **options):
    return run(
        skill_of(), setup(**setting, limits=Limits(**{"force_n": None, "torque_rate_nm_s": None, **limits})), **options
    )


def largest(values):
    return float(norm(values).max())


def shaken():
    """In the air the sensor reads the tool's inertia alone: an estimate of a contact that is not there."""
    return Hold(VALLEY, feedforward=lambda time: np.array([20.0 * np.sin(20.0 * time), 0, 0, 0, 0, 0]))


@pytest.mark.parametrize(
    ("name", "text", "skill", "world", "point", "of"),
    [
        ("force_n", "force limit", shaken, "free", "wrist", lambda trace: largest(trace.wrench[:, :3])),
        # of the ball's tip: the simulator's torque there is next to none
        ("torque_n_m", "torque limit", push_down, "valley", "tip", lambda trace: largest(trace.wrench[:, 3:])),
        (
            "energy_j",
            "energy limit",
            push_down,
            "valley",
            "wrist",
            lambda trace: np.cumsum((trace.command_wrench * trace.twist).sum(-1) * 1e-3).max(),
        ),
    ],
)
def test_a_limit_one_thousandth_below_what_a_run_reaches_stops_it_and_one_above_does_not(
    name, text, skill, world, point, of
):
    setting = {"world": world, "point": point}
    options = {"draws": {"start.offset_x": 0.015}, "duration_s": 0.8}
    free = limited(skill, {}, setting, trace_hz=1000, **options)
    reached = of(free.traces[0])
    above = limited(skill, {name: 1.001 * reached}, setting, **options)
    assert above.reason[0].startswith("time limit")
    below = limited(skill, {name: 0.999 * reached}, setting, trace_hz=1000, **options)
    assert below.reason[0].startswith(text)
    assert below.reason[0].endswith(f"(at {below.duration_s[0]:.3f} s)")
    assert not below.success[0]
    assert below.status[0] == Status.FAILURE
    assert of(below.traces[0]) >= 0.999 * reached  # the trace is kept, up to and with the tick that tripped
    assert below.traces[0].meta["failure"] == below.reason[0]


def test_a_workspace_just_too_small_stops_the_run_at_its_wall():
    setting, options = {"world": "free"}, {"duration_s": 0.5}
    free = limited(push_down, {}, setting, trace_hz=1000, **options)
    trace = free.traces[0]
    reach = trace.position[:, 2].min() + 0.2  # of the wrist, which is 200 mm above the tip
    for wall, trips in ((reach - 1e-5, False), (reach + 1e-5, True)):
        box = ((-1.0, -1.0, wall), (1.0, 1.0, 2.0))
        result = limited(push_down, {"workspace_m": box}, setting, **options)
        assert result.reason[0].startswith("workspace limit" if trips else "time limit")


@pytest.mark.parametrize(("share", "trips"), [(0.95, False), (1.10, True)])
def test_a_torque_rate_above_its_limit_stops_the_run_and_one_below_does_not(share, trips):
    """A feed-forward force that grows steadily. Its largest joint torque per newton is measured first."""
    limit, push = 500.0, np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    now = setup("panda", "free", point="wrist")
    home = start_configurations(now.robot, now.scene, {}, 1)[0]
    per_newton = np.abs(at(now.robot, home, np.zeros(7)).jacobian(now.robot.tool_frames[0]).T @ push).max()
    rate = share * limit / per_newton

    def ramp():
        damping = np.diag([1.0] * 3 + [0.1] * 3)  # hardly any, so that the push alone makes the torque
        return Hold(
            np.zeros((6, 6)), feedforward=lambda time: rate * (time - 0.06) * (time > 0.06) * push, damping=damping
        )

    result = limited(
        ramp, {"torque_rate_nm_s": limit}, {"robot_name": "panda", "world": "free", "point": "wrist"}, duration_s=0.1
    )
    assert result.reason[0].startswith("torque rate limit" if trips else "time limit"), result.reason[0]


def test_a_free_flying_tool_has_no_joint_torque_to_limit():
    result = limited(push_down, {"torque_rate_nm_s": 1.0}, {"world": "valley"}, duration_s=0.3)
    assert result.reason[0].startswith("time limit")


@pytest.mark.parametrize(
    ("push", "text"), [(1e4, "the tool moves at"), (1e9, "the controller commands"), (np.nan, "not a finite")]
)
def test_a_diverging_run_is_stopped_with_the_cause_and_its_trace(push, text):
    def wild():
        return Hold(VALLEY, feedforward=lambda time: np.full(6, push if time > 0.1 else 0.0))

    result = limited(wild, {}, {"world": "free"}, duration_s=0.5, trace_hz=1000)
    assert result.reason[0].startswith("diverged")
    assert text in result.reason[0]
    assert not result.success[0]
    assert len(result.traces[0].time) > 100
    tame = Hold(VALLEY, feedforward=lambda time: np.full(6, 0.1 * (time > 0.1)))
    assert run(tame, setup(world="free"), duration_s=0.2).reason[0].startswith("time limit")


def test_a_trial_that_diverges_before_its_start_is_stopped_and_its_neighbour_runs_on(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    light = {"robot.mass_scale": np.array([1e-6, 1.0])}  # the controller's nominal torques throw an arm of 18 mg
    both = run(Hold(VALLEY), setup("panda", world="free"), count=2, draws=light, duration_s=0.2, trace_hz=1000)
    assert both.reason[0].startswith("diverged")
    assert both.success[1]
    assert len(both.traces[0].time) >= 1
    assert not list(tmp_path.iterdir())  # the engine leaves no log where the user stands


def test_one_trial_that_diverges_leaves_its_neighbours_alone():
    class Odd(Hold):
        def step(self, observation):
            command = super().step(observation)
            push = command.feedforward.copy()
            push[0] = np.nan if observation.time[0] > 0.05 else 0.0
            return command._replace(feedforward=push)

    both = run(Odd(VALLEY), setup(world="free"), count=2, duration_s=0.2, trace_hz=1000)
    alone = run(Hold(VALLEY), setup(world="free"), count=2, duration_s=0.2, trace_hz=1000)
    assert both.reason[0].startswith("diverged")
    assert both.success[1]
    np.testing.assert_array_equal(both.traces[1].position, alone.traces[1].position)
