r"""Closed chain of `chain` as CasADi expressions, to differentiate or export as C.

The closed configuration q is a symbol, which `closing_function` computes from z, so that d/dz = d/dq G.

Velocities go from base to tips in body axes, linear part first; X is the motion transform into body i:

    V_i = X V_p + S qd_i,   V_r,i = X V_r,p + S v_r,i,   dV_r,i/dt = X dV_r,p/dt - (S qd_i) x (X V_r,p) + S a_r,i,

as dX/dt = -(S qd_i) x X (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 2).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin

from skillframe.frames import Float
from skillframe.robot import ClosedChain, ClosedLoop
from skillframe_hydraulics.law.generated import dense_function

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
    """V, V_r, dV_r/dt and gravity of a body, in body axes."""

    velocity: Twist
    required: Twist
    rate: Twist
    gravity: Expression


def constant(array: Float) -> Expression:
    """A sparse casadi constant."""
    return ca.sparsify(ca.SX(np.where(np.abs(array) < 1e-14, 0.0, array)))  # rounding


def placement_of(pose: pin.SE3) -> Placement:
    """A Pinocchio pose as expressions."""
    return Placement(constant(pose.rotation), constant(pose.translation))


class SymbolicChain:
    """Expressions of a chain at symbols q (nq,), closed, and zd (n,).

    Attributes:
        q, zd: the symbols; z: (n,) of q; gaps: (R,) of the loops; embedding: G (nv, n).
    """

    def __init__(self, chain: ClosedChain) -> None:
        self.chain, self.model = chain, chain.model
        free, moved, n = chain.free.tolist(), chain.dependent.tolist(), len(chain.free)
        self.q, self.zd = ca.SX.sym("q", self.model.nq), ca.SX.sym("zd", n)
        self.z = self.q[free]
        self._axes = {j: self._axis(j) for j in range(1, self.model.njoints)}
        followers = constant(chain.coupling) @ self.q - constant(chain.offsets)
        self.gaps = constant(chain.rows) @ ca.vertcat(*(self._gap(loop) for loop in chain.loops), followers)
        constraint = ca.jacobian(self.gaps, self.q)
        self.embedding = ca.SX(self.model.nv, n)
        self.embedding[free, :] = ca.SX.eye(n)
        if moved:
            self.embedding[moved, :] = -ca.solve(constraint[:, moved], constraint[:, free])

    def by_z(self, expression: Expression) -> Expression:
        """Jacobian of an expression of q by z."""
        return ca.jacobian(expression, self.q) @ self.embedding

    def along(self, expression: Expression) -> Expression:
        """Time derivative of an expression of q."""
        return ca.jtimes(expression, self.q, self.embedding @ self.zd)

    def drift_of(self, matrix: Expression, rate: Expression) -> Expression:
        """Time derivative of a matrix of q, times a rate (n,)."""
        held = ca.SX.sym("held", matrix.shape[1])
        return ca.substitute(self.along(matrix @ held), held, ca.densify(rate))

    def frame(self, frame: int) -> Placement:
        """Placement of a frame in base."""
        found = self.model.frames[frame]
        return self._up(0, int(found.parentJoint)).then(placement_of(found.placement))

    def joint(self, j: int) -> Placement:
        """Placement of a joint in base."""
        return self._up(0, j)

    def bodies(self, rate: Expression, acceleration: Expression) -> list[BodyMotion]:
        """Motion of every moving body for required rates and accelerations (n,) of z."""
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
        axis, q = self._axes[j], self.q[self.model.joints[j].idx_q]
        moved = Placement(ca.SX.eye(3), axis.linear * q)
        if axis.angular.nnz():
            k = ca.skew(axis.angular)
            moved = Placement(ca.SX.eye(3) + ca.sin(q) * k + (1 - ca.cos(q)) * (k @ k), ca.SX(3, 1))
        return placement_of(self.model.jointPlacements[j]).then(moved)

    def _up(self, ancestor: int, j: int) -> Placement:
        path = []
        while j != ancestor:
            path.append(j)
            j = int(self.model.parents[j])
        result = Placement(ca.SX.eye(3), ca.SX(3, 1))
        for k in reversed(path):
            result = result.then(self._step(k))
        return result

    def _gap(self, loop: ClosedLoop) -> Expression:
        """(3,) gap of a loop in its carrier's axes."""
        ends = []
        for frame in (self.model.frames[index] for index in loop.frames):
            placed = self._up(loop.carrier, int(frame.parentJoint)).then(placement_of(frame.placement))
            ends.append(placed.origin)
        return ends[0] - ends[1]


def closing_function(chain: ClosedChain) -> ca.Function:
    """(z, near) -> the closed configuration (nq,) by two steps of Newton's rule, and its largest gap [m].

    From a closed configuration `near` that is 1 mrad away two steps leave 1e-12 m.
    """
    s = SymbolicChain(chain)
    z, near = ca.SX.sym("z", len(chain.independent)), ca.SX.sym("near", chain.model.nq)
    moved = chain.dependent.tolist()
    step = s.q if not moved else ca.SX(s.q)
    if moved:
        step[moved] = s.q[moved] - ca.solve(ca.jacobian(s.gaps, s.q)[:, moved], s.gaps)
    after = ca.Function("step", [s.q], [step])
    gaps = ca.Function("gaps", [s.q], [ca.norm_inf(ca.densify(s.gaps)) if moved else ca.SX(0.0)])
    q = ca.SX(near)
    q[chain.free.tolist()] = z
    q = after(after(q))
    return dense_function("closing", (z, near), (q, gaps(q)))


def _into(placed: Placement, twist: Twist) -> Twist:
    back = placed.rotation.T
    return Twist(back @ (twist.linear - ca.cross(placed.origin, twist.angular)), back @ twist.angular)


def _cross(a: Twist, b: Twist) -> Twist:
    linear = ca.cross(a.angular, b.linear) + ca.cross(a.linear, b.angular)
    return Twist(linear, ca.cross(a.angular, b.angular))


def _less(a: Twist, b: Twist) -> Twist:
    return Twist(a.linear - b.linear, a.angular - b.angular)


def _plus(a: Twist, axis: Twist, rate: Expression) -> Twist:
    return Twist(a.linear + axis.linear * rate, a.angular + axis.angular * rate)
