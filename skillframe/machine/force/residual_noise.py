r"""How noisy the residual of `momentum` is on a machine of given sensors: what weighs its joints against each other.

Of a joint's residual r = L [p' - R^T F_p + ...] sensors' noise makes, with p = M_z z' of encoders and F_p = A_a p_a -
A_b p_b of pressures, both behind the sensors' filter,

    sigma_i^2 = sum_j (M_ij sigma_z g_2)^2 + sum_k R_ki^2 [ (A_a^2 + A_b^2) (sigma_p g_0)^2 + (0.04 F_C)^2 ]         (1)

g_m: standard deviation of white noise of one a sample, m times differentiated, behind filter and L. The last term is
what friction adds, 4 % of the Coulomb friction of a piston that slides (ours, measured in air: for the crane that ships
(1) gives 203 and 158 Nm and 164 N, where 220, 160 and 170 were found).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skillframe.frames import Float
from skillframe.machine.force.damped import share_of

if TYPE_CHECKING:
    from skillframe.machine.law.vdc_actuator import Cylinders
    from skillframe.robot.chain import ClosedChain
    from skillframe.robot.driven import MachineNoise

RUBBING = 0.04
"""Of Coulomb friction that a sliding piston leaves open."""
LEAST = 1.0
"""Nm or N, of a machine without noise and friction (ours: to weigh by, it must not be 0)."""
_POINTS = 4000


def residual_noise(chain: ClosedChain, cylinders: Cylinders, sensors: MachineNoise, corner: float, dt: float) -> Float:
    """Equation (1) at home: (n,) standard deviations [Nm or N].

    Args:
        chain: the controller's model.
        cylinders: as the controller knows them.
        sensors: of the machine.
        corner: of L, two equal poles [Hz].
        dt: sample time [s].
    """
    state = chain.at(chain.minimal(chain.robot.home), np.zeros(len(chain.independent)))
    accelerations = sensors.encoder * _passed(2, sensors.corner_hz, corner, dt)
    pressures = sensors.pressure * _passed(0, sensors.corner_hz, corner, dt)
    areas = np.square(cylinders.area_a) + np.square(cylinders.area_b)
    pistons = areas * pressures**2 + np.square(RUBBING * cylinders.coulomb_friction)
    variance = accelerations**2 * np.square(state.mass).sum(axis=1) + np.square(state.arms).T @ pistons
    return np.asarray(np.sqrt(np.maximum(variance, LEAST**2)))


def _passed(order: int, first: float, second: float, dt: float) -> float:
    """g_m, m 0 or 2: through a `RateFilter` and a `CriticallyDamped` of these corners [Hz] at samples of dt [s]."""
    back = np.exp(-2j * np.pi * (np.arange(_POINTS) + 0.5) / _POINTS / 2.0)  # 1/z at frequencies up to Nyquist's
    step, w, share = 1.0 - back, 2.0 * np.pi * first * dt, share_of(second, dt)
    value = w**2 / (step**2 + (2.0 * w * step + w**2) * back)
    through = value * (step / dt) ** order * (share / (1.0 - (1.0 - share) * back)) ** 2
    return float(np.sqrt(np.mean(np.abs(through) ** 2)))
