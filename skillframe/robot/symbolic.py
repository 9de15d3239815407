r"""A closed chain in casadi: the same kinematics as `loops`, as expressions that can be derived and written out as C.

Velocities go from the base to the tips in body axes, linear part first; X is the motion transform into body i:

    V_i = X V_p + S qd_i,   V_r,i = X V_r,p + S v_r,i,   dV_r,i/dt = X dV_r,p/dt - (S qd_i) x (X V_r,p) + S a_r,i,

components' derivatives, because dX/dt = -(S qd_i) x X (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 2).
The loops are closed in the axes of the link that carries the barrel, so that a joint on which a loop does not depend
stays out of its expressions. `pinocchio.casadi` is not in the wheel of `pin`; this needs `pinocchio.Model` alone.
Numbers below 1e-14 in the model's placements are rounding of angles and taken as zero.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from skillframe.frames import Float
from skillframe.robot.chain import ClosedChain, Cylinder

ROUNDING = 1e-14
Expression = Any  # casadi.SX


class Placement(NamedTuple):
    """Rotation (3, 3) and origin (3,)."""

    rotation: Expression
    origin: Expression

    def then(self, other: Placement) -> Placement:
        """The other placement, given in this one's frame."""
        return Placement(self.rotation @ other.rotation, self.rotation @ other.origin + self.origin)


class Twist(NamedTuple):
    """Linear and angular part (3,) each, body axes."""

    linear: Expression
    angular: Expression


class BodyMotion(NamedTuple):
    """Of one body, as in `control.vdc`: V, V_r, dV_r/dt and gravity, body axes."""

    velocity: Twist
    required: Twist
    rate: Twist
    gravity: Expression


def constant(array: Float) -> Expression:
    """A sparse casadi constant."""
    return ca.sparsify(ca.SX(np.where(np.abs(array) < ROUNDING, 0.0, array)))


def placement_of(pose: pin.SE3) -> Placement:
    """A Pinocchio pose as expressions."""
    return Placement(constant(pose.rotation), constant(pose.translation))


class SymbolicChain:
    """Expressions of a chain at symbols z and zd (n,).

    Args:
        chain: the model.

    Attributes:
        z, zd: the symbols; q: (nv,) closed configuration; embedding: G (nv, n).
    """

    def __init__(self, chain: ClosedChain) -> None:
        self.chain, self.model = chain, chain.model
        n = len(chain.independent)
        self.z, self.zd = ca.SX.sym("z", n), ca.SX.sym("zd", n)
        self._axes = {j: self._axis(j) for j in range(1, self.model.njoints)}
        self.q = self._closed()
        self.embedding = ca.jacobian(self.q, self.z)

    def along(self, expression: Expression) -> Expression:
        """Rate of an expression of z when z moves at zd."""
        return ca.jtimes(expression, self.z, self.zd)

    def drift_of(self, matrix: Expression, rate: Expression) -> Expression:
        """Rate of a matrix of z, times a rate (n,)."""
        held = ca.SX.sym("held", matrix.shape[1])
        return ca.substitute(self.along(matrix @ held), held, ca.densify(rate))

    def frame(self, frame: int) -> Placement:
        """A frame in base."""
        found = self.model.frames[frame]
        return self._up(0, int(found.parentJoint)).then(placement_of(found.placement))

    def joint(self, j: int) -> Placement:
        """A joint's frame in base."""
        return self._up(0, j)

    def bodies(self, rate: Expression, acceleration: Expression) -> list[BodyMotion]:
        """Motion of every moving body for required rates and accelerations (n,) in minimal coordinates."""
        v = self.embedding @ self.zd
        v_r, a_r = self.embedding @ rate, self.embedding @ acceleration + self.drift_of(self.embedding, rate)
        rest = Twist(ca.SX(3, 1), ca.SX(3, 1))
        result = [BodyMotion(rest, rest, rest, constant(self.model.gravity.linear))]
        for j in range(1, self.model.njoints):
            i = self.model.joints[j].idx_v
            result.append(self._body(j, result[self.model.parents[j]], (v[i], v_r[i], a_r[i])))
        return result[1:]

    def _body(self, j: int, parent: BodyMotion, rates: tuple[Any, ...]) -> BodyMotion:
        placed, axis = self._step(j), self._axes[j]
        own = Twist(*(part * rates[0] for part in axis))
        velocity, required, turned = (_into(placed, part) for part in parent[:3])
        rate = _less(turned, _cross(own, required))
        return BodyMotion(
            _plus(velocity, axis, rates[0]), _plus(required, axis, rates[1]), _plus(rate, axis, rates[2]),
            placed.rotation.T @ parent.gravity,
        )  # fmt: skip

    def _axis(self, j: int) -> Twist:
        s = np.array(self.model.joints[j].createData().S, dtype=float).reshape(6)
        return Twist(constant(s[:3]), constant(s[3:]))

    def _step(self, j: int) -> Placement:
        """Joint j's frame in its parent's."""
        return placement_of(self.model.jointPlacements[j]).then(self._moved(j, self.q[self.model.joints[j].idx_q]))

    def _moved(self, j: int, q: Expression) -> Placement:
        axis = self._axes[j]
        if axis.angular.nnz():
            k = ca.skew(axis.angular)
            return Placement(ca.SX.eye(3) + ca.sin(q) * k + (1 - ca.cos(q)) * (k @ k), ca.SX(3, 1))
        return Placement(ca.SX.eye(3), axis.linear * q)

    def _up(self, ancestor: int, j: int) -> Placement:
        """Joint j's frame in the frame of a joint that carries it."""
        path = []
        while j != ancestor:
            path.append(j)
            j = int(self.model.parents[j])
        result = Placement(ca.SX.eye(3), ca.SX(3, 1))
        for k in reversed(path):
            result = result.then(self._step(k))
        return result

    def _closed(self) -> Expression:
        self.q = ca.SX(self.model.nq, 1)
        self.q[list(map(int, self.chain._z))] = self.z
        for cylinder in self.chain.cylinders:
            angle, stroke = self._solve(cylinder)
            self.q[self.model.joints[cylinder.barrel].idx_q] = angle
            self.q[self.model.joints[cylinder.piston].idx_q] = stroke
        return self.q

    def _solve(self, c: Cylinder) -> tuple[Expression, Expression]:
        """As `ClosedChain` does, in the axes of the barrel at angle zero."""
        carrier = int(self.model.parents[c.barrel])
        frame = self.model.frames[c.eye]
        link = self._up(carrier, int(frame.parentJoint)).then(placement_of(frame.placement))
        base = self.model.jointPlacements[c.barrel]
        axis, rest, slide = constant(c.axis), constant(c.rest), constant(c.slide)
        eye = constant(base.rotation).T @ (link.origin - constant(base.translation))
        eye, rest = eye - ca.dot(eye, axis) * axis, rest - ca.dot(rest, axis) * axis
        along = ca.dot(rest, slide)
        stroke = ca.sqrt(ca.dot(eye, eye) - ca.dot(rest, rest) + along**2) - along
        rod = rest + stroke * slide
        return ca.atan2(ca.dot(axis, ca.cross(rod, eye)), ca.dot(rod, eye)), stroke


def _into(placed: Placement, twist: Twist) -> Twist:
    """A twist of the parent's frame in the child's."""
    back = placed.rotation.T
    return Twist(back @ (twist.linear - ca.cross(placed.origin, twist.angular)), back @ twist.angular)


def _cross(a: Twist, b: Twist) -> Twist:
    """Motion cross product a x b."""
    linear = ca.cross(a.angular, b.linear) + ca.cross(a.linear, b.angular)
    return Twist(linear, ca.cross(a.angular, b.angular))


def _less(a: Twist, b: Twist) -> Twist:
    return Twist(a.linear - b.linear, a.angular - b.angular)


def _plus(a: Twist, axis: Twist, rate: Expression) -> Twist:
    return Twist(a.linear + axis.linear * rate, a.angular + axis.angular * rate)
