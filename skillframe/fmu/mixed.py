"""A bank of some actuators in this process and some in child processes, for a robot that has both kinds.

Only what is foreign pays for its child; what was built here runs at full speed beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.fmu.actuator import Actuators, ActuatorSpec, Capabilities
from skillframe.fmu.wiring import columns


class _Part(NamedTuple):
    """One of the banks: where its instances lie in the whole, and its columns of `u` and `y`."""

    bank: Actuators
    rows: NDArray[np.int64]
    inputs: NDArray[np.int64]
    outputs: NDArray[np.int64]


class MixedBank:
    """A bank out of banks (see `Actuators`).

    Args:
        specs: the robot's actuators.
        banks: actuators of the robot (indices into `specs`) and the bank that holds them, for as many trials.
    """

    def __init__(self, specs: Sequence[ActuatorSpec], banks: Sequence[tuple[Sequence[int], Actuators]]) -> None:
        self.inputs, self.outputs = columns(specs)
        self.count = sum(bank.count for _, bank in banks)
        self.u = np.zeros((self.count, len(self.inputs)))
        self.y = np.full((self.count, len(self.outputs)), np.nan)
        self.active, self.status = np.ones(self.count, np.uint8), np.zeros(self.count, np.int64)
        self.notes: tuple[str, ...] = tuple(note for _, bank in banks for note in bank.notes)
        self._parts, self._owner = list[_Part](), dict[int, tuple[Actuators, int]]()
        first = np.arange(0, self.count, len(specs))
        for kinds, bank in banks:
            rows = (first[:, None] + np.array(kinds)).ravel()
            inputs = np.array([self.inputs.index(name) for name in bank.inputs])
            outputs = np.array([self.outputs.index(name) for name in bank.outputs])
            self._parts.append(_Part(bank, rows, inputs, outputs))
            self._owner.update({int(row): (bank, k) for k, row in enumerate(rows)})

    def _each(self, call: Callable[[_Part], bool | None]) -> bool:
        """Call every part with what the caller wrote, and take over what it says. Returns True if all went well."""
        fine = True
        for part in self._parts:
            part.bank.u[:] = self.u[part.rows[:, None], part.inputs]
            part.bank.active[:] = self.active[part.rows]
            fine &= call(part) is not False
            self.y[part.rows[:, None], part.outputs] = part.bank.y
            self.active[part.rows], self.status[part.rows] = part.bank.active, part.bank.status
        return fine

    def start(self, time: float = 0.0, parameters: Sequence[Mapping[str, Any]] | None = None) -> None:
        """Reset every instance and initialise it at `u`. See `Actuators`."""
        self._each(lambda p: p.bank.start(time, None if parameters is None else [parameters[i] for i in p.rows]))

    def step(self, time: float, step: float) -> bool:
        """Advance from `time` by `step` [s] with inputs `u`. Returns True if every active instance went well."""
        return self._each(lambda part: part.bank.step(time, step))

    def refresh(self) -> bool:
        """Outputs at the present inputs. No time passes."""
        return self._each(lambda part: part.bank.refresh())

    def save(self) -> None:
        """Remember the state of every active instance."""
        self._each(lambda part: part.bank.save())

    def restore(self) -> None:
        """Return to the last `save`."""
        self._each(lambda part: part.bank.restore())

    def capabilities(self, index: int) -> Capabilities:
        """What one instance can do."""
        bank, own = self._owner[index]
        return bank.capabilities(own)

    def problem(self, index: int) -> str:
        """Why an instance failed, one sentence, or empty if it did not."""
        bank, own = self._owner[index]
        return bank.problem(own)

    def close(self) -> None:
        """Free everything."""
        for part in self._parts:
            part.bank.close()
