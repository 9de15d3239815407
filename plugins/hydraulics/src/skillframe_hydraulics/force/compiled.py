"""The force estimate of N trials with its memory, in generated C: two calls per sample for all trials.

`momentum` has the equations, `symbolic` their expressions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from skillframe.frames import Float
from skillframe_hydraulics.force.identification import Identification
from skillframe_hydraulics.force.momentum import Estimate, ForceSettings, force_gain
from skillframe_hydraulics.force.symbolic import look_function, weigh_function
from skillframe_hydraulics.law.generated import Batch
from skillframe_hydraulics.law.hydraulic import tool_axes

if TYPE_CHECKING:
    from skillframe.robot import ClosedChain
    from skillframe_hydraulics.law.hydraulic import Measured, Terms
    from skillframe_hydraulics.law.vdc_actuator import Cylinders


class CompiledEstimator:
    """Estimates the force, and identifies friction and payload in air.

    Returned arrays are reused by the next call.

    Args:
        chain: the controller's model of the machine.
        cylinders: nominal cylinders.
        count: number of trials N.
        dt: sample time [s].
        settings: see `ForceSettings`.
        use_compiler: False uses casadi's interpreter.
        reads: the arrays given to every `step`, if always the same; they are then read in place.

    Attributes:
        identification: theta, its standard deviation, and the number of rows.
        raw: (N, m) the force before its Kalman filter [N].
        residual: (N, n) J^T f [Nm or N].
        regressors: (N, n, 2k + 1) phi, a view.
        estimate: the last one.
        calibrating: whether the tool is in air.
        notes: a sentence if there is no compiler.

    Raises:
        SkillframeError: a filter's corner is too high for the sample time.
    """

    def __init__(
        self, chain: ClosedChain, cylinders: Cylinders, count: int, dt: float, settings: ForceSettings | None = None,
        *, use_compiler: bool = True, reads: tuple[Measured, Terms] | None = None,
    ) -> None:  # fmt: skip
        self.settings = s = settings or ForceSettings()
        self._cylinders, zeros = cylinders, np.zeros
        n, k, m = len(s.row_noise), len(cylinders.area_a), len(tool_axes(chain))
        self.identification = Identification(count, k, s.identify)
        self._noise: Float = np.square(np.array(s.row_noise))
        self._every, self._tick, self.calibrating = max(1, round(s.identify.period / dt)), 0, False
        self.raw, self.residual = zeros((count, m)), zeros((count, n))
        shapes = ((n,), (k,), (k,), (n, n), (n,), (n,), (m, n), (k, n), (k,))
        self._reads = reads
        self._given = _looked_at(*reads) if reads else tuple(zeros((count, *shape)) for shape in shapes)
        self._load, self._fresh = zeros((count, n)), np.ones(1)
        look = look_function(cylinders, s, n, m, dt)
        weigh = weigh_function(s, n, k, force_gain(s.feedback_corner, dt, m), dt)
        self._memory = [zeros((count, int(f.numel_out(f.n_out() - 1)))) for f in (look, weigh)]
        self._seen = [zeros((count, *shape)) for shape in ((n,), (m, n), (n, 2 * k + 1), (n,), (n,))]
        residual, jacobian, phi, level, variance = self._seen
        self._theta, told = zeros((count, 2 * k + 1)), [zeros((count, m)) for _ in range(4)]
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
        """Start (True) or end (False) the phase in air. Starting resets the identification."""
        if on and not self.calibrating:
            self.identification.start()
        self.calibrating = on

    def start(self) -> None:
        """Reset, with the machine at rest."""
        for memory in self._memory:
            memory[:] = 0.0
        self._tick, self._fresh[0], self._rate = 0, 1.0, self._memory[0][:, : len(self._cylinders.area_a)]

    def step(self, measured: Measured, terms: Terms) -> Estimate:
        """One estimate from a measurement and the model's terms."""
        due = self._tick % self._every == 0
        if due:
            self._load[:] = terms.load
        if self._reads is None:
            for own, value in zip(self._given, _looked_at(measured, terms), strict=True):
                own[...] = value
        self._look.run(self._everyone)
        if self.calibrating and due:
            residual, _, phi, level, _ = self._seen
            self.identification.update(phi, residual, self._noise, level > 0.0)
        self._theta[...] = self.identification.theta
        self._weigh.run(self._everyone)
        self._fresh[0] = 0.0
        self._tick += 1
        return self.estimate

    def friction(self, terms: Terms) -> Float:
        """Current friction of the cylinders (N, k) [N], nominal plus identified."""
        c, found = self._cylinders, self.identification
        shape = np.tanh(self._rate / self.settings.sliding_speed)
        coulomb: Float = (c.coulomb_friction + found.coulomb) * shape
        return coulomb + (c.viscous_friction + found.viscous) * terms.piston_rate


def _looked_at(measured: Measured, terms: Terms) -> tuple[Float, ...]:
    _, rate, pressure_a, pressure_b, _, _ = measured
    mass, drift, gravity, jacobian, arms, _, piston_rate, _, _, _ = terms
    return rate, pressure_a, pressure_b, mass, drift, gravity, jacobian, arms, piston_rate
