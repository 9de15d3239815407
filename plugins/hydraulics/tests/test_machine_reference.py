"""What a machine's law follows and what its skill sees, against the same formulas in numpy."""

from types import SimpleNamespace

import numpy as np
import pytest
from skillframe_hydraulics.declared import MachineNoise
from skillframe_hydraulics.drive_reference import IMPEDANCE_RATE, LEAST_DAMPING, ToolReference
from skillframe_hydraulics.law.hydraulic import Measured, Reference
from skillframe_hydraulics.sensors import MachineSensors

from skillframe.control.limits import LimitGuard
from skillframe.frames import Pose
from skillframe.robot.spec import Limits
from skillframe.skill import Command, Impedance, no_reasons

DT, N, PLANE = 1e-3, 3, [0, 2]
SAME = 1e-14  # relative: products of two are added once, in another order at most


def plane_task(limits=None, tool=None, count=N):
    """A task of machines with two coordinates and one cylinder, and what it is wired to."""
    rng = np.random.default_rng(2)
    rngs = [np.random.default_rng(i) for i in range(count)]
    gauges = MachineSensors(MachineNoise(encoder=0.0, pressure=0.0), rngs, 2, 1, DT)
    gauges.start(rng.normal(size=(count, 2)), rng.normal(size=(count, 1)), rng.normal(size=(count, 1)))
    gauges.rate[:] = rng.normal(size=(count, 2))
    force = SimpleNamespace(**{name: rng.normal(size=(count, 2)) for name in ("feedback", "answered", "sigma")})
    zeros = [np.zeros((count, *shape)) for shape in ((2,), (2,), (1,), (1,), (2,), (2,))]
    shapes = ((2,), (2,), (2, 2), (2, 2), (2,), (1,), (1,), (2,))
    given = Measured(*zeros), Reference(*(np.ones((count, *shape)) for shape in shapes))
    law = SimpleNamespace(at=SimpleNamespace(tip=gauges.z, tip_rate=gauges.rate), given=given)
    guard = LimitGuard(limits or Limits(), count, DT)
    tool = rng.normal(size=(count, 3)) if tool is None else tool
    task = ToolReference(gauges, SimpleNamespace(estimate=force), law, guard, np.eye(3)[PLANE], tool, DT)
    return task, gauges, force, given, guard, tool


def command(rng, shared, damped):
    """Any command of N trials, its impedance one for all or one each."""
    lead = () if shared else (N,)
    stiffness, damping = (rng.normal(size=(*lead, 6, 6)) * scale for scale in (1e5, 1e4))
    stiffness = stiffness @ stiffness.mT
    numbers = [rng.normal(size=(N, size)) for size in (3, 6, 6)]
    pose = Pose(numbers[0], np.tile(np.eye(3), (N, 1, 1)))
    impedance = Impedance(stiffness, damping if damped else None)
    return Command(pose, numbers[1], impedance, numbers[2], np.zeros(N, dtype=int), no_reasons(N))


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("damped", [True, False])
def test_the_law_follows_the_commands_part_in_the_plane_and_the_wrench_is_equation_1(shared, damped):
    task, gauges, force, (measured, reference), guard, _ = plane_task()
    rng = np.random.default_rng(7)
    task.hold(np.full((N, 1), 0.7))
    for ramp in (0.25, 1.0):
        told, seen = command(rng, shared, damped), task.seen(0.0, np.tile(np.eye(3), (N, 1, 1)))
        energy = guard.energy.copy()
        task.aim(told, ramp)
        stiffness = np.broadcast_to(told.impedance.stiffness[..., PLANE, :][..., PLANE], (N, 2, 2))
        damping = np.maximum(np.linalg.eigvalsh(stiffness)[:, -1] / IMPEDANCE_RATE, LEAST_DAMPING)
        damping = damping[:, None, None] * np.eye(2)
        if damped:
            damping = np.broadcast_to(told.impedance.damping[..., PLANE, :][..., PLANE], (N, 2, 2))
        velocity, push = ramp * told.twist[:, PLANE], ramp * told.feedforward[:, PLANE]
        error, lead = (told.pose.position - seen.pose.position)[:, PLANE], velocity - seen.twist[:, PLANE]
        wrench = np.zeros((N, 6))
        wrench[:, PLANE] = push + np.einsum("nij,nj->ni", stiffness, error) + np.einsum("nij,nj->ni", damping, lead)
        for own, other in (
            (reference.position, told.pose.position[:, PLANE]), (reference.velocity, velocity), (reference.push, push),
            (reference.stiffness, stiffness), (reference.damping, damping), (task.law_wrench, wrench),
            (guard.energy, energy + DT * (wrench * seen.twist).sum(axis=1)),
        ):  # fmt: skip
            np.testing.assert_allclose(own, other, rtol=0, atol=4.0 * SAME * np.abs(other).max())
    np.testing.assert_array_equal(reference.joint, np.full((N, 1), 0.7))
    np.testing.assert_array_equal(reference.joint_rate, np.zeros((N, 1)))
    np.testing.assert_array_equal(reference.acceleration, np.zeros((N, 2)))
    now = gauges.z + gauges.lag * gauges.rate
    expected = (now, gauges.rate, gauges.pressure_a, gauges.pressure_b, force.answered, force.sigma)
    for own, other in zip(measured, expected, strict=True):
        np.testing.assert_array_equal(own, other)


def test_a_skill_sees_the_tool_in_the_plane_by_encoders_and_beside_it_where_it_is():
    task, gauges, force, _, _, tool = plane_task()
    seen = task.seen(0.5, np.tile(np.eye(3), (N, 1, 1)))
    np.testing.assert_array_equal(seen.time, np.full(N, 0.5))
    np.testing.assert_array_equal(seen.pose.position[:, PLANE], gauges.z + gauges.lag * gauges.rate)
    np.testing.assert_array_equal(seen.pose.position[:, 1], tool[:, 1])
    np.testing.assert_array_equal(seen.twist[:, PLANE], gauges.rate)
    np.testing.assert_array_equal(seen.wrench[:, PLANE], force.feedback)
    assert not np.any(np.delete(np.concatenate([seen.twist, seen.wrench]), PLANE, axis=1))
    kept = seen.wrench.copy()
    force.feedback += 1.0
    task.seen(0.6, np.tile(np.eye(3), (N, 1, 1)))
    np.testing.assert_array_equal(seen.wrench, kept)  # the loop goes by it for some ticks


def test_the_quick_look_at_limits_is_the_guards_own():
    """Trials on both sides of every limit, and some that are not finite, in both looks."""
    box = (-3.0, -3.0, -3.0), (3.0, 3.0, 3.0)
    limits = Limits(force_n=3.0, torque_n_m=3.0, energy_j=1e-3, workspace_m=box)
    rng, count, found = np.random.default_rng(3), 40, []
    task, gauges, force, _, guard, tool = plane_task(limits, np.zeros((count, 3)), count)
    for _ in range(20):
        scale = 10.0 ** rng.uniform(-1.0, 1.0, (count, 1))
        gauges.z[:], gauges.rate[:] = scale * rng.normal(size=(count, 2)), 0.1 * rng.normal(size=(count, 2))
        force.feedback[:] = scale * rng.normal(size=(count, 2))
        tool[:, 1] = rng.choice([0.0, 2.0, 4.0, np.nan, np.inf], count, p=[0.6, 0.2, 0.1, 0.05, 0.05])
        zero, still = np.zeros((count, 6)), np.zeros((6, 6))
        push = np.zeros((count, 6))
        push[:, PLANE] = rng.normal(size=(count, 2))
        seen = task.seen(0.0, np.tile(np.eye(3), (count, 1, 1)))
        other = LimitGuard(limits, count, DT)
        other.energy[:] = guard.energy[:] = rng.choice([0.0, 2e-3], count, p=[0.9, 0.1])
        pose, status = Pose(np.array(tool), np.eye(3)[None]), np.zeros(count, dtype=int)
        task.aim(Command(pose, zero, Impedance(still, still), push, status, no_reasons(count)), 1.0)
        with np.errstate(invalid="ignore"):
            expected = other.violations(seen.pose.position, seen.twist, seen.wrench, task.law_wrench, np.arange(count))
            broken = guard.named(np.arange(count))
        assert [one._replace(cause="") for one in broken] == [one._replace(cause="") for one in expected]
        rows = {one.row for one in broken}
        assert set(np.flatnonzero(task._fine == 0.0).tolist()) == rows
        assert task.fine == (not rows)
        found.append(len(rows))
    assert 20 < sum(found) < 700
