"""The crane's closed chains in the simulated world against the loop-embedding model, an independent oracle."""

import dataclasses

import mujoco
import numpy as np
import pytest

from skillframe.robot.chain import ClosedChain
from skillframe.world.convert import build_spec
from skillframe.world.layout import Layout
from tests.references import attach_payload, chain_step

START = np.array([np.pi / 4, -np.pi / 2, 0.5])
POSES = [START, [0.9, -2.0, 0.0], [0.2, -1.5, 0.8], [1.3, -0.9, 0.2], [0.6, -1.2, 1.1]]


@pytest.fixture
def crane(robot, scene):
    """Compiled plant at 1 ms, its data, where things lie, and the oracle carrying the same tool."""
    plain, task = robot("hiab_xs031"), scene("free")
    model = build_spec(plain, task).compile()
    held = task.tool
    loaded = attach_payload(plain.model, plain.tool_frames[0], held.mass, held.center_of_mass, held.inertia)
    return model, mujoco.MjData(model), Layout(model), ClosedChain(dataclasses.replace(plain, model=loaded))


def place(crane, z):
    _, data, layout, chain = crane
    data.qpos = layout.to_mujoco(chain.model, chain.configuration(np.asarray(z))[None])[0]
    data.qvel[:] = 0.0


def dofs(crane, names):
    return [int(crane[0].joint(name).dofadr[0]) for name in names]


def test_a_robot_without_loops_keeps_integrator_and_constraints(robot, scene):
    model = build_spec(robot("panda"), scene("free")).compile()
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert model.neq == 0


def test_each_loop_is_one_constraint_and_the_integrator_is_of_fourth_order(crane):
    assert crane[0].neq == 2
    assert crane[0].opt.integrator == mujoco.mjtIntegrator.mjINT_RK4


@pytest.mark.parametrize("z", POSES)
def test_the_plant_is_held_by_the_piston_forces_of_the_loop_embedding_model(crane, z):
    """Within 0.01 %: constraints of impedance 0.9999 pass on all but 1e-4 of a load, at most."""
    model, data, _, chain = crane
    free, driven = dofs(crane, chain.independent), dofs(crane, chain.actuated)
    place(crane, z)
    response = []
    for force in (np.zeros(3), *(1e4 * np.eye(3))):
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[driven] = force
        mujoco.mj_forward(model, data)
        response.append(data.qacc[free].copy())
    slope = (np.array(response[1:]) - response[0]).T / 1e4
    holding = np.linalg.solve(slope, -response[0])
    expected = chain.at(z, np.zeros(3)).holding_force()
    np.testing.assert_allclose(holding, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.slow
def test_an_open_loop_swing_agrees_with_the_oracle_and_the_loops_stay_closed(crane):
    """5 um of gap is the bound of the design. The tip may be off by ten times that after an unstable swing of 0.5 s."""
    model, data, layout, chain = crane
    place(crane, START)
    z, zd = START, np.zeros(3)
    force = chain.at(z, zd).holding_force() + np.array([1000.0, 500.0, 300.0])
    data.qfrc_applied[dofs(crane, chain.actuated)] = force
    gap = 0.0
    for _ in range(500):
        mujoco.mj_step(model, data)
        z, zd = chain_step(chain, z, zd, force, 0.001)
        gap = max(gap, np.abs(chain.gaps(layout.to_pinocchio(chain.model, data.qpos[None])[0])).max())
    mujoco.mj_kinematics(model, data)
    tip = chain.at(z, zd).data.oMf[chain.robot.tool_frames[0]].translation
    assert np.abs(z - START).max() > 0.05
    assert data.nefc == 6  # the loops alone: no joint stands at a limit, which the oracle does not know
    assert gap < 5e-6
    np.testing.assert_allclose(data.xpos[layout.sensor], tip, atol=5e-5)
