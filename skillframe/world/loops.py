"""Closed chains in the simulated world: one equality constraint for each `[[loop]]`, and an integrator that suits them.

The tree keeps the real bodies of barrel and rod; a `connect` constraint holds rod eye and link eye together. Its
stiffness follows the time step (time constant 2.2 steps, critically damped, impedance 0.9999), and Runge-Kutta 4
replaces the first-order integrator, whose error and not the constraint's would be the largest (our measurement: tip
error of an open-loop swing 0.002 mm instead of 10 mm, loop gap 1.4 um instead of 40 um). Robots without loops are not
touched.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import pinocchio as pin

from skillframe.errors import UnknownName
from skillframe.robot.driven import LoopClosure

TIME_CONSTANTS = 2.2  # time steps; MuJoCo refuses less than 2
SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)


def close_loops(spec: mujoco.MjSpec, model: pin.Model, loops: Sequence[LoopClosure], bodies: dict[int, Any]) -> None:
    """Close a robot's chains.

    Args:
        spec: holds the robot's tree; its time step is set.
        model: the tree that the bodies were made from.
        loops: frames whose origins coincide; none leaves the spec as it is.
        bodies: MuJoCo body by Pinocchio's joint id.

    Raises:
        UnknownName: a loop names a frame that the robot does not have.
    """
    if not loops:
        return
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    for index, loop in enumerate(loops):
        sites = [
            _site(model, name, bodies, f"loop_{index}_{side}") for side, name in zip("ab", _names(loop), strict=True)
        ]
        equality = spec.add_equality(
            name=f"loop_{index}", type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=sites[0], name2=sites[1],
        )  # fmt: skip
        equality.solref = [TIME_CONSTANTS * spec.option.timestep, 1.0]
        equality.solimp = SOLIMP


def _names(loop: LoopClosure) -> tuple[str, str]:
    return loop.frame_a, loop.frame_b


def _site(model: pin.Model, name: str, bodies: dict[int, Any], site: str) -> str:
    if not model.existFrame(name):
        raise UnknownName("frame", name, [f.name for f in model.frames], "named in [[loop]]")
    frame = model.frames[model.getFrameId(name)]
    bodies[frame.parentJoint].add_site(name=site, pos=frame.placement.translation)
    return site
