r"""The load that the controller assumes: the declared one, unless the cylinders' pressures contradict it.

At rest before the swing R^T (F_p - F_f) = g_z + dm g_1, so the load's error is, but for friction,

    dm = sum_j w_j g_j e_j / sum_j w_j g_j^2,   e = R^T F_p - g_z,   1/w_j = sum_k R_kj^2 F_Ck^2,  g_1 = (g_j)      (1)

A standing piston may hold up to 1.5 F_C, which the sum of |sum_j w_j g_j R_kj| 1.5 F_Ck / sum_j w_j g_j^2 over the
pistons bounds. Within that bound the declared load is used, and the swing identifies the rest; beyond it the weighed
load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.frames import Float
from skillframe.robot import loaded_inertias
from skillframe_hydraulics.checks.figures import CYLINDER
from skillframe_hydraulics.force.momentum import joint_force
from skillframe_hydraulics.law.vdc_body import parameters

if TYPE_CHECKING:
    from skillframe.robot import ClosedChain
    from skillframe.world import Draws
    from skillframe_hydraulics.law.hydraulic import Measured, Terms
    from skillframe_hydraulics.law.hydraulic_compiled import CompiledLaw
    from skillframe_hydraulics.law.vdc_actuator import Cylinders

__all__ = ["TOLD", "BelievedLoad", "Weighing", "believed", "carrier", "inertias", "weigh"]

TOLD = "robot.nominal_payload"


class Weighing(NamedTuple):
    """Error of the load and its bound by friction (N,) [kg]."""

    error: Float
    hidden: Float


def carrier(chain: ClosedChain) -> int:
    """Row of theta, the moving bodies' parameters, that holds the load."""
    payload, model = chain.robot.spec.payload, chain.model
    assert payload is not None
    return int(model.frames[model.getFrameId(payload.link, pin.FrameType.BODY)].parentJoint) - 1


def inertias(chain: ClosedChain, payload: Float) -> Float:
    """Inertial parameters theta (N, B, 10) of the moving bodies with loads (N,) [kg].

    Raises:
        InputError: a negative load, or one above the rating.
    """
    theta = np.tile(parameters(chain.model), (len(payload), 1, 1))
    _, loaded = loaded_inertias(chain.robot, payload)
    theta[:, carrier(chain)] = [inertia.toDynamicParameters() for inertia in loaded]
    return theta


def weigh(chain: ClosedChain, cylinders: Cylinders, measured: Measured, terms: Terms) -> Weighing:
    """Equation (1), for the machine at rest."""
    c, load = cylinders, terms.load
    left = joint_force(terms.arms, c.area_a * measured.pressure_a - c.area_b * measured.pressure_b) - terms.gravity
    weight = load / joint_force(
        np.square(terms.arms), np.square(c.coulomb_friction) + 1.0
    )  # 1 N^2 for cylinders without friction
    weight = weight / np.sum(weight * load, axis=-1, keepdims=True)
    felt = np.abs((terms.arms @ weight[..., None])[..., 0])
    hidden = 1.5 * np.sum(felt * c.coulomb_friction, axis=-1)
    return Weighing(np.sum(weight * left, axis=-1), np.maximum(hidden, 15.0))  # kg that the swing identifies


def believed(told: Float, weighing: Weighing, rating: float) -> Float:
    """The assumed load (N,) [kg]: declared, or weighed where friction cannot explain the difference."""
    weighed = np.clip(told + weighing.error, 0.0, rating)
    return np.where(np.abs(weighing.error) > weighing.hidden, weighed, told)


class BelievedLoad:
    """The loads assumed by a controller of N machines.

    Args:
        law: the controller, which is updated.
        draws: `robot.nominal_payload` (N,) is the declared load [kg], by default robot.toml's.
        count: number of trials N.

    Attributes:
        told, mass: (N,) declared and assumed [kg].

    Raises:
        InputError: a negative declared load, or one above the rating.
    """

    def __init__(self, law: CompiledLaw, draws: Draws, count: int) -> None:
        payload = law.chain.robot.spec.payload
        assert payload is not None  # required by the force estimate
        self._law, self._rating = law, payload.rating
        self.told: Float = np.array(np.broadcast_to(draws.get(TOLD, payload.mass), count), dtype=float)
        self.mass: Float = self.told
        if np.any(self.told != payload.mass):
            law.tell(inertias(law.chain, self.mass))

    def weigh(self, seen: Measured, terms: Terms) -> bool:
        """Check the declared load at rest, before the swing. Returns whether it was replaced."""
        law = self._law
        if not all(a.initial_force or a.fmu == CYLINDER for a in law.chain.robot.spec.actuation):
            return False  # a cylinder that does not start with the holding force shows no load
        self.mass = believed(self.told, weigh(law.chain, law.cylinders, seen, terms), self._rating)
        changed = bool(np.any(self.mass != self.told))
        if changed:
            law.tell(inertias(law.chain, self.mass))
        return changed
