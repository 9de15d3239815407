"""Machines that move their tool in space: a motor that slews, and the controller and force estimate of three axes."""

import dataclasses
import math

import numpy as np
import pytest
from skillframe_hydraulics.checks.feasibility import capacity, problems
from skillframe_hydraulics.checks.figures import unfit_figures, unfit_machine
from skillframe_hydraulics.cylinder import equations as eq
from skillframe_hydraulics.cylinder.bank import open_cylinders
from skillframe_hydraulics.cylinder.reference import ReferenceBank
from skillframe_hydraulics.faults import Faults, moved_joints
from skillframe_hydraulics.force.compiled import CompiledEstimator
from skillframe_hydraulics.force.momentum import ForceSettings
from skillframe_hydraulics.law.gains import law_gains
from skillframe_hydraulics.law.hydraulic import Measured, tool_axes
from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
from skillframe_hydraulics.law.vdc_actuator import chamber_lengths, cylinders
from skillframe_papers.rows.crane_runs import MOVING, Follow, blend, scene

from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.drives import audit
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.build import fmu_folders
from skillframe.fmu.table import read_table
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from tests.excavator import DISPLACEMENT, write_excavator
from tests.oracle.force_estimator import ForceEstimator
from tests.oracle.hydraulic_law import HydraulicLaw

DT = 1e-3
VOLUME, BULK, OTHER = 4e-3, 1.2e9, 8e-3
MOTOR = {
    "displacement": DISPLACEMENT, "dead_volume_a": VOLUME, "dead_volume_b": OTHER, "bulk_modulus": BULK, "leakage": 0.0,
    "coulomb_friction": 0.0, "static_friction": 0.0, "viscous_friction": 0.0, "relief_pressure": 400e5,
    "supply_pressure": 350e5, "initial_pressure": 150e5,
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_excavator(tmp_path_factory.mktemp("space"))


@pytest.fixture(scope="module")
def chain(folder):
    return ClosedChain(load_model(load_robot(folder)))


@pytest.mark.parametrize("kind", ["fmu", "reference"])
def test_a_motor_with_a_shut_valve_is_a_spring_of_its_oil_at_any_angle(kind):
    """Torque -B D^2 (1/V_a + 1/V_b) phi, with chambers that keep their volumes. 1e-4 rad in 100 ms; no ends."""
    spec = [ActuatorSpec(fmu="hydraulic_cylinder", parameters=MOTOR, inputs={}, outputs={}, name="slew")]
    table = read_table(fmu_folders()["hydraulic_cylinder"])
    bank = open_cylinders(spec) if kind == "fmu" else ReferenceBank(spec, table)
    bank.start()
    rate, at = 1e-3, {name: bank.inputs.index(name) for name in ("position", "velocity")}
    for k in range(100):
        bank.u[0, at["position"]], bank.u[0, at["velocity"]] = 50.0 + rate * DT * k, rate
        assert bank.step(k * DT, DT), bank.problem(0)
    stiffness = BULK * DISPLACEMENT**2 * (1.0 / VOLUME + 1.0 / OTHER)
    assert bank.y[0, bank.outputs.index("force")] == pytest.approx(-stiffness * rate * 0.1, rel=1e-6)
    bank.close()


def test_the_controller_and_the_oil_know_that_a_motors_chambers_keep_their_volumes(chain):
    known = cylinders(chain.robot.spec.actuation)
    lengths = chamber_lengths(known, np.full(5, 0.5))
    assert [length[0] * DISPLACEMENT for length in lengths] == pytest.approx([4e-3, 4e-3], rel=1e-12)
    assert lengths[0][1] - known.arm_a[1] == 0.5
    p = eq.derive({name: np.array([value]) for name, value in _defaults().items()})
    assert [float(volume[0]) for volume in eq.volumes(p, np.array([7.0]))] == [VOLUME, OTHER]


def _defaults():
    table = read_table(fmu_folders()["hydraulic_cylinder"])
    return {name: entry.start for name, entry in table.parameter.items()} | MOTOR


def test_a_motor_turns_with_its_displacement_times_the_pressure(chain):
    limit = capacity(chain.robot.spec.actuation[0])
    assert limit.push == limit.pull == pytest.approx(DISPLACEMENT * 345e5, rel=1e-12)


def test_an_arm_that_reaches_over_its_slew_axis_moves_in_space_though_its_jacobian_has_two_directions(tmp_path):
    """At home the tool stands on the axis, and turning does not move it."""
    lift = 1.0
    bend = math.acos(-math.cos(lift) / 0.8) - lift
    chain = ClosedChain(load_model(load_robot(_arm(tmp_path, lift, bend))))
    state = chain.at(chain.minimal(chain.home), np.zeros(3))
    assert np.linalg.matrix_rank(state.jacobian(chain.robot.tool_frames[0])[:3], 1e-6) == 2
    assert np.array_equal(tool_axes(chain), np.eye(3))


def _arm(folder, lift, bend):
    """An arm with slew, lift and bend, its links 1 m and 0.8 m long."""
    joint = '<joint name="{0}" type="revolute"><parent link="{1}"/><child link="{2}"/><origin xyz="{3}"/>'
    joint += '<axis xyz="{4}"/><limit lower="-4" upper="4" effort="0" velocity="1"/></joint>'
    link = '<link name="{0}"><inertial><mass value="9"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    parts = ['<link name="base"/>', *(link.format(name) + "</inertial></link>" for name in ("post", "upper", "fore"))]
    parts += [
        joint.format("slew", "base", "post", "0 0 0", "0 0 1"),
        joint.format("lift", "post", "upper", "0 0 1", "0 -1 0"),
        joint.format("bend", "upper", "fore", "1 0 0", "0 -1 0"), '<link name="tip"/><joint name="end" type="fixed">'
        '<parent link="fore"/><child link="tip"/><origin xyz="0.8 0 0"/></joint>',
    ]  # fmt: skip
    (folder / "arm.urdf").write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    text = f'summary = "an arm"\nurdf = "arm.urdf"\nbase = "fixed"\n[home]\nslew = 0.2\nlift = {lift}\nbend = {bend}\n'
    (folder / "robot.toml").write_text(
        text + '[[arm]]\nname = "arm"\ntool_frame = "tip"\n[workspace]\nfixture = [1, 0, 1]\n'
    )
    return folder


def test_the_law_in_space_is_the_readable_law(chain):
    """Four freedoms, five actuators of which one is a motor, three axes of the tool and a joint."""
    parts = chain, cylinders(chain.robot.spec.actuation), law_gains(chain)
    readable, compiled = HydraulicLaw(*parts, 1, DT), CompiledLaw(*parts, 1, DT, use_compiler=False)
    rng = np.random.default_rng(5)
    for jump in (0.1, 1e-4):
        measured, reference = compiled.given
        assert reference.position.shape == (1, 3) and reference.joint.shape == (1, 1)
        measured.z[:] = chain.minimal(chain.home) + jump * rng.uniform(-1.0, 1.0, (1, 4))
        measured.rate[:] = rng.uniform(-0.3, 0.3, (1, 4))
        for pressure in measured[2:4]:
            pressure[:] = rng.uniform(20e5, 200e5, (1, 5))
        measured.force[:], measured.sigma[:] = rng.uniform(-1e4, 1e4, (1, 3)), 800.0
        reference.position[:] = compiled.terms(measured).tip + 0.05
        half = rng.normal(size=(3, 3))
        reference.damping[:] = 5e4 * (np.eye(3) + 0.1 * half @ half.T)
        reference.stiffness[:] = 1e5 * half @ half.T
        reference.joint[:] = measured.z[:, 3:] + 0.1
        given = [type(part)(*(np.copy(x) for x in part)) for part in (measured, reference)]
        own, other = compiled.step(measured, reference, np.arange(1)), readable.step(*given, np.arange(1))
        for found, expected in zip(own, other, strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_the_force_estimate_in_space_is_the_readable_one_and_needs_as_many_freedoms_as_components_that_slide(chain):
    known, noise = cylinders(chain.robot.spec.actuation), (4000.0, 3000.0, 2000.0, 800.0)
    settings = ForceSettings(row_noise=noise, settle=0.01, memory=0.005)
    parts = chain, known, 1, DT, settings
    readable, generated = ForceEstimator(*parts), CompiledEstimator(*parts, use_compiler=False)
    law, moved = CompiledLaw(chain, known, law_gains(chain), 1, DT, use_compiler=False), {}
    home = chain.minimal(chain.home)
    for moving in ((1, 1, 1, 1), (0, 1, 1, 1), (0, 1, 0, 1)):  # of slew, boom, stick, bucket
        for each in (readable, generated):
            each.start()
        for k in range(40):
            turn, share = 2 * np.pi * k / 160, 0.1 * np.array(moving)
            z, rate = (home + share * np.sin(turn))[None], (share * np.cos(turn))[None]
            pressures = (np.full((1, 5), 90e5 + 3e6 * np.sin(turn)), np.full((1, 5), 60e5))
            measured = Measured(z, rate, *pressures, *np.zeros((2, 1, 3)))
            at = law.terms(measured)
            expected, found = readable.step(measured, at), generated.step(measured, at)
            for name, own, other in zip(expected._fields, found, expected, strict=True):
                np.testing.assert_allclose(own, other, rtol=0, atol=1e-7 * np.abs(other).max(), err_msg=name)
        moved[moving] = bool(found.valid[0]), found.sigma[0].copy()
    assert [valid for valid, _ in moved.values()] == [True, True, False]  # two booms are one freedom
    across = np.array([-np.sin(home[0]), np.cos(home[0]), 0.0])
    standing, slewing = (np.hypot(*(moved[key][1] * across)[:2]) for key in list(moved)[1::-1])
    assert slewing < 0.9 * standing  # what the slew's friction may hide is in sigma


def test_a_fault_of_any_of_more_actuators_than_freedoms_strikes_its_own_encoder(chain):
    faults = Faults({"fault.cylinder": 5.0, "sensor.encoder_step": 0.5}, moved_joints(chain), 1, DT, 0)
    faults.tick()
    read = faults.read(np.zeros((1, 4 + 10)))
    assert np.flatnonzero(read[0]).tolist() == [3]  # the bucket's


def test_the_check_of_a_machine_that_slews_finds_nothing_and_says_what_its_motor_lacks(folder, tmp_path):
    assert not [each for each in audit(load_robot(folder)).problems if each.severity != "info"]
    text = (folder / "robot.toml").read_text()
    for old, new, said in (
        (f"displacement = {DISPLACEMENT}, ", "", "the cylinder on slew has no bore, rod, stroke"),
        ("bore = 0.15,", "displacement = 0.02, bore = 0.15,", "the motor on bucket_cylinder_piston drives a"),
        (f"displacement = {DISPLACEMENT}", "displacement = 7735.0", "displacement of the motor on slew is 7735 m3"),
        ("dead_volume_a = 4e-3", 'dead_volume_a = -1.0', "dead_volume_a of the motor on slew is -1.0"),
    ):  # fmt: skip
        assert old in text
        other = write_excavator(tmp_path)
        (other / "robot.toml").write_text(text.replace(old, new, 1))
        spec = load_robot(other)
        slips = [slip for each in spec.actuation for slip in unfit_figures(each)]
        found = [slip.problem for slip in (*slips, *unfit_machine(load_model(spec)))]
        assert any(said in message for message in found), found


def test_a_port_relief_below_the_supply_is_named_and_limits_what_a_cylinder_holds(folder, tmp_path):
    other = write_excavator(tmp_path)
    text = (other / "robot.toml").read_text()
    (other / "robot.toml").write_text(text.replace(", relief_pressure = 400e5", "", 2))  # of slew and left boom
    spec = load_robot(other)
    said = [each.message for each in audit(spec).problems if each.code == "relief_pressure"]
    assert said == [
        f"port relief of the {name} opens at 250 bar, below its supply of 350 bar: it opens before the actuator"
        " pushes with all of it" for name in ("motor on slew", "cylinder on boom_left_piston")
    ]  # fmt: skip
    weak = dataclasses.replace(spec.actuation[1], parameters={**spec.actuation[1].parameters, "relief_pressure": 100e5})
    chain = ClosedChain(load_model(dataclasses.replace(spec, actuation=(spec.actuation[0], weak, *spec.actuation[2:]))))
    found = problems(chain, chain.minimal(chain.home))
    assert found == [
        "boom_left_piston would have to push 281.5 kN, more than the 195.8 kN that port relief at 100 bar leaves"
    ]


@pytest.mark.slow
def test_an_excavator_that_slews_follows_a_path_in_space_with_masses_and_friction_off(folder, chain):
    """1 m to the side, out and down at 0.46 m/s, within 10 mm, with masses 10 % heavier and friction 20 % lower."""
    tip = chain.at(chain.minimal(chain.home), np.zeros(4)).data.oMf[chain.robot.tool_frames[0]].translation

    def path(time):
        value, rate = blend(time / 4.0)
        way = np.array([0.4, 0.8, -0.4])
        return value * way, rate / 4.0 * way

    where = scene(tip - np.array([5.0, 0.0, 0.0]), plate=False)  # the fixture is 5 m farther out than the crane's
    draws = {"robot.mass_scale": np.array([1.1]), "actuator.friction_scale": np.array([0.8])}
    rngs = [np.random.default_rng(5)]
    setup = Setup(robot=load_robot_model(str(folder)), scene=where)
    trace = simulate(Follow(path, MOVING), setup, draws, rngs, duration_s=5.0, trace_hz=100.0).traces[0]
    assert trace.time[-1] > 4.9
    wanted = trace.position[0] + np.array([path(time)[0] for time in trace.time])
    assert np.linalg.norm(trace.position - wanted, axis=1).max() < 0.01
    assert trace.machine["force_sigma"].shape[1:] == (3,)
