r"""The control law of a hydraulic machine: from a desired motion and an impedance to valve commands, N trials at once.

The tool follows the first-order impedance, f the force of the environment on it and f_ff the feed-forward,

    D (X' - X_d') + K (X - X_d) = f + f_ff      by      X_r' = X_d' + D^-1 [K (X_d - X) + f + f_ff]             (1)

(J. Koivumaki and J. Mattila, IEEE/ASME T-Mech 22(2), 2017) as far as the force's uncertainty lets it (`doubt`), joints
that the tool's plane leaves open follow zd_r = zd_d + lambda (z_d - z), the bodies get what `vdc` says they need, and
each cylinder makes that force with its valve as in `vdc_actuator`. The required force's rate comes from a critically
damped filter. The force is left out of zdd_r (our choice: its derivative is noise). This file holds what goes in and
comes out; `hydraulic_symbolic` puts one sample together, and `hydraulic_compiled` runs it for many trials.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float
from skillframe.machine.law.vdc_actuator import (
    ContactFriction,
)
from skillframe.machine.law.vdc_reference import ToolTask
from skillframe.robot.chain import ClosedChain

REACH = 1e-6  # m per unit of a joint: an axis of base along which the tool moves less is not commanded


class Measured(NamedTuple):
    """What the machine's sensors say, for N trials.

    Attributes:
        z, rate: (N, n) minimal coordinates and their filtered rates.
        pressure_a, pressure_b: (N, k) [Pa].
        force, sigma: (N, 2) of the environment on the tool, along the plane's axes, and its standard deviation [N].
    """

    z: Float
    rate: Float
    pressure_a: Float
    pressure_b: Float
    force: Float
    sigma: Float


class Reference(NamedTuple):
    """What is wanted of the tool's point in the machine's plane, and of the joints it leaves open, for N trials.

    Attributes:
        position, velocity: X_d, X_d' (N, 2) [m, m/s].
        stiffness, damping: K, D (N, 2, 2) [N/m, Ns/m]; D is positive definite.
        push: f_ff (N, 2) [N].
        joint, joint_rate: (N, n - 2).
        acceleration: X_d'' and the open joints' (N, n), where it is known.
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
        jacobian: of the tool's point in the plane (N, 2, n); tip, tip_rate: its position and velocity (N, 2).
        arms: (N, k, n), dx/dz of the pistons; piston, piston_rate: (N, k).
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


@dataclass(frozen=True, slots=True, kw_only=True)
class HydraulicGains:
    """Gains of the law. Defaults are those of the crane that ships. `gains` has those of any machine.

    Attributes:
        velocity, force: k_x and k_f of each cylinder (k,). Published for this crane: 5e-3, 5e-3, 1e-3 and 2e-8, 2e-8,
            8e-9; the default k_f is a fifth of it, which tracks better where friction is not known (our measurement).
        body: K_A, the same for all bodies [N s/m, N m s/rad]. Published: 5, which damps nothing. Ours: a tool that
            lands on something hard is stopped in less time than k_x and k_f need, and this damps it; with twice as
            much and a valve that is 20 ms late the crane rings on 1e6 N/m.
        adaptation: rho of the inertial parameters; 0 switches it off. share: bounds, +- of each parameter as told.
        friction: rho_f of the cylinders' Coulomb [N/m] and viscous friction [N s/m^2 per m/s]; 0 switches it off.
            Published: 1e5 of both.
        friction_share: bounds, +- of each.
        joint: lambda of the joints that the tool's plane leaves open [1/s].
        contact: friction there, see `vdc_actuator`.
        force_corner: of the filter that gives the required force's rate [Hz]. Published: 8, too late for `body`.
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
    """What a step comes to: valve commands (N, k) in [-1, 1], required and present pressure force (N, k) [N]."""

    valve: Float
    required: Float
    present: Float


def plane_axes(chain: ClosedChain) -> tuple[int, int]:
    """The two axes of base (0 to 2) along which a machine moves its tool.

    Raises:
        InputError: it moves its tool along one axis, or along three.
    """
    state = chain.at(chain.minimal(chain.robot.home), np.zeros(len(chain.independent)))
    reach = np.abs(state.jacobian(chain.robot.tool_frames[0])[:3]).max(axis=1)
    axes = [int(i) for i in np.flatnonzero(reach > REACH)]
    if len(axes) != 2:
        text = f"moves its tool along {len(axes)} axes of base; the hydraulic law is for machines of one plane"
        raise InputError(chain.robot.spec.name, text, "take a robot without [[actuation]]")
    return axes[0], axes[1]


def plane_task(chain: ClosedChain) -> ToolTask:
    """The tool's point in its plane, and the last independent joints as far as the plane leaves them open."""
    return ToolTask(chain, plane_axes(chain), chain.independent[2:])
