"""A hydraulic machine in the one loop: trials that do not know each other, its delay, payload, starts and energy."""

import dataclasses
import re
import shutil

import numpy as np
import pytest
from skillframe_hydraulics.declared import Gains, with_gains
from skillframe_hydraulics.drive import holding_force
from skillframe_hydraulics.law.gains import law_gains
from skillframe_hydraulics.law.hydraulic import HydraulicGains
from skillframe_papers.rows.crane_runs import ABOVE, FIXTURE, MOVING, PRESSING, Follow, diamond, press_and_slide, scene

from skillframe.errors import InputError, SkillframeError
from skillframe.execution.executor import Setup, begin, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import audit
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.payload import with_payload
from skillframe.robot.spec import load_robot, robot_names
from skillframe.world.convert import SOLIMP
from tests.fmu_cache import own_cache  # noqa: F401

HOME = np.array([FIXTURE[0], 0.0, ABOVE])
DRAWS = {
    "robot.payload": np.array([475.0, 430.0]), "actuator.delay": np.array([0.0, 4e-3]),
    "actuator.supply_pressure": np.array([190e5, 180e5]), "actuator.friction_scale": np.array([1.0, 1.2]),
}  # fmt: skip


def setup(robot=None, **scene_values):
    where = scene(scene_values.pop("start", HOME), plate=scene_values.pop("plate", False))
    return Setup(robot=robot or load_robot_model("hiab_xs031"), scene=where)


def rngs(ids):
    return [np.random.default_rng([5, i]) for i in ids]


def of(draws, rows):
    return {name: values[rows] for name, values in draws.items()}


def run_of(rows):
    """Calibrated, then half a second of the diamond."""
    return simulate(Follow(diamond, MOVING), setup(), of(DRAWS, rows), rngs(rows), duration_s=0.5, trace_hz=100.0)


@pytest.fixture(scope="module")
def together():
    return run_of([0, 1])


@pytest.mark.slow
def test_a_trial_is_the_same_to_the_last_bit_alone_and_beside_another(together):
    for i in range(2):
        single = run_of([i])
        for name in ("position", "wrench", "q"):
            assert np.array_equal(getattr(together.traces[i], name), getattr(single.traces[0], name))
        for name, column in together.traces[i].machine.items():
            assert np.array_equal(column, single.traces[0].machine[name]), name


def test_trials_that_differ_in_their_machines_differ_in_their_runs(together):
    one, two = together.traces
    assert np.abs(one.machine["pressure_a"] - two.machine["pressure_a"]).max() > 1e5


def test_a_trace_says_which_actuators_it_shows_and_reads_back_whole(together, tmp_path):
    trace = together.traces[0]
    assert trace.meta["actuators"] == ["lift_piston", "tilt_piston", "extension"]
    assert all(len(column) == len(trace.time) for column in trace.machine.values())
    trace.save(tmp_path / "run.npz")
    read = type(trace).load(tmp_path / "run.npz")
    assert read.machine.keys() == trace.machine.keys()
    assert np.array_equal(read.machine["valve"], trace.machine["valve"])


def test_pistons_pass_on_what_the_machine_gains_and_the_pump_gives_more(together):
    """From a rest, energy is height and motion: W = m g dh + 1/2 m v^2, friction being inside the cylinders' force."""
    trace, chain = together.traces[0], ClosedChain(load_robot_model("hiab_xs031"))
    z = trace.q[:, [list(chain.model.names).index(name) - 1 for name in chain.independent]]
    rate = np.gradient(z, trace.time, axis=0)
    energy = [_mechanical(chain, *row) for row in zip(z, rate, strict=True)]
    gained, passed = energy[-2] - energy[1], trace.machine["energy_pistons"][-2] - trace.machine["energy_pistons"][1]
    assert gained == pytest.approx(passed, abs=0.02 * np.abs(passed) + 1.0)  # rates are differences over 20 ms
    assert trace.machine["energy_supply"][-1] > max(0.0, passed)


def _mechanical(chain, z, rate):
    import pinocchio as pin

    state, data = chain.at(z, rate), chain.model.createData()
    return 0.5 * rate @ state.mass @ rate + pin.computePotentialEnergy(chain.model, data, chain.configuration(z))


@pytest.mark.slow
def test_the_plant_carries_each_trials_own_payload():
    """Its mass matrix is that of a robot made with that payload, to rounding."""
    draws = {"robot.payload": np.array([0.0, 200.0, 475.0])}
    loop = begin(Follow(diamond, MOVING), setup(), draws, rngs(range(3)), None)
    masses = loop.plant.mass_matrix()
    for mass, got in zip(draws["robot.payload"], masses, strict=True):
        robot = load_model(with_payload(load_robot_model("hiab_xs031").spec, float(mass)))
        other = begin(Follow(diamond, MOVING), setup(robot), {}, rngs([0]), None)
        assert np.allclose(got, other.plant.mass_matrix()[0], rtol=1e-9, atol=1e-9 * np.abs(got).max())


def test_a_machine_starts_in_balance_with_what_it_carries():
    """What is left is MuJoCo's compliance of the loops: 1 - d of what a rod of 10.3 kg alone would do."""
    draws = {"robot.payload": np.array([475.0, 0.0]), "robot.mass_scale": np.array([1.1, 1.0])}
    loop = begin(Follow(diamond, MOVING), setup(), draws, rngs(range(2)), None)
    hold = holding_force(loop.drive.chain, loop.plant.state[0][:, loop.drive._z], draws)
    left = np.abs(loop.drive.actuated.plant.motion(hold.ravel()).acceleration).reshape(2, -1)
    assert np.all(left < (1.0 - SOLIMP[0]) * np.abs(hold).max(axis=1, keepdims=True) / 10.3)


@pytest.mark.slow
def test_the_swing_in_air_finds_the_payload():
    """A tenth of the load less; found within 3 kg, a sixth of what 2 % of all masses would be."""
    loop = begin(Follow(diamond, MOVING), setup(), {"robot.payload": np.array([427.5])}, rngs([0]), None)
    loop.prepare()
    assert loop.drive.estimator.identification.theta[0, -1] == pytest.approx(-47.5, abs=3.0)


def test_the_laws_own_defaults_are_those_of_the_crane_that_ships():
    assert law_gains(ClosedChain(load_model(load_robot("hiab_xs031")))) == HydraulicGains()


@pytest.mark.parametrize(("table", "key"), [("sensors", "corner_hz"), ("gains", "force_corner_hz")])
@pytest.mark.slow
def test_filters_that_the_control_rate_is_too_low_for_are_warned_of_and_refused(table, key):
    """Discrete filters ring, and are unstable from 0.13 of the rate on."""
    spec = load_robot("hiab_xs031")
    spec = dataclasses.replace(spec, tables={**spec.tables, table: {**spec.tables.get(table, {}), key: 81.0}})
    sentence = f"{table}.{key} is 81, too fast a filter for control.rate_hz of 1000"
    assert [p.message for p in audit(spec).problems if p.severity != "info"] == [sentence]
    with pytest.raises(InputError, match=re.escape(f"{sentence}; give 80 Hz at most")):
        begin(Follow(standing, MOVING), setup(load_model(spec)), {}, rngs([0]), None)


@pytest.mark.slow
def test_gains_that_a_crane_cannot_have_end_its_trial_with_what_to_lower():
    spec = with_gains(load_robot("hiab_xs031"), Gains(body=1e5))
    result = simulate(Follow(standing, MOVING), setup(load_model(spec)), {}, rngs([0]), duration_s=0.5)
    assert re.match(r"the machine rings: .* lower gains\.body from 1e\+05 to 59", result.reason[0])


@pytest.mark.slow
def test_a_crane_whose_boom_does_not_slide_out_runs_with_its_two_cylinders(tmp_path):
    """It stands where it is told to within what 4 kN of unknown stiction are over K, some centimetres."""
    robot = load_model(load_robot(without_extension(tmp_path)))
    result = simulate(
        Follow(standing, MOVING), setup(robot), {}, rngs([0]), duration_s=0.5, trace_hz=100.0,
    )  # fmt: skip
    trace = result.traces[0]
    assert trace.meta["actuators"] == ["lift_piston", "tilt_piston"]
    assert trace.machine["valve"].shape[1] == 2
    assert np.abs(trace.position - trace.desired_position)[:, [0, 2]].max() < 0.02


def standing(time):
    return np.zeros(3), np.zeros(3)


def without_extension(folder):
    """The crane with its extension fixed where home has it."""
    shutil.copytree(robot_names()["hiab_xs031"], folder / "short_crane")
    urdf, toml = (folder / "short_crane" / name for name in ("hiab_xs031.urdf", "robot.toml"))
    text = urdf.read_text(encoding="utf-8")
    joint = re.search(r'<joint name="extension".*?</joint>', text, re.DOTALL)[0]
    fixed = re.sub(r"<(axis|limit|dynamics)[^>]*/>", "", joint.replace("prismatic", "fixed")).replace("0.041", "0.541")
    urdf.write_text(text.replace(joint, fixed), encoding="utf-8")
    text = toml.read_text(encoding="utf-8").replace("extension = 0.5\n", "")
    toml.write_text(text[: text.rindex("[[actuation]]")], encoding="utf-8")
    return folder / "short_crane"


@pytest.mark.parametrize(("payload", "said"), [(-1.0, "-1 kg is beyond 0kg"), (476.0, "rating of 475 kg; carry less")])
def test_a_payload_beyond_the_rating_is_refused(payload, said):
    with pytest.raises(InputError, match=said):
        simulate(Follow(diamond, MOVING), setup(), {"robot.payload": np.array([payload])}, rngs([0]))


def test_a_payload_of_a_robot_that_declares_none_is_refused():
    panda = load_robot_model("panda")
    with pytest.raises(InputError, match="declares no payload"):
        simulate(Follow(diamond, MOVING), setup(panda), {"robot.payload": np.array([1.0])}, rngs([0]))


@pytest.mark.parametrize("start", [(9.0, 0.0, 1.0), (0.3, 0.0, 0.2)])
def test_a_start_out_of_reach_is_refused(start):
    with pytest.raises(SkillframeError):
        begin(Follow(diamond, MOVING), setup(start=np.array(start)), {}, rngs([0]), None)


def test_a_machine_steers_its_tool_frame_only():
    where = setup()
    other = Setup(robot=where.robot, scene=where.scene, center_of_compliance=np.array([0.0, 0.0, 0.1]))
    with pytest.raises(InputError, match="steers the origin of its tool frame"):
        simulate(Follow(diamond, MOVING), other, {}, rngs([0]))


@pytest.mark.slow
def test_pressing_on_a_plate_is_seen_in_the_pressures():
    """Sliding at 12 kN: the estimate follows the simulator's contact within 6 %, the threshold of the force figures."""
    result = simulate(
        Follow(press_and_slide(0.12), PRESSING), setup(plate=True), {}, rngs([0]), duration_s=9.0, trace_hz=100.0
    )
    trace = result.traces[0]
    moving = (trace.time > 7.0) & (trace.machine["force_valid"] > 0.5)
    true, seen = trace.wrench_true[moving][:, [0, 2]], trace.wrench[moving][:, [0, 2]]
    assert moving.sum() > 30
    assert np.hypot(*(seen - true).T).max() < 0.06 * np.hypot(*true.T).mean()


def test_a_start_across_the_plane_is_refused():
    aside = {"start.offset_y": np.array([0.0, 0.1])}
    with pytest.raises(InputError, match=r"start\.offset_y: hiab_xs031 moves its tool in a plane"):
        simulate(Follow(diamond, MOVING), setup(), aside, rngs([0, 1]), duration_s=0.1)


@pytest.mark.slow
def test_a_crane_that_is_told_to_stand_in_the_air_stands():
    """Its stuck pistons show a force of a kilonewton; answered, it set the tool swinging by 60 to 80 mm/s."""
    stiff = {"robot.mass_scale": np.array([1.0, 0.98]), "actuator.friction_scale": np.array([1.0, 1.2])}
    skill = Follow(lambda time: (np.zeros(3), np.zeros(3)), PRESSING)
    result = simulate(skill, setup(), stiff, rngs([0, 1]), duration_s=2.0, trace_hz=100.0)
    for trace in result.traces:
        seen = np.hypot(*trace.wrench[:, [0, 2]].T)
        rates = np.gradient(trace.q, trace.time, axis=0)[100:]
        assert seen.max() > 300.0  # the false force is there
        assert np.sqrt(np.mean(rates**2, axis=0)).max() < 1e-3  # 3 mm/s of the tool; swinging it was 2e-2


def test_the_record_holds_the_force_as_it_is_now_and_the_law_gets_the_late_one(together):
    """Fed back, a force that looks ahead made the crane bounce to its force limit."""
    trace = together.traces[0]
    loop = begin(Follow(diamond, MOVING), setup(), of(DRAWS, [0]), rngs([0]), 100.0)
    drive, estimate = loop.drive, loop.drive.estimator.estimate
    estimate.force[:], estimate.feedback[:], estimate.answered[:] = [3.0, 4.0], [1.0, 2.0], [0.5, 1.0]
    drive.estimate = estimate
    seen = drive._tool.seen(0.0, loop.plant.tool_pose().rotation)
    loop.skill.start(seen, rngs([0]))
    drive.act(loop.skill.step(seen), 1.0)
    np.testing.assert_array_equal(seen.wrench[0, [0, 2]], [1.0, 2.0])
    np.testing.assert_array_equal(loop.drive._read(seen).wrench[0, [0, 2]], [3.0, 4.0])
    np.testing.assert_array_equal(drive.law.given[0].force, [[0.5, 1.0]])
    assert trace.machine["force_sigma"].shape[1:] == (2,) and set(np.unique(trace.machine["force_valid"])) <= {0.0, 1.0}
