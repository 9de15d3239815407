"""The simulated robot in its world: N trials in lock-step on one persistent MuJoCo batch.

The plant is the truth: it may differ from the controller's model in mass, friction, grasp and fixture pose, trial by
trial. After each step its position- and velocity-dependent fields are current, so the kinematics that the controller
needs are read, not recomputed. Results are bit-identical for any number of trials in the batch.
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
from skillframe.robot.carried import loaded_inertias
from skillframe.robot.model import RobotModel
from skillframe.world.convert import FIXTURE, SECOND, TIMESTEP, build_spec, held
from skillframe.world.layout import Layout
from skillframe.world.movers import Travels
from skillframe.world.reading import compiled_jacobian
from skillframe.world.scene import Scene, State

Draws = Mapping[str, Float]
IMMOVABLE = 1e9
"""[kg, kg m^2] on the joints of a mount that is to be rigid: 1e8 of an arm's, and its mass matrix stays exact."""
_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)


class Kinematics(NamedTuple):
    """What the controller reads of a robot at a tick.

    Attributes:
        pose: of the tool frame in base.
        jacobian: (N, 6, nv) of a point, base axes, linear part first.
        bias: (N, nv) gravity, Coriolis and centrifugal generalised forces.
        velocity: (N, nv).
    """

    pose: Pose
    jacobian: Float
    bias: Float
    velocity: Float


class PlantState(NamedTuple):
    """Live arrays of N trials: position (N, nq), velocity, acceleration and generalised forces applied (N, nv).

    `still` names the columns of the forces that stay zero: nothing drives the fixture's sprung parts.
    """

    position: Float
    velocity: Float
    acceleration: Float
    applied: Float
    still: NDArray[np.int64]


def _leave_no_log_file() -> None:
    """MuJoCo would write MUJOCO_LOG.TXT where the user stands whenever a trial diverges, which the limits tell."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    mujoco.MjLogConfig.set(config)


class Plant:
    """N copies of one robot in one scene.

    Args:
        robot: nominal robot, without the tool.
        scene: the task.
        count: number of trials N.
        fixture: pose of the fixture in base per trial: (N, 3), (N, 3, 3).
        draws: quantities that differ from nominal: `grasp.*`, `robot.*` and `world.friction`, each (N,).
        timestep: [s].
        rigid: a soft mount does not give way, as a controller has it.
    """

    def __init__(
        self, robot: RobotModel, scene: Scene, count: int, fixture: Pose, draws: Draws, timestep: float = TIMESTEP,
        rigid: bool = False,
    ) -> None:  # fmt: skip
        _leave_no_log_file()
        self.robot, self.scene, self.count = robot, scene, count
        try:
            self.model = build_spec(robot, scene, timestep).compile()
        except ValueError as error:
            raise unusable(robot.spec, error) from None
        self._layout = Layout(self.model)
        if rigid:
            self.model.dof_armature[self._layout.mount] = IMMOVABLE
        self.batch = mujoco.batch.Batch(self.model, count, nthread=1, persistent=True)
        self._fixture, self._held, self.tool = fixture, held(robot, scene), scene.tool
        self._travels = Travels(self.model, scene)
        self._apply(draws)
        self._bind()

    def arms(self) -> list[Plant]:
        """This plant as each of its arms' sensor and tool point see it. They share one state."""
        if not self._held:
            return [self]
        second = copy.copy(self)
        assert self.scene.holder is not None
        second._layout, second.tool = Layout(self.model, SECOND, FIXTURE), self.scene.holder.tool
        second._view()
        return [self, second]

    def _bind(self) -> None:
        bind = self.batch.bind
        self._qpos, self._qvel, self._applied = bind("qpos"), bind("qvel"), bind("qfrc_applied")
        self._xpos, self._xmat, self._xquat = bind("xpos"), bind("xmat"), bind("xquat")
        self._anchor, self._axis, self._bias = bind("xanchor"), bind("xaxis"), bind("qfrc_bias")
        self._sensor, self._external, self._com = bind("sensordata"), bind("cfrc_ext"), bind("subtree_com")
        self._mocap_pos, self._mocap_quat, self._mass = bind("mocap_pos"), bind("mocap_quat"), bind("M")
        self._acceleration = bind("qacc")
        self._view()

    def _view(self) -> None:
        """What every tick reads of this arm, as live views."""
        i = self._layout.sensor
        self._tool_pose = Pose(self._xpos[:, i], self._xmat[:, i].reshape(-1, 3, 3))
        self.gauge: Float = self._sensor[:, self._layout.readings]
        """(N, 6) of the force-torque sensor as the simulator has it, live: `sensor_wrench` is its opposite."""
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
        """Give each trial its own payload. Returns whether there was one to give."""
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
        """Put the robot at rest at configurations (N, nq), in Pinocchio's order, and the fixture at its pose."""
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
            self._level()

    def _level(self) -> None:
        """Preload the springs of a soft mount by the tool's weight, as it hangs now."""
        places, dofs = self._layout.mount_places, self._layout.mount
        stiffness = self.model.jnt_stiffness[self.model.dof_jntid[dofs]]
        self.batch.expand("qpos_spring")[:, places] = self._bias[:, dofs] / stiffness
        self.batch.forward()

    def without_mount(self, qpos: Float, qvel: Float) -> tuple[Float, Float]:
        """State (N, nq), (N, nv) of an arm whose mount is rigid: what its encoders know."""
        if not len(self._layout.mount):
            return qpos, qvel
        qpos, qvel = qpos.copy(), qvel.copy()
        qpos[:, self._layout.mount_places] = 0.0
        qvel[:, self._layout.mount] = 0.0
        return qpos, qvel

    def positions_without_mount(self) -> Float:
        """`joint_positions` (N, nv) of an arm whose mount is rigid."""
        positions = self.joint_positions.copy()
        positions[:, self._layout.mount] = 0.0
        return positions

    def set_state(self, qpos: Float, qvel: Float, ids: NDArray[np.int64]) -> None:
        """Copy another plant's state and bring kinematics and velocities up to date."""
        self._qpos[:], self._qvel[:] = qpos, qvel
        self.batch.forward(ids=ids, stage=mujoco.mjtStage.mjSTAGE_VEL)

    @property
    def state(self) -> tuple[Float, Float]:
        """Generalised positions and velocities in MuJoCo's order, live views."""
        return self._qpos, self._qvel

    @property
    def joint_positions(self) -> Float:
        """(N, nv) position of the joint that each generalised velocity belongs to [rad or m]. A free base has none."""
        whole: Float = self._qpos
        return whole if self.model.nq == self.model.nv else whole[:, self._layout.places]

    @property
    def configuration(self) -> Float:
        """(N, nq) in Pinocchio's order."""
        return self._layout.to_pinocchio(self.robot.model, self._qpos)

    def engine_order(self, configuration: Float) -> Float:
        """Configurations (T, nq) of Pinocchio in MuJoCo's order."""
        return self._layout.to_mujoco(self.robot.model, configuration)

    def step(self, torque: Float, ids: NDArray[np.int64]) -> None:
        """Advance some trials by one time step under generalised forces (N, nv) in MuJoCo's order."""
        self._apply_torque(torque)
        self.advance(ids)

    def arrays(self) -> PlantState:
        """State and generalised forces as live arrays, MuJoCo's order, for whoever writes the forces there himself."""
        still = np.asarray(self._layout.sprung, dtype=np.int64)
        return PlantState(self._qpos, self._qvel, self._acceleration, self._applied, still)

    def advance(self, ids: NDArray[np.int64]) -> None:
        """Advance some trials by one time step under the generalised forces that are written already."""
        self.batch.step(ids=self._some(ids), stage=_VELOCITY)

    def accelerate(self, ids: NDArray[np.int64]) -> None:
        """Bring accelerations of some trials up to date with the forces that are written. No time passes."""
        self.batch.forward(ids=self._some(ids))

    def acceleration(self, torque: Float, ids: NDArray[np.int64]) -> Float:
        """Accelerations (N, nv) of some trials under generalised forces (N, nv), MuJoCo's order. No time passes."""
        self._apply_torque(torque)
        self.accelerate(ids)
        acceleration: Float = self._acceleration
        return acceleration

    def _some(self, ids: NDArray[np.int64]) -> NDArray[np.int64] | None:
        """None for all trials, which the engine need not check."""
        return ids if len(ids) < self.count else None

    def _apply_torque(self, torque: Float) -> None:
        """Nothing drives the fixture's sprung parts. A controller that cancels gravity would lift them."""
        self._applied[:] = torque
        if len(self._layout.sprung):
            self._applied[:, self._layout.sprung] = 0.0

    def tool_pose(self) -> Pose:
        """Pose of the robot's tool frame (where the sensor sits) in base, live views."""
        return self._tool_pose

    def kinematics(self, offset: Float) -> Kinematics:
        """Kinematics with the Jacobian of a point fixed in the tool frame, `offset` (3,) or (N, 3)."""
        pose = self._tool_pose
        if self._compiled is not None:
            return Kinematics(pose, self._compiled.at(offset), self._bias, self._qvel)
        point = pose.position + rotate(pose.rotation, offset)
        jacobian = self._layout.jacobian(self._anchor, self._axis, self._xmat, point)
        return Kinematics(pose, jacobian, self._bias, self._qvel)

    def mass_matrix(self) -> Float:
        """Dense mass matrices (N, nv, nv), MuJoCo's order."""
        return self._layout.dense(self._mass)

    def sensor_wrench(self) -> Float:
        """What the force-torque sensor reads without noise and bias, as the wrench on the tool, tool axes (N, 6).

        It holds contact, tool weight and the tool's inertial forces; the reading is that of the step just taken.
        """
        reading: Float = -self.gauge
        return reading

    def contact_wrench(self, offset: Float) -> Float:
        """True wrench (N, 6) of the environment on the tool at a point of the tool frame, base axes."""
        raw = self._external[:, self._layout.tool]
        at_com = np.concatenate([raw[:, 3:], raw[:, :3]], axis=-1)
        pose = self.tool_pose()
        point = pose.position + rotate(pose.rotation, offset)
        return move_wrench(at_com, point - self._com[:, self._layout.root])

    def contact_force(self) -> Float:
        """Size (N,) of the true contact force on the tool [N]."""
        return norm(self._force)

    def fixture_pose(self) -> Pose:
        """True pose of the fixture in base, standing or in the second arm's grip."""
        if not self._held:
            return self._fixture
        i = self._layout.fixture
        return Pose(self._xpos[:, i], self._xmat[:, i].reshape(-1, 3, 3))

    @property
    def dofs(self) -> NDArray[np.int64]:
        """Indices of the generalised velocities that move this arm's tool."""
        return self._layout.dofs

    def tip_state(self) -> State:
        """The tool's tip seen from the true fixture, for goals."""
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

    def body_frames(self) -> tuple[Float, Float]:
        """Positions (N, B, 3) and axes (N, B, 3, 3) of all bodies, the world first. The positions are a live view."""
        return self._xpos, self._xmat.reshape(*self._xpos.shape, 3)

    def body_coordinates(self) -> tuple[Float, Float]:
        """Positions (N, B, 3) and quaternions w, x, y, z (N, B, 4) of all bodies, the world first, as live views."""
        return self._xpos, self._xquat

    def body_poses(self) -> tuple[Float, Float]:
        """Positions (N, B, 3) and quaternions x, y, z, w (N, B, 4) of the drawn bodies: all but the world."""
        quaternion = self._xquat[:, 1:]
        return self._xpos[:, 1:], np.concatenate([quaternion[..., 1:], quaternion[..., :1]], axis=-1)


def grasp_pose(draws: Draws, count: int) -> Pose | None:
    """Pose of the tool in the grip for `grasp.offset_*` [m] and `grasp.tilt_*` [rad] (about the wrist), or None."""
    return displacement(draws, "grasp", count)


def displacement(draws: Draws, prefix: str, count: int) -> Pose | None:
    """A pose from `<prefix>.offset_x|y|z` and the rotation vector `<prefix>.tilt_x|y|z`, or None if none is drawn."""
    if not any(key.startswith((f"{prefix}.offset_", f"{prefix}.tilt_")) for key in draws):
        return None

    def vector(kind: str) -> Float:
        zero = np.zeros(count)
        return np.stack([np.asarray(draws.get(f"{prefix}.{kind}_{axis}", zero)) for axis in "xyz"], axis=-1)

    return Pose(vector("offset"), rotation_matrix(vector("tilt")))
