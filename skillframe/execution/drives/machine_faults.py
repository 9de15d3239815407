"""Faults of a batch of machines as its loop knows them: readings, commands, and inputs of the cylinders' FMUs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from skillframe.fmu.actuator import Actuators
from skillframe.frames import Float
from skillframe.machine.faults import Faults
from skillframe.machine.sensors import MachineSensors
from skillframe.robot.chain import ClosedChain


def moved_joints(chain: ClosedChain) -> NDArray[np.int64]:
    """(k,) which of the minimal coordinates each cylinder moves, at home."""
    state = chain.at(chain.minimal(chain.robot.home), np.zeros(len(chain.independent)))
    joints: NDArray[np.int64] = np.argmax(np.abs(state.arms), axis=1)
    return joints


class BrokenParts:
    """What `Faults` break of N machines, tick by tick.

    Args:
        chain: the machine; bank: its actuators, whose inputs for faults are closed here.
        draws: quantities per trial.
        gauges: which the faults of sensors go through from now on.
        dt: [s] of a tick; begin: tick of the first sample, from the skill's start.
    """

    def __init__(
        self, chain: ClosedChain, bank: Actuators, draws: Mapping[str, Float], gauges: MachineSensors, dt: float,
        begin: int,
    ) -> None:  # fmt: skip
        count = bank.count // len(chain.actuated)
        self._faults = Faults(draws, moved_joints(chain), count, dt, begin)
        self._bank, self._spool = bank, bank.outputs.index("spool")
        self._holes = {s: bank.inputs.index(f"burst_{s}") for s in "ab" if f"burst_{s}" in bank.inputs}
        self._drop = bank.inputs.index("supply_drop") if "supply_drop" in bank.inputs else None
        gauges.fault = self._faults.read

    def tick(self) -> None:
        """A sample later."""
        self._faults.tick()

    def obey(self, command: Float, height: Float) -> Float:
        """What the spools go by (N, k) when they are told this. The supply's height over the return line is [Pa]."""
        for side, column in self._holes.items():
            self._bank.u[:, column] = self._faults.leak(side).ravel()
        if self._drop is not None:
            self._bank.u[:, self._drop] = self._faults.drop(height).ravel()
        return self._faults.obey(command, self._bank.y[:, self._spool].reshape(command.shape))
