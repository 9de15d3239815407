"""Interface of actuators in the loop: a bank stepped together, motion in and force out.

A bank has `trials` x (actuators of the robot) instances, trial by trial. In a step x(s) = x + v s + a s^2/2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]  #: array of floats
INPUTS = ("command", "position", "velocity", "acceleration")  #: inputs of an actuator
#: outputs of an actuator
OUTPUTS = ("force", "force_mean", "work", "pressure_a", "pressure_b", "flow_a", "flow_b", "spool")

OK, WARNING, DISCARD, ERROR, FATAL, NOT_FINITE, ENDED, LOST = range(8)  #: statuses of a step
STATUS_TEXT = (
    "fine", "a warning", "the step was refused", "an error", "a fatal error", "an output is not a finite number",
    "the FMU terminated the simulation", "its process was lost",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class ActuatorSpec:
    """An actuator as declared in robot.toml.

    Attributes:
        fmu: a name in `fmus/`, or a path.
        parameters: FMU's parameters by name.
        inputs, outputs: names here to the FMU's names.
        name: for messages.
    """

    fmu: str
    parameters: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    name: str = ""


class Capabilities(NamedTuple):
    """Tested capabilities of an actuator (`probe`).

    Attributes:
        acceleration: takes the joint's acceleration; force_mean, work: gives mean force and work of a step.
        rollback: steps repeated from a saved state are identical.
        variable_step: steps of any length; refresh: outputs follow inputs without a step.
    """

    acceleration: bool
    force_mean: bool
    work: bool
    rollback: bool
    variable_step: bool
    refresh: bool


class Actuators(Protocol):
    """A bank of actuators.

    Attributes:
        count: number of instances; inputs, outputs: columns of `u` and `y`.
        u: (count, len(inputs)), written by the caller; y: (count, len(outputs)), NaN for missing outputs.
        active: (count,) 1 for stepped instances, 0 after a failure.
        status: (count,) outcome of the last call.
        notes: messages for the user.
    """

    count: int
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    u: Float
    y: Float
    active: NDArray[np.uint8]
    status: NDArray[np.int64]
    notes: tuple[str, ...]

    def start(self, time: float = 0.0, parameters: Sequence[Mapping[str, Any]] | None = None) -> None:
        """Initialise every instance at `u`, with one mapping of `parameters` each."""

    def step(self, time: float, step: float) -> bool:
        """Advance from `time` by `step` [s] with inputs `u`. Returns True if all active instances succeed."""

    def refresh(self) -> bool:
        """Update outputs for the present inputs."""

    def save(self) -> None:
        """Save the state of active instances."""

    def restore(self) -> None:
        """Restore the saved state."""

    def capabilities(self, index: int) -> Capabilities:
        """Capabilities of an instance."""

    def problem(self, index: int) -> str:
        """Reason for an instance's failure, or ""."""

    def close(self) -> None:
        """Free the bank."""


def columns(specs: Sequence[ActuatorSpec]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Columns of `u` and `y`: the standard ones, then those of mappings."""
    more_in = [name for spec in specs for name in spec.inputs if name not in INPUTS]
    more_out = [name for spec in specs for name in spec.outputs if name not in OUTPUTS]
    return (*INPUTS, *dict.fromkeys(more_in)), (*OUTPUTS, *dict.fromkeys(more_out))
