"""Kinematics and dynamics of a machine in space: slew, twin cylinders, a bucket linkage, and a turned base."""

import dataclasses

import casadi as ca
import mujoco
import numpy as np
import pinocchio as pin
import pytest
from skillframe_hydraulics.checks.feasibility import problems
from skillframe_hydraulics.law.symbolic_chain import SymbolicChain, closing_function

from skillframe.errors import InputError
from skillframe.extend.drives import audit
from skillframe.robot.chain import ClosedChain, OutOfReach
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.world.convert import build_spec
from skillframe.world.layout import Layout
from tests.excavator import write_excavator
from tests.references import attach_payload, chain_step

MOUNTED = {"level": "0 0 0", "turned": "0.2 0.3 0.7853981633974483"}
LOW, HIGH = np.array([-3.0, -0.9, 0.8, 0.2]), np.array([3.0, -0.05, 2.0, 1.5])


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    return {name: write_excavator(tmp_path_factory.mktemp(name), turn) for name, turn in MOUNTED.items()}


@pytest.fixture(scope="module", params=list(MOUNTED))
def chain(request, folders):
    return ClosedChain(load_model(load_robot(folders[request.param])))


@pytest.fixture
def states(chain):
    """Ten random states, each with a rate."""
    rng = np.random.default_rng(3)
    return [(rng.uniform(LOW, HIGH), rng.uniform(-0.5, 0.5, 4)) for _ in range(10)]


def test_the_freedoms_are_the_joints_that_carry_the_tool_and_plane_loops_have_two_rows_whatever_turns_them(chain):
    assert chain.independent == ("slew", "boom", "stick", "bucket")
    assert len(chain.actuated) == 5
    assert chain.rows.shape == (10, 15)


def test_the_loops_close_to_rounding_and_stay_on_the_branch_of_home_along_a_way(chain):
    """The sine of the angle between rocker and link has another sign on the other branch."""
    rng = np.random.default_rng(1)
    place, bent = chain.home, chain.model.getJointId("link") - 1
    for _ in range(60):
        z = rng.uniform(LOW, HIGH)
        place = chain.configuration(z, place)
        assert np.abs(chain.gaps(place)).max() < 1e-12
        assert np.sign(np.sin(place[bent])) == np.sign(np.sin(chain.home[bent]))
        np.testing.assert_allclose(place, chain.configuration(z), atol=1e-11)  # whatever way leads there


def test_another_home_is_the_other_branch(folders):
    """With rocker and link folded the other way, mirrored at the line from the rocker's pivot to the ear."""
    robot = load_model(load_robot(folders["level"]))
    own, home = ClosedChain(robot), robot.home.copy()
    j = [robot.model.getJointId(name) - 1 for name in ("rocker", "link")]
    home[j] = own.home[j[0]] + 1.6, -own.home[j[1]]
    other = ClosedChain(dataclasses.replace(robot, home=_aimed(own, home)))
    assert np.sin(other.home[j[1]]) * np.sin(own.home[j[1]]) < -0.1
    assert np.abs(other.gaps(other.home)).max() < 1e-12


def _aimed(chain, home):
    """A home whose bucket cylinder points at its pin on the rocker."""
    model, data, home = chain.model, chain.model.createData(), home.copy()
    pin.framesForwardKinematics(model, data, home)
    barrel = model.getJointId("bucket_cylinder_barrel")
    eye = data.oMi[barrel].actInv(data.oMf[model.getFrameId("bucket_cylinder_eye")].translation)
    home[barrel - 1] += np.arctan2(-eye[2], eye[0])
    home[barrel] = np.hypot(eye[0], eye[2]) - 2.05
    return home


def test_velocities_drift_and_transmission_are_derivatives_of_the_configuration(chain, states):
    """Central differences of step 1e-6: rounding of q (1e-15) over the step, and its square times curvature."""
    h = 1e-6
    for z, zd in states:
        state, (behind, ahead) = chain.at(z, zd), (chain.at(z + k * h * zd, zd) for k in (-1, 1))
        np.testing.assert_allclose((ahead.q - behind.q) / (2 * h), state.v, atol=1e-8)
        np.testing.assert_allclose((ahead.v - behind.v) / (2 * h), state.drift, atol=1e-7)
        for i, unit in enumerate(np.eye(4)):
            moved = chain.configuration(z + h * unit) - chain.configuration(z - h * unit)
            np.testing.assert_allclose(moved[chain.driven] / (2 * h), state.arms[:, i], atol=1e-8)


def test_a_loop_open_by_less_than_a_millimetre_is_closed_in_its_own_plane_wherever_that_turns(tmp_path, states):
    """What is left across the plane does not enter G and its rate, which it would by 0.9 mm/rad in base axes."""
    folder = write_excavator(tmp_path)
    text = (folder / "excavator.urdf").read_text()
    assert text.count('"-0.75 0.0 0.45"') == 1
    (folder / "excavator.urdf").write_text(text.replace('"-0.75 0.0 0.45"', '"-0.75 0.0009 0.45"'))
    skew, h = ClosedChain(load_model(load_robot(folder))), 1e-6
    for z, zd in states[:4]:
        state, (behind, ahead) = skew.at(z, zd), (skew.at(z + k * h * zd, zd) for k in (-1, 1))
        np.testing.assert_allclose(np.abs(skew.gaps(state.q)).max(), 9e-4, rtol=1e-9)
        np.testing.assert_allclose((ahead.q - behind.q) / (2 * h), state.v, atol=1e-8)
        np.testing.assert_allclose((ahead.v - behind.v) / (2 * h), state.drift, atol=1e-7)


def test_mass_and_gravity_are_derivatives_of_the_energies(chain, states):
    h = 1e-5
    for z, zd in states[:4]:
        state = chain.at(z, zd)
        assert 0.5 * zd @ state.mass @ zd == pytest.approx(state.energy()[0], rel=1e-10)
        potential = [[chain.at(z + k * h * e, zd).energy()[1] for k in (1, -1)] for e in np.eye(4)]
        slope = np.array([high - low for high, low in potential]) / (2 * h)
        np.testing.assert_allclose(state.gravity, slope, atol=1e-7 * np.abs(state.gravity).max())


def test_gravity_of_a_kilogram_of_load_is_what_a_heavier_bucket_adds(chain, states):
    model = chain.model
    body, z = model.getJointId("bucket"), states[0][0]
    heavy = model.copy()
    heavy.inertias[body] = model.inertias[body] + pin.Inertia(1.0, model.inertias[body].lever, np.zeros((3, 3)))
    more = ClosedChain(dataclasses.replace(chain.robot, model=heavy)).at(z, np.zeros(4)).gravity
    added, state = more - chain.at(z, np.zeros(4)).gravity, chain.at(z, np.zeros(4))
    np.testing.assert_allclose(state.load_gravity, added, atol=1e-8)  # 1e-13 of 5e5 Nm


def test_twin_cylinders_share_equally_and_unequal_ones_by_their_areas(chain, states):
    """Least squared pressure: F_i is A_i^2 times the same for equal arms."""
    for z, _ in states:
        state = chain.at(z, np.zeros(4))
        for weight in (None, np.array([1.0, 4.0, 4.0, 1.0, 1.0]), np.array([1.0, 1.0, 4.0, 1.0, 1.0])):
            force = state.holding_force(weight)
            assert force[2] == pytest.approx(force[1] * (1.0 if weight is None else weight[2] / weight[1]), rel=1e-9)
            np.testing.assert_allclose(state.arms.T @ force, state.gravity, atol=1e-9 * np.abs(state.gravity).max())


def test_the_machine_on_a_turned_base_has_the_same_masses_and_another_gravity(folders, states):
    one, other = (ClosedChain(load_model(load_robot(folders[name]))) for name in MOUNTED)
    for z, zd in states:
        a, b = one.at(z, zd), other.at(z, zd)
        np.testing.assert_allclose(a.q, b.q, atol=1e-10)  # the URDF's angles are rounded to 1e-16 of 10 m
        np.testing.assert_allclose(a.mass, b.mass, rtol=1e-9, atol=1e-6)
        assert np.abs(a.gravity[0]) < 1e-6 < np.abs(b.gravity[0])


def test_the_symbolic_chain_is_the_numeric_one_and_two_steps_of_newton_close_it(chain, states):
    symbolic, close = SymbolicChain(chain), closing_function(chain)
    rate = ca.SX.sym("rate", 4)
    drift = symbolic.drift_of(symbolic.embedding, rate)
    found = ca.Function("found", [symbolic.q, symbolic.zd, rate], [symbolic.embedding, drift])
    for z, zd in states:
        state = chain.at(z, zd)
        embedding, rates = (np.array(x) for x in found(state.q, zd, zd))
        np.testing.assert_allclose(embedding, state.embedding, atol=1e-12)
        np.testing.assert_allclose(rates.ravel(), state.drift, atol=1e-11)
        q, gap = close(z, chain.configuration(z + 1e-3 * zd / np.abs(zd).max()))
        assert float(gap) < 1e-11
        np.testing.assert_allclose(np.array(q).ravel(), state.q, atol=1e-11)


def test_a_machine_without_loops_is_its_tree():
    spec = dataclasses.replace(load_robot("hiab_xs031"), loop=(), actuation=())
    chain, z = ClosedChain(load_model(spec)), np.arange(7) / 10.0
    assert np.array_equal(chain.at(z, z).embedding, np.eye(7))
    q, gap = closing_function(chain)(z, np.zeros(7))
    assert np.array_equal(np.array(q).ravel(), z) and float(gap) == 0.0
    np.testing.assert_array_equal(np.array(ca.DM(SymbolicChain(chain).embedding)), np.eye(7))


@pytest.fixture
def plant(chain, scene):
    """Compiled MuJoCo model with one `connect` constraint per loop, its data and layout."""
    model = build_spec(chain.robot, scene("free")).compile()
    return model, mujoco.MjData(model), Layout(model)


@pytest.mark.slow
def test_mujocos_constraints_move_it_as_the_reduced_equations_do(chain, plant, scene):
    """100 ms under forces off balance. The gap's bound is the crane's; MuJoCo's soft loops pass 1e-4 of a load."""
    model, data, layout = plant
    robot = chain.robot
    tool = scene("free").tool
    held = attach_payload(robot.model, robot.tool_frames[0], tool.mass, tool.center_of_mass, tool.inertia)
    loaded = ClosedChain(dataclasses.replace(robot, model=held))
    z, zd = loaded.minimal(loaded.home), np.zeros(4)
    data.qpos = layout.to_mujoco(loaded.model, loaded.home[None])[0]
    dofs = [int(model.joint(name).dofadr[0]) for name in loaded.actuated]
    force = loaded.at(z, zd).holding_force() + np.array([5e4, 2e4, 1e4, -1.5e4, 1e4])
    data.qfrc_applied[dofs] = force
    start, gap = z.copy(), 0.0
    for _ in range(100):
        mujoco.mj_step(model, data)
        z, zd = chain_step(loaded, z, zd, force, 0.001)
        gap = max(gap, np.abs(loaded.gaps(layout.to_pinocchio(loaded.model, data.qpos[None])[0])).max())
    found = layout.to_pinocchio(loaded.model, data.qpos[None])[0]
    moved = np.abs(z - start)
    assert moved.min() > 1e-4
    assert gap < 5e-6
    np.testing.assert_allclose(loaded.minimal(found), z, atol=2e-3 * moved.max())


def test_a_dead_centre_of_a_linkage_is_refused_before_it_and_beyond_it(tmp_path):
    """With a shorter link the bucket cannot turn round: link folds onto rocker, which bisection finds."""
    folder = write_excavator(tmp_path)
    text = (folder / "excavator.urdf").read_text()
    assert text.count('"0.62 0.0 0.0"') == 1
    (folder / "excavator.urdf").write_text(text.replace('"0.62 0.0 0.0"', '"0.5 0.0 0.0"'))
    chain = ClosedChain(load_model(load_robot(folder)))
    z, inside, outside = chain.minimal(chain.home), 0.9, -1.6
    for _ in range(20):
        z[3] = 0.5 * (inside + outside)
        try:
            chain.configuration(z)
            inside = z[3]
        except OutOfReach as error:
            outside, said = z[3], str(error)
    assert "the loop ear - link_end cannot close in this configuration" in said
    z[3] = inside
    assert abs(np.sin(chain.configuration(z)[chain.model.getJointId("link") - 1])) < 0.01
    z[3] = -2.6  # where the loops would close again, but not without opening on the way
    with pytest.raises(OutOfReach, match="the loop ear - link_end cannot close"):
        chain.configuration(z)
    for before, refused in ((1e-4, True), (0.3, False)):
        z[3] = inside + before
        found = [text for text in problems(chain, z) if "the linkage of" in text]
        assert bool(found) == refused, found


def test_a_wrong_hinge_in_the_linkage_is_named_with_its_loop(folders, tmp_path):
    folder = write_excavator(tmp_path)
    text = (folder / "excavator.urdf").read_text()
    at = text.index("<axis", text.index('<joint name="link"'))
    (folder / "excavator.urdf").write_text(text[:at] + text[at:].replace('xyz="0 1 0"', 'xyz="0 0 1"', 1))
    with pytest.raises(InputError, match="the loop ear - link_end cannot move: its joints bucket, rocker, link do not"):
        ClosedChain(load_model(load_robot(folder)))


def test_check_finds_nothing_of_the_machine_with_its_slew_and_without_it(folders, tmp_path):
    assert audit(load_robot(folders["level"])).usable
    assert audit(load_robot(write_excavator(tmp_path, slew="fixed"))).usable


def test_a_slew_that_is_locked_is_the_machine_turned_in_a_plane_of_its_own_in_both_engines(folders, tmp_path, scene):
    """As the free one at that angle: tool, masses and MuJoCo's bodies."""
    folder = write_excavator(tmp_path)
    text = (folder / "robot.toml").read_text()
    motor = text.index("[[actuation]]")
    text = text[:motor] + text[text.index("[[actuation]]", motor + 1) :]
    text = text.replace("slew = 0.3\n", "").replace("[home]", "[lock]\nslew = 0.3\n[home]")
    (folder / "robot.toml").write_text(text)
    held, free = (ClosedChain(load_model(load_robot(each))) for each in (folder, folders["level"]))
    assert held.independent == ("boom", "stick", "bucket")
    z = free.minimal(free.home)
    one, other = held.at(z[1:], np.zeros(3)), free.at(z, np.zeros(4))
    np.testing.assert_allclose(one.mass, other.mass[1:, 1:], rtol=1e-9)
    bodies = []
    for chain in (held, free):
        model = build_spec(chain.robot, scene("free")).compile()
        data = mujoco.MjData(model)
        data.qpos = Layout(model).to_mujoco(chain.model, chain.home[None])[0]
        mujoco.mj_forward(model, data)
        bodies.append(data.body("bucket").xpos.copy())
    np.testing.assert_allclose(bodies[0], bodies[1], atol=1e-9)
    said = [problem.fix for problem in audit(load_robot(folder)).problems]
    assert said == ["write fixture = [7.301, 2.259, 0], or another in the plane"]  # 8 m out at 0.3 rad
