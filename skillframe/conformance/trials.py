"""A world tried out: compiled with a free-flying tool and a seven-joint arm, looked at where a run starts, and pushed.

An arm that cannot reach the start tells nothing of the world, and is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.frames import Float, Pose, matrix_from_quaternion
from skillframe.skill import Command, Impedance, Observation, Skill, no_reasons

if TYPE_CHECKING:
    from skillframe.robot.model import RobotModel
    from skillframe.world.scene import Geom, Scene

ROBOTS = ("free_tool", "panda")
LARGEST = {"fixture": 10.0, "tool": 3.0, "start": 10.0}
"""m (ours): a crane reaches 8 m. What is larger is most often in millimetres."""
FARTHEST = 1.0
"""m from the tool to the fixture at the start (ours): a teacher covers that in half a minute."""
DEEPEST = 1e-4
"""m that the tool may stand in the fixture at the start (ours): MuJoCo's contacts are that soft."""
SIDEWAYS = np.deg2rad(75.0)
"""Between the tool and the way into the fixture (ours): a start is tilted by degrees, a mistaken axis by 90."""
BROKEN = {"free_tool": {"diverged", "true_force", "force", "energy", "collision"}, "panda": {"diverged"}}
"""What tells of the world; where an arm stands to reach a start is not the world's business."""
SHORT_S, PUSH_M = 0.1, 0.01


def right_size(scene: Scene) -> Iterator[str]:
    """Everything is in metres, as far as one can see."""
    fixture = [*scene.fixture, *(geom for part in scene.sprung for geom in part.geoms)]
    for name, geoms in {"fixture": fixture, "tool": [*scene.tool.geoms]}.items():
        size = max((_extent(geom) for geom in geoms if geom.kind != "plane"), default=0.0)
        if size > LARGEST[name]:
            yield f"the {name} reaches {size:.3g} m from its frame; is it in millimetres? give metres"
    longest = max(float(np.linalg.norm(point)) for point in scene.tool.frames.values())
    if longest > LARGEST["tool"]:
        yield f"the tool has a frame {longest:.3g} m away from the wrist; is it in millimetres? give metres"
    away = float(np.linalg.norm(scene.start_tip))
    if away > LARGEST["start"]:
        yield f"the run starts {away:.3g} m from the fixture frame; is start_tip in millimetres? give metres"


def _extent(geom: Geom) -> float:
    """Farthest that a geom reaches from its body's frame [m]."""
    own = np.abs(geom.size).max(initial=0.0) if geom.vertices is None else np.abs(geom.vertices).max(initial=0.0)
    return float(own + np.linalg.norm(geom.position))


def points_into_the_fixture(scene: Scene) -> Iterator[str]:
    """The tool's z axis goes against the fixture's, or as in the aligned attitude. A lever may lie as it will."""
    task = scene.task
    if not scene.fixture or task.turn is not None:
        return
    into = np.array([0.0, 0.0, -1.0]) if task.aligned is None else matrix_from_quaternion(task.aligned)[:, 2]
    angle = float(np.arccos(np.clip(matrix_from_quaternion(scene.start_quaternion)[:, 2] @ into, -1.0, 1.0)))
    if angle > SIDEWAYS:
        yield (
            f"the tool starts turned {np.rad2deg(angle):.0f} degrees away from pointing into the fixture; "
            "its z axis points out along the tool, and start_quaternion (x, y, z, w) turns it to the fixture's -z"
        )


def compiles(scene: Scene) -> Iterator[str]:
    """MuJoCo takes it, the tool stands clear of the fixture at the start, and not far from it."""
    from skillframe.world.convert import build_spec

    for name, robot, configuration in _robots(scene):
        try:
            model = build_spec(robot, scene).compile()
        except (ValueError, KeyError, TypeError) as error:  # MuJoCo's words, or of what it is given
            yield f"MuJoCo does not take it: {' '.join(str(error).removeprefix('Error: ').split())}; correct that geom"
            return
        yield from _start_problems(scene, name, robot, model, configuration)


def _robots(scene: Scene) -> Iterator[tuple[str, RobotModel, Float]]:
    """Robots that reach the start, each with its configuration there."""
    from skillframe.execution.prepare import load_robot_model
    from skillframe.robot.kinematics import UnreachablePose
    from skillframe.world.placement import start_configurations

    for name in ROBOTS:
        robot = load_robot_model(name)
        try:
            yield name, robot, start_configurations(robot, scene, {}, 1)
        except UnreachablePose:
            continue


def _start_problems(scene: Scene, name: str, robot: RobotModel, model: Any, configuration: Float) -> Iterator[str]:
    gap = _gap(scene, robot, model, configuration)
    if gap is None:
        return
    if gap < -DEEPEST:
        yield f"the tool stands {-1e3 * gap:.3g} mm deep in the fixture at the start, with {name}; raise start_tip"
    elif gap > FARTHEST:
        yield f"the tool starts {gap:.3g} m away from the fixture, with {name}; start nearer than {FARTHEST:g} m"


def _gap(scene: Scene, robot: RobotModel, model: Any, configuration: Float) -> float | None:
    """Smallest distance [m] between what collides of tool and fixture, below zero if inside. None without a pair.

    Of two surfaces, whose distance MuJoCo does not know, contacts alone count.
    """
    import mujoco

    from skillframe.world.convert import FIXTURE, SPRUNG, TOOL
    from skillframe.world.placement import fixture_poses
    from skillframe.world.plant import Plant

    plant = Plant(robot, scene, 1, fixture_poses(robot, {}, 1), {})
    plant.reset(configuration)
    data = mujoco.MjData(model)
    data.qpos[:] = plant.state[0][0]
    fixture = plant.fixture_pose()
    if model.nmocap:
        mujoco.mju_mat2Quat(data.mocap_quat[0], fixture.rotation[0].ravel())
        data.mocap_pos[0] = fixture.position[0]
    mujoco.mj_forward(model, data)
    body = [model.body(model.geom_bodyid[g]).name for g in range(model.ngeom)]
    touches = [bool(model.geom_contype[g] or model.geom_conaffinity[g]) for g in range(model.ngeom)]
    tool = [g for g, owner in enumerate(body) if owner == TOOL and touches[g]]
    other = [g for g, owner in enumerate(body) if touches[g] and (owner == FIXTURE or owner.startswith(SPRUNG))]
    surfaces = {g for g in (*tool, *other) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_SDF}
    gaps = [
        mujoco.mj_geomDistance(model, data, a, b, 100.0, None)
        for a in tool for b in other if not surfaces & {a, b}
    ]  # fmt: skip
    gaps += [float(contact.dist) for contact in data.contact if surfaces & set(contact.geom)]
    return min(gaps, default=None)


class Push(Skill):
    """Holds where it starts, and moves against the fixture's z in the second half of the run.

    Args:
        distance: how far [m]; 0 holds.
    """

    def __init__(self, distance: float) -> None:
        self._distance = distance

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Remember where the tool is."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())

    def step(self, observation: Observation) -> Command:
        """Ask for the start, and then for what lies further down."""
        count, zero = len(observation.time), np.zeros((len(observation.time), 6))
        down = np.maximum(observation.time - 0.5 * SHORT_S, 0.0)[:, None] * [0.0, 0.0, -2.0 * self._distance / SHORT_S]
        gains = Impedance(np.diag([1000.0] * 3 + [50.0] * 3))
        pose = Pose(self._home.position + down, self._home.rotation)
        return Command(pose, zero, gains, zero, np.zeros(count, dtype=np.int64), no_reasons(count))


def runs(scene: Scene) -> Iterator[str]:
    """Holding and pushing for 100 ms stays finite and within the robot's limits."""
    from skillframe.execution.executor import Setup, simulate

    for name, robot, _ in _robots(scene):
        what = f"holding the tool at the start and pushing it 10 mm, {1e3 * SHORT_S:g} ms with {name},"
        rngs = [np.random.default_rng([12, i]) for i in range(2)]
        try:
            result = simulate(Push(PUSH_M), Setup(robot=robot, scene=scene), {}, rngs, duration_s=SHORT_S)
        except SkillframeError as error:
            yield f"does not run with {name}: {error}"
            continue
        if result.ended_by[0] in BROKEN[name]:
            yield f"{what} ends: {result.reason[0]}; look at the geoms' sizes, masses and the start"
        elif not np.isfinite([*result.peak_force_n, *result.final_error_m, *result.final_error_rad]).all():
            yield f"{what} gives results that are not finite; look at the goal and at the geoms"
