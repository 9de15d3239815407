"""A plant whose joints are driven by FMUs: one coupled step a tick, what fails in it, and the energy it makes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skillframe.control.endings import Broken, Ended
from skillframe.cosim.coupling import coupling_numbers, require_stable
from skillframe.cosim.master import CosimSettings, Master
from skillframe.execution.drive import Trials
from skillframe.execution.drives.coupled import CoupledPlant
from skillframe.fmu.actuator import Actuators
from skillframe.frames import Float
from skillframe.world.plant import Plant

RESIDUAL_LIMIT, RESIDUAL_ENERGY, RESIDUAL_TICKS = 1e-2, 200.0, 100
"""Relative bond residual that ends a trial, once so many joules were exchanged; looked at every 100 ticks."""


class Actuated:
    """N robots with k driven joints each, in lock-step with their N k actuators.

    Args:
        plant: the simulated robots.
        joints: names of the k driven joints.
        bank: their actuators, trial by trial.
        dt: [s] of a tick, and the coupling's step.
    """

    def __init__(self, plant: Plant, joints: Sequence[str], bank: Actuators, dt: float) -> None:
        self.joints, self.bank, self.dt = tuple(joints), bank, dt
        self.plant = CoupledPlant(plant, joints)
        self.master = Master(self.plant, bank, CosimSettings(step=dt))

    @property
    def force(self) -> Float:
        """(N, k) on the joints now [N, Nm]."""
        return self.master.force.reshape(self.plant.trials, -1)

    def require_stable(self) -> None:
        """Judge the step against the loads that the started actuators feel, if their states can be restored.

        Raises:
            StepTooLarge: the control rate is too low for the load on an actuator.
        """
        if all(self.bank.capabilities(i).rollback for i in range(len(self.joints))):
            require_stable(coupling_numbers(self.bank, self.plant.effective_mass(), self.dt), self.dt, self.joints)

    def step(self, command: Float, active: Trials) -> list[Broken]:
        """A tick under commands (N, k). Trials among `active` whose FMU failed, each with its sentence."""
        self.plant.active = active
        return [] if self.master.step(command.ravel()) else self.failed(active)

    def failed(self, active: Trials) -> list[Broken]:
        """The trials of which an FMU has failed, with the first one's sentence."""
        k, found = len(self.joints), dict[int, Broken]()
        for index in range(self.bank.count):
            if index // k in active and (problem := self.bank.problem(index)):
                found.setdefault(index // k, Broken(index // k, Ended.MACHINE, problem))
        return list(found.values())

    def end(self, rows: Trials) -> None:
        """Their FMUs are not stepped any more."""
        k = len(self.joints)
        self.bank.active[(rows[:, None] * k + np.arange(k)).ravel()] = 0

    def violations(self, tick: int, active: Trials) -> list[Broken]:
        """Trials of which a bond has made or lost too much energy. Every 100 ticks."""
        if tick % RESIDUAL_TICKS:
            return []
        residual = self.master.residual.reshape(self.plant.trials, -1)
        enough = self.master.exchanged.reshape(residual.shape) > RESIDUAL_ENERGY
        bad = enough & (residual > RESIDUAL_LIMIT)
        text = f"is above {RESIDUAL_LIMIT:g}; take a smaller step"
        return [
            Broken(i, Ended.MACHINE, f"co-simulation of {self.joints[k]}: bond residual {residual[i, k]:.2g} {text}")
            for i, k in ((int(i), int(np.argmax(bad[i]))) for i in active if bad[i].any())
        ]
