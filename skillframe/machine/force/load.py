r"""What the controller takes the load in the grip for: what it is told, unless the cylinders' pressures contradict.

Before it swings the machine hangs still on its pistons, R^T (F_p - F_f) = g_z + dm g_1 with the load as told. So

    dm = sum_j w_j g_j e_j / sum_j w_j g_j^2,   e = R^T F_p - g_z,   1/w_j = sum_k R_kj^2 F_Ck^2,  g_1 = (g_j)      (1)

is what the load is known wrongly by, but for friction: a piston that stands may hold up to 1.5 F_C, which the sum of
|sum_j w_j g_j R_kj| 1.5 F_Ck / sum_j w_j g_j^2 over the pistons bounds, for this crane to some 70 kg. Within that bound
the load is as told, and the swing finds what is left of it; beyond it the pressures are right. All ours. Without it the
swing itself failed: a law that is told of 475 kg and has none throws the tool off by 0.4 m and more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from skillframe.frames import Float
from skillframe.machine.checks.figures import CYLINDER
from skillframe.machine.force.momentum import joint_force
from skillframe.machine.law.vdc_body import parameters
from skillframe.robot.carried import loaded_inertias

if TYPE_CHECKING:
    from skillframe.machine.law.hydraulic import Measured, Terms
    from skillframe.machine.law.hydraulic_compiled import CompiledLaw
    from skillframe.machine.law.vdc_actuator import Cylinders
    from skillframe.robot.chain import ClosedChain
    from skillframe.robot.spec import RobotSpec
    from skillframe.world.plant import Draws

__all__ = ["TOLD", "BelievedLoad", "Weighing", "believed", "carrier", "inertias", "weigh"]

TOLD = "robot.nominal_payload"
HIDDEN, LEAST = 1.5, 15.0
"""Times Coulomb friction, and at least so many kg, which the swing finds by itself (`identification`)."""


class Weighing(NamedTuple):
    """Of N machines: what the load is known wrongly by, and how much of it friction may make (N,) [kg]."""

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
        InputError: a load that is negative, or above the rating.
    """
    theta = np.tile(parameters(chain.model), (len(payload), 1, 1))
    _, loaded = loaded_inertias(chain.robot, payload)
    theta[:, carrier(chain)] = [inertia.toDynamicParameters() for inertia in loaded]
    return theta


def weigh(chain: ClosedChain, cylinders: Cylinders, measured: Measured, terms: Terms) -> Weighing:
    """Equation (1), the machine at rest."""
    c, load = cylinders, chain.load_gravity(measured.z)
    left = joint_force(terms.arms, c.area_a * measured.pressure_a - c.area_b * measured.pressure_b) - terms.gravity
    weight = load / joint_force(
        np.square(terms.arms), np.square(c.coulomb_friction) + 1.0
    )  # 1 N^2: not all have friction
    weight = weight / np.sum(weight * load, axis=-1, keepdims=True)
    felt = np.abs((terms.arms @ weight[..., None])[..., 0])
    hidden = HIDDEN * np.sum(felt * c.coulomb_friction, axis=-1)
    return Weighing(np.sum(weight * left, axis=-1), np.maximum(hidden, LEAST))


def believed(told: Float, weighing: Weighing, rating: float) -> Float:
    """(N,) the load to go by [kg]: as told, or as weighed where friction cannot be why the two differ."""
    weighed = np.clip(told + weighing.error, 0.0, rating)
    return np.where(np.abs(weighing.error) > weighing.hidden, weighed, told)


class BelievedLoad:
    """What a law takes the loads of N machines for.

    Args:
        law: is told of them.
        draws: `robot.nominal_payload` (N,) is what the controller is told [kg]; else robot.toml's, whatever is true.
        count: number of trials N.

    Attributes:
        told, mass: (N,) as told and as believed [kg].

    Raises:
        InputError: it is told of a load that is negative, or above the rating.
    """

    def __init__(self, law: CompiledLaw, draws: Draws, count: int) -> None:
        payload = law.chain.robot.spec.payload
        assert payload is not None  # else the force estimate has refused the robot
        self._law, self._rating = law, payload.rating
        self.told: Float = np.array(np.broadcast_to(draws.get(TOLD, payload.mass), count), dtype=float)
        self.mass: Float = self.told
        if np.any(self.told != payload.mass):
            self._tell()

    def weigh(self, seen: Measured, terms: Terms) -> bool:
        """Judge what was told at rest, before the swing. Whether the law goes by something else now."""
        law = self._law
        if not _starts_in_balance(law.chain.robot.spec):
            return False
        self.mass = believed(self.told, weigh(law.chain, law.cylinders, seen, terms), self._rating)
        changed = bool(np.any(self.mass != self.told))
        if changed:
            self._tell()
        return changed

    def _tell(self) -> None:
        self._law.tell(inertias(self._law.chain, self.mass))


def _starts_in_balance(spec: RobotSpec) -> bool:
    """Do all cylinders begin with the force that holds the machine? Else their pressures say nothing of its load."""
    return all(a.initial_force or a.fmu == CYLINDER for a in spec.actuation)
