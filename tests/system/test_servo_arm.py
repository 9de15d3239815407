"""One LMC skill on the arm of ideal torques and on the same arm with servos, side by side; figures of own-fmu.md."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from skillframe.cli.main import run
from skillframe.execution.executor import simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend.reading import read_demonstration
from skillframe.fmu.build import find_compiler

pytestmark = [
    pytest.mark.slow, pytest.mark.needs_plugins,
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
]  # fmt: skip
COUNT = 24
DRAWS = {"start.tilt_y": np.linspace(-0.1, 0.1, COUNT)}


@pytest.fixture(scope="module")
def skill(tmp_path_factory):
    """Learned from two demonstrations on the arm of ideal torques."""
    folder = tmp_path_factory.mktemp("skill")
    demonstrations = folder / "peg.npz"
    world = ["--world", "peg_in_hole", "--robot", "panda", "--teacher", "kinesthetic", "--count", "2", "--seed", "1"]
    assert run(["record", *world, "--out", str(demonstrations)]) == 0
    files = sorted(str(path) for path in folder.glob("peg*.npz"))
    assert run(["learn", *files, "--at", "tip", "--out", str(folder / "peg.skill.json")]) == 0
    return folder / "peg.skill.json"


@cache
def tried(skill, robot, friction=None):
    """24 starts tilted by -0.1 to 0.1 rad."""
    document = json.loads(skill.read_text(encoding="utf-8"))
    ready, setup = prepare(load_robot_model(robot), load_world("peg_in_hole", {}), document)
    draws = DRAWS if friction is None else {**DRAWS, "actuator.friction_scale": np.full(COUNT, friction)}
    rngs = [np.random.default_rng([3, i]) for i in range(COUNT)]
    return simulate(ready, setup, draws, rngs, duration_s=20.0)


def told(name, result):
    force = result.peak_force_n
    return f"{name} | {np.count_nonzero(result.success)} of {COUNT} | {np.median(force):.1f} N | {force.max():.1f} N"


@pytest.mark.figures
def test_servos_without_friction_to_speak_of_do_what_ideal_torques_do(skill):
    """With a tenth of the friction the goal is reached as closely, and no limit is broken."""
    ideal, light = tried(skill, "panda"), tried(skill, "panda_servo", 0.1)
    print(told("panda", ideal), told("panda_servo, a tenth of the friction", light), sep="\n")
    assert ideal.success.all() and light.success.all()
    np.testing.assert_allclose(light.final_error_m, ideal.final_error_m, atol=2e-4)


@pytest.mark.figures
def test_friction_in_the_gears_costs_successes_and_a_position_servo_has_less_of_it(skill):
    torque, position = tried(skill, "panda_servo"), tried(skill, "panda_position")
    print(told("panda_servo", torque), told("panda_position", position), sep="\n")
    print(*sorted(set(torque.failure) | set(position.failure)), sep="\n")
    assert np.count_nonzero(torque.success) < np.count_nonzero(position.success) <= COUNT
    assert set(torque.ended_by) | set(position.ended_by) == {"skill"}  # at rest in the mouth; nothing else is wrong


@pytest.mark.parametrize("robot", ["panda_servo", "panda_position"])
def test_arms_of_servos_are_led_by_hand_into_the_hole_without_a_failed_attempt(robot, tmp_path, capsys):
    """A hand that cannot overcome the gears' friction leaves the peg on its rim until the time is over."""
    words = f"record --world peg_in_hole --robot {robot} --count 2 --seed 1 --json --out".split()
    assert run([*words, str(tmp_path / "d.npz")]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["rejected"] == []
    for file in said["files"]:
        assert read_demonstration(Path(file)).duration < 12.0


@pytest.mark.parametrize(
    ("words", "refused"),
    [
        ("--angle=5", "angle: is for machines that are taught by an operator, and panda_servo is not"),
        ("--set teacher.force_scale=2", "--set teacher: unknown key 'force_scale'"),
    ],
)
def test_settings_of_machines_are_refused_for_an_arm_of_servos(words, refused, tmp_path, capsys):
    words = f"record --world peg_in_hole --robot panda_servo {words} --out".split()
    assert run([*words, str(tmp_path / "d.npz")]) == 2
    assert refused in capsys.readouterr().err
