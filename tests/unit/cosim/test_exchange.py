"""A macro step in C is the master's own, to the last bit: forces, motions, ledger, and what fails."""

import numpy as np
import pytest

from skillframe.cosim import CosimSettings, Master
from skillframe.execution.drives.actuated import CoupledPlant
from skillframe.fmu.actuator import ActuatorSpec
from skillframe.fmu.opening import open_actuators
from skillframe.world.placement import fixture_poses
from skillframe.world.plant import Plant
from tests.laws.crane_plants import crane, empty_scene
from tests.laws.vdc_loop import START

TRIALS, TICKS, DT = 3, 120, 1e-3


@pytest.fixture(autouse=True)
def _with_a_compiler(compiler):
    pass


def cranes(native, monkeypatch):
    """Three cranes that hang differently, coupled with their cylinders."""
    robot = crane().robot
    scales = {"robot.mass_scale": np.linspace(0.95, 1.05, TRIALS)}
    plant = Plant(robot, empty_scene(), TRIALS, fixture_poses(robot, {}, TRIALS), scales, DT)
    poses = [np.asarray(START) + 0.02 * i for i in range(TRIALS)]
    plant.reset(np.stack([crane().configuration(z) for z in poses]))
    holding = np.concatenate([crane().at(z, np.zeros(3)).holding_force() for z in poses])
    specs = [
        ActuatorSpec(fmu="hydraulic_cylinder", parameters=dict(a.parameters), name=a.joint)
        for a in robot.spec.actuation
    ]
    if not native:
        monkeypatch.setattr("skillframe.cosim.master.compiled_exchange", lambda *given: None)
    coupled = CoupledPlant(plant, crane().actuated)
    master = Master(coupled, open_actuators(specs, TRIALS), CosimSettings(step=DT))
    monkeypatch.undo()
    assert (master._native is not None) == native
    master.start(0.0, 0.0, [{"initial_force": float(force)} for force in holding])
    return master


def run(master, upset):
    """Everything that a run leaves, tick by tick, under commands of which some are upset."""
    rng, rows = np.random.default_rng(4), []
    coupled, bank = master.plant, master.bank
    for tick in range(TICKS):
        command = 0.2 * rng.standard_normal(bank.count)
        coupled.load[:] = 10.0 * rng.standard_normal(coupled.load.shape)
        upset(tick, command, master)
        fine = master.step(command)
        position, velocity = coupled.plant.state
        rows.append(
            np.concatenate(
                [master.force, bank.y.ravel(), bank.u.ravel(), position.ravel(), velocity.ravel(), bank.active, [fine]]
            )
        )
    left = master.difference, master.exchanged, list(master.trouble().values()), master.time, master.steps
    bank.close()
    return np.array(rows), left


def nothing(tick, command, master):
    """All goes well."""


def one_ends(tick, command, master):
    """The second crane is not stepped any more from the 40th tick on."""
    if tick == 40:
        master.plant.active, master.bank.active[3:6] = np.array([0, 2]), 0


def one_fails(tick, command, master):
    """A cylinder of the third crane is told what is no number."""
    if tick == 60:
        command[7] = np.nan
    if tick > 60:
        master.plant.active, master.bank.active[6:] = np.array([0, 1]), 0


@pytest.mark.parametrize("upset", [nothing, one_ends, one_fails])
def test_a_macro_step_in_c_leaves_what_the_masters_own_leaves(upset, monkeypatch):
    (own, mine), (other, theirs) = (run(cranes(native, monkeypatch), upset) for native in (True, False))
    np.testing.assert_array_equal(own, other)
    for one, two in zip(mine, theirs, strict=True):
        np.testing.assert_array_equal(one, two)
    failed = upset is one_fails
    assert (not own[60, -1]) == failed  # it is told in the tick in which it happens
    assert any("at 0.06 s" in text for text in mine[2]) == failed


@pytest.mark.parametrize("settings", [{"actuator_substeps": 2}, {"plant_substeps": 2}, {"tolerance_j": 1.0}])
def test_what_only_the_masters_own_step_can_do_is_left_to_it(settings):
    robot = crane().robot
    plant = Plant(robot, empty_scene(), 1, fixture_poses(robot, {}, 1), {}, DT)
    specs = [ActuatorSpec(fmu="hydraulic_cylinder", name=a.joint) for a in robot.spec.actuation]
    bank = open_actuators(specs)
    for given, native in (({}, True), (settings, False)):
        master = Master(CoupledPlant(plant, crane().actuated), bank, CosimSettings(step=DT, **given))
        assert (master._native is not None) == native
    bank.close()
