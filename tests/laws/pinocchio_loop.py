"""One trial of a push at a time, written with Pinocchio and `mujoco.mj_step`: the witness of the batched executor.

It shares the compiled MuJoCo model and the start with skillframe, and no law: equation (1), damping design, null space,
taring, ramp and the push itself are written again here, over single vectors and Pinocchio's data.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

DT = 1e-3
TARE_TICKS, RAMP, REFRESH = 100, 0.05, 40
HOLD_STIFFNESS = np.diag([2000.0] * 3 + [100.0] * 3)
FLOOR = (20.0, 0.3)
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def loaded_model(robot, tool):
    """Pinocchio's model of the robot with its tool."""
    model = robot.model.copy()
    frame = model.frames[robot.tool_frames[0]]
    load = pin.Inertia(tool.mass, np.array(tool.center_of_mass), np.diag(tool.inertia))
    model.appendBodyToJoint(frame.parentJoint, load, frame.placement)
    return model


class Body:
    """The robot's kinematics and dynamics from Pinocchio at a MuJoCo state, for one point of the tool."""

    def __init__(self, robot, tool, point):
        self.model = loaded_model(robot, tool)
        self.data, self.frame, self.point = self.model.createData(), robot.tool_frames[0], point
        self.free = self.model.joints[1].nq == 7

    def update(self, qpos, qvel):
        q, v = self._ordered(qpos, qvel)
        pin.computeAllTerms(self.model, self.data, q, v)
        pin.updateFramePlacements(self.model, self.data)
        placement = self.data.oMf[self.frame]
        lever = placement.rotation @ self.point
        jacobian = pin.getFrameJacobian(self.model, self.data, self.frame, WORLD).copy()
        jacobian[:3] += -pin.skew(lever) @ jacobian[3:]
        self.jacobian, self.twist = jacobian, jacobian @ v
        self.position, self.rotation = placement.translation + lever, placement.rotation.copy()
        self.mass = np.triu(self.data.M) + np.triu(self.data.M, 1).T
        self.velocity, self.bias = v, self.data.nle.copy()
        if self.free:  # the bias of coordinates whose linear velocity is in base axes: their frame turns
            self.bias += self.mass @ np.concatenate([-np.cross(v[3:], v[:3]), np.zeros(3)])

    def _ordered(self, qpos, qvel):
        if not self.free:
            return qpos.copy(), qvel.copy()
        x, y, z, qw, qx, qy, qz = qpos
        self.turn = pin.Quaternion(qw, qx, qy, qz).matrix()
        return np.array([x, y, z, qx, qy, qz, qw]), np.concatenate([self.turn.T @ qvel[:3], qvel[3:]])

    def engine_torque(self, torque):
        """Pinocchio's generalised force in MuJoCo's: a free base's force is written in base axes there."""
        if not self.free:
            return torque
        return np.concatenate([self.turn @ torque[:3], torque[3:]])


def square_root(matrix):
    value, vector = np.linalg.eigh(matrix)
    return vector @ np.diag(np.sqrt(np.maximum(value, 0.0))) @ vector.T


def designed_damping(stiffness, body):
    """2 sqrt(Lambda) sqrt(Lambda^-1/2 K Lambda^-1/2) sqrt(Lambda) for each half, eigenvalues at least the floor."""
    inertia = np.linalg.inv(body.jacobian @ np.linalg.inv(body.mass) @ body.jacobian.T + 1e-6 * np.eye(6))
    damping = np.zeros((6, 6))
    for half, least in ((slice(0, 3), FLOOR[0]), (slice(3, 6), FLOOR[1])):
        root = square_root(inertia[half, half])
        back = np.linalg.inv(root)
        value, vector = np.linalg.eigh(2.0 * root @ square_root(back @ stiffness[half, half] @ back) @ root)
        damping[half, half] = vector @ np.diag(np.maximum(value, least)) @ vector.T
    return damping


def quiet_null_space(body):
    inverse = np.linalg.inv(body.mass)
    task = np.linalg.inv(body.jacobian @ inverse @ body.jacobian.T + 1e-9 * np.eye(6))
    projector = np.eye(len(inverse)) - body.jacobian.T @ task @ body.jacobian @ inverse
    return -10.0 * projector @ body.mass @ projector.T


@dataclass
class Outcome:
    configuration: np.ndarray
    position: np.ndarray
    ticks: int
    peak_force: float


class Loop:
    """One trial: `run` gives its outcome after `ticks` control ticks."""

    def __init__(self, robot, scene, model, point, configuration, fixture):
        self.engine, self.data = model, mujoco.MjData(model)
        self.data.qpos[:] = configuration
        self.data.mocap_pos[0], self.data.mocap_quat[0] = fixture
        mujoco.mj_forward(self.engine, self.data)
        self.body = Body(robot, scene.tool, point)
        self.damped_for, self.damping, self.tick, self.projector = None, None, 0, None

    def law(self, wanted, stiffness, twist):
        """Equation (1) as a wrench on the tool."""
        body = self.body
        if self.damped_for is not stiffness:
            self.damped_for, self.damping = stiffness, designed_damping(stiffness, body)
        turn = pin.log3(wanted[1] @ body.rotation.T)
        error = np.concatenate([wanted[0] - body.position, turn])
        return stiffness @ error + self.damping @ (twist - body.twist)

    def step(self, wanted, stiffness, twist):
        body = self.body
        torque = body.jacobian.T @ self.law(wanted, stiffness, twist) + body.bias
        if len(body.velocity) > 6:
            if self.tick % REFRESH == 0:
                self.projector = quiet_null_space(body)
            torque += self.projector @ body.velocity
        self.tick += 1
        self.data.qfrc_applied[:] = body.engine_torque(torque)
        mujoco.mj_step(self.engine, self.data)

    def contact_force(self):
        return float(np.linalg.norm(self.data.cfrc_ext[self.engine.body("tool").id, 3:]))

    def run(self, direction, stiffness, speed, cap, ticks):
        body = self.body
        body.update(self.data.qpos, self.data.qvel)
        stay = body.position.copy(), body.rotation.copy()
        for _ in range(TARE_TICKS):
            body.update(self.data.qpos, self.data.qvel)
            self.step(stay, HOLD_STIFFNESS, np.zeros(6))
        peak, twist, desired = 0.0, np.concatenate([speed * direction, np.zeros(3)]), None
        for tick in range(ticks):
            body.update(self.data.qpos, self.data.qvel)
            if desired is None:
                desired, attitude = body.position.copy(), body.rotation.copy()
            desired = desired + speed * DT * direction
            lead = (desired - body.position) @ direction
            desired = desired - max(lead - cap / stiffness.max(), 0.0) * direction
            peak = max(peak, self.contact_force())
            self.step((desired, attitude), stiffness, min(1.0, tick * DT / RAMP) * twist)
        body.update(self.data.qpos, self.data.qvel)
        return Outcome(self.data.qpos.copy(), body.position.copy(), ticks, peak)
