"""Where a tilted peg jams: the shipped plant against the analytic oracle, on a grid that chose no parameter."""

import itertools

import numpy as np
import pytest

from skillframe.world.placement import start_poses
from tests.laws.pushing import Push
from tests.laws.runs import robot, run, setup
from tests.oracle import ring_peg

FRICTION, TILT, TURN_STIFFNESS = (0.1, 0.25), (3.0, 6.0, 10.0), (5.0, 30.0, 100.0)
DURATION, SAME = 6.0, 1.5e-3


def common_body(scene):
    """Mass, centre of mass and inertia about it of the free carrier (2 kg) with the scene's tool, from its URDF."""
    carrier, tool = robot("free_tool").model.inertias[1], scene.tool
    mass = carrier.mass + tool.mass
    center = (carrier.mass * carrier.lever + tool.mass * np.array(tool.center_of_mass)) / mass
    inertia = np.zeros((3, 3))
    parts = ((carrier.mass, carrier.lever, carrier.inertia), (tool.mass, tool.center_of_mass, np.diag(tool.inertia)))
    for m, lever, about in parts:
        r = np.array(lever) - center
        inertia += about + m * (r @ r * np.eye(3) - np.outer(r, r))
    return ring_peg.Tool(mass=mass, center=center, inertia=inertia)


@pytest.mark.slow
@pytest.mark.figures
def test_plant_and_oracle_agree_on_which_tilted_pegs_jam():
    cases = np.array(list(itertools.product(FRICTION, TILT, TURN_STIFFNESS)))
    friction, tilt, turn = cases[:, 0], np.deg2rad(cases[:, 1]), cases[:, 2]
    count = len(cases)
    soft = np.tile([20.0, 20.0, 1500.0], (count, 1))
    stiffness = np.concatenate([soft, np.stack([turn, turn, 0.0 * turn + 20.0], axis=1)], axis=1)
    damping = np.concatenate([np.maximum(1.6 * np.sqrt(4.0 * stiffness[:, :3]), 25.0),
                              np.maximum(1.6 * np.sqrt(0.05 * stiffness[:, 3:]), 0.3)], axis=1)  # fmt: skip
    setting = setup("free_tool", "peg_in_hole")
    draws = {"start.tilt_y": tilt, "world.friction": friction}
    matrices = [values[:, :, None] * np.eye(6) for values in (stiffness, damping)]
    skill = Push((0.0, 0.0, -1.0), matrices[0], damping=matrices[1], stall=False)
    skill.lead = 20.0 / 1500.0
    plant = run(skill, setting, draws, count, duration_s=DURATION, trace_hz=10)
    start = start_poses(setting.robot, setting.scene, draws, count)
    path, _ = ring_peg.insert(
        ring_peg.Geometry(), common_body(setting.scene), ring_peg.Push(stiffness=stiffness, damping=damping), friction,
        start.position, start.rotation, DURATION,
    )  # fmt: skip
    depths = np.array([[trace.position[-1, 2] for trace in plant.traces], path[-1, :, 2]])
    agree = np.abs(depths[0] - depths[1]) < SAME
    print(f"\nfriction, tilt [deg], stiffness [Nm/rad]: tip height [mm] in plant and oracle; {agree.sum()} of 18 agree")
    for (mu, angle, k), mine, theirs, same in zip(cases, *(1e3 * depths), agree, strict=True):
        print(f"{mu:.2f} {angle:4.0f} {k:5.0f}: {mine:7.2f} {theirs:7.2f} {'' if same else '  differ'}")
    assert agree.sum() >= 15
