"""The excavator in space with payload and friction off: pressed into a corner of three plates, and sliding on a floor.

Plates stand on springs of 1e6 N/m with a friction of 0.3, and turn with the slew angle. A push of 15 kN along the
corner's diagonal has 8.7 kN for each plate, against 5.2 kN of friction by the other two. Along (0.55, 0.45, -0.70)
6.8 kN remain for the second wall, against 6.0 kN: what is left is within sigma of the estimate (1.2 kN), so the
controller does not answer it, and the tool creeps at millimetres per second.
"""

import numpy as np
import pytest
from skillframe_papers.rows.crane_runs import RADIUS, Follow, Stiffness, blend

from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.frames import Pose
from skillframe.robot.chain import ClosedChain
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.skill import Command, Impedance, Skill, Status, no_reasons
from skillframe.world.scene import Geom, Scene, Sprung, Task, Tool
from skillframe.world.shapes import anywhere, no_error
from tests.excavator import HOME, write_excavator
from tests.figures.teaching import row

pytestmark = pytest.mark.figures
HALF, SPRING, FORCE = 0.3, 1e6, 15e3  # half a plate [m], its spring [N/m], the push [N]
STIFFNESS, DAMPING, SPEED = 2e5, 1.5e5, 0.1  # along the push [N/m], all axes [N s/m], of the reference [m/s]
AT = {**HOME, "boom": -0.40, "stick": 1.45, "bucket": 0.75}
TOOL = Tool(
    geoms=(Geom(kind="sphere", size=(RADIUS,)),), mass=1e-3, center_of_mass=(0.0, 0.0, 0.0),
    inertia=(1e-6, 1e-6, 1e-6), frames={"tip": (0.0, 0.0, 0.0)},
)  # fmt: skip
OFF = {"robot.payload": (1350.0, 1500.0), "actuator.friction_scale": (0.8, 1.2)}
SEED, COUNT = 12, 64
"""Of the trials in the corner."""


class Press(Skill):
    """Pushes along a direction, stiff along it alone, with a reference that runs ahead as far as the push needs."""

    def __init__(self, direction):
        self._way = direction / np.linalg.norm(direction)

    def start(self, observation, rngs):
        count = len(rngs)
        self._at, self._rotation = observation.pose.position.copy(), observation.pose.rotation.copy()
        stiffness, damping = np.zeros((2, count, 6, 6))
        stiffness[:, :3, :3] = STIFFNESS * np.outer(self._way, self._way)
        damping[:, :3, :3] = DAMPING * np.eye(3)
        self._impedance, self._none = Impedance(stiffness, damping), np.zeros((count, 6))
        self._status, self._reason = np.full(count, Status.RUNNING), no_reasons(count)

    def step(self, observation):
        ahead = (self._at - observation.pose.position) @ self._way
        twist = self._none.copy()
        twist[:, :3] = np.where((ahead < FORCE / STIFFNESS)[:, None], SPEED * self._way, 0.0)
        self._at = self._at + twist[:, :3] * observation.dt
        pose = Pose(self._at.copy(), self._rotation)
        return Command(pose, twist, self._impedance, self._none, self._status, self._reason)


def turned(slew):
    return np.array([[np.cos(slew), -np.sin(slew), 0.0], [np.sin(slew), np.cos(slew), 0.0], [0.0, 0.0, 1.0]])


def machine(folder, slew):
    """Robot folder with the fixture in the corner, which is 0.55 m out, 0.75 m aside and 0.75 m down from home."""
    axes, home = turned(slew), {**AT, "slew": slew - 0.12}
    chain = ClosedChain(load_model(load_robot(write_excavator(folder, home=home))))
    state = chain.at(chain.minimal(chain.home), np.zeros(4))
    tip = np.array(state.data.oMf[chain.robot.tool_frames[0]].translation)
    corner = np.round(tip + axes @ [0.55, 0.75, -0.75], 6)
    write_excavator(folder, home=home, fixture=tuple(corner.tolist()))
    return folder, axes, corner, tip - corner


def plates(axes, faces):
    """Sprung plates (normal, middle, half sizes) in the fixture's axes, turned by `axes`."""
    half = 0.5 * np.arctan2(axes[1, 0], axes[0, 0])
    found = []
    for i, (normal, middle, size) in enumerate(faces):
        turn = (0.0, 0.0, float(np.sin(half)), float(np.cos(half)))
        box = Geom(kind="box", size=size, position=tuple((axes @ middle).tolist()), quaternion=turn)
        along = tuple((axes @ normal).tolist())
        found.append(Sprung(name=f"plate{i}", geoms=(box,), axis=along, stiffness=SPRING, mass=8.0, damping_ratio=0.6))
    return tuple(found)


def scene(start, sprung):
    mark = Geom(kind="box", size=(0.01, 0.01, 0.01), position=(0.0, 0.0, -3.0), collide=False)
    return Scene(
        name="plates", fixture=(mark,), sprung=sprung, tool=TOOL, friction=0.3, start_tip=tuple(start.tolist()),
        start_quaternion=(0.0, 0.0, 0.0, 1.0), goal=anywhere, goal_error=no_error, task=Task(direction=None),
    )  # fmt: skip


@pytest.mark.parametrize("slew", [0.3, -0.9, 1.6, -2.2])
def test_a_push_along_the_diagonal_ends_in_the_corner_at_any_slew_angle(slew, tmp_path):
    """On the springs of all three plates, of which each deflects by its 8.7 kN and what friction leaves it."""
    folder, axes, corner, _ = machine(tmp_path, slew)
    faces = (
        ((0.0, 0.0, 1.0), np.array([0.0, 0.0, -RADIUS - HALF]), (1.2, 1.2, HALF)),
        ((1.0, 0.0, 0.0), np.array([RADIUS + HALF, 0.0, 0.2]), (HALF, 1.0, 0.3)),
        ((0.0, 1.0, 0.0), np.array([0.0, RADIUS + HALF, 0.2]), (1.0, HALF, 0.3)),
    )
    where = scene(axes @ [-0.55, -0.45, 0.5], plates(axes, faces))
    rng = np.random.default_rng(SEED)
    draws = {name: rng.uniform(*ends, COUNT) for name, ends in OFF.items()}
    draws |= {f"start.offset_{axis}": rng.uniform(-0.1, 0.1, COUNT) for axis in "xy"}
    setup = Setup(robot=load_robot_model(str(folder)), scene=where)
    rngs = [np.random.default_rng([SEED, i]) for i in range(COUNT)]
    result = simulate(Press(axes @ [1.0, 1.0, -1.0]), setup, draws, rngs, duration_s=24.0, trace_hz=20.0)
    ends = np.array([(trace.position[-1] - corner) @ axes for trace in result.traces]) * [1.0, 1.0, -1.0]
    inside = np.all((ends > 0.003) & (ends < 0.02), axis=1)
    row(
        f"excavator in the corner of three plates at slew {slew}", f"{inside.sum()} of {COUNT}",
        f"{1e3 * ends.min():.1f} to {1e3 * ends.max():.1f} mm into each plate",
        f"peak {result.peak_force_n.max() / 1e3:.0f} kN", *sorted({str(each) for each in result.failure if each}),
    )  # fmt: skip
    assert inside.all()


def test_the_force_of_a_slide_in_space_is_within_4_percent_rms_and_10_at_most_without_a_sensor(tmp_path):
    """Three axes, standard encoders of 1e-4 rad, all of the contact, reversals too; truth averaged over 0.1 s."""
    folder, axes, _, start = machine(tmp_path, 0.3)
    floor = ((0.0, 0.0, 1.0), axes.T @ start - [0.0, 0.0, 0.35 + RADIUS + HALF], (2.0, 2.0, HALF))
    where = scene(start, plates(axes, (floor,)))

    def place(time):
        since = max(0.0, time - 4.0)
        along = min(since, 1.0) * np.array([0.4 * np.sin(0.42 * since), 0.55 * np.sin(0.33 * since + 0.6)])
        return axes @ [*along, -0.47 * blend(time / 4.0)[0]]

    def path(time):
        h = 1e-4
        return place(time), (place(time + h) - place(max(time - h, 0.0))) / (h + min(h, time))

    setup, rngs = (
        Setup(robot=load_robot_model(str(folder)), scene=where),
        [np.random.default_rng([4, i]) for i in (0, 1)],
    )
    off = {name: np.array(ends) for name, ends in OFF.items()}
    result = simulate(Follow(path, Stiffness(1.5e5, 1.5e5)), setup, off, rngs, duration_s=16.0, trace_hz=1000.0)
    assert not any(result.failure)
    for trace in result.traces:
        kernel = np.full(100, 0.01)
        true = np.stack([np.convolve(column, kernel, "same") for column in trace.wrench_true[:, :3].T], axis=1)
        slid = (trace.time > 5.5) & (trace.time < 15.9)
        error = (trace.wrench[:, :3] - true)[slid]
        normal = true[slid, 2].mean()
        rms, most = 100.0 * np.sqrt(np.mean(error[:, 2] ** 2)) / normal, 100.0 * np.abs(error[:, 2]).max() / normal
        vector = 100.0 * np.sqrt(np.mean(np.sum(error**2, axis=1))) / normal
        row(
            "force in space without a sensor",
            f"rms {rms:.2f}, max {most:.2f}, vector rms {vector:.2f} % of {normal:.0f} N",
        )
        assert rms < 4.1 and most < 10.0
        assert np.mean(np.abs(error) < 2.0 * trace.machine["force_sigma"][slid]) > 0.95
