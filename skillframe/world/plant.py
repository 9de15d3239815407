"""Simulated robot in its world: N trials in lock-step on one persistent MuJoCo batch.

Position- and velocity-dependent fields are current after a step. Results are bit-identical for any batch size.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import mujoco.batch
import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float, Pose, move_wrench, norm, quaternion_from_matrix, rotate, rotation_matrix
from skillframe.robot.audit import unusable
from skillframe.robot.model import RobotModel
from skillframe.robot.payload import loaded_inertias
from skillframe.world.convert import FIXTURE, SECOND, SPRUNG, TIMESTEP, build_spec, held
from skillframe.world.layout import Layout
from skillframe.world.reading import compiled_jacobian
from skillframe.world.scene import Mover, Scene, State


class Travels:
    """Displacements of the movers in a plant's coordinates."""

    def __init__(self, model: mujoco.MjModel, scene: Scene) -> None:
        self._places: list[tuple[Mover, int]] = []
        for part in scene.sprung:
            if isinstance(part, Mover):
                first = SPRUNG + part.name + ("_x" if part.joint == "free" else "")
                self._places.append((part, int(model.joint(first).qposadr[0])))

    def __call__(self, qpos: Float) -> dict[str, Float]:
        """(N,) displacements [m or rad] by quantity, for MuJoCo configurations (N, nq)."""
        found: dict[str, Float] = {}
        for part, at in self._places:
            if part.joint != "free":
                values: tuple[Float, ...] = (qpos[:, at].copy(),)
            else:
                away, ball = qpos[:, at : at + 3], qpos[:, at + 3 : at + 7]
                values = norm(away), 2.0 * np.arctan2(norm(ball[:, 1:]), np.abs(ball[:, 0]))
            found.update(zip(part.quantities, values, strict=True))
        return found


Draws = Mapping[str, Float]  #: sampled values of each quantity, one for each trial
START_DEPTH = 1e-4
"""Largest penetration at the start [m]; resting parts have 20 um."""
_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)


class Kinematics(NamedTuple):
    """Kinematics at a time step: tool pose in base, Jacobian (N, 6, nv) of a point, bias and velocity (N, nv)."""

    pose: Pose
    jacobian: Float
    bias: Float
    velocity: Float


class Inside(NamedTuple):
    """Two overlapping bodies: row of the trial, names, depth [m]."""

    row: int
    first: str
    second: str
    depth: float

    @property
    def cause(self) -> str:
        """Text such as "the tool is 1.0 mm inside the fixture"."""
        return f"{self.first} is {1000.0 * self.depth:.2g} mm inside {self.second}"


class PlantState(NamedTuple):
    """Views of N trials: position (N, nq), velocity, acceleration and forces (N, nv). Columns `still` stay zero."""

    position: Float
    velocity: Float
    acceleration: Float
    applied: Float
    still: NDArray[np.int64]


class Plant:
    """N copies of one robot in one scene.

    Args:
        robot: nominal, without the tool.
        scene: the task.
        count: N.
        fixture: its pose in base per trial.
        draws: sampled `grasp.*`, `robot.*` and `world.friction`, each (N,).
        timestep: [s].
        rigid: makes a soft mount rigid.
    """

    def __init__(
        self, robot: RobotModel, scene: Scene, count: int, fixture: Pose, draws: Draws, timestep: float = TIMESTEP,
        rigid: bool = False,
    ) -> None:  # fmt: skip
        config = mujoco.MjLogConfig.get()
        config.logto_file = False
        mujoco.MjLogConfig.set(config)
        self.robot, self.scene, self.count = robot, scene, count
        try:
            self.model = build_spec(robot, scene, timestep).compile()
        except ValueError as error:
            raise unusable(robot.spec, error) from None
        self._layout = Layout(self.model)
        if rigid:
            self.model.dof_armature[self._layout.mount] = 1e9  # kg, kg m^2
        self.batch = mujoco.batch.Batch(self.model, count, nthread=1, persistent=True)
        self._fixture, self._held, self.tool = fixture, held(robot, scene), scene.tool
        self._travels = Travels(self.model, scene)
        self._looked_into: mujoco.MjData | None = None
        self._apply(draws)
        bind = self.batch.bind
        self._qpos, self._qvel, self._applied = bind("qpos"), bind("qvel"), bind("qfrc_applied")
        self._xpos, self._xmat, self._xquat = bind("xpos"), bind("xmat"), bind("xquat")
        self._anchor, self._axis, self._bias = bind("xanchor"), bind("xaxis"), bind("qfrc_bias")
        self._sensor, self._external, self._com = bind("sensordata"), bind("cfrc_ext"), bind("subtree_com")
        self._mocap_pos, self._mocap_quat, self._mass = bind("mocap_pos"), bind("mocap_quat"), bind("M")
        self._acceleration = bind("qacc")
        self._view()

    def arms(self) -> list[Plant]:
        """This plant for each arm's sensor and tool, with shared state."""
        if not self._held:
            return [self]
        second = copy.copy(self)
        assert self.scene.holder is not None
        second._layout, second.tool = Layout(self.model, SECOND, FIXTURE), self.scene.holder.tool
        second._view()
        return [self, second]

    def _view(self) -> None:
        i = self._layout.sensor
        self._tool_pose = Pose(self._xpos[:, i], self._xmat[:, i].reshape(-1, 3, 3))
        self.gauge: Float = self._sensor[:, self._layout.readings]
        """(N, 6) raw force-torque sensor, a view: the opposite of `sensor_wrench`."""
        self._force = self._external[:, self._layout.tool, 3:]
        self._compiled = compiled_jacobian(self._layout, self._anchor, self._axis, self._xmat, self._tool_pose)

    def _apply(self, draws: Draws) -> None:
        if "world.friction" in draws:
            friction = self.batch.expand("geom_friction")
            friction[:, :, 0] = draws["world.friction"][:, None]
        if "robot.joint_friction" in draws:
            friction_loss = draws["robot.joint_friction"][:, None] * self._layout.friction_share(self.robot)
            friction_loss[:, self._layout.sprung] = self.model.dof_frictionloss[self._layout.sprung]
            self.batch.expand("dof_frictionloss")[:] = friction_loss
        grasp = grasp_pose(draws, self.count)
        inertial = self._load(draws)
        if grasp is not None:
            self.batch.expand("body_pos")[:, self._layout.tool] = grasp.position
            q = quaternion_from_matrix(grasp.rotation)
            self.batch.expand("body_quat")[:, self._layout.tool] = q[:, [3, 0, 1, 2]]
            inertial = True
        if "robot.mass_scale" in draws:
            scale = draws["robot.mass_scale"][:, None]
            links = self._layout.links
            self.batch.expand("body_mass")[:, links] *= scale
            self.batch.expand("body_inertia")[:, links] *= scale[..., None]
            inertial = True
        if inertial:
            self.batch.set_const()

    def _load(self, draws: Draws) -> bool:
        """Set each trial's payload. Returns whether there is one."""
        if "robot.payload" not in draws:
            return False
        name, inertias = loaded_inertias(self.robot, draws["robot.payload"])
        body = self.model.body(name).id
        axes = [np.linalg.eigh(inertia.inertia) for inertia in inertias]
        turns = np.array([basis * np.sign(np.linalg.det(basis)) for _, basis in axes])
        self.batch.expand("body_mass")[:, body] = [inertia.mass for inertia in inertias]
        self.batch.expand("body_ipos")[:, body] = [inertia.lever for inertia in inertias]
        self.batch.expand("body_inertia")[:, body] = [moments for moments, _ in axes]
        self.batch.expand("body_iquat")[:, body] = quaternion_from_matrix(turns)[:, [3, 0, 1, 2]]
        return True

    def reset(self, configuration: Float) -> None:
        """Set robots at rest at Pinocchio configurations (N, nq), and fixtures at their poses."""
        self.batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
        if not self._held:
            self._mocap_pos[:, 0] = self._fixture.position
            self._mocap_quat[:, 0] = quaternion_from_matrix(self._fixture.rotation)[:, [3, 0, 1, 2]]
        self._qpos[:] = self.engine_order(configuration)
        self._qpos[:, self._layout.balls] = 1.0
        self._qvel[:] = 0.0
        self._applied[:] = 0.0
        self.batch.forward()
        if len(self._layout.mount):
            places, dofs = self._layout.mount_places, self._layout.mount
            stiffness = self.model.jnt_stiffness[self.model.dof_jntid[dofs]]
            self.batch.expand("qpos_spring")[:, places] = self._bias[:, dofs] / stiffness
            self.batch.forward()

    def without_mount(self, qpos: Float, qvel: Float) -> tuple[Float, Float]:
        """State (N, nq), (N, nv) as with a rigid mount, which encoders measure."""
        if not len(self._layout.mount):
            return qpos, qvel
        qpos, qvel = qpos.copy(), qvel.copy()
        qpos[:, self._layout.mount_places] = 0.0
        qvel[:, self._layout.mount] = 0.0
        return qpos, qvel

    def positions_without_mount(self) -> Float:
        """`joint_positions` (N, nv) as with a rigid mount."""
        positions = self.joint_positions.copy()
        positions[:, self._layout.mount] = 0.0
        return positions

    def set_state(self, qpos: Float, qvel: Float, ids: NDArray[np.int64]) -> None:
        """Copy another plant's state and update kinematics and velocities."""
        self._qpos[:], self._qvel[:] = qpos, qvel
        self.batch.forward(ids=ids, stage=mujoco.mjtStage.mjSTAGE_VEL)

    @property
    def state(self) -> tuple[Float, Float]:
        """Positions and velocities in MuJoCo's order, as views."""
        return self._qpos, self._qvel

    @property
    def joint_positions(self) -> Float:
        """(N, nv) joint position of each generalised velocity [rad or m], except for a free base."""
        whole: Float = self._qpos
        return whole if self.model.nq == self.model.nv else whole[:, self._layout.places]

    @property
    def configuration(self) -> Float:
        """(N, nq) in Pinocchio's order."""
        return self._layout.to_pinocchio(self.robot.model, self._qpos)

    def engine_order(self, configuration: Float) -> Float:
        """Convert Pinocchio configurations (T, nq) to MuJoCo's order."""
        return self._layout.to_mujoco(self.robot.model, configuration)

    def step(self, torque: Float, ids: NDArray[np.int64]) -> None:
        """Advance trials by one step under generalised forces (N, nv)."""
        self._apply_torque(torque)
        self.advance(ids)

    def arrays(self) -> PlantState:
        """Views of state and writable forces, in MuJoCo's order."""
        still = np.asarray(self._layout.sprung, dtype=np.int64)
        return PlantState(self._qpos, self._qvel, self._acceleration, self._applied, still)

    def advance(self, ids: NDArray[np.int64]) -> None:
        """Advance trials by one step under the forces already written."""
        self.batch.step(ids=self._some(ids), stage=_VELOCITY)

    def accelerate(self, ids: NDArray[np.int64]) -> None:
        """Update the accelerations of trials for the written forces."""
        self.batch.forward(ids=self._some(ids))

    def acceleration(self, torque: Float, ids: NDArray[np.int64]) -> Float:
        """Accelerations (N, nv) under generalised forces (N, nv), without a step."""
        self._apply_torque(torque)
        self.accelerate(ids)
        acceleration: Float = self._acceleration
        return acceleration

    def _some(self, ids: NDArray[np.int64]) -> NDArray[np.int64] | None:
        return ids if len(ids) < self.count else None

    def _apply_torque(self, torque: Float) -> None:
        """Write forces, zero on sprung parts, which gravity compensation would lift."""
        self._applied[:] = torque
        if len(self._layout.sprung):
            self._applied[:, self._layout.sprung] = 0.0

    def tool_pose(self) -> Pose:
        """Tool frame (sensor) in base, as views."""
        return self._tool_pose

    def kinematics(self, offset: Float) -> Kinematics:
        """Kinematics with the Jacobian of a point `offset` (3,) or (N, 3) in the tool frame."""
        pose = self._tool_pose
        if self._compiled is not None:
            return Kinematics(pose, self._compiled.at(offset), self._bias, self._qvel)
        point = pose.position + rotate(pose.rotation, offset)
        jacobian = self._layout.jacobian(self._anchor, self._axis, self._xmat, point)
        return Kinematics(pose, jacobian, self._bias, self._qvel)

    def mass_matrix(self) -> Float:
        """Dense mass matrices (N, nv, nv) in MuJoCo's order."""
        return self._layout.dense(self._mass)

    def sensor_wrench(self) -> Float:
        """Noiseless sensor wrench on the tool (N, 6), tool axes: contact, weight and inertia."""
        reading: Float = -self.gauge
        return reading

    def contact_wrench(self, offset: Float) -> Float:
        """True contact wrench (N, 6) on the tool at a point of the tool frame, base axes, with any xfrc_applied."""
        raw = self._external[:, self._layout.tool]
        at_com = np.concatenate([raw[:, 3:], raw[:, :3]], axis=-1)
        pose = self.tool_pose()
        point = pose.position + rotate(pose.rotation, offset)
        return move_wrench(at_com, point - self._com[:, self._layout.root])

    def contact_force(self) -> Float:
        """Magnitude (N,) of the true contact force on the tool [N]."""
        return norm(self._force)

    def inside(self) -> list[Inside]:
        """Deepest contact of each trial with more than `START_DEPTH`."""
        found = []
        for row in np.flatnonzero(self.batch.bind("ncon")):
            self._looked_into = self.batch.get_data(int(row), self._looked_into)
            contacts = self._looked_into.contact
            deepest = int(np.argmin(contacts.dist))
            if (depth := -float(contacts.dist[deepest])) > START_DEPTH:
                second, first = sorted(self._layout.body_of(int(geom)) for geom in contacts.geom[deepest])
                found.append(Inside(int(row), first, second, depth))
        return found

    def fixture_pose(self) -> Pose:
        """True fixture pose in base."""
        if not self._held:
            return self._fixture
        i = self._layout.fixture
        return Pose(self._xpos[:, i], self._xmat[:, i].reshape(-1, 3, 3))

    @property
    def dofs(self) -> NDArray[np.int64]:
        """Indices of the velocities that move this arm's tool."""
        return self._layout.dofs

    def tip_state(self) -> State:
        """State of the tool's tip in the true fixture frame."""
        i = self._layout.tool
        held = Pose(self._xpos[:, i], self._xmat[:, i].reshape(-1, 3, 3))
        tip = np.array(self.scene.tool.frames["tip"])
        in_base = held.at(tip)
        fixture = self.fixture_pose()
        in_fixture = fixture.inverse().compose(in_base)
        pose = self.tool_pose()
        offset = rotate(np.swapaxes(pose.rotation, -1, -2), in_base.position - pose.position)
        wrench = self.contact_wrench(offset)
        back = np.swapaxes(fixture.rotation, -1, -2)
        turned = np.concatenate([rotate(back, wrench[:, :3]), rotate(back, wrench[:, 3:])], axis=-1)
        return State(in_fixture, turned, self._travels(self._qpos))

    def body_coordinates(self) -> tuple[Float, Float]:
        """Positions (N, B, 3) and quaternions w, x, y, z (N, B, 4) of all bodies, as views."""
        return self._xpos, self._xquat

    def body_poses(self) -> tuple[Float, Float]:
        """Positions (N, B, 3) and quaternions x, y, z, w (N, B, 4) of all bodies but the world."""
        quaternion = self._xquat[:, 1:]
        return self._xpos[:, 1:], np.concatenate([quaternion[..., 1:], quaternion[..., :1]], axis=-1)


def grasp_pose(draws: Draws, count: int) -> Pose | None:
    """Tool pose in the grip from `grasp.offset_*` [m] and `grasp.tilt_*` [rad] about the wrist, or None."""
    return displacement(draws, "grasp", count)


def displacement(draws: Draws, prefix: str, count: int) -> Pose | None:
    """Pose from `<prefix>.offset_x|y|z` and rotation vector `<prefix>.tilt_x|y|z`, or None if absent."""
    if not any(key.startswith((f"{prefix}.offset_", f"{prefix}.tilt_")) for key in draws):
        return None

    def vector(kind: str) -> Float:
        zero = np.zeros(count)
        return np.stack([np.asarray(draws.get(f"{prefix}.{kind}_{axis}", zero)) for axis in "xyz"], axis=-1)

    return Pose(vector("offset"), rotation_matrix(vector("tilt")))
