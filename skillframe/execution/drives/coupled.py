"""A batch of simulated machines as the mechanics of a co-simulation: one power bond per trial and piston joint.

Bonds run trial by trial, as actuators do in their bank. MuJoCo holds generalised forces over a step, so a force that
goes linearly from F0 to F1 acts as its mean, which leaves the coupling of second order
(position error H^3 F'/12 m a step).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.cosim.exchange import PlantArrays
from skillframe.cosim.plant import Motion
from skillframe.errors import SkillframeError
from skillframe.frames import Float
from skillframe.world.plant import Plant

PROBE_N = (
    1000.0  # force that finds the mass a piston feels: far above rounding, far below what moves the machine's pose
)


class CoupledPlant:
    """The `skillframe.cosim` side of a plant whose joints are driven by actuators.

    Args:
        plant: the batch; `active` says which trials go on.
        joints: names of the driven joints, each with one degree of freedom.

    Attributes:
        count: number of bonds, trials x joints.
        active: ids of the trials that are stepped.
        dofs: (k,) generalised velocities of the driven joints, MuJoCo's order.
        load: (N, nv) generalised forces besides the bonds', MuJoCo's order; zero unless written.
    """

    def __init__(self, plant: Plant, joints: Sequence[str]) -> None:
        self.plant, self.trials, self.joints = plant, plant.count, tuple(joints)
        self.count = self.trials * len(self.joints)
        self._qpos = np.array([plant.model.joint(name).qposadr[0] for name in joints])
        self.dofs = np.array([plant.model.joint(name).dofadr[0] for name in joints])
        self._timestep = float(plant.model.opt.timestep)
        self._spread: Float = np.eye(plant.model.nv)[self.dofs]
        self.active: NDArray[np.int64] = np.arange(self.trials)
        self.load: Float = np.zeros((self.trials, plant.model.nv))
        self._saved: tuple[Float, Float] = plant.state
        self._all: Float = np.zeros_like(self.load)

    def arrays(self) -> PlantArrays:
        """Where the plant keeps its numbers, for a master that moves them itself."""
        own = self.plant.arrays()
        return PlantArrays(
            own.position, own.velocity, own.acceleration, self.load, own.applied, self._qpos, self.dofs, own.still,
            self._timestep, lambda: self.plant.accelerate(self.active), lambda: self.plant.advance(self.active),
        )  # fmt: skip

    def motion(self, force: Float) -> Motion:
        """Motion (count,) of the pistons now, with forces (count,) [N] acting on them."""
        acceleration = self.plant.acceleration(self._torque(force), self.active)
        return Motion(*self.where(), acceleration.take(self.dofs, axis=1).ravel())

    def where(self) -> tuple[Float, Float]:
        """Positions and velocities (count,) of the pistons now."""
        position, velocity = self.plant.state
        return position.take(self._qpos, axis=1).ravel(), velocity.take(self.dofs, axis=1).ravel()

    @property
    def velocity(self) -> Float:
        """(trials, joints) of the driven joints now."""
        velocity: Float = self.plant.state[1].take(self.dofs, axis=1)
        return velocity

    def advance(self, begin: Float, end: Float, step: float) -> None:
        """Advance by the plant's time step under forces (count,) that go linearly from `begin` to `end`.

        Raises:
            SkillframeError: another step is asked for.
        """
        if abs(step - self._timestep) > 1e-12:
            own = self._timestep
            raise SkillframeError(f"the simulated machine steps by {own:g} s and not by {step:g} s; make the two equal")
        self.plant.step(self._torque(0.5 * (begin + end)), self.active)

    def effective_mass(self) -> Float:
        """Mass (count,) [kg] that each bond feels now, the others free."""
        rest = self.motion(np.zeros(self.count)).acceleration
        mass = np.zeros((self.trials, len(self.joints)))
        for j in range(len(self.joints)):
            push = np.zeros((self.trials, len(self.joints)))
            push[:, j] = PROBE_N
            gained = (self.motion(push.ravel()).acceleration - rest).reshape(self.trials, -1)
            mass[:, j] = PROBE_N / gained[:, j]
        return mass.ravel()

    def save(self) -> None:
        """Remember the state, for `restore`."""
        position, velocity = self.plant.state
        self._saved = position.copy(), velocity.copy()

    def restore(self) -> None:
        """Return to the state of the last `save`."""
        self.plant.set_state(*self._saved, self.active)

    def _torque(self, force: Float) -> Float:
        """Generalised forces (N, nv), in an array that the next call uses again."""
        torque = np.matmul(force.reshape(self.trials, -1), self._spread, out=self._all)
        torque += self.load
        return torque
