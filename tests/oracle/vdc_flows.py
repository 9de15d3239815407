r"""Virtual Decomposition Control, virtual power flows: why the whole machine is stable when each part is.

Cut every joint and every loop's eyes. The flow at a cut is p = (V_r - V)^T (F_r - F), the required less the actual
force that passes through. Per body, what goes in less what comes out is (V_r - V)^T (F_r - F) of its net force. At a
pin or an eye both sides have one velocity and no torque about the axis, so the two flows cancel; at a piston they leave
(xd_r - xd) (f_cr - f_c), which the cylinder's own accompanying function takes up (W.-H. Zhu, "Virtual Decomposition
Control", Springer 2010). The eyes' forces lambda follow from the passive joints: tau_tree = S f_c + A^T lambda.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.frames import Float, cross
from skillframe.robot.chain import ChainState
from tests.oracle.vdc import Bodies


class PowerFlows(NamedTuple):
    """Virtual power flows [W].

    Attributes:
        bodies: (B,) of net forces.
        outer, inner: (B,) at each body's own joint, seen from it and from the body (or the ground) that carries it.
        eyes: (loops, 2) into the link and into the rod.
        balance: (B,) what goes into a body less what comes out less `bodies`: zero by Newton's third law.
        pistons: (actuators,) (xd_r - xd) (f_cr - f_c); damping: (B,) of the pins.
    """

    bodies: Float
    outer: Float
    inner: Float
    eyes: Float
    balance: Float
    pistons: Float
    damping: Float


def eye_forces(state: ChainState, tree: Float, piston: Float) -> Float:
    """Forces lambda (loops, 3) on each link's eye from its rod, base axes [N].

    Args:
        state: of the chain.
        tree: (nv,) generalised forces the tree needs.
        piston: (actuators,) forces.
    """
    rest = np.array(tree)
    rest[state.chain.driven] -= piston
    if not state.chain.loops:
        return np.zeros((0, 3))
    model, axes = state.chain.model, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    gaps = [
        (pin.getFrameJacobian(model, state.data, a, axes) - pin.getFrameJacobian(model, state.data, b, axes))[:3]
        for a, b in (loop.frames for loop in state.chain.loops)
    ]
    solution = np.linalg.lstsq(np.concatenate(gaps).T, rest, rcond=1e-12)[0]
    return np.asarray(solution, dtype=float).reshape(-1, 3)


def power_flows(state: ChainState, motion: Bodies, difference: Float, tool: Float | None = None) -> PowerFlows:
    """All flows of a machine whose bodies' net forces differ from the required ones.

    Args:
        state: of the chain.
        motion: required motion of the bodies.
        difference: F_r - F (B, 6) of the bodies' net forces, body axes.
        tool: difference of the tool's generalised forces (n,), zero where not given.
    """
    model, error = state.chain.model, motion.tree_required - state.v
    damping = model.damping * error
    tree = np.einsum("bij,bi->j", motion.jacobian, difference) + damping
    tau = state.embedding.T @ tree
    piston = state.actuator_force(tau if tool is None else tau - tool)
    eyes = eye_forces(state, tree, piston)
    through = _joint_forces(state, difference, eyes)
    outer = np.einsum("bi,bi->b", motion.error, through)
    inner = _inner(state, motion.error, through)
    eye_flow = _eye_flows(state, motion.error, eyes)
    net = np.einsum("bi,bi->b", motion.error, difference)
    balance = _balance(state, net, outer, inner, eye_flow)
    rates = (state.embedding @ state.chain.minimal(error))[state.chain.driven]
    return PowerFlows(net, outer, inner, eye_flow, balance, rates * piston, damping * error)


def _joint_forces(state: ChainState, net: Float, eyes: Float) -> Float:
    """Forces (B, 6) through each joint into its body, body axes: from the tips to the ground."""
    model, data = state.chain.model, state.data
    through = [pin.Force(row) for row in net]
    for loop, force in zip(state.chain.loops, eyes, strict=True):
        for frame, sign in zip(loop.frames, (-1.0, 1.0), strict=True):
            joint = model.frames[frame].parentJoint
            through[joint - 1] += _at_body(state, frame, sign * force)
    for joint in range(model.njoints - 1, 0, -1):
        parent = int(model.parents[joint])
        if parent:
            through[parent - 1] += data.liMi[joint].act(through[joint - 1])
    return np.array([force.vector for force in through])


def _at_body(state: ChainState, frame: int, force: Float) -> pin.Force:
    """A force in base axes at a frame's origin as a spatial force of its body, body axes."""
    joint = state.chain.model.frames[frame].parentJoint
    inside = np.array(state.data.oMi[joint].rotation).T @ force
    lever = np.array(state.chain.model.frames[frame].placement.translation)
    return pin.Force(inside, cross(lever, inside))


def _inner(state: ChainState, error: Float, through: Float) -> Float:
    """Flow at each joint with the velocity error of the body that carries it."""
    model, result = state.chain.model, np.zeros(len(through))
    for joint in range(1, model.njoints):
        parent = int(model.parents[joint])
        if parent:
            carried = state.data.liMi[joint].actInv(pin.Motion(error[parent - 1]))
            result[joint - 1] = float(carried.vector @ through[joint - 1])
    return result


def _eye_flows(state: ChainState, error: Float, eyes: Float) -> Float:
    model, result = state.chain.model, np.zeros((len(eyes), 2))
    for row, (loop, force) in enumerate(zip(state.chain.loops, eyes, strict=True)):
        for side, (frame, sign) in enumerate(zip(loop.frames, (1.0, -1.0), strict=True)):
            joint = model.frames[frame].parentJoint
            result[row, side] = float(error[joint - 1] @ _at_body(state, frame, sign * force).vector)
    return result


def _balance(state: ChainState, net: Float, outer: Float, inner: Float, eyes: Float) -> Float:
    model, result = state.chain.model, outer - net
    for joint in range(1, model.njoints):
        parent = int(model.parents[joint])
        if parent:
            result[parent - 1] -= inner[joint - 1]
    for row, loop in enumerate(state.chain.loops):
        for side, frame in enumerate(loop.frames):
            result[model.frames[frame].parentJoint - 1] += eyes[row, side]
    return np.asarray(result)
