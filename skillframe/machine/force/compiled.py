"""The force estimate with its memory, for N trials, in generated C: two calls a sample for all trials.

`momentum` says what is estimated, and `symbolic` writes a sample of it as expressions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from skillframe.frames import Float
from skillframe.machine.force.identification import Identification
from skillframe.machine.force.momentum import Estimate, ForceSettings, force_gain, joint_force
from skillframe.machine.force.symbolic import look_function, weigh_function
from skillframe.machine.law.generated import Batch

if TYPE_CHECKING:
    from skillframe.machine.law.hydraulic import Measured, Terms
    from skillframe.machine.law.vdc_actuator import Cylinders
    from skillframe.robot.chain import ClosedChain


class CompiledEstimator:
    """Estimates online, identifies in air when told to, and holds what it found.

    Arrays that it returns are used again by the next call.

    Args:
        chain: the controller's model of the machine; gives the payload's gravity.
        cylinders: what the controller knows of them.
        count: number of trials N.
        dt: sample time [s].
        settings: see `ForceSettings`.
        use_compiler: False runs the same expressions in casadi's interpreter.
        reads: the very arrays that `step` will be given every time, which are then read where they are.

    Attributes:
        identification: theta, its standard deviation, and how many rows it has seen.
        raw: (N, 2) the force before its Kalman filter [N].
        residual: (N, n) what is left for J^T f [Nm or N].
        regressors: (N, n, 2k + 1) phi, to be read and not kept.
        estimate: the last one.
        calibrating: whether the tool is said to be in air.
        notes: a sentence where there is no compiler.

    Raises:
        SkillframeError: a filter's corner is too high for the sample time.
    """

    def __init__(
        self, chain: ClosedChain, cylinders: Cylinders, count: int, dt: float, settings: ForceSettings | None = None,
        *, use_compiler: bool = True, reads: tuple[Measured, Terms] | None = None,
    ) -> None:  # fmt: skip
        self.settings = s = settings or ForceSettings()
        self._chain, self._cylinders, zeros = chain, cylinders, np.zeros
        n, k = len(s.row_noise), len(cylinders.area_a)
        self.identification = Identification(count, k, s.identify)
        self._noise: Float = np.square(np.array(s.row_noise))
        self._every, self._tick, self.calibrating = max(1, round(s.identify.period / dt)), 0, False
        self.raw, self.residual = zeros((count, 2)), zeros((count, n))
        shapes = ((n,), (k,), (k,), (n, n), (n,), (n,), (2, n), (k, n), (k,))
        self._reads = reads
        self._given = _looked_at(*reads) if reads else tuple(zeros((count, *shape)) for shape in shapes)
        self._load, self._fresh = zeros((count, n)), np.ones(1)
        look = look_function(cylinders, s, n, dt)
        weigh = weigh_function(s, n, k, force_gain(s.feedback_corner, dt), dt)
        self._memory = [zeros((count, int(f.numel_out(f.n_out() - 1)))) for f in (look, weigh)]
        self._seen = [zeros((count, *shape)) for shape in ((n,), (2, n), (n, 2 * k + 1), (k,), (n,))]
        residual, jacobian, phi, level, variance = self._seen
        self._theta, told = zeros((count, 2 * k + 1)), [zeros((count, 2)) for _ in range(4)]
        force, sigma, feedback, answered = told
        self.estimate = Estimate(force, sigma, level, feedback, answered)

        def batch(function: ca.Function, inputs: list[Float], memory: Float, outputs: list[Float]) -> Batch:
            last, carried = len(inputs) + 1, {function.n_out() - 1: len(inputs)}
            arrays = [*inputs, memory, self._fresh], [*outputs, memory.copy()]
            return Batch(function, *arrays, (last,), carried=carried, use_compiler=use_compiler)

        self._look = batch(look, [*self._given, self._load], self._memory[0], self._seen)
        weighed = [residual, jacobian, phi, variance, self._theta]
        self._weigh = batch(weigh, weighed, self._memory[1], [self.residual, self.raw, *told])
        self.regressors, self._everyone, self.notes = phi, np.arange(count), self._look.notes

    def calibrate(self, on: bool) -> None:
        """Say that the tool is in air (True), or that it may touch from now on (False): an explicit step of a task.

        Turning it on begins the identification anew.
        """
        if on and not self.calibrating:
            self.identification.start()
        self.calibrating = on

    def start(self, measured: Measured) -> None:
        """Begin at a measurement, the machine at rest."""
        self._load[:] = self._chain.load_gravity(measured.z)
        for memory in self._memory:
            memory[:] = 0.0
        self._tick, self._fresh[0], self._rate = 0, 1.0, self._memory[0][:, : len(self._cylinders.area_a)]

    def step(self, measured: Measured, terms: Terms) -> Estimate:
        """One estimate from one measurement and the model's terms there."""
        due = self._tick % self._every == 0
        if due:
            self._load[:] = self._chain.load_gravity(measured.z)
        if self._reads is None:
            for own, value in zip(self._given, _looked_at(measured, terms), strict=True):
                own[...] = value
        self._look.run(self._everyone)
        if self.calibrating and due:
            residual, _, phi, sliding, _ = self._seen
            rows = joint_force(np.abs(terms.arms), np.where(sliding > 0.0, 0.0, 1.0)) == 0.0
            self.identification.update(phi, residual, self._noise, rows)
        self._theta[...] = self.identification.theta
        self._weigh.run(self._everyone)
        self._fresh[0] = 0.0
        self._tick += 1
        return self.estimate

    def friction(self, terms: Terms) -> Float:
        """(N, k) of every cylinder as it is known now, nominal and what was identified [N]."""
        c, found = self._cylinders, self.identification
        shape = np.tanh(self._rate / self.settings.sliding_speed)
        coulomb: Float = (c.coulomb_friction + found.coulomb) * shape
        return coulomb + (c.viscous_friction + found.viscous) * terms.piston_rate


def _looked_at(measured: Measured, terms: Terms) -> tuple[Float, ...]:
    """What `look_function` takes of a sample, in its order."""
    _, rate, pressure_a, pressure_b, _, _ = measured
    mass, drift, gravity, jacobian, arms, _, piston_rate, _, _ = terms
    return rate, pressure_a, pressure_b, mass, drift, gravity, jacobian, arms, piston_rate
