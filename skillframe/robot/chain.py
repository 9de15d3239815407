r"""Closed chains by loop embedding: kinematics and dynamics of a robot with cylinders in minimal coordinates.

URDF says a tree; each `[[loop]]` of robot.toml closes it where two frames meet: the eye of a link, and the eye of a rod
that slides in a pivoting barrel. With the independent joints z, every joint is \(q = \phi(z)\), and

    v = G zd,    vd = G zdd + gamma,    A v = 0,  A = J_a - J_b  of the loops' frames,
    M_z = G^T M G,    h_z = G^T (h + D v + M gamma),    tau_z = R^T F,    R = rows of G of the actuated joints,

so a piston's force is F = R^-T tau_z (virtual work; Petrovic and Mattila, Mech. Mach. Theory 170 (2022) 104680, reach
the same by cutting). \(\phi\) is closed form: the rod's eye must be as far from the barrel's pivot as the link's eye.
D is the tree's joint damping.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.errors import InputError, UnknownName
from skillframe.frames import Float
from skillframe.robot.carried import CarriedLoad
from skillframe.robot.model import RobotModel

_LWA = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class OutOfReach(InputError):
    """A rod's eye cannot reach its link's eye in a configuration."""


class Cylinder(NamedTuple):
    """A loop as found in the tree: joint ids of barrel and piston, frame ids of the link's and of the rod's eye.

    Attributes:
        slide: (3,) sliding direction, barrel's axes; rest: (3,) the rod's eye at piston position 0, barrel's axes [m].
        axis: (3,) the barrel's hinge, its own axes.
    """

    barrel: int
    piston: int
    eye: int
    rod_eye: int
    slide: Float
    rest: Float
    axis: Float


class ClosedChain:
    """A robot's loop-embedding model.

    Args:
        robot: its spec names the loops; every joint has one coordinate.

    Attributes:
        independent: names of the joints that span the minimal coordinates z, in Pinocchio's order.
        actuated: names of the joints that actuators drive, in robot.toml's order; without actuators, `independent`.
        driven: (actuators,) indices of these joints in velocities of the tree.

    Raises:
        UnknownName: a loop or an actuator names a frame or a joint that the URDF does not have.
        InputError: a loop that is not a pivoting cylinder; actuators that do not match the freedoms.
    """

    def __init__(self, robot: RobotModel) -> None:
        self.robot, self.model = robot, robot.model
        self._where = str(robot.spec.folder / "robot.toml")
        if any(joint.nq != 1 for joint in list(self.model.joints)[1:]):
            raise InputError(self._where, "closed chains need joints with one coordinate each", "use limited joints")
        self.cylinders = tuple(self._cylinder(loop.frame_a, loop.frame_b) for loop in robot.spec.loop)
        passive = {j for c in self.cylinders for j in (c.barrel, c.piston)}
        free = [j for j in range(1, self.model.njoints) if j not in passive]
        self.independent = tuple(self.model.names[j] for j in free)
        self._z = np.array([self.model.joints[j].idx_q for j in free], dtype=int)
        self.actuated = tuple(a.joint for a in robot.spec.actuation) or self.independent
        self.driven = np.array([self._joint(name) for name in self.actuated], dtype=int)
        if len(self.driven) != len(free):
            text = f"{len(self.actuated)} actuators for {len(free)} freedoms ({', '.join(self.independent)})"
            raise InputError(self._where, text, "give one [[actuation]] for each")
        self._data = self.model.createData()
        self._load: CarriedLoad | None = None

    def configuration(self, z: Float) -> Float:
        """(nq,) closed configuration of minimal coordinates (n,).

        Raises:
            OutOfReach: a rod's eye cannot reach its link's eye.
        """
        q = np.zeros(self.model.nq)
        q[self._z] = z
        pin.framesForwardKinematics(self.model, self._data, q)
        for cylinder in self.cylinders:
            angle, stroke = self._solve(cylinder)
            q[self.model.joints[cylinder.barrel].idx_q] = angle
            q[self.model.joints[cylinder.piston].idx_q] = stroke
        return q

    def minimal(self, q: Float) -> Float:
        """(n,) minimal coordinates of a configuration or of a velocity (nq,)."""
        result: Float = np.asarray(q)[self._z]
        return result

    def gaps(self, q: Float) -> Float:
        """(loops, 3) from each rod's eye to its link's eye in base [m]."""
        pin.framesForwardKinematics(self.model, self._data, np.asarray(q))
        placed = self._data.oMf
        return np.array([placed[c.eye].translation - placed[c.rod_eye].translation for c in self.cylinders])

    def load_gravity(self, z: Float) -> Float:
        """(N, n) gravity's generalised forces per kilogram of the robot's payload at minimal coordinates (N, n).

        Raises:
            InputError: the robot declares no payload, or a cylinder moves it.
        """
        if self._load is None:
            self._load = CarriedLoad(self)
        return self._load.gravity(np.asarray(z, dtype=float))

    def at(self, z: Float, zd: Float) -> ChainState:
        """The state of minimal coordinates and their rates (n,).

        Raises:
            OutOfReach: a rod's eye cannot reach its link's eye.
        """
        return ChainState(self, np.asarray(z, dtype=float), np.asarray(zd, dtype=float))

    def _joint(self, name: str) -> int:
        names = list(self.model.names)[1:]
        if name not in names:
            raise UnknownName("joint", name, names, "named in [[actuation]]")
        return int(self.model.joints[self.model.getJointId(name)].idx_v)

    def _frame(self, name: str) -> int:
        if not self.model.existFrame(name):
            raise UnknownName("frame", name, [f.name for f in self.model.frames], "named in [[loop]]")
        return int(self.model.getFrameId(name))

    def _cylinder(self, name_a: str, name_b: str) -> Cylinder:
        a, b = self._frame(name_a), self._frame(name_b)
        for eye, rod_eye in ((a, b), (b, a)):
            piston = int(self.model.frames[rod_eye].parentJoint)
            barrel = int(self.model.parents[piston])
            hangs_on = set(self.model.supports[self.model.frames[eye].parentJoint])
            if self._slides(piston) and barrel and not self._slides(barrel) and self.model.parents[barrel] in hangs_on:
                return self._describe(barrel, piston, eye, rod_eye)
        text = f"the loop {name_a} - {name_b} is not a rod that slides in a pivoting barrel"
        raise InputError(self._where, text, "join the eye of a link and the eye of such a rod")

    def _slides(self, joint: int) -> bool:
        return bool(joint) and str(self.model.joints[joint].shortname()).startswith("JointModelP")

    def _describe(self, barrel: int, piston: int, eye: int, rod_eye: int) -> Cylinder:
        placement = self.model.jointPlacements[piston]
        slide, hinge = (np.array(self.model.joints[j].createData().S, dtype=float).reshape(6) for j in (piston, barrel))
        rest = placement.act(np.array(self.model.frames[rod_eye].placement.translation))
        return Cylinder(barrel, piston, eye, rod_eye, placement.rotation @ slide[:3], rest, hinge[3:])

    def _solve(self, c: Cylinder) -> tuple[float, float]:
        """Barrel's angle [rad] and piston's position [m]: |rest + x slide| = |eye|, across the hinge's axis."""
        base = self._data.oMi[self.model.parents[c.barrel]] * self.model.jointPlacements[c.barrel]
        eye = _across(base.actInv(np.array(self._data.oMf[c.eye].translation)), c.axis)
        rest, slide = _across(c.rest, c.axis), c.slide
        along = float(rest @ slide)
        square = float(eye @ eye - rest @ rest) + along * along
        if square < 0.0:
            name = self.model.names[c.piston]
            raise OutOfReach(self._where, f"{name} cannot reach its eye in this configuration", "move the joints")
        stroke = np.sqrt(square) - along
        rod = rest + stroke * slide
        return float(np.arctan2(_triple(c.axis, rod, eye), rod @ eye)), float(stroke)


class ChainState:
    """Kinematics and dynamics of a closed chain at (z, zd), computed when asked for.

    Attributes:
        q, v: (nv,) of the tree; embedding: G (nv, n); drift: gamma (nv,); arms: R (actuators, n), dx/dz of each piston.
    """

    def __init__(self, chain: ClosedChain, z: Float, zd: Float) -> None:
        self.chain, self.z, self.zd = chain, z, zd
        model, self.data = chain.model, chain.model.createData()
        self.q = chain.configuration(z)
        pin.computeJointJacobians(model, self.data, self.q)
        pin.updateFramePlacements(model, self.data)
        self.constraint, self._dependent = self._constraint(), self._dependents()
        self.embedding: Float = self._embedding()
        self.v: Float = self.embedding @ zd
        pin.computeJointJacobiansTimeVariation(model, self.data, self.q, self.v)
        pin.updateFramePlacements(model, self.data)
        self.constraint_rate = self._constraint_rate()
        self.drift: Float = self.drift_of(zd)
        self.arms: Float = self.embedding[chain.driven]

    def _dependents(self) -> list[int]:
        joints = self.chain.model.joints
        return [joints[j].idx_v for c in self.chain.cylinders for j in (c.barrel, c.piston)]

    def _constraint(self) -> Float:
        model, data = self.chain.model, self.data
        jacobian = [
            (pin.getFrameJacobian(model, data, c.eye, _LWA) - pin.getFrameJacobian(model, data, c.rod_eye, _LWA))[:3]
            for c in self.chain.cylinders
        ]
        return np.concatenate(jacobian) if jacobian else np.zeros((0, model.nv))

    def _constraint_rate(self) -> Float:
        model, data, rate = self.chain.model, self.data, pin.getFrameJacobianTimeVariation
        rows = [(rate(model, data, c.eye, _LWA) - rate(model, data, c.rod_eye, _LWA))[:3] for c in self.chain.cylinders]
        return np.concatenate(rows) if rows else np.zeros((0, model.nv))

    def _embedding(self) -> Float:
        n, nv = len(self.z), self.chain.model.nv
        result = np.zeros((nv, n))
        result[self.chain._z, np.arange(n)] = 1.0
        result[self._dependent] = -self._dependent_of(self.constraint[:, self.chain._z])
        return result

    def _dependent_of(self, rows: Float) -> Float:
        """Least squares over the dependent joints: exact, because the loops' gaps lie across the hinges' axes."""
        a = self.constraint[:, self._dependent]
        return np.asarray(
            np.linalg.solve(a.T @ a, a.T @ rows) if len(a) else np.zeros((0, *rows.shape[1:])), dtype=float
        )

    def drift_of(self, rate: Float) -> Float:
        """(nv,) dG/dt times a rate (n,): what the loops add to accelerations."""
        result = np.zeros(self.chain.model.nv)
        result[self._dependent] = -self._dependent_of(self.constraint_rate @ (self.embedding @ rate))
        return result

    @property
    def piston(self) -> tuple[Float, Float]:
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
        return full  # a new array: the chain's data is scratch

    @property
    def bias(self) -> Float:
        """(n,) gravity, Coriolis, centrifugal and damping generalised forces, what `M_z zdd` is not."""
        model, data = self.chain.model, self.chain._data
        tree = pin.rnea(model, data, self.q, self.v, self.drift) + model.damping * self.v
        result: Float = self.embedding.T @ tree
        return result

    @property
    def gravity(self) -> Float:
        """(n,) gravity's generalised forces."""
        model = self.chain.model
        result: Float = self.embedding.T @ pin.computeGeneralizedGravity(model, self.chain._data, self.q)
        return result

    def jacobian(self, frame: int) -> Float:
        """(6, n) Jacobian of a frame, linear part first, base axes."""
        result: Float = pin.getFrameJacobian(self.chain.model, self.data, frame, _LWA) @ self.embedding
        return result

    def jacobian_drift(self, frame: int, rate: Float) -> Float:
        """(6,) d(J G)/dt times a rate (n,), base axes."""
        model, data = self.chain.model, self.data
        tree = pin.getFrameJacobianTimeVariation(model, data, frame, _LWA) @ (self.embedding @ rate)
        result: Float = tree + pin.getFrameJacobian(model, data, frame, _LWA) @ self.drift_of(rate)
        return result

    def piston_force(self, generalised: Float) -> Float:
        """Forces (actuators,) [N] that make generalised forces (n,) in minimal coordinates."""
        return np.asarray(np.linalg.solve(self.arms.T, generalised), dtype=float)

    def holding_force(self) -> Float:
        """Piston forces (actuators,) [N] that hold the chain at rest against gravity."""
        return self.piston_force(self.gravity)

    def acceleration(self, force: Float, external: Float | None = None) -> Float:
        """(n,) under piston forces (actuators,) and other generalised forces (n,)."""
        drive = self.arms.T @ force - self.bias + (0.0 if external is None else external)
        return np.asarray(np.linalg.solve(self.mass, drive), dtype=float)

    def energy(self) -> tuple[float, float]:
        """Kinetic and potential energy of the tree [J]."""
        model, data = self.chain.model, self.chain._data
        kinetic = float(pin.computeKineticEnergy(model, data, self.q, self.v))
        return kinetic, float(pin.computePotentialEnergy(model, data, self.q))


def _across(vector: Float, axis: Float) -> Float:
    """Part of a vector across an axis."""
    result: Float = vector - (vector @ axis) * axis
    return result


def _triple(a: Float, b: Float, c: Float) -> float:
    """A . (b x c) in plain numbers: np.cross takes longer than all the rest."""
    (a0, a1, a2), (b0, b1, b2), (c0, c1, c2) = a.tolist(), b.tolist(), c.tolist()
    return float(a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0))


def _advance(chain: ClosedChain, z: Float, zd: Float, force: Float, external: Float | None) -> Float:
    return chain.at(z, zd).acceleration(force, external)


def step(
    chain: ClosedChain, z: Float, zd: Float, force: Float, dt: float, external: Float | None = None
) -> tuple[Float, Float]:
    """One classical Runge-Kutta step of length dt [s] under piston forces held over it: the oracle's integrator."""
    a1 = _advance(chain, z, zd, force, external)
    v2 = zd + 0.5 * dt * a1
    a2 = _advance(chain, z + 0.5 * dt * zd, v2, force, external)
    v3 = zd + 0.5 * dt * a2
    a3 = _advance(chain, z + 0.5 * dt * v2, v3, force, external)
    v4 = zd + dt * a3
    a4 = _advance(chain, z + dt * v3, v4, force, external)
    return z + dt / 6 * (zd + 2 * v2 + 2 * v3 + v4), zd + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
