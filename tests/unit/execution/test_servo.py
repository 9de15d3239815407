"""An arm whose joints are driven by servos as FMUs, told torques or positions, beside the arm of ideal torques."""

import re
import shutil
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from skillframe_reports.plots import run_plots
from skillframe_testkit.suites import HoldSkill

from skillframe.cosim.coupling import StepTooLarge
from skillframe.cosim.servos import Servos, servos
from skillframe.errors import InputError, SkillframeError, UnknownName
from skillframe.execution.drives.servo_plots import servo_plots
from skillframe.execution.executor import Setup, begin, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import audit
from skillframe.fmu.build import fmu_folders
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot, robot_names
from skillframe.world.quantities import SensorSettings
from tests.fmu_cache import compiler, own_cache  # noqa: F401
from tests.laws.pushing import FORCE_CAP, Push
from tests.laws.runs import SILENT, generators, scene

pytestmark = pytest.mark.usefixtures("own_cache", "compiler")
KINDS = ["panda_servo", "panda_position"]
STILL = np.diag([1000.0] * 3 + [50.0] * 3)


@cache
def model(name):
    return load_robot_model(name)


def setup(name, world="valley", sensors=SILENT):
    task, robot = scene(world), model(name) if isinstance(name, str) else name
    return Setup(robot=robot, scene=task, center_of_compliance=np.array(task.tool.frames["tip"]), sensors=sensors)


def changed(**values):
    """The torque servos with another first entry."""
    spec = load_robot("panda_servo")
    first, *rest = spec.actuation
    return replace(spec, actuation=(replace(first, **values), *rest))


def pushed(name, seconds=1.5, count=1, draws=None, sensors=SILENT, trace_hz=100.0):
    skill = Push((0.0, 0.0, -1.0), STILL, speed=0.05, stall=False, damping=np.diag([60.0] * 3 + [3.0] * 3))
    return simulate(skill, setup(name, sensors=sensors), draws or {}, generators(count), duration_s=seconds,
                    trace_hz=trace_hz)  # fmt: skip


@pytest.fixture(scope="module")
def runs():
    return {name: pushed(name, 2.5).traces[0] for name in ("panda", *KINDS)}


@pytest.mark.parametrize("name", KINDS)
def test_a_servo_arm_that_is_told_to_hold_stands_as_it_was_put(name):
    """The servos start in balance with gravity: the tool moves by less than a hundredth of a millimetre."""
    result = simulate(HoldSkill(), setup(name), {}, generators(1), duration_s=0.3, trace_hz=100.0)
    position = result.traces[0].position
    assert np.abs(position - position[0]).max() < 1e-5
    assert result.reason[0].startswith("time limit")


def test_in_contact_servos_push_as_ideal_torques_do_but_for_their_friction(runs):
    """In the valley the law's spring holds 20 N, 23 N with its damping while x_d goes on. Coulomb friction of 1 Nm in
    shoulder and elbow, half a metre from the tool, hides 2 N each; a position servo's inner loop divides friction by
    1 + K_p/k = 3."""
    force = {name: trace.wrench_true[-20:, 2].mean() for name, trace in runs.items()}
    assert force["panda"] == pytest.approx(FORCE_CAP + 60.0 * 0.05, abs=0.1)
    assert 0.05 < abs(force["panda_servo"] - force["panda"]) < 4.0
    assert abs(force["panda_position"] - force["panda"]) < 4.0 / 3.0
    for name in KINDS:
        np.testing.assert_allclose(runs[name].position[-1], runs["panda"].position[-1], atol=1e-3)


def test_what_a_servo_is_told_and_gives_is_in_the_trace(runs, tmp_path):
    for name in KINDS:
        trace = runs[name]
        assert trace.meta["actuators"] == [f"joint{i}" for i in range(1, 8)]
        assert trace.meta["notes"] == []
        trace.save(tmp_path / "t.npz")
        columns = type(trace).load(tmp_path / "t.npz").machine
        assert set(columns) == {"servo_command", "servo_force", "servo_motor_position", "servo_motor_velocity"}
        wound = columns["servo_motor_position"] - trace.q
        stiffness = np.array([3000.0] * 4 + [1500.0] * 2 + [400.0])
        np.testing.assert_allclose(
            columns["servo_force"][-1], stiffness * wound[-1], atol=0.01
        )  # at rest, k (theta - q)
    np.testing.assert_allclose(runs["panda_servo"].machine["servo_command"][-1], columns["servo_force"][-1], atol=2.0)


def test_a_position_turns_back_into_the_torque_that_it_stands_for():
    """With theta = q + tau/k, at rest and moving: K_p (target - theta) - K_v w = tau."""
    spec = load_robot("panda_position")
    own = servos(spec)
    torque, q = np.array([[5.0, -20.0, 1.0, 18.0, 0.5, 2.0, -0.1]]), np.full((1, 7), 0.3)
    for speed in (0.0, 0.7):
        target = own.command(torque, q, np.full((1, 7), speed))[0]
        for k, actuation in enumerate(spec.actuation):
            p, tau = actuation.parameters, torque[0, k]
            error = target[k] - (0.3 + tau / p["stiffness"])
            assert p["position_gain"] * error - p["velocity_gain"] * speed == pytest.approx(tau, rel=1e-9)


def test_the_servos_of_a_trial_that_has_ended_are_not_stepped():
    loop = begin(HoldSkill(), setup("panda_servo"), {}, generators(2))
    loop.prepare()
    loop.drive.end(np.array([1]))
    assert loop.drive.limb.bank.active.tolist() == [1] * 7 + [0] * 7


@pytest.mark.parametrize("name", KINDS)
def test_a_trial_is_the_same_to_the_last_bit_alone_and_beside_others(name):
    draws = {"robot.mass_scale": np.array([1.0, 1.03, 0.97]), "actuator.friction_scale": np.array([1.0, 0.0, 2.0])}
    together = pushed(name, 0.3, 3, draws, SensorSettings())
    skill = Push((0.0, 0.0, -1.0), STILL, speed=0.05, stall=False, damping=np.diag([60.0] * 3 + [3.0] * 3))
    for i in range(3):
        alone = simulate(
            skill, setup(name, sensors=SensorSettings()), {key: v[i : i + 1] for key, v in draws.items()},
            [np.random.default_rng([0, i])], duration_s=0.3, trace_hz=100.0,
        )  # fmt: skip
        for column in ("position", "wrench", "q"):
            assert np.array_equal(getattr(together.traces[i], column), getattr(alone.traces[0], column)), column
        for column, values in together.traces[i].machine.items():
            assert np.array_equal(values, alone.traces[0].machine[column]), column


def test_the_law_reads_the_motors_speeds_and_knows_their_rotors():
    loop = begin(HoldSkill(), setup("panda_position"), {}, generators(2))
    limb, ideal = loop.drive.limb, begin(HoldSkill(), setup("panda"), {}, generators(2)).drive.limb
    column = limb.bank.outputs.index("motor_velocity")
    limb.bank.y[:, column] = np.linspace(0.1, 1.4, 14)
    np.testing.assert_array_equal(limb.kinematics(loop.active).velocity, limb.bank.y[:, column].reshape(2, 7))
    np.testing.assert_array_equal(limb.plant.state[1], np.zeros((2, 7)))
    rotors = np.diag([0.5] * 4 + [0.15] * 3) / 3.0  # the inner loop's 1 + K_p/k
    np.testing.assert_allclose(limb.mass_matrix() - ideal.mass_matrix(), np.tile(rotors, (2, 1, 1)), atol=1e-12)


def test_a_report_shows_torques_and_motors_and_calls_the_force_measured(runs):
    trace = runs["panda_servo"]
    assert [plot.title for plot in servo_plots(trace)] == ["Joint torques", "Motors"]
    assert len(run_plots(trace)) == 4  # with torque and attitude, which an estimated force does not show
    assert not servo_plots(replace(trace, machine={"thrust": np.zeros((len(trace.time), 2))}))  # another's columns


def test_friction_that_is_drawn_reaches_the_servos():
    loop = begin(
        HoldSkill(),
        setup("panda_servo", sensors=SensorSettings()),
        {"actuator.friction_scale": np.array([0.0, 3.0])},
        generators(2),
    )
    loop.prepare()
    loop.run(0.2, None)
    bank = loop.drive.limb.bank
    motor = bank.y[:, bank.outputs.index("motor_velocity")].reshape(2, 7)
    assert np.abs(motor[0]).max() > np.abs(motor[1]).max()  # noise moves what does not stick


@pytest.mark.slow
def test_joints_without_a_servo_are_driven_ideally():
    spec = load_robot("panda_servo")
    half = load_model(replace(spec, actuation=spec.actuation[:4]))
    result = pushed(half, 2.0)
    assert result.traces[0].meta["actuators"] == ["joint1", "joint2", "joint3", "joint4"]
    assert result.traces[0].wrench_true[-1, 2] == pytest.approx(FORCE_CAP + 3.0, abs=4.0)  # as above
    assert result.traces[0].machine["servo_command"].shape[1] == 4


def test_an_input_that_nobody_maps_is_said_in_the_result_and_by_robots_check():
    spec = changed(unused=("motor_torque", "current"))
    sentence = "no inputs entry writes target (0) of electric_servo on joint1; such an input keeps its start value"
    result = simulate(HoldSkill(), setup(load_model(spec)), {}, generators(1), duration_s=0.01, trace_hz=100.0)
    assert result.traces[0].meta["notes"] == [sentence]
    found = [(p.code, p.message) for p in audit(spec).problems]
    assert found == [
        ("not_mapped", sentence),
        ("not_mapped", "no outputs entry reads friction of electric_servo on joint1"),
    ]
    assert not audit(load_robot("panda_servo")).problems and not audit(load_robot("panda_position")).problems


def test_what_is_left_alone_must_be_there():
    spec = changed(unused=("targt",))
    with pytest.raises(UnknownName, match=r"did you mean 'target'\?"):
        begin(HoldSkill(), setup(load_model(spec)), {}, generators(1))
    assert [p.code for p in audit(spec).problems] == ["cannot_run"] and not audit(spec).usable


MOTION = {"position": "position", "velocity": "velocity", "acceleration": "acceleration"}


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"inputs": MOTION}, r"the servo on joint1 has no command: its inputs map neither torque nor target"),
        (
            {"inputs": {**MOTION, "torque": "torque", "target": "target"}},
            "has two commands, torque and target; map one",
        ),
        ({"inputs": {**MOTION, "command": "torque"}}, "has no command"),
        ({"inputs": {**MOTION, "target": "target"}}, r"its position_gain \[N m/rad\] is not known; add it"),
        ({"nominal": {"stiffness": 0.0}}, r"stiffness of the servo on joint1 is 0\.0; it must be greater than zero"),
        (
            {"nominal": {"rotor_inertia": "big"}},
            r"rotor_inertia of the servo on joint1 is 'big'; it must be zero",
        ),
    ],
)
def test_servos_that_could_not_be_driven_are_refused_and_named_by_robots_check(values, sentence):
    spec = changed(**values)
    with pytest.raises(InputError, match=sentence):
        begin(HoldSkill(), setup(load_model(spec)), {}, generators(1))
    assert any(p.code == "cannot_run" and re.search(sentence.split(";")[0], p.message) for p in audit(spec).problems)


def test_an_input_of_a_wrong_name_is_answered_with_the_nearest():
    spec = changed(inputs={**MOTION, "torque": "torqe"})
    with pytest.raises(UnknownName, match="did you mean 'torque'"):
        begin(HoldSkill(), setup(load_model(spec)), {}, generators(1))


def test_a_spring_too_stiff_for_the_control_rate_is_refused():
    spec = changed(parameters={**load_robot("panda_servo").actuation[0].parameters, "stiffness": 1e6})
    with pytest.raises(StepTooLarge, match="joint1: with a step of 1 ms"):
        begin(HoldSkill(), setup(load_model(spec)), {}, generators(1))


def test_a_servo_that_refuses_its_figures_says_which(monkeypatch):
    monkeypatch.setattr("skillframe.extend.drives.require_within", lambda *known: None)
    draws = {"actuator.friction_scale": np.array([-1.0])}
    with pytest.raises(SkillframeError, match=r"joint1 .*parameter viscous_friction is -2; it must be zero or more"):
        begin(HoldSkill(), setup("panda_servo"), draws, generators(1))


@pytest.mark.parametrize("name", KINDS)
def test_a_delay_holds_back_what_each_trial_s_servos_are_told_and_no_other_s(name, monkeypatch):
    sent, command = [], Servos.command
    monkeypatch.setattr(Servos, "command", lambda *given: sent.append(command(*given)) or sent[-1])
    late = pushed(name, 0.1, 2, {"actuator.delay": np.array([0.0, 0.005])}, trace_hz=1000.0).traces
    # The last command comes after the last row of a trace.
    told = np.stack([trace.machine["servo_command"][-50:] for trace in late], axis=1)
    np.testing.assert_array_equal(told[:, 0], np.array(sent[-51:-1])[:, 0])
    np.testing.assert_array_equal(told[:, 1], np.array(sent[-56:-6])[:, 1])  # 5 ticks of a millisecond
    plain = pushed(name, 0.1, 1, trace_hz=1000.0).traces[0].machine["servo_command"][-50:]
    np.testing.assert_array_equal(told[:, 0], plain)


def test_a_servo_arm_that_is_told_late_to_hold_stands_and_one_told_far_too_late_does_not():
    """Its damping is behind the delay: a few milliseconds pass, with 0.1 s it rings until a limit ends it."""
    few, many = (pushed("panda_servo", 1.0, 1, {"actuator.delay": np.array([late])}).traces[0] for late in (0.002, 0.1))
    plain = pushed("panda_servo", 1.0, 1).traces[0]
    # 2 ms at the push's 50 mm/s are 0.1 mm
    np.testing.assert_allclose(few.position[-1], plain.position[-1], atol=5e-4)
    assert many.meta["failure"] and len(many.time) < len(plain.time)


def written(tmp_path, text):
    folder = tmp_path / "robots" / "mine"
    shutil.copytree(robot_names()["panda"], folder.parent / "panda", dirs_exist_ok=True)
    folder.mkdir()
    (folder / "robot.toml").write_text(text)
    return folder / "robot.toml"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('kind = "servo"', 'kind = "servos"', r"drive\.kind: unknown drive 'servos'; did you mean 'servo'"),
        ("[drive]", "[gains]\nbody = 2.0\n[drive]", "unknown key 'gains'"),
        ("[drive]", '[[loop]]\nframe_a = "a"\nframe_b = "b"\n[drive]', "servos drive one open arm"),
    ],
)
def test_a_drive_that_cannot_be_meant_is_refused(tmp_path, old, new, sentence):
    text = (robot_names()["panda_servo"] / "robot.toml").read_text().replace(old, new, 1)
    with pytest.raises(InputError, match=sentence):
        load_robot_model(str(written(tmp_path, text)))


def test_a_kind_without_actuators_is_refused(tmp_path):
    text = (robot_names()["panda"] / "robot.toml").read_text().replace("panda.urdf", "../panda/panda.urdf")
    with pytest.raises(InputError, match=r"there is no \[\[actuation\]\] that it could be the kind of"):
        load_robot(written(tmp_path, text + '\n[drive]\nkind = "servo"\n'))


@pytest.mark.slow
def test_the_same_arm_moves_with_either_version_of_the_standard(monkeypatch):
    """FMI 3 in place of 2: the same bits."""
    import skillframe.cosim.servos as module

    assert "electric_servo" in fmu_folders()
    two = pushed("panda_servo", 0.1).traces[0]
    opened = module.open_actuators
    monkeypatch.setattr(module, "kept", lambda key, make: make())
    monkeypatch.setattr(module, "open_actuators", lambda specs, trials, base: opened(specs, trials, base, version=3))
    three = pushed("panda_servo", 0.1).traces[0]
    for column in ("position", "q", "wrench_true"):
        np.testing.assert_array_equal(getattr(three, column), getattr(two, column))
