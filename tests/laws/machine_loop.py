r"""The loop of a hydraulic machine in the air, linear: plant, oil, spools, sensors' filters and the law, at one pose.

    M zdd = R^T (f_p - b R zd),   f_p' = B u_f - k_h R zd,   u_f as `vdc_actuator` says, behind spool and 1.5 ticks

Coulomb friction, leakage, gravity's stiffness and the force estimate are left out. Written from the equations alone;
of the product only the chain, the cylinders' figures and the task's Jacobian are used.
"""

from itertools import pairwise

import numpy as np
import pinocchio as pin
from skillframe_hydraulics.declared import noise_of
from skillframe_hydraulics.law.hydraulic import tool_task
from skillframe_hydraulics.law.vdc_actuator import cylinders

from skillframe.robot.chain import ClosedChain

SPOOL_HZ, SPOOL_DAMPING, TICKS = 30.0, 0.707, 1.5e-3
LEAD = 6.0  # 1/s, of the swing and of free motion


def poles(robot, gains, delay=0.0):
    """Eigenvalues of the loop at home [1/s] with gains as `HydraulicGains` and valves that are so late [s]."""
    chain = ClosedChain(robot)
    c, z = cylinders(robot.spec.actuation), chain.minimal(robot.home)
    state, n, k = chain.at(z, 0.0 * z), len(z), len(c.area_a)
    mass, arms, (x, _) = state.mass, state.arms, state.driven_motion
    jacobian, spring = tool_task(chain).jacobian(state), c.area_a / (c.arm_a + x) + c.area_b / (c.arm_b + c.stroke - x)
    lead = np.linalg.solve(jacobian, np.diag([LEAD, LEAD] + [gains.joint] * (n - 2)) @ jacobian)
    w, wf, ws = (2.0 * np.pi * f for f in (noise_of(robot.spec).corner_hz, gains.force_corner, SPOOL_HZ))
    sizes = {"z": n, "v": n, "f": k, "m": n, "r": n, "fm": k, "fr": k, "fv": k, "fs": k, "u": k, "du": k, "told": k}
    edges = np.cumsum([0, *sizes.values()])
    at = {name: slice(*pair) for name, pair in zip(sizes, pairwise(edges), strict=True)}
    unit, a = np.eye(edges[-1]), np.zeros((edges[-1], edges[-1]))
    s = {name: unit[rows] for name, rows in at.items()}
    required = -lead @ (s["m"] + 2.0 / w * s["r"])
    body = gains.body * _damping(chain, state)
    needed = np.linalg.solve(arms.T, -mass @ lead @ s["r"] + body @ (required - s["r"]))
    needed = needed + c.viscous_friction[:, None] * (arms @ required)
    demand = np.diag(gains.velocity) @ arms @ (required - s["r"]) + np.diag(gains.force) @ (needed - s["fm"])
    demand = demand + s["fs"] / c.bulk_modulus[:, None] + spring[:, None] * (arms @ s["r"])
    a[at["z"]] = s["v"]
    a[at["v"]] = np.linalg.solve(mass, arms.T @ (s["f"] - c.viscous_friction[:, None] * (arms @ s["v"])))
    a[at["f"]] = c.bulk_modulus[:, None] * (s["u"] - spring[:, None] * (arms @ s["v"]))
    for value, rate, corner, shown in (("m", "r", w, s["z"]), ("fm", "fr", w, s["f"]), ("fv", "fs", wf, needed)):
        a[at[value]], a[at[rate]] = s[rate], corner**2 * (shown - s[value]) - 2.0 * corner * s[rate]
    a[at["told"]] = (demand - s["told"]) / (TICKS + delay)
    a[at["u"]], a[at["du"]] = s["du"], ws**2 * (s["told"] - s["u"]) - 2.0 * SPOOL_DAMPING * ws * s["du"]
    return np.linalg.eigvals(a)


def least_damping(found, below_hz=24.0):
    """Least damping ratio of the poles below a frequency [Hz]; those above are the oil's own, which no law reaches."""
    slow = found[np.abs(found) < 2.0 * np.pi * below_hz]
    return float((-slow.real / np.abs(slow)).min())


def _damping(chain, state):
    bodies = range(1, chain.model.njoints)
    jacobians = [pin.getJointJacobian(chain.model, state.data, j, pin.LOCAL) @ state.embedding for j in bodies]
    return sum(jacobian.T @ jacobian for jacobian in jacobians)
