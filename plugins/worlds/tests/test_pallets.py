"""Surfaces on springs: a stiffness in N/m, the oscillator that goes with it, friction, and no trace of it elsewhere."""

import numpy as np
import pytest
from skillframe_worlds.pallets import STIFFNESS

from skillframe.errors import InputError
from skillframe.frames import Pose
from skillframe.world.convert import SPRUNG
from skillframe.world.placement import start_configurations
from skillframe.world.plant import Plant

ALL, TICK = np.arange(1), 1e-3


def push(now, force, ticks):
    """The free tool, kept from turning, pushed by a force (3,). Deflections (ticks, 2) of stack and stop."""
    rows, wrench, upright = [], np.zeros((now.count, now.model.nv)), now.tool_pose().rotation.copy()
    for _ in range(ticks):
        bias = now.kinematics(np.zeros(3)).bias
        wrench[:] = bias
        wrench[:, :3] += force - 1e3 * now.state[1][:, :3]
        turned = np.swapaxes(now.tool_pose().rotation, 1, 2) @ upright
        wrench[:, 3:6] += 1e3 * turned[:, [2, 0, 1], [1, 2, 0]] - 10.0 * now.state[1][:, 3:6]
        now.step(wrench, np.arange(now.count))
        rows.append(deflection(now)[0].copy())
    return np.array(rows)


def deflection(now):
    return now.state[0][:, [now.model.joint(SPRUNG + name).qposadr[0] for name in ("stack", "stop")]]


def over_the_stack(plant, **params):
    return plant("free_tool", "pallets", {"start.offset_z": -0.01 + 1e-4}, above=0.01, **params)


@pytest.mark.parametrize(("surface", "force"), [("wood", 7000.0), ("styrofoam", 1500.0)])
def test_a_surface_yields_by_force_over_stiffness(plant, surface, force):
    now = over_the_stack(plant, surface=surface)
    rows = push(now, np.array([0.0, 0.0, -force]), 1500)
    assert rows[-1, 0] == pytest.approx(-force / STIFFNESS[surface], rel=1e-3)  # 1.5 s: rest to 1e-3 with the damping
    assert abs(rows[-1, 1]) < 1e-9
    assert now.contact_force()[0] == pytest.approx(force, rel=1e-3)


def test_a_given_stiffness_replaces_the_surfaces_own(plant):
    rows = push(over_the_stack(plant, stiffness=2e5), np.array([0.0, 0.0, -4000.0]), 800)
    assert rows[-1, 0] == pytest.approx(-0.02, rel=1e-3)


def test_a_second_stop_yields_across_and_closes_the_corner(plant, scene):
    """Pushed along the diagonal by 2 kN an axis without friction, the tool deflects each surface by 2 mm."""
    params = {"friction": 0.0, "above": 0.01, "away": 0.01, "aside": 0.01}
    now = plant("free_tool", "pallets", **params)
    push(now, 2000.0 * np.array([1.0, 1.0, -1.0]), 1500)
    names = ("stop", "side_stop", "stack")
    yields = [now.state[0][0, now.model.joint(SPRUNG + name).qposadr[0]] for name in names]
    np.testing.assert_allclose(yields, [2e-3, 2e-3, -2e-3], rtol=1e-3)
    away = now.tool_pose().position[0] - now.fixture_pose().position[0] - scene("pallets", **params).reached[0]
    assert np.all(away * [1.0, 1.0, -1.0] > 2e-3) and np.linalg.norm(away) < 5e-3
    np.testing.assert_allclose(scene("pallets", **params).task.direction, np.array([1.0, 1.0, -1.0]) / np.sqrt(3.0))


@pytest.mark.parametrize("room", [{"away": 0.01}, {"above": 0.01}, {"aside": 0.01}])
def test_no_demonstration_begins_behind_a_surface(scene, room):
    """However near to it the tool's nominal start is."""
    where = scene("pallets", **{"aside": 0.3, **room})
    for start in where.task.starts:
        offset = np.array([start.get(f"start.offset_{axis}", 0.0) for axis in "xyz"])
        left = (np.array(where.reached[0]) - where.start_tip - offset) * [1.0, 1.0, -1.0]
        assert np.all(left > 0.0)


@pytest.mark.parametrize(("stiffness", "ratio"), [(1e6, 0.1), (3e4, 0.5)])
def test_a_surface_let_go_swings_at_its_natural_frequency_and_dies_away_by_its_damping(plant, stiffness, ratio):
    now = plant("free_tool", "pallets", stiffness=stiffness, damping_ratio=ratio)
    qpos, _ = now.state
    qpos[:, now.model.joint(SPRUNG + "stop").qposadr[0]] = 0.01
    now.batch.forward()
    rows = push(now, np.zeros(3), round(4.0 / np.sqrt(stiffness / 40.0) / TICK))[:, 1]
    w = np.sqrt(stiffness / 40.0)
    wd, t = w * np.sqrt(1.0 - ratio**2), TICK * np.arange(1, len(rows) + 1)
    exact = 0.01 * np.exp(-ratio * w * t) * (np.cos(wd * t) + ratio * w / wd * np.sin(wd * t))
    # The integrator is of first order: its error is of the order of half a step, w dt / 2, of the amplitude.
    np.testing.assert_allclose(rows, exact, atol=0.01 * w * TICK)


@pytest.mark.parametrize(("pull", "slides"), [(0.28, False), (0.32, True)])
def test_a_tool_sticks_below_mu_times_the_load_and_slides_above(plant, pull, slides):
    now = over_the_stack(plant)
    load = 2000.0
    push(now, np.array([0.0, 0.0, -load]), 300)
    before = now.tool_pose().position[0, 0]
    push(now, np.array([pull * load, 0.0, -load]), 300)
    assert (now.tool_pose().position[0, 0] - before > 2e-3) == slides


def test_sprung_surfaces_do_not_sag_and_are_no_links_of_the_robot(plant):
    now = plant("free_tool", "pallets", {"robot.mass_scale": [1.0, 1.5], "robot.joint_friction": 5.0}, count=2)
    push(now, np.zeros(3), 100)
    assert np.abs(deflection(now)).max() < 1e-12
    assert now.configuration.shape[1] == now.robot.model.nq
    bodies = [now.model.body(SPRUNG + name).id for name in ("stack", "stop")]
    assert now.model.body_mass[bodies].tolist() == [40.0, 40.0]
    assert len(set(bodies) & set(now._layout.links)) == 0


def test_a_reset_puts_the_surfaces_back_and_repeats_to_the_last_bit(plant):
    now = over_the_stack(plant)
    first = push(now, np.array([100.0, 0.0, -2000.0]), 200)
    now.reset(start_configurations(now.robot, now.scene, {"start.offset_z": np.array([-0.01 + 1e-4])}, 1))
    assert np.array_equal(push(now, np.array([100.0, 0.0, -2000.0]), 200), first)


def test_a_trial_is_the_same_alone_and_beside_another(plant):
    starts = np.array([-0.0099, -0.005])
    both = plant("free_tool", "pallets", {"start.offset_z": starts}, count=2, above=0.01)
    push(both, np.array([100.0, 0.0, -2000.0]), 200)
    for i, start in enumerate(starts):
        alone = plant("free_tool", "pallets", {"start.offset_z": start}, above=0.01)
        push(alone, np.array([100.0, 0.0, -2000.0]), 200)
        assert np.array_equal(alone.state[0][0], both.state[0][i])


def test_surfaces_turn_and_move_with_the_fixture(robot, scene):
    """Turned by half a turn about z, the stop yields the other way."""
    model, task = robot("free_tool"), scene("pallets")
    turned = Pose(np.array([[0.1, 0.2, 0.3]]), np.array([np.diag([-1.0, -1.0, 1.0])]))
    now = Plant(model, task, 1, turned, {})
    now.reset(start_configurations(model, task, {}, 1))
    stop = now.model.body(SPRUNG + "stop").id
    np.testing.assert_allclose(now.body_poses()[0][0, stop - 1], [0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(now._axis[0, now.model.joint(SPRUNG + "stop").id], [-1.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("params", "said"),
    [
        ({"stiffness": 10.0}, "1e3 <= stiffness"),
        ({"stiffness": 4e6, "plate_mass": 10.0}, "natural frequency"),
        ({"friction": -0.1}, "friction"),
        ({"pallets": 0}, "pallets: 0 is beyond 1 to 6"),
        ({"surface": "steel"}, "steel"),
        ({"above": 0.0}, "above"),
    ],
)
def test_surfaces_that_make_no_sense_are_refused(scene, params, said):
    with pytest.raises(InputError, match=said):
        scene("pallets", **params)
