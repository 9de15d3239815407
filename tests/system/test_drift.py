"""How far a skill drifts across its push where nothing holds it, in 30 s in the air.

The tare leaves a bias of 2 N across the push, which arms feel that take positions or velocities, and 2 N more are
commanded across it, as those feel that take torques and carry 2 N more than they know.
"""

import numpy as np
import pytest
from skillframe_lmc.gains import ROTATION, TRANSLATION, gains

from skillframe.document.file import new_document
from skillframe.document.frame import frame_at
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend.registry import registry
from skillframe.frames import norm
from skillframe.world.sensors import Sensors

pytestmark = [pytest.mark.slow, pytest.mark.figures, pytest.mark.needs_plugins]
BIAS_N, NOISES_N, STIFFNESS = 2.0, (1.0, 3.0), 1000.0


def pushing(share):
    """An LMC document: push along x at 1 mm/s, with this share of the stiffness across, stiff in rotation."""
    push = np.array([1.0, 0.0, 0.0])
    stiffness, damping = gains(np.zeros((0, 3)), STIFFNESS, TRANSLATION, push, share)
    turning, turning_damping = gains(np.zeros((0, 3)), 20.0, ROTATION)

    def part(direction, speed, k, d):
        return {
            "desired_direction": direction, "speed": speed, "compliant_axes": [], "fully_compliant": False,
            "stiffness": k.tolist(), "damping": d.tolist(), "evidence": {},
        }  # fmt: skip

    phase = {
        "translation": part(push.tolist(), 0.001, stiffness, damping),
        "rotation": part(None, 0.0, turning, turning_damping),
        "pitch": None, "stop": {"stall_s": 60.0, "time_limit_s": 60.0},
    }  # fmt: skip
    return new_document(registry().skill("lmc"), {"frame": frame_at([0.0, 0.0, 0.1], axes="base"), "phases": [phase]})


def drift(robot, share, monkeypatch):
    """Largest distance across the push [m], of a trial for each noise of the sensor."""
    tare = Sensors.set_tare

    def tare_that_leaves_a_bias(sensor, mean, rotation):
        left = mean.copy()
        left[:, 1] -= BIAS_N
        tare(sensor, left, rotation)

    monkeypatch.setattr(Sensors, "set_tare", tare_that_leaves_a_bias)
    skill, setup = prepare(load_robot_model(robot), load_world("free", {}), pushing(share))
    step, weight = skill.step, np.array([0.0, 0.0, 0.0 if robot.startswith("ur5e") else BIAS_N, 0.0, 0.0, 0.0])

    def step_with_a_weight(observation):
        command = step(observation)
        return command._replace(feedforward=command.feedforward - weight)

    monkeypatch.setattr(skill, "step", step_with_a_weight)
    draws = {"sensor.force_noise": np.array(NOISES_N)}
    rngs = np.random.default_rng(5).spawn(len(NOISES_N))
    result = simulate(skill, setup, draws, rngs, duration_s=30.0, trace_hz=10.0)
    found = np.array([norm((trace.position - trace.position[0])[:, 1:]).max() for trace in result.traces])
    print(f"{robot}, share {share:g}: {1e3 * found} mm")
    return found


@pytest.mark.parametrize("robot", ["free_tool", "panda", "ur5e", "ur5e_velocity"])
def test_across_the_push_it_drifts_no_farther_than_the_bias_bends_the_stiffness_that_is_left(robot, monkeypatch):
    """2 N on 100 N/m are 20 mm."""
    found = drift(robot, 0.1, monkeypatch)
    assert 0.2 * BIAS_N < 0.1 * STIFFNESS * found.min() <= 0.1 * STIFFNESS * found.max() < 1.1 * BIAS_N


def test_an_arm_of_torques_without_stiffness_there_drifts_ten_times_as_far(monkeypatch):
    assert drift("panda", 1e-9, monkeypatch).min() > 0.2
