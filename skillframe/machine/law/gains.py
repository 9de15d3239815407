r"""Gains of a hydraulic machine's law from what it is: oil, areas, volumes, masses, filters, sensors. All are ours.

A piston's oil is a spring \(k_h = B (A_a/(V_a/A_a + x) + A_b/(V_b/A_b + s - x))\), and on the mass m that it feels it
swings at \(\omega_h^2 = k_h / m\). The law's flow for the measured speed takes that spring away and k_x puts a share
kappa of it back, both T late by sensors' filter and spool. At omega there remain a stiffness and a damping,

    omega^2 = omega_h^2 (1 - (1 - kappa) cos(omega T)),   2 zeta omega = omega_h^2 (1 - kappa) sin(omega T)/omega,  (1)

so kappa below 1 damps, and one above 1 rings. B k_x is kappa times the least k_h over the stroke, so that it holds
wherever the piston stands. k_f makes a force loop of rate B k_f, a fifth of the published one.

K_A makes rates of decay \(J^{-T} G^T \sum J_b^T J_b G J^{-1} K_A\) over the mass felt at the tool, with the open joints
held. They act through the required force's filter as well, and so T' late: the largest, with an empty grip, times T' is
kept at `BODY`. If the noise of sensors then moves a valve by more than `NOISE` of its travel, k_x and K_A go down
by as much. What robot.toml gives stands. The crane that ships gives its own, tuned by hand: kappa .65 to 1.1 and a
product of .83, which leave its empty grip less damping than (1) does.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.frames import Float, norm
from skillframe.machine.law.hydraulic import HydraulicGains, plane_task
from skillframe.machine.law.vdc_actuator import Cylinders, cylinders
from skillframe.robot.chain import ChainState, ClosedChain
from skillframe.robot.model import RobotModel, load_model
from skillframe.robot.payload import with_payload
from skillframe.robot.spec import RobotSpec

__all__ = ["derived_gains", "law_gains", "missing_gains", "with_derived_gains"]

SHARE, RATE, BODY = 0.3, 3.2, 0.5
"""kappa; B k_f [1/s], as of the crane's lift and tilt; K_A's rate times T'. A linear model of the loop
(tests/laws/machine_loop.py) gives a digger of 1.5 t a damping ratio of 0.22 and more, 0.06 if valves are 20 ms late."""
NOISE = 0.05
"""Standard deviation of a valve's command that sensors may make by the gains, share of its travel; the crane that ships
has 0.008."""
SPOOL_HZ, SPOOL_DAMPING = 30.0, 0.707
"""Of a valve that does not say."""
_POINTS = 4000


class DerivedGains(NamedTuple):
    """k_x (k,) [m] and k_f (k,) [m^2/(N s)] of every cylinder, K_A [N s/m and N m s/rad]."""

    velocity: Float
    force: Float
    body: float


def law_gains(chain: ClosedChain) -> HydraulicGains:
    """Those of a machine's robot.toml. What it does not give is derived.

    Raises:
        InputError: a figure of a cylinder is missing, or the machine cannot stand at home.
    """
    spec = with_derived_gains(chain.robot).spec
    velocity, force = (tuple(getattr(a, f"{name}_gain") for a in spec.actuation) for name in ("velocity", "force"))
    assert spec.gains.body is not None
    return HydraulicGains(velocity=velocity, force=force, body=spec.gains.body, force_corner=spec.gains.force_corner_hz)


def with_derived_gains(robot: RobotModel) -> RobotModel:
    """A hydraulic machine with every gain that its robot.toml does not give.

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
    gains = replace(spec.gains, body=found.body) if spec.gains.body is None else spec.gains
    return replace(robot, spec=replace(spec, actuation=drives, gains=gains))


def missing_gains(spec: RobotSpec) -> list[str]:
    """Gains that a hydraulic machine's robot.toml does not give, by name. None for other robots."""
    if not spec.hydraulic:
        return []
    names = ("velocity_gain", "force_gain")
    found = [f"{name} of {a.joint}" for a in spec.actuation for name in names if getattr(a, name) is None]
    return found + (["gains.body"] if spec.gains.body is None else [])


def derived_gains(chain: ClosedChain) -> DerivedGains:
    """All gains as the module says, whatever robot.toml gives.

    Raises:
        InputError: as `law_gains`.
    """
    spec = chain.robot.spec
    c = cylinders(spec.actuation, spec.folder / "robot.toml")
    velocity = SHARE * least_spring(c)
    late = _lag(spec) + 1.0 / (np.pi * spec.gains.force_corner_hz)
    empty = _empty(chain)
    state = empty.at(empty.minimal(empty.robot.home), np.zeros(len(empty.independent)))
    body = BODY / (late * _largest_rate(empty, state))
    share = min(1.0, NOISE / float(_valve_noise(c, state, velocity, body, spec).max()))
    return DerivedGains(share * velocity, RATE / c.bulk_modulus, share * body)


def least_spring(c: Cylinders) -> Float:
    """k_h / B (k,) [m] where the oil is softest within the stroke."""
    a, b = np.sqrt(c.area_a), np.sqrt(c.area_b)
    whole = c.arm_b + c.stroke
    x = np.clip((whole * a - c.arm_a * b) / (a + b), 0.0, c.stroke)
    softest: Float = c.area_a / (c.arm_a + x) + c.area_b / (whole - x)
    return softest


def _lag(spec: RobotSpec) -> float:
    """T [s]: sensors' filter, the slowest spool, a tick and a half."""
    known = [a.known for a in spec.actuation]
    spools = [
        2.0 * float(p.get("spool_damping", SPOOL_DAMPING)) / (2.0 * np.pi * float(p.get("spool_frequency", SPOOL_HZ)))
        for p in known
    ]
    return float(1.0 / (np.pi * spec.sensors.corner_hz) + max(spools) + 1.5 / spec.control.rate_hz)


def _empty(chain: ClosedChain) -> ClosedChain:
    spec = chain.robot.spec
    return chain if spec.payload is None else ClosedChain(load_model(with_payload(spec, 0.0)))


def _damping(state: ChainState) -> Float:
    """G^T sum_b J_b^T J_b G (n, n): what a K_A of 1 is in minimal coordinates."""
    model, data = state.chain.model, state.data
    jacobians = [pin.getJointJacobian(model, data, j, pin.LOCAL) @ state.embedding for j in range(1, model.njoints)]
    total: Float = np.sum([jacobian.T @ jacobian for jacobian in jacobians], axis=0)
    return total


def _largest_rate(chain: ClosedChain, state: ChainState) -> float:
    """Of decay at the tool, for a K_A of 1 [1/s], open joints held."""
    back = np.linalg.inv(plane_task(chain).jacobian(state))[:, :2]
    mass, damping = (back.T @ matrix @ back for matrix in (state.mass, _damping(state)))
    return float(np.linalg.eigvals(np.linalg.solve(mass, damping)).real.max())


def _valve_noise(c: Cylinders, state: ChainState, velocity: Float, body: float, spec: RobotSpec) -> Float:
    """(k,) standard deviation of the valves' commands from encoders and pressures, by k_x, k_f and K_A."""
    dt, corner, a_corner = 1.0 / spec.control.rate_hz, spec.sensors.corner_hz, spec.gains.force_corner_hz
    rates = spec.sensors.encoder * _passed(1, (corner,), dt)
    changes = spec.sensors.encoder * _passed(2, (corner, a_corner), dt)
    forces = spec.sensors.pressure * _passed(0, (corner,), dt) * np.hypot(c.area_a, c.area_b)
    needed = np.asarray(np.linalg.solve(state.arms.T, body * _damping(state)), dtype=float)  # (k, n), over rates
    size = [
        velocity * norm(state.arms) * rates,
        norm(needed) * changes / c.bulk_modulus,
        RATE / c.bulk_modulus * forces,
    ]
    middle = 1.0 / (c.arm_a + 0.5 * c.stroke) + 1.0 / (c.arm_b + 0.5 * c.stroke)
    drop = np.sqrt(0.5 * (c.supply_pressure - c.return_pressure))
    noise: Float = norm(np.array(size, dtype=float).T) / (c.edge * drop * middle)
    return noise


def _passed(order: int, corners: tuple[float, ...], dt: float) -> float:
    """White noise of one a sample, differentiated so often behind filters of these corners [Hz]: its deviation."""
    back = np.exp(-2j * np.pi * (np.arange(_POINTS) + 0.5) / _POINTS / 2.0)  # 1/z at frequencies up to Nyquist's
    step, through = 1.0 - back, np.ones(_POINTS, dtype=complex)
    for corner in corners:
        w = 2.0 * np.pi * corner * dt
        through = through * w**2 / (step**2 + (2.0 * w * step + w**2) * back)
    return float(np.sqrt(np.mean(np.abs(through * (step / dt) ** order) ** 2)))
