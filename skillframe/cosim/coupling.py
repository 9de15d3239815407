r"""Stability of the coupling step, from two numbers per bond measured on the actuators.

A force held over a step H makes the bond a sampled spring and damper: \(\omega_h H\) with \(\omega_h = \sqrt{k/m}\),
and \(c H / m\), where k is force per displacement over a step, c force per velocity at once, and m the mass at the
bond.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from skillframe.cosim.energy_balance import Float
from skillframe.errors import SkillframeError
from skillframe.fmu.actuator import Actuators

WARN, REFUSE = 0.3, 1.0  # tests diverge at 2
SPEED = 1e-3  # test speed [m/s]


class StepTooLarge(SkillframeError):
    """The step is unstable with this load. The message names a stable one."""


class Coupling(NamedTuple):
    """Coupling numbers of every bond, (count,) each.

    Attributes:
        stiffness: force per displacement over a step [N/m]; feedthrough: force per velocity at once [N s/m].
        frequency: \\(\\omega_h\\) [rad/s].
        oscillation: \\(\\omega_h H\\); damping: \\(c H/m\\), both without a unit.
    """

    stiffness: Float
    feedthrough: Float
    frequency: Float
    oscillation: Float
    damping: Float

    @property
    def worst(self) -> Float:
        """The larger number of each bond."""
        return np.maximum(self.oscillation, self.damping)


def coupling_numbers(bank: Actuators, mass: Float, step: float, time: float = 0.0) -> Coupling:
    """Measure coupling numbers for masses (count,) [kg] at the bonds and a step [s]. States are restored.

    Raises:
        SkillframeError: an actuator cannot be restored, or fails.
    """
    kept, velocity = bank.u.copy(), bank.inputs.index("velocity")
    forward, back = (_pushed(bank, sign * SPEED, step, time, kept, velocity) for sign in (1.0, -1.0))
    bank.u[:] = kept
    bank.refresh()
    stiffness = np.maximum((back[0] - forward[0]) / (2 * SPEED * step), 0.0)
    feedthrough = np.maximum((back[1] - forward[1]) / (2 * SPEED), 0.0)
    frequency = np.sqrt(stiffness / mass)
    return Coupling(stiffness, feedthrough, frequency, frequency * step, feedthrough * step / mass)


def _pushed(bank: Actuators, speed: float, step: float, time: float, kept: Float, velocity: int) -> tuple[Float, Float]:
    """Force after moving for a step and stopping, and force at once at that speed."""
    force = bank.outputs.index("force")
    if not all(bank.capabilities(i).rollback for i in range(bank.count)):
        raise SkillframeError("the coupling cannot be tried out: an actuator's state cannot be restored")
    bank.u[:] = kept
    bank.u[:, velocity] = speed
    bank.refresh()
    at_once = bank.y[:, force].copy()
    bank.save()
    fine = bank.step(time, step)
    bank.u[:] = kept
    bank.u[:, bank.inputs.index("position")] += speed * step
    bank.u[:, velocity] = 0.0
    fine = bank.refresh() and fine
    after = bank.y[:, force].copy()
    bank.restore()
    if not fine:
        problem = next((p for p in map(bank.problem, range(bank.count)) if p), "an actuator refused")
        raise SkillframeError(f"the coupling cannot be tried out: {problem}")
    return after, at_once


def require_stable(
    coupling: Coupling, step: float, names: Sequence[str], warn: Callable[[str], None] = lambda text: None
) -> None:
    """Refuse an unstable step and warn about an inaccurate one.

    Raises:
        StepTooLarge: with the bond, its numbers, and a stable step.
    """
    for i, worst in enumerate(coupling.worst):
        if worst <= WARN:
            continue
        text = (
            f"{names[i % len(names)]}: with a step of {step * 1e3:g} ms omega_h H = {coupling.oscillation[i]:.2g} and"
            f" c H/m = {coupling.damping[i]:.2g}, above"
        )
        if worst > REFUSE:
            enough = f"{REFUSE / worst * step * 1e3:.2g} ms"
            raise StepTooLarge(f"{text} {REFUSE:g}, which is unstable; take {enough} or less")
        warn(f"{text} {WARN:g}; take {WARN / worst * step * 1e3:.2g} ms for accuracy")
