r"""Controller of a hydraulic machine: valve commands for a desired motion and an impedance.

The tool follows a first-order impedance, with f the force of the environment and f_ff the feed-forward,

    D (X' - X_d') + K (X - X_d) = f + f_ff      by      X_r' = X_d' + D^-1 [K (X_d - X) + f + f_ff]             (1)

(J. Koivumaki and J. Mattila, IEEE/ASME T-Mech 22(2), 2017), attenuated by the force's uncertainty (`vdc_reference`).
Joints that the tool's axes leave free follow zd_r = zd_d + lambda (z_d - z); `vdc_body` computes the bodies' forces,
`vdc_actuator` the valves' commands. zdd_r omits the force, whose derivative is noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.robot import ClosedChain
from skillframe_hydraulics.law.vdc_actuator import ContactFriction
from skillframe_hydraulics.law.vdc_reference import ToolTask


class Measured(NamedTuple):
    """Measurements of N trials.

    Attributes:
        z, rate: (N, n) minimal coordinates and their filtered rates.
        pressure_a, pressure_b: (N, k) [Pa].
        force, sigma: (N, m) of the environment on the tool, along the task's axes, and its standard deviation [N].
    """

    z: Float
    rate: Float
    pressure_a: Float
    pressure_b: Float
    force: Float
    sigma: Float


class Reference(NamedTuple):
    """Reference of the tool along the task's m axes, and of the free joints, for N trials.

    Attributes:
        position, velocity: X_d, X_d' (N, m) [m, m/s].
        stiffness, damping: K, D (N, m, m) [N/m, Ns/m]; D is positive definite.
        push: f_ff (N, m) [N].
        joint, joint_rate: (N, n - m).
        acceleration: X_d'' and the free joints' (N, n), if known.
    """

    position: Float
    velocity: Float
    stiffness: Float
    damping: Float
    push: Float
    joint: Float
    joint_rate: Float
    acceleration: Float | None = None


class Terms(NamedTuple):
    """The model's terms in minimal coordinates, for N trials.

    Attributes:
        mass: M_z (N, n, n); drift: C_z^T zd (N, n); gravity: g_z (N, n).
        jacobian: of the tool along the task's axes (N, m, n).
        tip, tip_rate: position and velocity (N, m) of the tool, or of where it hangs at rest.
        arms: (N, k, n), dx/dz of the pistons; piston, piston_rate: (N, k).
        load: (N, n), gravity of a kilogram of payload [N/kg or Nm/kg], zero if none is declared.
    """

    mass: Float
    drift: Float
    gravity: Float
    jacobian: Float
    arms: Float
    piston: Float
    piston_rate: Float
    tip: Float
    tip_rate: Float
    load: Float


@dataclass(frozen=True, slots=True, kw_only=True)
class HydraulicGains:
    """Gains of the controller, by default of the shipped crane. `gains` derives them for any machine.

    Attributes:
        velocity, force: k_x and k_f of each cylinder (k,). Published: 5e-3, 5e-3, 1e-3 and 2e-8, 2e-8, 8e-9; a fifth of
            this k_f tracks better with unknown friction.
        body: K_A of all bodies [N s/m, N m s/rad]. The published 5 does not damp impacts, which are faster than k_x and
            k_f; twice the default rings on 1e6 N/m with a valve 20 ms late.
        adaptation: rho of the inertial parameters; 0 for none. share: bounds, +- of each declared parameter.
        friction: rho_f of the cylinders' Coulomb [N/m] and viscous friction [N s/m^2 per m/s]; 0 for none.
            Published: 1e5 of both.
        friction_share: bounds, +- of each.
        joint: lambda of the free joints [1/s].
        contact: friction in contact, see `vdc_actuator`.
        force_corner: of the filter for the required force's rate [Hz]. Published: 8, too slow for `body`.
    """

    velocity: tuple[float, ...] = (5e-3, 5e-3, 1e-3)
    force: tuple[float, ...] = (4e-9, 4e-9, 1.6e-9)
    body: float = 1000.0
    adaptation: float = 300.0
    share: float = 0.3
    friction: tuple[float, float] = (2e5, 2e5)
    friction_share: float = 0.5
    joint: float = 3.0
    force_corner: float = 16.0
    contact: ContactFriction = field(default_factory=ContactFriction)


class Demand(NamedTuple):
    """Valve commands (N, k) in [-1, 1], required and present pressure force (N, k) [N]."""

    valve: Float
    required: Float
    present: Float


def tool_axes(chain: ClosedChain) -> Float:
    """Axes (m, 3) in base along which a machine moves its tool: those of its plane, or all three.

    Axes of a plane are axes of base, in their order, where those span it; else the second one is as upright as
    possible. A machine whose tool leaves its plane by moving on moves in space.

    Raises:
        InputError: it moves its tool along a line.
    """
    frame, n = chain.robot.tool_frames[0], len(chain.free)
    driven = np.eye(n)[: chain.steered]
    state = chain.at(chain.minimal(chain.home), driven.sum(axis=0))
    turned = np.array([state.jacobian_drift(frame, rate)[:3] for rate in driven])
    ways, sizes, _ = np.linalg.svd(np.concatenate([state.jacobian(frame)[:3] @ driven.T, turned.T], axis=1))
    moves = int((sizes > 1e-6).sum())  # m per unit of a joint
    if moves == 3:
        return np.eye(3)
    if moves != 2:
        text = f"moves its tool along {moves} axes of base; the controller is for machines of a plane or of space"
        raise InputError(chain.robot.spec.name, text, "give it joints that move the tool along two axes at least")
    normal = ways[:, 2]
    if (across := np.abs(normal)).max() > 1.0 - 1e-12:
        return np.delete(np.eye(3), int(np.argmax(across)), axis=0)
    up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
    up = up / np.linalg.norm(up)
    level = np.cross(up, normal)
    return np.array([level * np.sign(level[np.argmax(np.abs(level))]), up])


def tool_task(chain: ClosedChain) -> ToolTask:
    """The task of the tool along its axes, and of the joints that follow the first m.

    Raises:
        InputError: as `tool_axes`, or fewer freedoms than axes, or a fixture beside a machine's plane.
    """
    axes, spec = tool_axes(chain), chain.robot.spec
    state = chain.at(chain.minimal(chain.home), np.zeros(len(chain.free)))
    if len(axes) == 2:
        normal, fixture = np.cross(*axes), np.asarray(spec.workspace.fixture, dtype=float)
        beside = float(normal @ (fixture - state.data.oMf[chain.robot.tool_frames[0]].translation))
        if abs(beside) > 0.05:  # m; what is pressed on is wider
            there = ", ".join(f"{x:.4g}" for x in np.round(fixture - beside * normal, 4) + 0.0)
            text = f"the fixture stands {abs(beside):.3g} m beside the plane in which the machine moves its tool"
            fix = f"write fixture = [{there}], or another in the plane"
            raise InputError(f"{spec.name}: workspace.fixture", text, fix)
    return ToolTask(chain, axes, chain.independent[len(axes) :])
