r"""Gauss-Seidel master: first the actuators, then the mechanics under a force linear to the new one.

A macro step H with the last force F_k, of second order in H:
1. the plant's motion x, v, a under F_k;
2. every actuator steps along x + v s + a s^2/2 and gives F_{k+1} and its work;
3. the plant advances under the force from F_k to F_{k+1};
4. actuators whose outputs follow inputs get the true x and v, which corrects F_{k+1} (friction).
Actuators without acceleration input take `plain_substeps` at mean velocities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.cosim.energy_balance import BondLedger, Float, Mechanics, Motion, bond_work, relative_residual
from skillframe.cosim.exchange import compiled_exchange
from skillframe.errors import SkillframeError
from skillframe.fmu.actuator import Actuators


@dataclass(frozen=True, slots=True, kw_only=True)
class CosimSettings:
    """Settings of the master.

    Attributes:
        step: macro step H [s].
        plant_substeps: steps of the plant in H, under the interpolated force.
        actuator_substeps: steps of actuators in H, along the same parabola.
        plain_substeps: the same for actuators that take no acceleration.
        tolerance_j: halve a step whose bond error exceeds this energy [J]; None keeps H. One trial at a time.
        least_step: below it, a failing step ends the trial [s].
        residual_limit: relative bond residual that `trouble` reports.
    """

    step: float = 1e-3
    plant_substeps: int = 1
    actuator_substeps: int = 1
    plain_substeps: int = 4
    tolerance_j: float | None = None
    least_step: float = 1e-5
    residual_limit: float = 1e-2


class Master:
    """Couples a plant and a bank of actuators.

    Attributes:
        time: now [s]; force: (count,) on the bonds [N]; steps: macro steps taken.

    Raises:
        SkillframeError: bonds do not match, or halving is impossible.
    """

    def __init__(self, plant: Mechanics, bank: Actuators, settings: CosimSettings | None = None) -> None:
        self.plant, self.bank, self.settings = plant, bank, settings or CosimSettings()
        if plant.count != bank.count:
            raise SkillframeError(
                f"the plant has {plant.count} bonds and there are {bank.count} actuators; make them equal"
            )
        capable = [bank.capabilities(i) for i in range(bank.count)]
        self.rollback = all(c.rollback for c in capable)
        self._takes_acceleration = all(c.acceleration for c in capable)
        self._plain = self._takes_acceleration and self.settings.actuator_substeps == 1
        self._refresh = all(c.refresh for c in capable)
        self._gives_work = np.array([c.work for c in capable])
        self._all_give_work = bool(self._gives_work.all())
        self._where = getattr(plant, "where", None)
        self._column = {name: bank.inputs.index(name) for name in ("command", "position", "velocity", "acceleration")}
        self._shown = [bank.u[:, self._column[name]] for name in ("position", "velocity", "acceleration")]
        self._force, self._work = bank.outputs.index("force"), bank.outputs.index("work")
        if self.settings.tolerance_j is not None and not self.rollback:
            raise SkillframeError("step halving needs actuators whose state can be restored; leave tolerance_j out")
        self.time, self.steps = 0.0, 0
        self.force = np.zeros(bank.count)
        self._ledger = BondLedger(bank.count)
        s = self.settings
        usual = self._plain and self._all_give_work and self._refresh and s.plant_substeps == 1
        if not usual or s.tolerance_j is not None:
            self._native = None
        else:
            self._native = compiled_exchange(self.plant, self.bank, self._ledger, self.force, s.step)

    @property
    def difference(self) -> Float:
        """(count,) work of the plant minus work of the actuator [J]."""
        lost: Float = self._ledger.sums()[0].copy()
        return lost

    @property
    def exchanged(self) -> Float:
        """(count,) sum of |work| [J]."""
        passed: Float = self._ledger.sums()[1].copy()
        return passed

    def start(
        self,
        time: float = 0.0,
        command: Float | float = 0.0,
        parameters: Sequence[Mapping[str, Any]] | None = None,
    ) -> None:
        """Start the bank at the plant's motion and at `time` [s], with its forces acting from then on."""
        motion = self.plant.motion(np.zeros(self.bank.count))
        self._show(motion.position, motion.velocity, 0.0)
        self.bank.u[:, self._column["command"]] = command
        self.bank.start(time, parameters)
        self.time, self.steps = time, 0
        self.force[:] = self.bank.y[:, self._force]
        self._ledger.start()

    def step(self, command: Float | float) -> bool:
        """Do a macro step under a command (count,). Returns False if an actuator failed (see `trouble`)."""
        self.bank.u[:, self._column["command"]] = command
        if self.settings.tolerance_j is None:
            return self._exchange(self.settings.step)
        whole, level, done = self.settings.step, 0, 0.0
        deepest = max(0, int(np.floor(np.log2(whole / self.settings.least_step))))
        begin = self.time
        while done < 1.0:
            part = 0.5**level
            self.plant.save()
            self.bank.save()
            self._kept = (self.time, self.steps, self.force.copy(), self._ledger.sums().copy())
            fine = self._exchange(whole * part)
            if (not fine or self.mismatch.max() > self.settings.tolerance_j) and level < deepest:
                self.plant.restore()
                self.bank.restore()
                self.time, self.steps, self.force, sums = self._kept
                self._ledger.restore(sums)
                level += 1
                continue
            if not fine:
                return False
            done += part
            self.time = begin + done * whole
            if level and self.mismatch.max() < self.settings.tolerance_j / 16 and (done / (2 * part)).is_integer():
                level -= 1
        return True

    def _show(self, position: Float, velocity: Float, acceleration: Float | float | None) -> None:
        at_position, at_velocity, at_acceleration = self._shown
        at_position[:], at_velocity[:] = position, velocity
        if acceleration is not None:
            at_acceleration[:] = acceleration

    def _exchange(self, step: float) -> bool:
        if self._native is not None:
            fine = self._native.step(self.time, step)
            self.time += step
            self.steps += 1
            return fine
        begin = self.plant.motion(self.force)
        fine, given = self._actuate(begin, step)
        after = self._felt(self.force)
        parts = self.settings.plant_substeps
        if parts == 1:
            self.plant.advance(self.force, after, step)
        for j in range(parts if parts > 1 else 0):
            from_, to = (self.force + share * (after - self.force) for share in (j / parts, (j + 1) / parts))
            self.plant.advance(from_, to, step / parts)
        if self._where is None:
            x, v, a = self.plant.motion(after)
        else:
            (x, v), a = self._where(), begin.acceleration
        if self.settings.tolerance_j is not None:
            self.mismatch: Float = np.abs(after * (v - begin.velocity - begin.acceleration * step)) * step
        self._ledger.add((self.force, after), (begin.position, x), (begin.velocity, v), given, step)
        self.force = after
        if self._refresh:
            self._show(x, v, a if self._where is None else None)
            fine = self.bank.refresh() and fine
            self.force = self._felt(after)
        self.time += step
        self.steps += 1
        return fine

    def _felt(self, before: Float) -> Float:
        force = self.bank.y[:, self._force]
        ended = 0 in self.bank.active.tobytes()
        return np.where(self.bank.active > 0, force, before) if ended else force.copy()

    def _actuate(self, begin: Motion, step: float) -> tuple[bool, Float]:
        x, v, a = begin
        if self._plain and self._all_give_work:
            self._show(x, v, a)
            return self.bank.step(self.time, step), self.bank.y[:, self._work].copy()
        count = self.settings.actuator_substeps if self._takes_acceleration else self.settings.plain_substeps
        part, fine, given = step / count, True, np.zeros(self.bank.count)
        for j in range(count):
            s = j * part
            speed = v + a * s if self._takes_acceleration else v + a * (s + 0.5 * part)
            self._show(x + s * (v + 0.5 * a * s), speed, a)
            fine = self.bank.step(self.time + s, part) and fine
            given += self.bank.y[:, self._work]
        if self._all_give_work:
            return fine, given
        path = step * (v + 0.5 * a * step)
        assumed = bond_work(self.force, self.bank.y[:, self._force], path, v, v + a * step, step)
        return fine, np.where(self._gives_work, given, assumed)

    @property
    def residual(self) -> Float:
        """(count,) relative energy error of the coupling."""
        return relative_residual(self.difference, self.exchanged)

    def trouble(self) -> dict[int, str]:
        """Message by bond for failures and high residuals."""
        found = {i: text for i in range(self.bank.count) if (text := self.bank.problem(i))}
        high: NDArray[np.int64] = np.flatnonzero(self.residual > self.settings.residual_limit)
        for i in high:
            text = (
                f"bond {i}: the coupling has made or lost {self.residual[i]:.2g} of the energy it passed on, above"
                f" {self.settings.residual_limit:g}; take a smaller step"
            )
            found.setdefault(int(i), text)
        return found
