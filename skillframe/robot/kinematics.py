r"""Kinematics and dynamics of a robot at a state, and inverse kinematics.

Everything is in base axes at a point of interest (Pinocchio's LOCAL_WORLD_ALIGNED): for a point fixed in frame f at an
offset r, \(J_r = [J_v - [R r]_\times J_\omega;\; J_\omega]\).

Inverse kinematics minimises the error \(e = [p_d - p;\ \log(R_d R^T)]\) by the Levenberg-Marquardt step
\(\Delta = J^T (J J^T + \lambda I)^{-1} e\) with \(\lambda = e^T e / 2 + 10^{-10}\): damping that vanishes with the
error (Sugihara, "Solvability-Unconcerned Inverse Kinematics by the Levenberg-Marquardt Method", IEEE T-RO 27(5), 2011).
Joint limits by clipping each step and leaving clipped joints out of the next, and seeded restarts are our choice.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float, Pose, rotation_vector, skew
from skillframe.robot.model import RobotModel

Flags = NDArray[np.bool_]

_TOLERANCE = 1e-9  # m and rad: far below any clearance, far above rounding
_STEPS = 60
_RESTARTS = 30
_LWA = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class UnreachablePose(SkillframeError):
    """No configuration within the joint limits was found for a pose.

    Attributes:
        arm: name of the arm; residual_m, residual_rad: what the nearest configuration found still misses.
        limits: the limit [rad or m], by name, of every joint that stands there and would have to go on.
    """

    def __init__(
        self, arm: str, pose: Pose, residual_m: float, residual_rad: float, limits: Mapping[str, float] | None = None
    ) -> None:
        self.arm, self.residual_m, self.residual_rad, self.limits = arm, residual_m, residual_rad, dict(limits or {})
        place = ", ".join(f"{x:.3f}" for x in pose.position)
        stuck = ", ".join(f"{name} at {limit:.4g}" for name, limit in self.limits.items())
        super().__init__(
            f"arm {arm!r} does not reach the pose at ({place}) m: the nearest configuration found misses it by "
            f"{1e3 * residual_m:.1f} mm and {np.degrees(residual_rad):.1f} degrees"
            + (f", held by joint limits (rad or m): {stuck}" if stuck else "")
            + "; move the fixture or the start"
        )


class RobotState:
    """Mass matrix, bias forces, poses and Jacobians at one state (q, v).

    Attributes:
        mass: (nv, nv) joint-space mass matrix; bias: (nv,) Coriolis, centrifugal and gravity forces [N m or N].
    """

    __slots__ = ("_data", "_model", "_v", "bias", "mass")

    def __init__(self, model: pin.Model, q: Float, v: Float) -> None:
        self._model, self._data, self._v = model, model.createData(), v
        upper = np.triu(pin.crba(model, self._data, q))
        self.mass: Float = upper + np.triu(upper, 1).T
        self.bias: Float = np.array(pin.nonLinearEffects(model, self._data, q, v))
        pin.computeJointJacobians(model, self._data, q)
        pin.updateFramePlacements(model, self._data)

    def pose(self, frame: int) -> Pose:
        """Pose of a frame in base."""
        return _pose(self._data.oMf[frame])

    def jacobian(self, frame: int, offset: Float | None = None) -> Float:
        """(6, nv) Jacobian, linear part first, base axes, at a point `offset` (3,) in frame axes [m]."""
        jacobian: Float = np.array(pin.getFrameJacobian(self._model, self._data, frame, _LWA))
        if offset is not None:
            jacobian[:3] -= skew(self._data.oMf[frame].rotation @ offset) @ jacobian[3:]
        return jacobian

    def twist(self, frame: int, offset: Float | None = None) -> Float:
        """(6,) twist of that point in base axes."""
        result: Float = self.jacobian(frame, offset) @ self._v
        return result


def at(robot: RobotModel | pin.Model, q: Float, v: Float) -> RobotState:
    """The robot's state at a configuration (nq,) and velocity (nv,)."""
    return RobotState(robot.model if isinstance(robot, RobotModel) else robot, q, v)


def tool_pose(model: pin.Model, q: Float, frame: int) -> Pose:
    """Pose of a frame in base at a configuration (nq,)."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return _pose(data.oMf[frame])


def inverse_kinematics(robot: RobotModel, arm: str | int, pose: Pose, q0: Float) -> Float:
    """A configuration that puts an arm's tool frame at a pose, near `q0` where there is one near.

    Args:
        robot: the nominal model; on a free base the joints stay as they are and the base is solved in closed form.
        arm: name or index.
        pose: of the tool frame in base.
        q0: (nq,) where to start; decides which of several solutions is found.

    Returns:
        (nq,) configuration within the joint limits; the same for the same arguments.

    Raises:
        UnreachablePose: none was found.
    """
    index = robot.arm_index(arm) if isinstance(arm, str) else arm
    frame = robot.tool_frames[index]
    if robot.spec.base == "free":
        return _place_base(robot.model, frame, pose, q0)
    best, error = q0, np.full(6, np.inf)
    for start in _starts(robot.model, frame, q0):
        q, left = _descend(robot.model, frame, pose, start)
        if np.abs(left).max() < _TOLERANCE:
            return q
        if left @ left < error @ error:
            best, error = q, left
    residual = _error(pose, tool_pose(robot.model, best, frame))
    missed, turned = float(np.linalg.norm(residual[:3])), float(np.linalg.norm(residual[3:]))
    held = _holding_limits(robot.model, frame, best, residual)
    raise UnreachablePose(robot.spec.arm[index].name, pose, missed, turned, held)


def random_configuration(model: pin.Model, rng: np.random.Generator) -> Float:
    """(nq,) configuration uniform within the limits. Where there are none, within +-pi rad or m of neutral."""
    q: Float = pin.integrate(model, pin.neutral(model), rng.uniform(-np.pi, np.pi, model.nv))
    low, high, bounded = _bounds(model)
    span = np.minimum(high, 1e6) - np.maximum(low, -1e6)
    q[bounded] = (np.maximum(low, -1e6) + span * rng.random(model.nq))[bounded]
    return q


def _pose(placement: pin.SE3) -> Pose:
    return Pose(np.array(placement.translation), np.array(placement.rotation))


def _error(wanted: Pose, now: Pose) -> Float:
    return np.concatenate([wanted.position - now.position, rotation_vector(wanted.rotation @ now.rotation.T)])


def _place_base(model: pin.Model, frame: int, pose: Pose, q0: Float) -> Float:
    """Q with the free-flying base placed so that the frame is at the pose: base = pose (base^-1 frame)^-1."""
    q = np.array(q0)
    base = pin.XYZQUATToSE3(q[:7])
    now = tool_pose(model, q, frame)
    inside = base.inverse() * pin.SE3(now.rotation, now.position)
    q[:7] = pin.SE3ToXYZQUAT(pin.SE3(pose.rotation, pose.position) * inside.inverse())
    return q


def _bounds(model: pin.Model) -> tuple[Float, Float, Flags]:
    """Limits (nq,) and which coordinates they bound: those of joints with one coordinate and a range."""
    low, high = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    single = np.zeros(model.nq, dtype=bool)
    for joint in list(model.joints)[1:]:
        if joint.nq == 1:  # a joint that follows another has none, and another's index
            single[joint.idx_q] = True
    return low, high, single & (low < high)


def _starts(model: pin.Model, frame: int, q0: Float) -> Iterator[Float]:
    """First q0, then random configurations of the joints that move the frame. Every other joint stays."""
    yield q0
    moves = np.zeros(model.nq, dtype=bool)
    for index in list(model.supports[model.frames[frame].parentJoint])[1:]:
        joint = model.joints[index]
        moves[joint.idx_q : joint.idx_q + joint.nq] = True
    rng = np.random.default_rng(0)  # fixed: the same question has the same answer
    for _ in range(_RESTARTS):
        yield np.where(moves, random_configuration(model, rng), q0)


def _descend(model: pin.Model, frame: int, pose: Pose, q0: Float) -> tuple[Float, Float]:
    """Damped least squares from one start: configuration and the error (6,) left."""
    data, (low, high, bounded) = model.createData(), _bounds(model)
    q, held = np.array(q0), np.zeros(model.nv, dtype=bool)
    columns = _columns(model, bounded)
    for _ in range(_STEPS):
        jacobian = pin.computeFrameJacobian(model, data, q, frame, _LWA)
        pin.updateFramePlacement(model, data, frame)
        error = _error(pose, _pose(data.oMf[frame]))
        if np.abs(error).max() < _TOLERANCE:
            break
        step = _step(jacobian, error, held)
        q_new = pin.integrate(model, q, step)
        clipped = np.where(bounded, np.clip(q_new, low, high), q_new)
        held = np.zeros(model.nv, dtype=bool)
        held[columns[1]] = (clipped != q_new)[columns[0]]
        if np.abs(clipped - q).max() < 1e-13:
            break
        q = clipped
    return q, error


def _holding_limits(model: pin.Model, frame: int, q: Float, error: Float) -> dict[str, float]:
    """Limits that joints stand at by name, of those that the error (6,) would drive on: J^T e points out of them."""
    low, high, bounded = _bounds(model)
    drive = pin.computeFrameJacobian(model, model.createData(), q, frame, _LWA).T @ error
    found = {}
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if joint.nq == 1 and bounded[i := joint.idx_q]:
            limit = high[i] if drive[joint.idx_v] > 0.0 else low[i]
            if abs(q[i] - limit) < _TOLERANCE and abs(drive[joint.idx_v]) > _TOLERANCE:
                found[name] = float(limit)
    return found


def _columns(model: pin.Model, bounded: Flags) -> tuple[list[int], list[int]]:
    """Coordinates and velocities of the joints that limits bound."""
    pairs = [(j.idx_q, j.idx_v) for j in list(model.joints)[1:] if j.nq == 1 and bounded[j.idx_q]]
    return [p[0] for p in pairs], [p[1] for p in pairs]


def _step(jacobian: Float, error: Float, held: Flags) -> Float:
    """Levenberg-Marquardt step. Joints that stand at a limit are left out."""
    jacobian = np.where(held, 0.0, jacobian)
    damping = 0.5 * float(error @ error) + 1e-10
    gain = jacobian @ jacobian.T
    gain.flat[::7] += damping
    result: Float = jacobian.T @ np.linalg.solve(gain, error)
    return result
