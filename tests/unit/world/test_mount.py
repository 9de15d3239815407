"""A soft mount between force sensor and tool: springs with the tool on them, and an arm that knows nothing of it."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from skillframe.errors import InputError
from skillframe.execution.executor import Setup, begin, simulate
from skillframe.frames import norm
from skillframe.robot.interface import Control
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot
from skillframe.robot.tables import Mount
from skillframe.world.placement import fixture_poses, start_configurations
from skillframe.world.plant import Plant
from tests.laws.pushing import Push, impedance
from tests.laws.runs import SILENT, generators, scene

K, TURN = 2e4, 200.0
AIR = {"start.offset_z": np.array([0.05])}
DOWN = (0.0, 0.0, -1.0)


def robot(mount, control=None, heavy=0.0):
    """A UR5e. `heavy` is what its joints get of inertia, so that it hardly moves."""
    made = load_model(load_robot("ur5e_torque"))
    model = copy.deepcopy(made.model)
    model.armature = model.armature + heavy
    return replace(made, model=model, spec=replace(made.spec, mount=mount, control=control or made.spec.control))


def plant(mount, timestep=1e-3, heavy=1e7, rigid=False):
    """In the air, with the peg."""
    arm, task = robot(mount, heavy=heavy), scene("peg_in_hole")
    made = Plant(arm, task, 1, fixture_poses(arm, AIR, 1), {}, timestep=timestep, rigid=rigid)
    made.reset(start_configurations(arm, task, AIR, 1))
    return made


def steps(made, count, force=None):
    """Mount's coordinates (count, 6) while the arm is held against gravity and `force` (6,) acts on the tool's mass."""
    if force is not None:
        made.batch.bind("xfrc_applied")[:, made.model.body("tool").id] = force
    seen = np.empty((count, 6))
    for i in range(count):
        made.step(made.kinematics(np.zeros(3)).bias, np.arange(1))
        seen[i] = made.state[0][0, -6:]
    return seen


def test_where_a_trial_starts_the_mount_is_level_and_the_sensor_reads_the_tools_weight():
    made = plant(Mount(stiffness=K, turning_stiffness=TURN))
    assert np.abs(steps(made, 200)).max() < 1e-12
    weight = made.tool.mass * 9.81
    assert norm(made.sensor_wrench()[:, :3])[0] == pytest.approx(weight, rel=1e-9)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_under_a_force_it_gives_way_by_force_over_stiffness_and_turns_by_the_lever(axis):
    """10 N on the tool's mass, which is 0.1 m out: 0.5 mm, and 5 mrad across. To 1 %, what a turn of 5 mrad bends."""
    made = plant(Mount(stiffness=K, turning_stiffness=TURN, damping_ratio=1.0))
    tool = made.tool_pose().rotation[0]
    force = np.concatenate([10.0 * tool[:, axis], np.zeros(3)])
    way = steps(made, 500, force)[-1]
    out = made.tool.center_of_mass[2]
    want = np.zeros(6)
    want[axis] = 10.0 / K
    if axis < 2:
        want[4 - axis] = (1.0 if axis == 0 else -1.0) * 10.0 * out / TURN
    np.testing.assert_allclose(way, want, atol=1e-2 * np.abs(want).max())
    assert norm(made.sensor_wrench()[0, :3] - force[:3] @ tool) == pytest.approx(made.tool.mass * 9.81, rel=0.01)


def test_it_swings_at_the_frequencies_of_the_tool_on_its_springs():
    """Along the tool sqrt(k / m); across it the pencil of [[m, m l], [m l, I + m l^2]] on the two springs.

    Undamped, at 0.2 ms: zero crossings of 1 s, to half a one.
    """
    made = plant(Mount(stiffness=K, turning_stiffness=TURN, damping_ratio=0.0), timestep=2e-4)
    m, out, inertia = made.tool.mass, made.tool.center_of_mass[2], made.tool.inertia[0]
    mass = np.array([[m, m * out], [m * out, inertia + m * out**2]])
    squared, shapes = eigh(np.diag([K, TURN]), mass)
    made.state[0][0, -4] = 1e-4  # along the tool
    made.state[0][0, [-6, -2]] = 1e-4 * shapes[:, 0] / shapes[0, 0]  # across it, in the slower shape alone
    seen = steps(made, 5000)
    for column, omega in ((2, np.sqrt(K / m)), (0, np.sqrt(squared[0]))):
        crossings = np.count_nonzero(np.diff(np.sign(seen[:, column])))
        assert crossings == pytest.approx(omega / np.pi, abs=1.0)


def test_a_swing_along_the_tool_fades_by_the_damping_ratio():
    """From peak to peak by exp(-2 pi z / sqrt(1 - z^2)), to 2 %: semi-implicit steps of 0.2 ms."""
    ratio = 0.1
    made = plant(Mount(stiffness=K, turning_stiffness=TURN, damping_ratio=ratio), timestep=2e-4)
    made.state[0][0, -4] = 1e-4
    seen = steps(made, 800)[:, 2]
    peaks = [seen[i] for i in range(1, 799) if seen[i - 1] < seen[i] >= seen[i + 1]]
    fading = np.exp(-2.0 * np.pi * ratio / np.sqrt(1.0 - ratio**2))
    np.testing.assert_allclose(np.array(peaks[1:4]) / peaks[:3], fading, rtol=0.02)


def test_the_stiffest_mount_under_the_slenderest_tool_stays_calm():
    """Without the inertia that is added, the peg would swing about its axis by 22 rad a step."""
    made = plant(Mount(stiffness=1e6, turning_stiffness=1e5, damping_ratio=0.0))
    made.state[0][0, -6:] = [1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-4]
    seen = np.abs(steps(made, 500))
    assert seen[:, :3].max() < 1e-4 and seen[:, 3:].max() < 1e-3  # modes mix: ten times the first deflections


def test_what_the_controller_knows_is_the_arm_with_a_rigid_mount_wherever_the_tool_hangs():
    arm, task = robot(Mount(stiffness=K, turning_stiffness=TURN)), scene("peg_in_hole")
    tip = np.array(task.tool.frames["tip"])
    loop = begin(Push(DOWN, impedance("x"), stall=False),
                 Setup(robot=arm, scene=task, center_of_compliance=tip, sensors=SILENT),
                 AIR, generators(1))  # fmt: skip
    limb, made = loop.drive.limb, loop.drive.plant
    made.state[0][0, -6:] = [1e-3, -1e-3, 2e-3, 0.01, 0.02, 0.0]
    made.state[1][0, -6:] = 0.1
    known, inertia = limb.kinematics(np.arange(1)), limb.mass_matrix()
    stiff = plant(None, heavy=0.0)
    want = stiff.kinematics(tip)
    np.testing.assert_allclose(known.pose.position, want.pose.position, atol=1e-12)
    np.testing.assert_allclose(known.jacobian[..., :6], want.jacobian, atol=1e-12)
    assert not known.jacobian[..., 6:].any() and not known.velocity.any()
    rigid = stiff.mass_matrix()
    np.testing.assert_allclose(inertia[:, :6, :6], rigid, rtol=1e-9, atol=1e-12)
    mobility = np.linalg.inv(inertia)[:, :6, :6]  # 1e9 against 1 kg m^2: what gives way is 1e-9 of the arm
    np.testing.assert_allclose(mobility, np.linalg.inv(rigid), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(limb.joint_positions()[:, :6], stiff.joint_positions, atol=1e-12)
    assert not limb.joint_positions()[:, 6:].any()


def touched(control, mount):
    """Result of a push down at 20 mm/s, or as fast as the arm may, onto the valley's bottom."""
    task = scene("valley")
    setting = Setup(robot=robot(mount, control), scene=task, center_of_compliance=np.array(task.tool.frames["tip"]),
                    sensors=SILENT)  # fmt: skip
    start = {"start.offset_z": np.array([0.004])}
    skill = Push(DOWN, np.diag([1000.0] * 3 + [50.0] * 3), speed=0.02, stall=False)
    return simulate(skill, setting, start, generators(1), duration_s=1.0, trace_hz=1000.0)


@pytest.mark.slow
def test_an_arm_told_positions_touches_through_a_mount_at_twenty_millimetres_a_second():
    """T_tot 36.6 ms, 1.4e4 N/m in series: 26 mm/s at 20 N. Bare, at 4e4 N/m, 9.1 mm/s. By the rule for a speed that is
    kept, 1.75 k v T, the peak is 18 N, less than the push that follows."""
    told = Control(interface="position", rate_hz=500.0, contact_stiffness=1.4e4)
    result = touched(told, Mount(stiffness=K, turning_stiffness=TURN))
    trace = result.traces[0]
    force = norm(trace.wrench_true[:, :3])
    first = int(np.argmax(force > 0.0))
    speed = (trace.position[first - 101, 2] - trace.position[first - 1, 2]) / 0.1
    assert speed == pytest.approx(0.02, rel=0.1)
    assert force.max() < 1.5 * 20.0
    np.testing.assert_allclose(force[-200:], 20.0, atol=0.5)


@pytest.fixture
def declared(tmp_path):
    def load(text, robot="kuka_iiwa14", extra=""):
        source = load_robot(robot).folder
        (tmp_path / "robot.toml").write_text((source / "robot.toml").read_text().replace(*extra or ("", "")) + text)
        for urdf in source.glob("*.urdf"):
            (tmp_path / urdf.name).write_text(urdf.read_text())
        return load_robot(tmp_path)

    return load


@pytest.mark.parametrize(
    ("text", "extra", "words"),
    [
        ("stiffness = 10.0\nturning_stiffness = 100.0", (), r"mount.stiffness: 10 N/m is beyond 1000N/m to 1e\+06N/m"),
        ("stiffness = 2e4\nturning_stiffness = 100.0\ndamping_ratio = -1", (), "damping_ratio: -1 is beyond 0 to 2"),
        ("stiffness = 2e4\nturning_stiffness = 100.0", ("rate_hz = 1000", 'interface = "position"\nrate_hz = 500'),
         r"contact_stiffness: is 5e\+04 N/m, and the mount alone, .* yields with 2e\+04 N/m.*1\.5e\+04"),
        ("stiffness = 2e4\nturning_stiffness = 100.0", ('base = "fixed"', 'base = "free"'), "stands on a free base"),
    ],
)  # fmt: skip
def test_a_mount_that_cannot_be_is_refused_with_the_key_and_a_cure(declared, text, extra, words):
    with pytest.raises(InputError, match=words):
        declared(f"\n[mount]\n{text}\n", extra=extra)


def test_a_mount_is_told_with_its_figures(declared):
    from skillframe.robot.describe import describe

    spec = declared("\n[mount]\nstiffness = 2e4\nturning_stiffness = 200\n")
    assert spec.mount == Mount(stiffness=2e4, turning_stiffness=200.0, damping_ratio=0.1)
    assert "mount: 2e+04 N/m, 200 Nm/rad, damping ratio 0.1, between force sensor and tool" in describe(
        load_model(spec)
    )
