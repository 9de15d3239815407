r"""Kinematics, dynamics and inverse kinematics of a robot, in base axes at a point.

For offset r in frame f, \(J_r = [J_v - [R r]_\times J_\omega;\; J_\omega]\). Inverse kinematics minimises \(e = [p_d -
p;\ \log(R_d R^T)]\) with Levenberg-Marquardt steps \(\Delta = J^T (J J^T + \lambda I)^{-1} e\), \(\lambda = e^T e / 2 +
10^{-10}\) (Sugihara, IEEE T-RO 27(5), 2011), clipped at joint limits, and random restarts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from skillframe.errors import InputError, SkillframeError
from skillframe.frames import Float, Pose, rotation_vector, skew
from skillframe.robot.model import ROOT_JOINT, RobotModel, load_model
from skillframe.robot.spec import load_robot

Flags = NDArray[np.bool_]

_TOLERANCE = 1e-9  # m and rad
_LWA = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class UnreachablePose(SkillframeError):
    """No configuration within the joint limits was found for a pose.

    Attributes:
        arm: its name; residual_m, residual_rad: remaining error.
        limits: limits [rad or m] by joint name that hinder.
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
        mass: (nv, nv) mass matrix; bias: (nv,) Coriolis, centrifugal and gravity forces [N m or N].
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
        """(6, nv) Jacobian in base axes, linear part first, at a point `offset` (3,) in frame axes [m]."""
        jacobian: Float = np.array(pin.getFrameJacobian(self._model, self._data, frame, _LWA))
        if offset is not None:
            jacobian[:3] -= skew(self._data.oMf[frame].rotation @ offset) @ jacobian[3:]
        return jacobian

    def twist(self, frame: int, offset: Float | None = None) -> Float:
        """(6,) twist of that point in base axes."""
        result: Float = self.jacobian(frame, offset) @ self._v
        return result


def at(robot: RobotModel | pin.Model, q: Float, v: Float) -> RobotState:
    """Return the state at a configuration (nq,) and velocity (nv,)."""
    return RobotState(robot.model if isinstance(robot, RobotModel) else robot, q, v)


def tool_pose(model: pin.Model, q: Float, frame: int) -> Pose:
    """Pose of a frame in base at a configuration (nq,)."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return _pose(data.oMf[frame])


def inverse_kinematics(robot: RobotModel, arm: str | int, pose: Pose, q0: Float) -> Float:
    """Configuration (nq,) that puts an arm's tool frame at a pose in base, starting from `q0`.

    It is within the joint limits and deterministic. A free base is placed in closed form.

    Raises:
        UnreachablePose: none was found.
    """
    index = robot.arm_index(arm) if isinstance(arm, str) else arm
    frame = robot.tool_frames[index]
    if robot.spec.base == "free":
        q = np.array(q0)
        base = pin.XYZQUATToSE3(q[:7])
        now = tool_pose(robot.model, q, frame)
        inside = base.inverse() * pin.SE3(now.rotation, now.position)
        q[:7] = pin.SE3ToXYZQUAT(pin.SE3(pose.rotation, pose.position) * inside.inverse())
        return q
    best, error = q0, np.full(6, np.inf)
    for start in _starts(robot.model, frame, q0):
        q, left = _descend(robot.model, frame, pose, start)
        if np.abs(left).max() < _TOLERANCE:
            return q
        if left @ left < error @ error:
            best, error = q, left
    residual = _error(pose, tool_pose(robot.model, best, frame))
    missed, turned = float(np.linalg.norm(residual[:3])), float(np.linalg.norm(residual[3:]))
    model = robot.model
    low, high, bounded = _bounds(model)
    drive = pin.computeFrameJacobian(model, model.createData(), best, frame, _LWA).T @ residual
    held = {}
    for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
        if joint.nq == 1 and bounded[i := joint.idx_q]:
            limit = high[i] if drive[joint.idx_v] > 0.0 else low[i]
            if abs(best[i] - limit) < _TOLERANCE and abs(drive[joint.idx_v]) > _TOLERANCE:
                held[name] = float(limit)
    raise UnreachablePose(robot.spec.arm[index].name, pose, missed, turned, held)


def random_configuration(model: pin.Model, rng: np.random.Generator) -> Float:
    """(nq,) configuration uniform within the limits, or +-pi rad or m of neutral."""
    q: Float = pin.integrate(model, pin.neutral(model), rng.uniform(-np.pi, np.pi, model.nv))
    low, high, bounded = _bounds(model)
    span = np.minimum(high, 1e6) - np.maximum(low, -1e6)
    q[bounded] = (np.maximum(low, -1e6) + span * rng.random(model.nq))[bounded]
    return q


def _pose(placement: pin.SE3) -> Pose:
    return Pose(np.array(placement.translation), np.array(placement.rotation))


def _error(wanted: Pose, now: Pose) -> Float:
    return np.concatenate([wanted.position - now.position, rotation_vector(wanted.rotation @ now.rotation.T)])


def _bounds(model: pin.Model) -> tuple[Float, Float, Flags]:
    low, high = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    single = np.zeros(model.nq, dtype=bool)
    for joint in list(model.joints)[1:]:
        if joint.nq == 1:
            single[joint.idx_q] = True
    return low, high, single & (low < high)


def _starts(model: pin.Model, frame: int, q0: Float) -> Iterator[Float]:
    yield q0
    moves = np.zeros(model.nq, dtype=bool)
    for index in list(model.supports[model.frames[frame].parentJoint])[1:]:
        joint = model.joints[index]
        moves[joint.idx_q : joint.idx_q + joint.nq] = True
    rng = np.random.default_rng(0)
    for _ in range(30):
        yield np.where(moves, random_configuration(model, rng), q0)


def _descend(model: pin.Model, frame: int, pose: Pose, q0: Float) -> tuple[Float, Float]:
    data, (low, high, bounded) = model.createData(), _bounds(model)
    q, held = np.array(q0), np.zeros(model.nv, dtype=bool)
    pairs = [(j.idx_q, j.idx_v) for j in list(model.joints)[1:] if j.nq == 1 and bounded[j.idx_q]]
    places, speeds = [p[0] for p in pairs], [p[1] for p in pairs]
    for _ in range(60):
        jacobian = pin.computeFrameJacobian(model, data, q, frame, _LWA)
        pin.updateFramePlacement(model, data, frame)
        error = _error(pose, _pose(data.oMf[frame]))
        if np.abs(error).max() < _TOLERANCE:
            break
        jacobian = np.where(held, 0.0, jacobian)
        damping = 0.5 * float(error @ error) + 1e-10
        gain = jacobian @ jacobian.T
        gain.flat[::7] += damping
        step = jacobian.T @ np.linalg.solve(gain, error)
        q_new = pin.integrate(model, q, step)
        clipped = np.where(bounded, np.clip(q_new, low, high), q_new)
        held = np.zeros(model.nv, dtype=bool)
        held[speeds] = (clipped != q_new)[places]
        if np.abs(clipped - q).max() < 1e-13:
            break
        q = clipped
    return q, error


def tool_poses(robot: str, arm: str | None, names: Sequence[str], positions: Float) -> Pose:
    """Poses of a robot's tool frame in base, position (T, 3) and rotation (T, 3, 3).

    Args:
        robot: name or path.
        arm: name, or None for the only one.
        names: recorded joints.
        positions: (T, len(names)) [rad, m].

    Raises:
        InputError, UnknownName: a wrong robot or arm, a free base, or a missing joint.
    """
    model = load_model(load_robot(robot))
    if arm is None and len(model.spec.arm) != 1:
        arms = ", ".join(a.name for a in model.spec.arm) or "none"
        raise InputError(f"robot {robot}", f"has the arms {arms}", "choose one with --set arm")
    frame = model.tool_frames[0 if arm is None else model.arm_index(arm)]
    columns = [(model.model.joints[i], names.index(name)) for i, name in _joints(model, robot, frame, names)]
    configuration, data = model.home.copy(), model.model.createData()
    position, rotation = np.empty((len(positions), 3)), np.empty((len(positions), 3, 3))
    for row, recorded in enumerate(positions):
        for joint, column in columns:
            value = float(recorded[column])
            angle = (np.cos(value), np.sin(value)) if joint.nq == 2 else (value,)
            configuration[joint.idx_q : joint.idx_q + joint.nq] = angle
        pin.framesForwardKinematics(model.model, data, configuration)
        position[row], rotation[row] = data.oMf[frame].translation, data.oMf[frame].rotation
    return Pose(position, rotation)


def _joints(model: RobotModel, robot: str, frame: int, names: Sequence[str]) -> list[tuple[int, str]]:
    supports = [int(i) for i in model.model.supports[model.model.frames[frame].parentJoint] if i > 0]
    found = [(i, str(model.model.names[i])) for i in supports if str(model.model.names[i]) not in model.followers]
    if any(name == ROOT_JOINT for _, name in found):
        raise InputError(f"robot {robot}", "has a free base, whose pose joint states do not hold", "record the pose")
    missing = [name for _, name in found if name not in names]
    if missing:
        raise InputError(
            f"robot {robot}", f"needs the joints {', '.join(missing)}; recorded are {', '.join(names)}",
            "choose the robot that was recorded, with its joint names",
        )  # fmt: skip
    return found
