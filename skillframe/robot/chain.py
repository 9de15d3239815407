r"""Closed chains in minimal coordinates, by loop embedding.

Each `[[loop]]` of robot.toml makes one point of two frames of the URDF's tree. Gaps of loops are written in the axes of
the loop's carrier, the last joint that both frames hang on. With the independent joints z and the others d,

    c(q) = 0,   C = dc/dq = [C_z C_d],   G = [1; -C_d^-1 C_z],   v = G zd,   vd = G zdd + gamma,
    M_z = G^T M G,    h_z = G^T (h + D v + M gamma),    tau_z = R^T F,    R = rows of G of the actuated joints,

with joint damping D and actuator forces F (compare Petrovic and Mattila, Mech. Mach. Theory 170 (2022) 104680).

q follows from z by Newton's rule along a straight way from `[home]`, in steps that stay on home's branch: no turning
joint moves far in a step, and det C_d keeps its sign, which differs between the two branches of a loop.
The rows of c are chosen at home: a plane loop has two, in its plane, whatever turns the plane. A joint that follows
another (mimic of the URDF) has one, q - ratio q_leader - offset. With more actuators than
freedoms, F = W R (R^T W R)^-1 tau has the least F^T W^-1 F.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.linalg import block_diag, qr

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float, norm
from skillframe.robot.loops import (
    DEGENERATE,
    closed_loop,
    couplings,
    dependent_joints,
    followers_of,
    loop_gaps,
    moving_rows,
    require_plain_joints,
)
from skillframe.robot.model import RobotModel
from skillframe.robot.payload import published_inertia

_LWA = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
CLOSED = 1e-10
"""Largest gap of a closed loop [m]."""
MISFIT = 1e-3
"""Largest gap across the directions in which a loop's joints move it [m]: what drawings leave by rounding."""
FARTHEST = 0.5
"""Largest turn of a joint in a step of Newton's rule from a closed configuration [rad]; branches are farther apart."""


class OutOfReach(InputError):
    """The loops cannot be closed in a configuration."""


class ClosedChain:
    """Loop-embedding model of a robot, whose joints have one coordinate each.

    Independent are the joints of no loop, then those that carry the tool, then any others. Those of `[[passive]]` stand
    last in z: no actuator moves them, and at home they hang at rest.

    Attributes:
        home: (nq,) closed configuration at `[home]`.
        steered: number of the first coordinates of z, which actuators move; the others are passive.
        loops: the loops; followers: ids of joints that follow others.
        coupling, offsets: (followers, nv) and (followers,) of their gaps, coupling q - offsets.
        rows: (R, 3 loops + followers) constant rows of all gaps that are kept.
        independent: names of the joints of z, in Pinocchio's order, passive ones last.
        free, dependent: indices in velocities of the joints of z, and of the others.
        actuated: names of the actuated joints, else `independent`.
        driven: (actuators,) their indices in velocities.

    Raises:
        UnknownName: a loop or actuator names a missing frame or joint.
        InputError: a loop that cannot move or does not close at home, or a freedom without an actuator.
    """

    def __init__(self, robot: RobotModel) -> None:
        self.robot, self.model = robot, robot.model
        self._where = str(robot.spec.folder / "robot.toml")
        require_plain_joints(self.model, self._where)
        self._data = self.model.createData()
        self.loops = tuple(closed_loop(self.model, loop.frame_a, loop.frame_b, self._where) for loop in robot.spec.loop)
        found = followers_of(robot)
        self.followers = tuple(each.joint for each in found)
        self.coupling, self.offsets = couplings(self.model, found)
        _, jacobian = self.constraints(robot.home, self._data)
        rows = moving_rows(self.model, self.loops, jacobian[: 3 * len(self.loops)], self._where)
        self.rows: Float = block_diag(rows, np.eye(len(self.offsets)))
        self.dependent = dependent_joints(robot, self.loops, self.followers, self.rows @ jacobian)
        _, _, order = qr((self.rows @ jacobian)[:, self.dependent].T, pivoting=True)
        self.rows = self.rows[np.sort(order[: len(self.dependent)])]
        swinging = self._passive()
        self.free = np.append(np.setdiff1d(np.arange(self.model.nv), [*self.dependent, *swinging]), swinging)
        self.steered = len(self.free) - len(swinging)
        self.independent = tuple(self.model.names[int(i) + 1] for i in self.free)
        self.actuated = tuple(a.joint for a in robot.spec.actuation) or self.independent[: self.steered]
        joints = list(self.model.names)[1:]
        for name in self.actuated:
            if name not in joints:
                raise UnknownName("joint", name, joints, "named in [[actuation]]")
        self.driven = np.array([self.model.joints[self.model.getJointId(n)].idx_v for n in self.actuated], dtype=int)
        turning = [not str(self.model.joints[int(i) + 1].shortname()).startswith("JointModelP") for i in self.dependent]
        self._turning = np.array(turning, dtype=bool)
        self._sign = 0.0
        self.home = self._closed_home()
        if len(swinging):
            self.home = self.configuration(self.settled(self.minimal(self.home)))
        self._require_driven()

    def configuration(self, z: Float, near: Float | None = None) -> Float:
        """(nq,) configuration with closed loops at minimal coordinates (n,), by the way from `near` (nq,), else home.

        Raises:
            OutOfReach: the loops cannot be closed, or not without passing a dead centre.
        """
        q: Float = np.array(self.home if near is None else near, dtype=float)
        begin, passed, step = q[self.free].copy(), 0.0, 1.0
        way = np.asarray(z, dtype=float) - begin
        while passed < 1.0:
            reached = min(passed + step, 1.0)
            found = self._newton(q, z if reached == 1.0 else begin + reached * way)
            if found is not None:
                q, passed, step = found, reached, 2.0 * step
            elif step > 1e-3:
                step *= 0.5
            else:
                text = f"{self._open_loop(q, begin + reached * way)} cannot close in this configuration"
                raise OutOfReach(self._where, text, "move the joints")
        return q

    def minimal(self, q: Float) -> Float:
        """(n,) minimal coordinates of a configuration or velocity (nq,)."""
        result: Float = np.asarray(q)[self.free]
        return result

    def settled(self, z: Float) -> Float:
        """Minimal coordinates (n,) with passive joints where they hang at rest, by Newton's rule from z.

        Raises:
            OutOfReach: the loops cannot be closed.
            InputError: a passive joint falls without end.
        """
        z, h = np.array(z, dtype=float), 1e-5
        hung = slice(self.steered, None)
        still = np.zeros(len(z))
        steps = h * np.eye(len(z))[hung]
        for _ in range(100 if len(steps) else 0):
            turned = self.at(z, still).gravity[hung]
            slope = np.array([self.at(z + s, still).gravity - self.at(z - s, still).gravity for s in steps])[:, hung]
            values, ways = np.linalg.eigh((slope + slope.T) / (4.0 * h))
            along = ways.T @ turned  # down the potential, also from a point where it is greatest
            down = np.where(np.abs(along) > 1e-9, along / np.maximum(np.abs(values), 1e-6), values < -1e-6)
            step = ways @ down
            widest = float(np.abs(step).max(initial=0.0))
            if widest < 1e-9:
                return z
            z[hung] -= step * min(1.0, FARTHEST / widest)
        if len(steps):
            names = " and ".join(self.independent[hung])
            raise InputError(
                self._where, f"{names} does not come to rest: nothing holds its weight", "add an [[actuation]]"
            )
        return z

    def gaps(self, q: Float) -> Float:
        """(loops, 3) vectors between each loop's frames, in the axes of its carrier [m]."""
        return loop_gaps(self.model, self.loops, self._data, np.asarray(q))[0].reshape(-1, 3)

    def at(self, z: Float, zd: Float) -> ChainState:
        """Return the state at minimal coordinates and their rates (n,).

        Raises:
            OutOfReach: the loops cannot be closed.
        """
        return ChainState(self, np.asarray(z, dtype=float), np.asarray(zd, dtype=float))

    def _newton(self, start: Float, z: Float) -> Float | None:
        """The closed configuration (nq,) on the branch of a closed one, or None."""
        q, last = start.copy(), np.inf
        q[self.free] = z
        for _ in range(30):
            gaps, jacobian = self.constraints(q, self._data)
            left, square = self.rows @ gaps, (self.rows @ jacobian)[:, self.dependent]
            size = float(np.abs(left).max(initial=0.0))
            if not np.isfinite(size):
                return None
            if size < 1e-14 or (size < CLOSED and size >= last):
                turned = np.abs(q - start)[self.dependent][self._turning].max(initial=0.0)
                same = self._sign == 0.0 or (np.linalg.slogdet(square)[0] == self._sign and turned < FARTHEST)
                return q if same else None
            last = size
            try:
                step = np.linalg.solve(square, left)
            except np.linalg.LinAlgError:
                return None
            widest = np.abs(step[self._turning]).max(initial=0.0)
            q[self.dependent] -= step if widest < FARTHEST else FARTHEST / widest * step
        return None

    def _branch(self, q: Float) -> float:
        """Sign of det C_d, which differs between the two branches of a loop."""
        return float(np.linalg.slogdet((self.rows @ self.constraints(q, self._data)[1])[:, self.dependent])[0])

    def _open_loop(self, q: Float, z: Float) -> str:
        """Name of the loop that is widest open with the independent joints at z."""
        q = q.copy()
        q[self.free] = z
        return f"the loop {self.loops[int(np.argmax(norm(self.gaps(q))))].name}" if self.loops else "the chain"

    def _closed_home(self) -> Float:
        found = self._newton(self.robot.home, self.minimal(self.robot.home))
        if found is None:
            if not self.loops:
                raise OutOfReach(self._where, "its followers have no place near [home]", "correct their mimic tags")
            loop, wide = max(zip(self.loops, norm(self.gaps(self.robot.home)), strict=True), key=lambda pair: pair[1])
            place = ", ".join(f"{1e3 * x:.0f}" for x in self._data.oMf[loop.frames[0]].translation)
            gap = f"open by {1e3 * wide:.3g} mm at ({place}) mm in base"
            text = f"the loop {loop.name}, {gap}, cannot be closed near [home]"
            names = ", ".join(self.model.names[j] for j in loop.joints if self.model.names[j] not in self.independent)
            raise OutOfReach(self._where, text, f"write nearer positions of {names} under [home]")
        written, self._sign = (self._branch(q) for q in (self.robot.home, found))
        hinges = {f"{strut.name}_hinge" for strut in self.robot.spec.strut}
        turning = {self.model.names[int(i) + 1] for i in self.dependent[self._turning]} - hinges
        if written != self._sign and turning and turning <= self.robot.spec.home.keys():
            places = ", ".join(f"{n} {found[self.model.getJointId(n) - 1]:.4g}" for n in sorted(turning))
            text = f"the loops do not close on the branch that is written, but on another ({places} rad)"
            raise InputError(self._where, text, "correct the positions of these joints, or the pins")
        for loop, wide in zip(self.loops, norm(self.gaps(found)), strict=True):
            if wide > MISFIT:
                text = f"at home the loop {loop.name} is open by {1e3 * wide:.3g} mm, along the hinges of its joints"
                raise InputError(self._where, text, "draw both frames in the plane that the joints move them in")
        return found

    def constraints(self, q: Float, data: pin.Data) -> tuple[Float, Float]:
        """Gaps (3 loops + followers,) of loops and followers [m or rad], and their Jacobian."""
        gaps, jacobian = loop_gaps(self.model, self.loops, data, q)
        left = self.coupling @ q - self.offsets
        return np.concatenate([gaps, left]), np.concatenate([jacobian, self.coupling])

    def _passive(self) -> np.ndarray:
        """Indices in velocities of the joints of `[[passive]]`."""
        found, driven = [], [a.joint for a in self.robot.spec.actuation]
        for name in (each.joint for each in self.robot.spec.passive):
            if not self.model.existJointName(name):
                raise UnknownName("joint", name, list(self.model.names)[1:], "named in [[passive]]")
            index = int(self.model.joints[self.model.getJointId(name)].idx_v)
            why = "moved by an [[actuation]]" if name in driven else "moved by a [[loop]] or a leader"
            if name in driven or index in self.dependent:
                raise InputError(self._where, f"{name} is passive and {why}", "leave it out of one of them")
            found.append(index)
        return np.array(found, dtype=int)

    def _require_driven(self) -> None:
        arms = self.at(self.minimal(self.home), np.zeros(len(self.free))).arms
        names = self.independent[: self.steered]
        text = f"{len(self.actuated)} actuators for {len(names)} freedoms ({', '.join(names)})"
        arms = arms[:, : self.steered]
        idle = [name for name, arm in zip(names, arms.T, strict=True) if not np.any(np.abs(arm) > DEGENERATE)]
        if idle:
            fix = "give each an [[actuation]], hold it by [lock], or let it swing as a [[passive]] joint"
            raise InputError(self._where, f"{text}: no actuator moves {' and '.join(idle)}", fix)
        if np.linalg.matrix_rank(arms, DEGENERATE) < self.steered:
            raise InputError(self._where, f"{text}: several move the same joints", "give one [[actuation]] for each")


class ChainState:
    """Kinematics and dynamics of a closed chain at (z, zd), computed on access.

    Attributes:
        q, v: (nv,) of the tree; embedding: G (nv, n); drift: gamma (nv,); arms: R (actuators, n).
        constraint, constraint_rate: C and dC/dt (dependent, nv).
    """

    def __init__(self, chain: ClosedChain, z: Float, zd: Float) -> None:
        self.chain, self.z, self.zd = chain, z, zd
        model, self.data = chain.model, chain.model.createData()
        self.q = chain.configuration(z)
        _, jacobian = chain.constraints(self.q, self.data)
        self.constraint: Float = chain.rows @ jacobian
        self.embedding: Float = np.zeros((model.nv, len(z)))
        self.embedding[chain.free, np.arange(len(z))] = 1.0
        self.embedding[chain.dependent] = -self._dependent_of(self.constraint[:, chain.free])
        self.v: Float = self.embedding @ zd
        pin.computeJointJacobiansTimeVariation(model, self.data, self.q, self.v)
        pin.updateFramePlacements(model, self.data)
        self.constraint_rate: Float = chain.rows @ self._gap_rates()
        self.drift: Float = self.drift_of(zd)
        self.arms: Float = self.embedding[chain.driven]

    def _gap_rates(self) -> Float:
        """(3 loops + followers, nv) time derivative of the gaps' Jacobian."""
        model, data = self.chain.model, self.data
        rates = np.zeros((self.chain.rows.shape[1], model.nv))
        for index, loop in enumerate(self.chain.loops):
            a, b = loop.frames
            gap = np.array(data.oMf[a].translation - data.oMf[b].translation)
            moved = (pin.getFrameJacobian(model, data, a, _LWA) - pin.getFrameJacobian(model, data, b, _LWA))[:3]
            rate = pin.getFrameJacobianTimeVariation(model, data, a, _LWA)
            rate = (rate - pin.getFrameJacobianTimeVariation(model, data, b, _LWA))[:3]
            if loop.carrier:  # d/dt of R^T (J_a - J_b + [gap] J_w), with dR/dt = [w] R
                turning = pin.getJointJacobian(model, data, loop.carrier, _LWA)[3:]
                more = pin.getJointJacobianTimeVariation(model, data, loop.carrier, _LWA)[3:]
                rate = rate + pin.skew(moved @ self.v) @ turning + pin.skew(gap) @ more
                rate = rate - pin.skew(turning @ self.v) @ (moved + pin.skew(gap) @ turning)
            rates[3 * index : 3 * index + 3] = data.oMi[loop.carrier].rotation.T @ rate
        return rates

    def _dependent_of(self, rows: Float) -> Float:
        """C_d^-1 times rows."""
        return np.asarray(np.linalg.solve(self.constraint[:, self.chain.dependent], rows), dtype=float)

    def drift_of(self, rate: Float) -> Float:
        """(nv,) dG/dt times a rate (n,)."""
        result = np.zeros(self.chain.model.nv)
        result[self.chain.dependent] = -self._dependent_of(self.constraint_rate @ (self.embedding @ rate))
        return result

    @property
    def driven_motion(self) -> tuple[Float, Float]:
        """Positions and velocities (actuators,) of the actuated joints [m or rad]."""
        return self.q[self.chain.driven], self.v[self.chain.driven]

    @property
    def mass(self) -> Float:
        """(n, n) mass matrix in minimal coordinates."""
        result: Float = self.embedding.T @ self.tree_mass @ self.embedding
        return result

    @property
    def tree_mass(self) -> Float:
        """(nv, nv) mass matrix of the tree."""
        upper = np.triu(pin.crba(self.chain.model, self.chain._data, self.q))
        full: Float = upper + np.triu(upper, 1).T
        return full

    @property
    def bias(self) -> Float:
        """(n,) gravity, Coriolis, centrifugal and damping forces."""
        model, data = self.chain.model, self.chain._data
        tree = pin.rnea(model, data, self.q, self.v, self.drift) + model.damping * self.v
        result: Float = self.embedding.T @ tree
        return result

    @property
    def gravity(self) -> Float:
        """(n,) gravity forces."""
        model = self.chain.model
        result: Float = self.embedding.T @ pin.computeGeneralizedGravity(model, self.chain._data, self.q)
        return result

    def jacobian(self, frame: int) -> Float:
        """(6, n) Jacobian of a frame in base axes, linear part first."""
        result: Float = pin.getFrameJacobian(self.chain.model, self.data, frame, _LWA) @ self.embedding
        return result

    def jacobian_drift(self, frame: int, rate: Float) -> Float:
        """(6,) d(J G)/dt times a rate (n,), in base axes."""
        model, data = self.chain.model, self.data
        tree = pin.getFrameJacobianTimeVariation(model, data, frame, _LWA) @ (self.embedding @ rate)
        result: Float = tree + pin.getFrameJacobian(model, data, frame, _LWA) @ self.drift_of(rate)
        return result

    @property
    def load_gravity(self) -> Float:
        """(n,) gravity of a kilogram of payload at its link's centre of mass [N/kg or Nm/kg].

        Raises:
            InputError: no payload is declared.
        """
        robot, model = self.chain.robot, self.chain.model
        if robot.spec.payload is None:
            where = f"{robot.spec.folder / 'robot.toml'}: payload"
            raise InputError(where, "the robot declares no payload", "add [payload] with link, mass and rating")
        frame = model.getFrameId(robot.spec.payload.link, pin.FrameType.BODY)
        lever = self.data.oMf[frame].rotation @ np.array(published_inertia(robot.spec).com)
        rows = pin.getFrameJacobian(model, self.data, frame, _LWA) @ self.embedding
        result: Float = -(rows[:3] - pin.skew(lever) @ rows[3:]).T @ model.gravity.linear
        return result

    def actuator_force(self, generalised: Float, weight: Float | None = None) -> Float:
        """Actuator forces (actuators,) [N] equal to generalised forces (n,), those on passive joints aside.

        `weight` (actuators,), by default one each, is the diagonal of W: how willingly more actuators than freedoms
        take part. It has no effect on as many.
        """
        arms, needed = self.arms[:, : self.chain.steered], np.asarray(generalised)[: self.chain.steered]
        shared = arms if weight is None else weight[:, None] * arms
        return np.asarray(shared @ np.linalg.solve(arms.T @ shared, needed), dtype=float)

    def holding_force(self, weight: Float | None = None) -> Float:
        """Actuator forces (actuators,) [N] at rest under gravity."""
        return self.actuator_force(self.gravity, weight)

    def acceleration(self, force: Float, external: Float | None = None) -> Float:
        """(n,) acceleration under actuator forces (actuators,) and other generalised forces (n,)."""
        drive = self.arms.T @ force - self.bias + (0.0 if external is None else external)
        return np.asarray(np.linalg.solve(self.mass, drive), dtype=float)

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of the tree [J]."""
        model, data = self.chain.model, self.chain._data
        kinetic = float(pin.computeKineticEnergy(model, data, self.q, self.v))
        return kinetic, float(pin.computePotentialEnergy(model, data, self.q))
