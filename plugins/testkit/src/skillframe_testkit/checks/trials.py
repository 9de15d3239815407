"""Checks of a world by simulation with a free-flying tool and a seven-joint arm.

An arm that cannot reach the start is skipped.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.frames import Float, Pose, matrix_from_quaternion
from skillframe.skill import Command, Impedance, Observation, Skill, no_reasons

if TYPE_CHECKING:
    from skillframe.robot import RobotModel
    from skillframe.world import Scene

ROBOTS = ("free_tool", "panda")
LARGEST = {"fixture": 10.0, "tool": 3.0, "start": 10.0}
"""m: a crane reaches 8 m; larger values are usually millimetres."""
BROKEN = {"free_tool": {"diverged", "true_force", "force", "energy", "collision"}, "panda": {"diverged"}}
"""Failures due to the world and not to the arm's pose."""
SHORT_S = 0.1


def right_size(scene: Scene) -> Iterator[str]:
    """Check that lengths are plausible in metres."""
    fixture = [*scene.fixture, *(geom for part in scene.sprung for geom in part.geoms)]
    for name, geoms in {"fixture": fixture, "tool": [*scene.tool.geoms]}.items():
        size = 0.0  # farthest reach from the body's frame [m]
        for geom in (geom for geom in geoms if geom.kind != "plane"):
            own = np.abs(geom.size if geom.vertices is None else geom.vertices).max(initial=0.0)
            size = max(size, float(own + np.linalg.norm(geom.position)))
        if size > LARGEST[name]:
            yield f"the {name} reaches {size:.3g} m from its frame; is it in millimetres? give metres"
    longest = max(float(np.linalg.norm(point)) for point in scene.tool.frames.values())
    if longest > LARGEST["tool"]:
        yield f"the tool has a frame {longest:.3g} m away from the wrist; is it in millimetres? give metres"
    away = float(np.linalg.norm(scene.start_tip))
    if away > LARGEST["start"]:
        yield f"the run starts {away:.3g} m from the fixture frame; is start_tip in millimetres? give metres"


def points_into_the_fixture(scene: Scene) -> Iterator[str]:
    """Check that the tool's z axis opposes the fixture's, or matches the aligned orientation, levers aside."""
    task = scene.task
    if not scene.fixture or task.turn is not None:
        return
    into = np.array([0.0, 0.0, -1.0]) if task.aligned is None else matrix_from_quaternion(task.aligned)[:, 2]
    angle = float(np.arccos(np.clip(matrix_from_quaternion(scene.start_quaternion)[:, 2] @ into, -1.0, 1.0)))
    if angle > np.deg2rad(75.0):  # starts are tilted by degrees, wrong axes by 90
        yield (
            f"the tool starts turned {np.rad2deg(angle):.0f} degrees away from pointing into the fixture; "
            "its z axis points out along the tool, and start_quaternion (x, y, z, w) turns it to the fixture's -z"
        )


def compiles(scene: Scene) -> Iterator[str]:
    """Check that MuJoCo compiles it, with the tool near and outside the fixture."""
    from skillframe.world import build_spec

    for name, robot, configuration in _robots(scene):
        try:
            model = build_spec(robot, scene).compile()
        except (ValueError, KeyError, TypeError) as error:  # MuJoCo's errors, or those of its input
            yield f"MuJoCo does not take it: {' '.join(str(error).removeprefix('Error: ').split())}; correct that geom"
            return
        gap = _gap(scene, robot, model, configuration)
        if gap is not None and gap < -1e-4:  # m, as soft as MuJoCo's contacts
            yield f"the tool stands {-1e3 * gap:.3g} mm deep in the fixture at the start, with {name}; raise start_tip"
        elif gap is not None and gap > 1.0:  # m, half a minute for a teacher
            yield f"the tool starts {gap:.3g} m away from the fixture, with {name}; start nearer than 1 m"


def _robots(scene: Scene) -> Iterator[tuple[str, RobotModel, Float]]:
    from skillframe.execution import load_robot_model
    from skillframe.robot import UnreachablePose
    from skillframe.world import start_configurations

    for name in ROBOTS:
        robot = load_robot_model(name)
        try:
            yield name, robot, start_configurations(robot, scene, {}, 1)
        except UnreachablePose:
            continue


def _gap(scene: Scene, robot: RobotModel, model: Any, configuration: Float) -> float | None:
    """Smallest distance [m] of tool and fixture, negative in penetration, None without a pair.

    For two surfaces, whose distance MuJoCo does not know, only contacts count.
    """
    import mujoco

    from skillframe.world import FIXTURE, SPRUNG, TOOL, Plant, fixture_poses

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
    """Holds its start, and in the second half of the run moves down by `distance` [m]."""

    def __init__(self, distance: float) -> None:
        self._distance = distance

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Store the tool's pose."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())

    def step(self, observation: Observation) -> Command:
        """Command the start, then below it."""
        count, zero = len(observation.time), np.zeros((len(observation.time), 6))
        down = np.maximum(observation.time - 0.5 * SHORT_S, 0.0)[:, None] * [0.0, 0.0, -2.0 * self._distance / SHORT_S]
        gains = Impedance(np.diag([1000.0] * 3 + [50.0] * 3))
        pose = Pose(self._home.position + down, self._home.rotation)
        return Command(pose, zero, gains, zero, np.zeros(count, dtype=np.int64), no_reasons(count))


def runs(scene: Scene) -> Iterator[str]:
    """Check that 100 ms of holding and pushing stay finite and within limits."""
    from skillframe.execution import Setup, simulate

    for name, robot, _ in _robots(scene):
        what = f"holding the tool at the start and pushing it 10 mm, {1e3 * SHORT_S:g} ms with {name},"
        rngs = [np.random.default_rng([12, i]) for i in range(2)]
        try:
            result = simulate(Push(0.01), Setup(robot=robot, scene=scene), {}, rngs, duration_s=SHORT_S)
        except SkillframeError as error:
            yield f"does not run with {name}: {error}"
            continue
        if result.ended_by[0] in BROKEN[name]:
            yield f"{what} ends: {result.reason[0]}; check the geoms' sizes, masses and the start"
        elif not np.isfinite([*result.peak_force_n, *result.final_error_m, *result.final_error_rad]).all():
            yield f"{what} gives results that are not finite; check the goal and at the geoms"


def taught(scene: Scene) -> Iterator[str]:
    """Check that a teacher can start the task with the first robot that reaches it.

    Tasks without a direction are skipped.
    """
    from skillframe_teaching.sessions import record
    from skillframe_teaching.teacher import TeacherSettings

    robot = next((robot for _, robot, _ in _robots(scene)), None)
    if robot is None or scene.task.direction is None:
        return
    try:
        # a demonstration of a second need not reach the goal
        record(robot, scene, TeacherSettings(), count=1, seed=1, duration_s=1.0, attempts=1)
    except SkillframeError as error:
        if type(error) is not SkillframeError:  # the teacher's own failure is the base class
            yield f"nobody can take the tool: {error}"
