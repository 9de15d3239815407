r"""Controller gains derived from a machine's oil, areas, volumes, masses, filters and sensors.

A piston's oil is a spring \(k_h = B (A_a/(V_a/A_a + x) + A_b/(V_b/A_b + s - x))\) with \(\omega_h^2 = k_h / m\). The
controller's flow for the measured speed removes that spring and k_x restores a share kappa, both T late. There remain

    omega^2 = omega_h^2 (1 - (1 - kappa) cos(omega T)),   2 zeta omega = omega_h^2 (1 - kappa) sin(omega T)/omega,  (1)

so kappa must be below 1. B k_x is kappa times the least k_h over the stroke. k_f gives a force loop of rate B k_f. K_A
gives decay rates of \(J^{-T} G^T \sum J_b^T J_b G J^{-1} K_A\) over the mass at the tool, through the required force's
filter, T' late: the largest, with an empty grip, times T' is `BODY`. If sensor noise then moves a valve by more than
a twentieth of its travel, k_x and K_A are scaled down. robot.toml overrides.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.frames import Float, norm
from skillframe.robot import ChainState, ClosedChain, RobotModel, RobotSpec, load_model, with_payload
from skillframe_hydraulics.declared import gains_of, noise_of, with_gains
from skillframe_hydraulics.force.damped import noise_passed
from skillframe_hydraulics.law.hydraulic import HydraulicGains, tool_task
from skillframe_hydraulics.law.vdc_actuator import Cylinders, cylinders
from skillframe_hydraulics.lines import kept_drops

__all__ = ["derived_gains", "law_gains", "missing_gains", "with_derived_gains"]

SHARE, RATE, BODY = 0.3, 3.2, 0.5
"""kappa; B k_f [1/s], as of the crane's lift and tilt; K_A's rate times T'.

In a linear model (tests/laws/machine_loop.py) a 1.5 t digger has a damping ratio of at least 0.22, or 0.06 with valves
20 ms late.
"""


class DerivedGains(NamedTuple):
    """k_x (k,) [m] and k_f (k,) [m^2/(N s)] of every cylinder, K_A [N s/m and N m s/rad]."""

    velocity: Float
    force: Float
    body: float


def law_gains(chain: ClosedChain) -> HydraulicGains:
    """Gains of a machine's robot.toml, completed by derived ones.

    Raises:
        InputError: a figure of a cylinder is missing, or the machine cannot stand at home.
    """
    spec = with_derived_gains(chain.robot).spec
    velocity, force = (tuple(getattr(a, f"{name}_gain") for a in spec.actuation) for name in ("velocity", "force"))
    own = gains_of(spec)
    assert own.body is not None
    return HydraulicGains(velocity=velocity, force=force, body=own.body, force_corner=own.force_corner_hz)


def with_derived_gains(robot: RobotModel) -> RobotModel:
    """A hydraulic machine with missing gains derived.

    Raises:
        InputError: as `law_gains`.
    """
    spec = robot.spec
    if not missing_gains(spec):
        return robot
    found = derived_gains(ClosedChain(robot))
    drives = tuple(
        replace(
            a, velocity_gain=float(k_x) if a.velocity_gain is None else a.velocity_gain,
            force_gain=float(k_f) if a.force_gain is None else a.force_gain,
        ) for a, k_x, k_f in zip(spec.actuation, found.velocity, found.force, strict=True)
    )  # fmt: skip
    own = gains_of(spec)
    gains = replace(own, body=float(found.body)) if own.body is None else own
    return replace(robot, spec=with_gains(replace(spec, actuation=drives), gains))


def missing_gains(spec: RobotSpec) -> list[str]:
    """Names of gains missing in robot.toml."""
    names = ("velocity_gain", "force_gain")
    found = [f"{name} of {a.joint}" for a in spec.actuation for name in names if getattr(a, name) is None]
    return found + (["gains.body"] if gains_of(spec).body is None else [])


def derived_gains(chain: ClosedChain) -> DerivedGains:
    """All gains derived as in the module's text.

    Raises:
        InputError: as `law_gains`.
    """
    spec = chain.robot.spec
    c = cylinders(spec.actuation, spec.folder / "robot.toml")
    velocity = SHARE * least_spring(c)
    spools = [
        2.0 * float(p.get("spool_damping", 0.707)) / (2.0 * np.pi * float(p.get("spool_frequency", 30.0)))  # of a valve
        for p in (a.known for a in spec.actuation)
    ]
    # T: sensors' filter, the slowest spool, and 1.5 ticks
    lag = float(1.0 / (np.pi * noise_of(spec).corner_hz) + max(spools) + 1.5 / spec.control.rate_hz)
    late = lag + 1.0 / (np.pi * gains_of(spec).force_corner_hz)
    empty = chain if spec.payload is None else ClosedChain(load_model(with_payload(spec, 0.0)))
    state = empty.at(empty.minimal(empty.home), np.zeros(len(empty.independent)))
    task = tool_task(empty)
    back = np.linalg.inv(task.jacobian(state))[:, : len(task.axes)]
    mass, damping = (back.T @ matrix @ back for matrix in (state.mass, _damping(state)))
    rate = float(np.linalg.eigvals(np.linalg.solve(mass, damping)).real.max())  # at the tool, open joints held [1/s]
    body = BODY / (late * rate)
    share = min(1.0, 0.05 / float(_valve_noise(c, state, velocity, body, spec).max()))
    return DerivedGains(share * velocity, RATE / c.bulk_modulus, share * body)


def least_spring(c: Cylinders) -> Float:
    """k_h / B (k,) [m] where the oil is softest within the stroke."""
    a, b = np.sqrt(c.area_a), np.sqrt(c.area_b)
    whole = c.arm_b + c.stroke
    x = np.clip((whole * a - c.arm_a * b) / (a + b), 0.0, c.stroke)
    softest: Float = c.area_a / (c.arm_a + x) + c.area_b / (whole - x)
    return softest


def _damping(state: ChainState) -> Float:
    """G^T sum_b J_b^T J_b G (n, n): K_A = 1 in minimal coordinates."""
    model, data = state.chain.model, state.data
    jacobians = [pin.getJointJacobian(model, data, j, pin.LOCAL) @ state.embedding for j in range(1, model.njoints)]
    total: Float = np.sum([jacobian.T @ jacobian for jacobian in jacobians], axis=0)
    return total


def _valve_noise(c: Cylinders, state: ChainState, velocity: Float, body: float, spec: RobotSpec) -> Float:
    """Standard deviation of the valves' commands (k,) due to encoder and pressure noise."""
    dt, corner, a_corner = 1.0 / spec.control.rate_hz, noise_of(spec).corner_hz, gains_of(spec).force_corner_hz
    rates = noise_of(spec).encoder * noise_passed(1, (corner,), dt)
    changes = noise_of(spec).encoder * noise_passed(2, (corner, a_corner), dt)
    forces = noise_of(spec).pressure * noise_passed(0, (corner,), dt) * np.hypot(c.area_a, c.area_b)
    needed = state.actuator_force(body * _damping(state), c.area_a**2)  # (k, n), over rates
    size = [
        velocity * norm(state.arms) * rates,
        norm(needed) * changes / c.bulk_modulus,
        RATE / c.bulk_modulus * forces,
    ]
    length_a, length_b = c.arm_a + 0.5 * c.stroke, c.arm_b + 0.5 * c.stroke
    half = 0.5 * (c.supply_pressure - c.return_pressure)
    into_a, into_b = (np.sqrt(kept_drops(spec) / half).clip(max=1.0) * edge for edge in (c.edge_pa, c.edge_pb))
    middle = np.minimum(into_a / length_a + c.edge_bt / length_b, c.edge_at / length_a + into_b / length_b)
    noise: Float = norm(np.array(size, dtype=float).T) / (c.edge * np.sqrt(half) * middle)
    return noise
