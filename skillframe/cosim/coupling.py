r"""Is the step small enough for the load? Two numbers per bond, measured on the actuators themselves.

Holding an actuator's force over a step H makes the bond a sampled spring and damper: \(\omega_h H\) with
\(\omega_h = \sqrt{k/m}\), and \(c H / m\), where k is the force per displacement over one step, c the force per
velocity at once (direct feedthrough, such as friction), and m the mass the bond feels. Warn above 0.3 and refuse above
1.0: our choice, because in trials the master was stable up to about 1.5 in either and diverged at 2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from skillframe.cosim.plant import Float
from skillframe.errors import SkillframeError
from skillframe.fmu.actuator import Actuators

WARN, REFUSE = 0.3, 1.0
SPEED = 1e-3  # m/s, of the trial motion


class StepTooLarge(SkillframeError):
    """The step cannot be stable with this load. The sentence has the numbers and the step that would do."""


class Coupling(NamedTuple):
    """Numbers of every bond, (count,) each.

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
    """Try the actuators out at their present inputs with a slow push and pull. They are back afterwards.

    Args:
        bank: started; position inputs at the pose to be judged.
        mass: (count,) that each bond feels [kg].
        step: macro step [s].
        time: present time [s].

    Raises:
        SkillframeError: an actuator cannot be set back, or refuses the trial.
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
    """(force after moving for a step and stopping, force at once at that speed)."""
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
    """Refuse a step that cannot be stable. Warn about one that will be inaccurate.

    Raises:
        StepTooLarge: with the bond, its numbers, and a step that would do.
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
