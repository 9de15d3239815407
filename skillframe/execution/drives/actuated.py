"""A plant with joints driven by FMUs: coupled steps, failures, and the energy error of the coupling.

A batch of simulated machines as the mechanics of a co-simulation, with one power bond per trial and driven joint.

MuJoCo holds generalised forces over a step, so a force that changes linearly from F0 to F1 acts as its mean: the
coupling is of second order (position error H^3 F'/12 m per step).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.cosim.coupling import coupling_numbers, require_stable
from skillframe.cosim.energy_balance import Motion
from skillframe.cosim.exchange import PlantArrays
from skillframe.cosim.master import CosimSettings, Master
from skillframe.errors import SkillframeError
from skillframe.execution.drive import Trials
from skillframe.fmu.actuator import Actuators
from skillframe.frames import Float
from skillframe.skill import Broken, Ended
from skillframe.world.plant import Plant


class Actuated:
    """N robots with k driven joints each, stepped together with their N k actuators.

    `dt` [s] is the tick and the step of the coupling.
    """

    def __init__(self, plant: Plant, joints: Sequence[str], bank: Actuators, dt: float) -> None:
        self.joints, self.bank, self.dt = tuple(joints), bank, dt
        self.plant = CoupledPlant(plant, joints)
        self.master = Master(self.plant, bank, CosimSettings(step=dt))

    @property
    def force(self) -> Float:
        """Forces on the joints (N, k) [N, Nm]."""
        return self.master.force.reshape(self.plant.trials, -1)

    def require_stable(self) -> None:
        """Check the step against the loads on the started actuators, if their states can be restored.

        Raises:
            StepTooLarge: the control rate is too low for the load on an actuator.
        """
        if all(self.bank.capabilities(i).rollback for i in range(len(self.joints))):
            require_stable(coupling_numbers(self.bank, self.plant.effective_mass(), self.dt), self.dt, self.joints)

    def step(self, command: Float, active: Trials) -> list[Broken]:
        """Step under commands (N, k). Returns trials among `active` whose FMU failed."""
        self.plant.active = active
        return [] if self.master.step(command.ravel()) else self.failed(active)

    def failed(self, active: Trials) -> list[Broken]:
        """Trials with a failed FMU, and the first one's message."""
        k, found = len(self.joints), dict[int, Broken]()
        for index in range(self.bank.count):
            if index // k in active and (problem := self.bank.problem(index)):
                found.setdefault(index // k, Broken(index // k, Ended.MACHINE, problem))
        return list(found.values())

    def end(self, rows: Trials) -> None:
        """Stop stepping their FMUs."""
        k = len(self.joints)
        self.bank.active[(rows[:, None] * k + np.arange(k)).ravel()] = 0

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """Trials in which a bond has gained or lost too much energy."""
        if tick % 100:
            return []
        residual = self.master.residual.reshape(self.plant.trials, -1)
        enough = self.master.exchanged.reshape(residual.shape) > 200.0  # [J]
        bad = enough & (residual > 1e-2)
        text = "is above 0.01; take a smaller step"
        return [
            Broken(i, Ended.MACHINE, f"co-simulation of {self.joints[k]}: bond residual {residual[i, k]:.2g} {text}")
            for i, k in ((int(i), int(np.argmax(bad[i]))) for i in active if bad[i].any())
        ]


PROBE_N = 1000.0
"""Force [N] that probes the mass at a joint: far above rounding, too small to move the machine noticeably."""


class CoupledPlant:
    """The `skillframe.cosim` side of a plant whose joints are driven by actuators.

    Attributes:
        count: number of bonds, trials x joints.
        active: ids of the trials that are stepped.
        dofs: (k,) generalised velocities of the driven joints, MuJoCo's order.
        load: (N, nv) further generalised forces, MuJoCo's order, initially zero.
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
        """The plant's arrays, for a master that steps them itself."""
        own = self.plant.arrays()
        return PlantArrays(
            own.position, own.velocity, own.acceleration, self.load, own.applied, self._qpos, self.dofs, own.still,
            self._timestep, lambda: self.plant.accelerate(self.active), lambda: self.plant.advance(self.active),
        )  # fmt: skip

    def motion(self, force: Float) -> Motion:
        """Motion (count,) of the driven joints under forces (count,) [N]."""
        acceleration = self.plant.acceleration(self._torque(force), self.active)
        return Motion(*self.where(), acceleration.take(self.dofs, axis=1).ravel())

    def where(self) -> tuple[Float, Float]:
        """Positions and velocities (count,) of the driven joints."""
        position, velocity = self.plant.state
        return position.take(self._qpos, axis=1).ravel(), velocity.take(self.dofs, axis=1).ravel()

    @property
    def velocity(self) -> Float:
        """Velocities (trials, joints) of the driven joints."""
        velocity: Float = self.plant.state[1].take(self.dofs, axis=1)
        return velocity

    def advance(self, begin: Float, end: Float, step: float) -> None:
        """Advance by the plant's time step under forces (count,) that change linearly from `begin` to `end`.

        Raises:
            SkillframeError: `step` differs from the plant's.
        """
        if abs(step - self._timestep) > 1e-12:
            own = self._timestep
            raise SkillframeError(f"the simulated machine steps by {own:g} s and not by {step:g} s; make the two equal")
        self.plant.step(self._torque(0.5 * (begin + end)), self.active)

    def effective_mass(self) -> Float:
        """Mass (count,) [kg] at each bond, with the other joints free."""
        rest = self.motion(np.zeros(self.count)).acceleration
        mass = np.zeros((self.trials, len(self.joints)))
        for j in range(len(self.joints)):
            push = np.zeros((self.trials, len(self.joints)))
            push[:, j] = PROBE_N
            gained = (self.motion(push.ravel()).acceleration - rest).reshape(self.trials, -1)
            mass[:, j] = PROBE_N / gained[:, j]
        return mass.ravel()

    def save(self) -> None:
        """Store the state for `restore`."""
        position, velocity = self.plant.state
        self._saved = position.copy(), velocity.copy()

    def restore(self) -> None:
        """Return to the last saved state."""
        self.plant.set_state(*self._saved, self.active)

    def _torque(self, force: Float) -> Float:
        """Generalised forces (N, nv) in a reused array."""
        torque = np.matmul(force.reshape(self.trials, -1), self._spread, out=self._all)
        torque += self.load
        return torque
