"""MuJoCo model from a `pinocchio.Model` and a scene.

Both models share joints, placements and inertias. The contact parameters avoid chatter in sliding and creep of jammed
pegs.

Each `[[loop]]` becomes a `connect` constraint and each mimic joint of a machine a `joint` constraint, integrated with
Runge-Kutta 4: the error of the first-order integrator would dominate (10 mm instead of 0.002 mm at the tip).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from skillframe.errors import SkillframeError, UnknownName
from skillframe.frames import matrix_from_quaternion, quaternion_from_matrix
from skillframe.robot.loops import followers_of
from skillframe.robot.model import RobotModel
from skillframe.robot.tables import LoopClosure
from skillframe.world.scene import Geom, Holder, Mover, Scene, Sprung, Tool
from skillframe.world.surfaces import number_of

TIMESTEP = 0.001  #: of the contact simulation [s]
SOLREF = (0.004, 1.0)  # 4 time steps, critically damped
SOLIMP = (0.01, 0.95, 1e-4, 0.5, 1.0)  # impedance rises from almost zero at touch, against chatter
FIXTURE, TOOL, SENSOR, SECOND = "fixture", "tool", "sensor", "second_sensor"  #: names of bodies and sensors
BASE = "robot_base"  # fixed parts of the robot
SPRUNG = "sprung_"  #: prefix of sprung parts
MOUNT = SPRUNG + "mount_"  # prefix of the joints of a soft mount
FASTEST_SWING = 1.2  #: rad a time step, of the tool on a soft mount: semi-implicit Euler is stable to 2
STICTION_SOLREF, STICTION_SOLIMP = (0.004, 1.0), (0.99, 0.999, 1e-3, 0.5, 2.0)  # joint friction with little creep
_KINDS = {
    "box": mujoco.mjtGeom.mjGEOM_BOX, "sphere": mujoco.mjtGeom.mjGEOM_SPHERE, "plane": mujoco.mjtGeom.mjGEOM_PLANE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE, "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "mesh": mujoco.mjtGeom.mjGEOM_MESH,
}  # fmt: skip


def wxyz(quaternion: Any) -> list[float]:
    """Quaternion in MuJoCo's order."""
    x, y, z, w = (float(v) for v in quaternion)
    return [w, x, y, z]


def build_spec(robot: RobotModel, scene: Scene, timestep: float = TIMESTEP) -> mujoco.MjSpec:
    """MuJoCo spec of the robot with the scene's tool, and the fixture as mocap body or in the second arm."""
    spec = mujoco.MjSpec()
    spec.modelname = f"{robot.spec.name} in {scene.name}"
    spec.compiler.degree = False
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 20.0  # stiff friction, against creep of a jammed peg
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.iterations = 50
    spec.option.tolerance = 1e-10
    spec.option.noslip_iterations = 0
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a reset would hide divergence
    spec.memory = 2 * 1024 * 1024  # the default of 13.6 MB a trial is too much for 256 trials
    model = robot.model
    spec.option.gravity = np.array(model.gravity.linear)
    spec.worldbody.add_body(name=BASE)
    bodies: dict[int, Any] = {0: spec.worldbody}
    for joint in range(1, model.njoints):
        body = bodies[model.parents[joint]].add_body(name=model.names[joint])
        placement = model.jointPlacements[joint]
        body.pos = placement.translation
        body.quat = wxyz(quaternion_from_matrix(placement.rotation))
        set_inertia(body, model.inertias[joint])
        _add_joint(body, model, joint)
        bodies[joint] = body
    close_loops(spec, robot.model, robot.spec.loop, bodies)
    couple_followers(spec, robot)
    _add_tool(spec, robot, scene, bodies)
    fixture = _add_holder(spec, robot, scene.holder, bodies) if scene.holder and held(robot, scene) else None
    fixture = fixture or spec.worldbody.add_body(name=FIXTURE, mocap=True)
    for index, geom in enumerate(scene.fixture):
        add_geom(spec, fixture, geom, f"{FIXTURE}_{index}", contype=1, conaffinity=2, friction=scene.friction)
    for part in scene.sprung:
        if isinstance(part, Mover):
            _add_mover(spec, fixture, part, scene.friction)
        else:
            _add_sprung(spec, fixture, part, scene.friction)
    return spec


def _add_mover(spec: mujoco.MjSpec, fixture: Any, part: Mover, friction: float) -> None:
    name = SPRUNG + part.name
    body = fixture.add_body(name=name)
    set_inertia(body, pin.Inertia(part.mass, np.array(part.center_of_mass), part.inertia))
    if part.joint == "free":
        for letter, axis in zip("xyz", np.eye(3), strict=True):
            body.add_joint(name=f"{name}_{letter}", axis=axis, type=mujoco.mjtJoint.mjJNT_SLIDE)
        body.add_joint(name=f"{name}_turn", pos=part.center_of_mass, type=mujoco.mjtJoint.mjJNT_BALL)
    else:
        kind = mujoco.mjtJoint.mjJNT_HINGE if part.joint == "hinge" else mujoco.mjtJoint.mjJNT_SLIDE
        joint = body.add_joint(name=name, axis=part.axis, pos=part.anchor, type=kind)
        joint.stiffness, joint.springref = [part.stiffness, 0.0, 0.0], part.rest
        joint.damping, joint.frictionloss = [part.damping, 0.0, 0.0], part.friction
        joint.solref_friction, joint.solimp_friction = STICTION_SOLREF, STICTION_SOLIMP
        if part.range is not None:
            joint.limited, joint.range = True, part.range
            joint.solref_limit, joint.solimp_limit = STICTION_SOLREF, STICTION_SOLIMP
    meets = 2 | 4  # tool and other movers
    if part.joint == "free":  # MuJoCo would otherwise filter contacts with its parent, the fixture
        meets |= 1
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    for index, geom in enumerate(part.geoms):
        add_geom(spec, body, geom, f"{name}_{index}", contype=1 | 4, conaffinity=meets, friction=friction)


def _add_sprung(spec: mujoco.MjSpec, fixture: Any, part: Sprung, friction: float) -> None:
    name = SPRUNG + part.name
    body = fixture.add_body(name=name, gravcomp=1.0)
    set_inertia(body, pin.Inertia(part.mass, np.zeros(3), part.mass * np.eye(3)))
    joint = body.add_joint(name=name, axis=part.axis, type=mujoco.mjtJoint.mjJNT_SLIDE)
    joint.stiffness = [part.stiffness, 0.0, 0.0]
    joint.damping = [2.0 * part.damping_ratio * np.sqrt(part.stiffness * part.mass), 0.0, 0.0]
    for index, geom in enumerate(part.geoms):
        add_geom(spec, body, geom, f"{name}_{index}", contype=1, conaffinity=2, friction=friction)


def held(robot: RobotModel, scene: Scene) -> bool:
    """Whether the robot's second arm holds the fixture."""
    return scene.holder is not None and len(robot.tool_frames) > 1


def set_inertia(body: Any, inertia: pin.Inertia) -> None:
    """Set a body's mass, centre of mass and inertia."""
    body.mass = inertia.mass
    body.ipos = inertia.lever
    i = inertia.inertia
    body.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    body.explicitinertial = True


def _add_joint(body: Any, model: pin.Model, index: int) -> None:
    joint = model.joints[index]
    name, kind = model.names[index], joint.shortname()
    if kind == "JointModelFreeFlyer":
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_FREE)
        return
    subspace = np.array(joint.createData().S, dtype=float).reshape(6, -1)
    sliding = joint.nv == 1 and not subspace[3:].any()
    if joint.nv != 1 or not (sliding or not subspace[:3].any()):
        cure = "set mimic = false in robot.toml" if kind == "JointModelMimic" else "use revolute and prismatic joints"
        raise SkillframeError(f"joint {name!r} is a {kind}, which the simulated world cannot hold; {cure}")
    axis = subspace[:3, 0] if sliding else subspace[3:, 0]
    v = joint.idx_v
    made = body.add_joint(
        name=name, axis=axis, type=mujoco.mjtJoint.mjJNT_SLIDE if sliding else mujoco.mjtJoint.mjJNT_HINGE
    )
    made.damping = [float(model.damping[v]), 0.0, 0.0]
    made.frictionloss = float(model.friction[v])
    made.armature = float(model.armature[v])
    if joint.nq == 1 and np.isfinite(model.lowerPositionLimit[joint.idx_q]):
        made.limited = True
        made.range = [model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]]


def _add_tool(spec: mujoco.MjSpec, robot: RobotModel, scene: Scene, bodies: dict[int, Any]) -> None:
    body = _mount(robot, 0, bodies, SENSOR).add_body(name=TOOL)
    if robot.spec.mount is not None:
        turning = np.diag(tool_inertia(scene.tool).matrix())[3:]
        for kind, stiffness, loads in (
            (mujoco.mjtJoint.mjJNT_SLIDE, robot.spec.mount.stiffness, np.full(3, scene.tool.mass)),
            (mujoco.mjtJoint.mjJNT_HINGE, robot.spec.mount.turning_stiffness, turning),
        ):
            for letter, axis, load in zip("xyz", np.eye(3), loads, strict=True):
                made = body.add_joint(name=f"{MOUNT}{kind.name[6:].lower()}_{letter}", axis=axis, type=kind)
                made.stiffness = [stiffness, 0.0, 0.0]
                least = stiffness * (spec.option.timestep / FASTEST_SWING) ** 2
                made.armature = max(least - load, 0.0)  # else the tool would swing too fast for the time step
                made.damping = [2.0 * robot.spec.mount.damping_ratio * np.sqrt(stiffness * max(load, least)), 0.0, 0.0]
    set_inertia(body, tool_inertia(scene.tool))
    for index, geom in enumerate(scene.tool.geoms):
        add_geom(spec, body, geom, f"{TOOL}_{index}", contype=2, conaffinity=1, friction=scene.friction)
    _add_sensors(spec, SENSOR)


def _add_holder(spec: mujoco.MjSpec, robot: RobotModel, holder: Holder, bodies: dict[int, Any]) -> Any:
    body = _mount(robot, 1, bodies, SECOND).add_body(name=FIXTURE)
    body.pos, body.quat = holder.position, wxyz(holder.quaternion)
    in_hand = pin.SE3(matrix_from_quaternion(holder.quaternion), np.array(holder.position))
    set_inertia(body, in_hand.actInv(tool_inertia(holder.tool)))
    _add_sensors(spec, SECOND)
    for joint in spec.joints:
        joint.solref_friction, joint.solimp_friction = STICTION_SOLREF, STICTION_SOLIMP
    return body


def _mount(robot: RobotModel, arm: int, bodies: dict[int, Any], name: str) -> Any:
    frame = robot.model.frames[robot.tool_frames[arm]]
    mount = bodies[frame.parentJoint].add_body(name=name)
    mount.pos = frame.placement.translation
    mount.quat = wxyz(quaternion_from_matrix(frame.placement.rotation))
    mount.add_site(name=name)
    return mount


def _add_sensors(spec: mujoco.MjSpec, site: str) -> None:
    for name, kind in (("force", mujoco.mjtSensor.mjSENS_FORCE), ("torque", mujoco.mjtSensor.mjSENS_TORQUE)):
        spec.add_sensor(name=f"{site}_{name}", type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site)


def tool_inertia(tool: Tool) -> pin.Inertia:
    """Spatial inertia of the tool in its frame."""
    return pin.Inertia(tool.mass, np.array(tool.center_of_mass), np.diag(tool.inertia))


def add_geom(
    spec: mujoco.MjSpec, body: Any, geom: Geom, name: str, *, contype: int, conaffinity: int, friction: float
) -> None:
    """Add a geom of a scene to a body. Geoms that do not collide are only drawn."""
    made = body.add_geom(
        name=name, type=_KINDS[geom.kind], pos=geom.position, quat=wxyz(geom.quaternion), rgba=geom.rgba
    )
    if geom.kind == "mesh":
        assert geom.vertices is not None
        mesh = spec.add_mesh(name=f"{name}_mesh")
        made.meshname = mesh.name
        if geom.surface is None:
            mesh.uservert = geom.vertices.ravel()
        else:
            assert geom.vertices is not None
            assert geom.surface is not None
            low, high = geom.vertices.min(axis=0), geom.vertices.max(axis=0)
            mesh.uservert = np.array([[(low, high)[(c >> x) & 1][x] for x in range(3)] for c in range(8)]).ravel()
            mesh.needsdf, mesh.octree_maxdepth = True, 1
            made.type = mujoco.mjtGeom.mjGEOM_SDF
            spec.nuser_geom = 1
            made.userdata = [float(number_of(geom.surface))]
    else:
        made.size[: len(geom.size)] = geom.size
    made.contype, made.conaffinity = (contype, conaffinity) if geom.collide else (0, 0)
    made.condim = 3
    made.friction = [friction, 0.0, 0.0]
    made.solref = SOLREF
    made.solimp = SOLIMP
    made.mass = 0.0


def close_loops(spec: mujoco.MjSpec, model: pin.Model, loops: Sequence[LoopClosure], bodies: dict[int, Any]) -> None:
    """Close a robot's chains, given the MuJoCo bodies by Pinocchio's joint id.

    Raises:
        UnknownName: the robot lacks a loop's frame.
    """
    if not loops:
        return
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for index, loop in enumerate(loops):
        sites = [f"loop_{index}_a", f"loop_{index}_b"]
        for site, name in zip(sites, (loop.frame_a, loop.frame_b), strict=True):
            if not model.existFrame(name):
                raise UnknownName("frame", name, [f.name for f in model.frames], "named in [[loop]]")
            frame = model.frames[model.getFrameId(name)]
            bodies[frame.parentJoint].add_site(name=site, pos=frame.placement.translation)
        equality = spec.add_equality(
            name=f"loop_{index}", type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=sites[0], name2=sites[1],
        )  # fmt: skip
        _stiffen(spec, equality)


def couple_followers(spec: mujoco.MjSpec, robot: RobotModel) -> None:
    """Let the joints of a machine follow others as its URDF says."""
    for each in followers_of(robot):
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
        equality = spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=robot.model.names[each.joint],
            name2=robot.model.names[each.leader], data=[each.offset, each.ratio, *[0.0] * (mujoco.mjNEQDATA - 2)],
        )  # fmt: skip
        _stiffen(spec, equality)


def _stiffen(spec: mujoco.MjSpec, equality: Any) -> None:
    equality.solref = [2.2 * spec.option.timestep, 1.0]  # time steps; MuJoCo's minimum is 2
    equality.solimp = (0.9999, 0.9999, 0.001, 0.5, 2.0)
