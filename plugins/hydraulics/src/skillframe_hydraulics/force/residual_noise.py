r"""Noise of the residual of `momentum` for given sensors, which sets the weights of the joints.

With p = M_z z' of encoders and F_p = A_a p_a - A_b p_b of pressures behind the sensors' filter,

    sigma_i^2 = sum_j (M_ij sigma_z g_2)^2 + sum_k R_ki^2 [ (A_a^2 + A_b^2) (sigma_p g_0)^2 + (0.04 F_C)^2 ]         (1)

g_m is the standard deviation of unit white noise, m times differentiated, behind filter and L. The last term is
friction, as measured in air.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skillframe.frames import Float
from skillframe_hydraulics.force.damped import noise_passed

if TYPE_CHECKING:
    from skillframe.robot import ClosedChain
    from skillframe_hydraulics.declared import MachineNoise
    from skillframe_hydraulics.law.vdc_actuator import Cylinders

RUBBING = 0.04
"""Uncertain share of a sliding piston's Coulomb friction."""
LEAST = 1.0
"""Lower bound [Nm or N] that keeps weights finite."""


def residual_noise(chain: ClosedChain, cylinders: Cylinders, sensors: MachineNoise, corner: float, dt: float) -> Float:
    """Equation (1) at home: standard deviations (n,) [Nm or N].

    `corner` [Hz] is of L, `dt` [s] the sample time.
    """
    state = chain.at(chain.minimal(chain.home), np.zeros(len(chain.independent)))
    accelerations = sensors.encoder * noise_passed(2, (sensors.corner_hz,), dt, corner)
    pressures = sensors.pressure * noise_passed(0, (sensors.corner_hz,), dt, corner)
    areas = np.square(cylinders.area_a) + np.square(cylinders.area_b)
    pistons = areas * pressures**2 + np.square(RUBBING * cylinders.coulomb_friction)
    variance = accelerations**2 * np.square(state.mass).sum(axis=1) + np.square(state.arms).T @ pistons
    return np.asarray(np.sqrt(np.maximum(variance, LEAST**2)))
