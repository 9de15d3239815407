r"""`ForceEstimator` in generated C: the same inputs, outputs and numbers, in two calls a sample for all trials.

Read `conditioning.momentum` to understand the estimate, use this to run it; `force_symbolic` writes it as expressions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from skillframe.machine.force.momentum import Estimate, ForceEstimator, ForceSettings, force_gain, pull
from skillframe.machine.force.symbolic import look_function, weigh_function
from skillframe.machine.law.generated import Batch

if TYPE_CHECKING:
    from skillframe.machine.law.hydraulic import Measured, Terms
    from skillframe.machine.law.vdc_actuator import Cylinders
    from skillframe.robot.chain import ClosedChain


class CompiledEstimator(ForceEstimator):
    """As `ForceEstimator`, for moment arms (N, k, n); arrays that it returns are used again by the next call.

    Args:
        chain: the controller's model of the machine; gives the payload's gravity.
        cylinders: what the controller knows of them.
        count: number of trials N.
        dt: sample time [s].
        settings: see `ForceSettings`.
        use_compiler: False runs the same expressions in casadi's interpreter.
    """

    def __init__(
        self, chain: ClosedChain, cylinders: Cylinders, count: int, dt: float, settings: ForceSettings | None = None,
        *, use_compiler: bool = True,
    ) -> None:  # fmt: skip
        super().__init__(chain, cylinders, count, dt, settings)
        n, k = len(self.settings.row_noise), len(cylinders.area_a)
        zeros, s = np.zeros, self.settings
        shapes = ((n,), (k,), (k,), (n, n), (n,), (n,), (2, n), (k, n), (k,))
        self._given = [zeros((count, *shape)) for shape in shapes]
        self._load, self._fresh = zeros((count, n)), np.ones(1)
        look = look_function(cylinders, s, n, dt)
        weigh = weigh_function(s, n, k, force_gain(s.feedback_corner, dt), dt)
        self._memory = [zeros((count, int(f.numel_out(f.n_out() - 1)))) for f in (look, weigh)]
        self._next = [memory.copy() for memory in self._memory]
        self._seen = [zeros((count, *shape)) for shape in ((n,), (2, n), (n, 2 * k + 1), (k,), (n,))]
        residual, jacobian, phi, _, variance = self._seen
        self._theta = zeros((count, 2 * k + 1))
        self._told = [self.residual, self.raw, *(zeros((count, 2)) for _ in range(4))]
        inputs = [*self._given, self._load, self._memory[0], self._fresh]
        self._look = Batch(
            look, inputs, [*self._seen, self._next[0]], (len(inputs) - 1,), use_compiler=use_compiler
        )  # fmt: skip
        inputs = [residual, jacobian, phi, variance, self._theta, self._memory[1], self._fresh]
        self._weigh = Batch(
            weigh, inputs, [*self._told, self._next[1]], (len(inputs) - 1,), use_compiler=use_compiler
        )  # fmt: skip
        self.regressors, self._everyone, self.notes = phi, np.arange(count), self._look.notes

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
        values = (
            measured.rate, measured.pressure_a, measured.pressure_b, terms.mass, terms.drift, terms.gravity,
            terms.jacobian, terms.arms, terms.piston_rate,
        )  # fmt: skip
        for own, value in zip(self._given, values, strict=True):
            own[...] = value
        self._look(self._everyone)
        residual, _, phi, sliding, _ = self._seen
        if self.calibrating and due:
            rows = pull(np.abs(terms.arms), np.where(sliding > 0.0, 0.0, 1.0)) == 0.0
            self.identification.update(phi, residual, self._noise, rows)
        self._theta[...] = self.identification.theta
        self._weigh(self._everyone)
        for memory, after in zip(self._memory, self._next, strict=True):
            memory[...] = after
        self._fresh[0] = 0.0
        self._tick += 1
        _, _, force, sigma, feedback, answered = self._told
        return Estimate(force, sigma, (sliding > 1.0).sum(axis=-1) >= 2, feedback, answered)
