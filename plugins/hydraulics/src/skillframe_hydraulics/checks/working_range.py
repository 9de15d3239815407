r"""What an engineer compares with a data sheet: the reach of a machine's tool, and the force that it can push with.

Reach is sought from home by linear programmes: with the independent joints' steps dz, the loops' embedding E and the
slope g of a distance, g dz is the largest of those within a trust region for which every joint q + E dz stays between
its limits. Cylinders limit by their strokes. A tool that hangs on a passive joint keeps its place below that joint.

The largest force s along e has R^T F = g + s J^T e, with each actuator's force F between its pull and its push.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.optimize import linprog

from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe.robot import ChainState, ClosedChain, OutOfReach
from skillframe_hydraulics.checks.feasibility import capacity

LEAST_STEP = 2e-3  # rad or m: a reach of 10 m is then found to millimetres
OVER = 1e-3  # m or rad that a joint may pass its limit by, as rods move along curves
_Value = Callable[[ChainState], tuple[float, Float]]


class WorkingRange(NamedTuple):
    """Largest distance of the tool from the base's vertical axis, highest and lowest place above its origin [m]."""

    reach: float
    highest: float
    lowest: float


def working_range(chain: ClosedChain, frame: str = "") -> WorkingRange:
    """Working range of the tool, or of another `frame` of the machine, from the limits of joints and the strokes.

    Raises:
        OutOfReach: the machine cannot stand at home.
    """
    gravity = chain.model.gravity.linear
    up = -np.asarray(gravity) / np.linalg.norm(gravity)
    point = chain.model.getFrameId(frame) if frame else chain.robot.tool_frames[0]
    hung = _hung(chain, point)
    start = chain.minimal(chain.home)
    state = chain.at(start, 0.0 * start)
    below = _place(state, hung) - _place(state, point)

    def reach(state: ChainState) -> tuple[float, Float]:
        level = _place(state, hung) - below
        level -= (level @ up) * up
        size = float(norm(level))
        return size, level @ state.jacobian(hung)[:3] / max(size, 1e-9)

    def height(sign: float) -> _Value:
        return lambda state: (
            sign * float((_place(state, hung) - below) @ up),
            sign * up @ state.jacobian(hung)[:3],
        )

    widest, at_widest = _farthest(chain, reach, start)
    ends = [max(_farthest(chain, height(sign), z)[0] for z in (start, at_widest)) for sign in (1.0, -1.0)]
    return WorkingRange(widest, ends[0], -ends[1])


def largest_forces(chain: ClosedChain) -> dict[str, float]:
    """Largest force [N] of the tool at home by "+x" to "-z" of base, beyond its weight, without friction.

    Directions in which the structure carries the force are left out, and all if a cylinder has no known size.
    """
    z = chain.minimal(chain.home)
    state, steered, spec = chain.at(z, 0.0 * z), chain.steered, chain.robot.spec
    try:
        limits = [capacity(each) for each in spec.actuation]
    except InputError:
        return {}
    arms, weight = state.arms[:, :steered], state.gravity[:steered]
    jacobian, found = state.jacobian(_hung(chain, chain.robot.tool_frames[0]))[:3, :steered], {}
    bounds = [(-one.pull, one.push) for one in limits]
    for way, name in [(sign * axis, f"{mark}{letter}") for axis, letter in zip(np.eye(3), "xyz", strict=True)
                      for sign, mark in ((1.0, "+"), (-1.0, "-"))]:  # fmt: skip
        if float(norm(moved := way @ jacobian)) > 1e-6:
            solved = linprog(np.append(np.zeros(len(arms)), -1.0), A_eq=np.column_stack([arms.T, -moved]), b_eq=weight,
                             bounds=[*bounds, (0.0, None)])  # fmt: skip
            if solved.status == 0:
                found[name] = float(solved.x[-1])
    return found


def _hung(chain: ClosedChain, frame: int) -> int:
    """The frame, or that of the first passive joint that it hangs on, below which it keeps its place."""
    model = chain.model
    above = [int(j) for j in model.supports[model.frames[frame].parentJoint]]
    swinging = [name for name in chain.independent[chain.steered :] if model.getJointId(name) in above]
    first = min((model.getJointId(name) for name in swinging), default=0)
    return int(model.getFrameId(model.names[first], pin.FrameType.JOINT)) if first else frame


def _place(state: ChainState, frame: int) -> Float:
    return np.array(state.data.oMf[frame].translation)


def _farthest(chain: ClosedChain, value: _Value, z: Float) -> tuple[float, Float]:
    """Largest value found from minimal coordinates z (n,) on, and the coordinates that have it."""
    low, high = chain.model.lowerPositionLimit, chain.model.upperPositionLimit
    held = np.arange(len(z)) >= chain.steered
    state, step = chain.at(z, 0.0 * z), 0.5
    far, slope = value(state)
    while step > LEAST_STEP:
        room = np.concatenate([high - state.q, state.q - low])
        solved = linprog(-slope, A_ub=np.concatenate([state.embedding, -state.embedding]), b_ub=room,
                         bounds=[(0.0, 0.0) if still else (-step, step) for still in held])  # fmt: skip
        step *= 0.5
        if solved.status != 0:
            continue
        try:
            there = chain.at(z + solved.x, 0.0 * z)
        except OutOfReach:
            continue
        farther, turned = value(there)
        if farther > far + 1e-6 and np.all(there.q <= high + OVER) and np.all(there.q >= low - OVER):
            z, state, far, slope, step = z + solved.x, there, farther, turned, 3.0 * step
    return far, z


def working_figures(chain: ClosedChain) -> Iterator[tuple[str, str, str, dict[str, float]]]:
    """Code, sentence, what to do with it, and figures of the working range and of the largest forces."""
    found = working_range(chain)
    text = f"the tool reaches {found.reach:.4g} m from the base's vertical axis, and from {found.lowest:.4g} to"
    text += f" {found.highest:.4g} m above its origin, within strokes and joint limits"
    yield "working_range", text, "compare it with the data sheet: it shows a wrong pin, closed or stroke", {
        "reach_m": found.reach, "highest_m": found.highest, "lowest_m": found.lowest
    }  # fmt: skip
    if forces := largest_forces(chain):
        told = ", ".join(f"{force / 1e3:.3g} kN along {way}" for way, force in forces.items())
        text = f"at home the tool pushes with at most {told}, besides carrying its weight and load"
        yield "largest_force", text, "compare it with the data sheet: it shows a wrong bore, pressure or pin", forces
