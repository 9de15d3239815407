"""The contract of actuators in the loop: a bank of them, stepped together, motion in and force out.

A bank holds `trials` x (actuators of the robot) instances, trial by trial. The caller writes `u`, steps, and reads `y`;
no call allocates. The acceleration lets an actuator follow the piston inside a step, x(s) = x + v s + a s^2/2, which
makes the coupling of second order (our measurement, tests of `cosim`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
INPUTS = ("command", "position", "velocity", "acceleration")
OUTPUTS = ("force", "force_mean", "work", "pressure_a", "pressure_b", "flow_a", "flow_b", "spool")

OK, WARNING, DISCARD, ERROR, FATAL, NOT_FINITE, ENDED, LOST = range(8)
STATUS_TEXT = (
    "fine", "a warning", "the step was refused", "an error", "a fatal error", "an output is not a finite number",
    "the FMU asked to end", "its process was lost",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class ActuatorSpec:
    """One actuator as robot.toml declares it.

    Attributes:
        fmu: a name in `fmus/`, or a path to an FMU.
        parameters: FMU's parameters by name.
        inputs, outputs: our names to the FMU's; empty takes the FMU's variables that have our names.
        name: for messages, usually the joint.
    """

    fmu: str
    parameters: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    outputs: dict[str, str] = field(default_factory=dict)
    name: str = ""


class Capabilities(NamedTuple):
    """What an actuator can do, tried out and not only claimed (`probe`).

    Attributes:
        acceleration: takes the piston's acceleration; force_mean, work: gives mean force and work of a step.
        rollback: saving, stepping, restoring and stepping again gives the identical result.
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
        count: number of instances; inputs, outputs: names of the columns of `u` and `y`.
        u: (count, len(inputs)), written by the caller; y: (count, len(outputs)), NaN where an FMU lacks an output.
        active: (count,) 1 for instances that are stepped; the bank clears it where one has failed.
        status: (count,) outcome of the last call, OK to LOST.
        notes: sentences for the user, such as that a slower stand-in runs.
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
        """Reset every instance and initialise it at `u`. `parameters` has one mapping per instance."""

    def step(self, time: float, step: float) -> bool:
        """Advance from `time` by `step` [s] with inputs `u`. Returns True if every active instance went well."""

    def refresh(self) -> bool:
        """Outputs at the present inputs. No time passes."""

    def save(self) -> None:
        """Remember the state of every active instance, for `restore`."""

    def restore(self) -> None:
        """Return to the state of the last `save`."""

    def capabilities(self, index: int) -> Capabilities:
        """What one instance can do."""

    def problem(self, index: int) -> str:
        """Why an instance failed, one sentence, or empty if it did not."""

    def close(self) -> None:
        """Free everything. The bank cannot be used afterwards."""
