"""Parts as pieces in contact: a key stops a turn where rigid parts would, a pin slides at its friction."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from manifold3d import JoinType
from skillframe_parts.record import world_of_file

from skillframe.extend import make_scene
from skillframe.frames import matrix_from_quaternion, rotation_vector
from tests import part_meshes
from tests.laws.pushing import Hold, Push, impedance
from tests.laws.runs import run, setup

SOFT_TURN = 0.010, 0.004  # rad; contacts sink by 0.06 mm on both sides; measured before with another program


def in_world(path):
    record = world_of_file(Path(path))
    return replace(setup("free_tool", "free"), scene=(scene := make_scene(record, {})),
                   center_of_compliance=np.array(scene.tool.frames["tip"]))  # fmt: skip


def keyed_pair(play):
    """A shaft of 10 mm with a key of 6 x 3 mm, with the same play all round."""
    plug = part_meshes.keyed(10.0, 6.0, 3.0, -20.0, 10.0)
    section = plug.slice(-1.0).offset(play, JoinType.Miter)
    way = section.extrude(21.0).translate([0.0, 0.0, -20.0])
    return plug, section, part_meshes.box((-25, -25, -25), (25, 25, 0)) - way


def rigid_turn(plug, section):
    """The largest turn of the shaft that some shift leaves inside its way, by bisection over a grid of shifts."""
    shaft, low, high = plug.slice(-1.0), 0.0, 0.1
    shifts = [(x, y) for x in np.linspace(-0.1, 0.1, 11) for y in np.linspace(-0.1, 0.1, 11)]
    while high - low > 1e-4:
        turn = 0.5 * (low + high)
        turned = shaft.rotate(float(np.rad2deg(turn)))
        fits = any((turned.translate(shift) - section).area() < 1e-9 for shift in shifts)
        low, high = (turn, high) if fits else (low, turn)
    return low


@pytest.mark.slow
def test_a_key_stops_a_turn_where_rigid_parts_would(tmp_path):
    plug, section, socket = keyed_pair(0.1)
    setting = in_world(part_meshes.write(tmp_path, plug, socket))
    skill = Hold(impedance("xy", "z"), feedforward=lambda time: np.array([0.0] * 5 + [0.5 if time < 0.5 else -0.5]))
    draws = {"start.offset_z": -0.015}
    (trace,) = run(skill, setting, draws, 1, duration_s=1.0, trace_hz=100).traces
    turns = matrix_from_quaternion(trace.quaternion) @ matrix_from_quaternion(trace.quaternion[0]).T
    angle = rotation_vector(turns)[:, 2]
    there, back = angle[(trace.time > 0.4) & (trace.time < 0.5)], angle[trace.time > 0.9]
    rigid = rigid_turn(plug, section)
    print(f"turns {there.mean():.4f} and {back.mean():.4f} rad (std {there.std():.1e}), rigid {rigid:.4f} rad")
    for found in (abs(there.mean()), abs(back.mean())):
        assert found == pytest.approx(rigid + SOFT_TURN[0], abs=SOFT_TURN[1])
    assert max(there.std(), back.std()) < 1e-3


@pytest.mark.slow
def test_a_square_peg_goes_in_straight_and_not_turned_by_five_degrees(tmp_path):
    """A 10 mm peg in a hole with 0.2 mm of play on each side can turn by 2.3 degrees: 10.4 = 10 (cos t + sin t)."""
    plug = part_meshes.box((-5, -5, -12), (5, 5, 8))
    socket = part_meshes.box((-15, -15, -17), (15, 15, 0)) - part_meshes.box((-5.2, -5.2, -12), (5.2, 5.2, 1))
    setting = in_world(part_meshes.write(tmp_path, plug, socket))
    draws = {"start.tilt_z": np.deg2rad([0.0, 5.0])}
    stiff = Push((0.0, 0.0, -1.0), impedance(turn_stiffness=200.0))
    result = run(stiff, setting, draws, 2, duration_s=4.0)
    assert result.success.tolist() == [True, False]


@pytest.mark.slow
def test_a_pin_slides_on_its_socket_at_its_friction(tmp_path):
    """Pushed down with 10 N and along with 15 mm/s on the top of the block."""
    plug, socket = part_meshes.round_pair()[0], part_meshes.hole(5.2, 12.0, half=30.0)
    setting = in_world(part_meshes.write(tmp_path, plug, socket))
    frictions = np.array([0.1, 0.2, 0.4])
    skill = Push((1.0, 0.0, 0.0), impedance("z"), speed=0.015, cap=30.0, stall=False)
    hold = skill.step

    def pushed(observation):
        return hold(observation)._replace(feedforward=np.broadcast_to([0.0, 0.0, -10.0, 0.0, 0.0, 0.0], (3, 6)))

    skill.step = pushed
    draws = {"world.friction": frictions, "start.offset_x": np.full(3, -0.010), "start.offset_y": np.full(3, -0.015),
             "start.offset_z": np.full(3, -0.0009)}  # fmt: skip
    traces = run(skill, setting, draws, 3, duration_s=1.0, trace_hz=500).traces
    for friction, trace in zip(frictions, traces, strict=True):
        force = trace.wrench[trace.time > 0.5, :3]
        ratio = np.hypot(force[:, 0], force[:, 1]) / force[:, 2]
        print(
            f"friction {friction}: {force[:, 2].mean():.3f} N (std {force[:, 2].std():.3f}), ratio {ratio.mean():.4f}"
        )
        assert ratio.mean() == pytest.approx(friction, rel=0.02)
        assert force[:, 2].std() < 0.35
