"""The swing in the air before a run, and what of its findings the law holds from then on.

Friction and payload are identified as an explicit step, by the phase of the task and not by a threshold of the force
(automatic gates took stiction for contact); the swing and its figures are our choice.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from skillframe.frames import Float
from skillframe.machine.force.identification import Identification
from skillframe.machine.force.load import carrier, inertias
from skillframe.machine.law.hydraulic_compiled import CompiledLaw
from skillframe.machine.law.vdc_actuator import friction_parameters
from skillframe.machine.law.vdc_adaptation import relative_bounds

CALIBRATION_S, SETTLE_S, SWING_M = 6.0, 1.0, (0.10, 0.10, 0.05)
"""Two or three reversals of every cylinder, and a moment to come to rest."""


@lru_cache(maxsize=1 << 14)
def swing(time: float) -> tuple[Float, Float, float, float]:
    """Displacement (2,) [m] and velocity of the tool, and of the open joint, at a time of the calibration [s].

    Up and back to the start, to and fro along the first axis, the joint out and in: every cylinder reverses. All runs
    ask for the same times, so what was computed is kept.
    """
    h = 1e-4
    now, rate = _displacement(time), (_displacement(time + h) - _displacement(time - h)) / (2 * h)
    return now[:2], rate[:2], float(now[2]), float(rate[2])


def _displacement(time: float) -> Float:
    fade = min(1.0, max(0.0, time / 0.5), max(0.0, (CALIBRATION_S - time) / 1.0))
    fade = fade * fade * (3.0 - 2.0 * fade)
    turn = 2.0 * np.pi * time / CALIBRATION_S
    return fade * np.array(
        [SWING_M[0] * np.sin(3 * turn), SWING_M[1] * (1.0 - np.cos(2 * turn)), SWING_M[2] * np.sin(2 * turn)]
    )


def hold_identified(law: CompiledLaw, found: Identification) -> None:
    """Let a law compensate the friction and the payload that were found, and learn no more.

    The load may be any within the rating, and what carries it heavier or lighter by `share`. What the law's adaptation
    has come to by then is dropped: it makes the swing follow, and goes on wandering with the friction of pistons that
    stand, by a tenth of the load's mass.
    """
    nominal = friction_parameters(law.cylinders)
    lower, upper = relative_bounds(nominal, law.gains.friction_share)
    errors = np.stack([found.coulomb, found.viscous], axis=1)
    law.adapt(False)
    law.friction[:] = np.clip(nominal + errors, lower, upper)
    row, (least, most) = carrier(law.chain), carried_bounds(law)
    mass = law.told[:, row, 0]
    law.theta[:] = law.told
    law.theta[:, row] *= (np.clip(mass + found.payload, least, most) / mass)[:, None]


def carried_bounds(law: CompiledLaw) -> tuple[float, float]:
    """Least and largest mass of the body that carries the load, load included [kg]."""
    payload, share = law.chain.robot.spec.payload, law.gains.share
    assert payload is not None  # else the estimate has refused the robot
    empty, full = inertias(law.chain, np.array([0.0, payload.rating]))[:, carrier(law.chain), 0]
    return (1.0 - share) * float(empty), (1.0 + share) * float(full)
