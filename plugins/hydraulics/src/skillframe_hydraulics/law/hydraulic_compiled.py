r"""The controller of `hydraulic` with its memory, for N trials in generated C.

`hydraulic_symbolic` writes one sample as casadi expressions from the `pinocchio.Model`; `generated` compiles them.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.robot import CLOSED, ClosedChain, OutOfReach
from skillframe_hydraulics.law.generated import Batch
from skillframe_hydraulics.law.hydraulic import Demand, HydraulicGains, Measured, Reference, Terms, tool_axes
from skillframe_hydraulics.law.hydraulic_symbolic import cylinder_table, functions
from skillframe_hydraulics.law.vdc_actuator import Cylinders, friction_parameters
from skillframe_hydraulics.law.vdc_adaptation import relative_bounds
from skillframe_hydraulics.law.vdc_body import parameters


class Closing:
    """Closed configurations of N machines, each from the one of the sample before.

    Args:
        chain: the machine. function: its `closing_function`. z: live array (N, n) of minimal coordinates.
        use_compiler: False uses casadi's interpreter.

    Attributes:
        q: (N, nq), NaN where the loops cannot be closed.
    """

    def __init__(self, chain: ClosedChain, function: ca.Function, z: Float, *, use_compiler: bool = True) -> None:
        self._chain, self._z, self._gap = chain, z, np.zeros(len(z))
        self.q: Float = np.tile(chain.home, (len(z), 1))
        inputs, outputs = [z, self.q], [self.q.copy(), self._gap]
        self._near = Batch(function, inputs, outputs, carried={0: 1}, use_compiler=use_compiler)

    def run(self, ids: NDArray[np.int64]) -> None:
        """Close the given trials. Where two steps do not, because z has jumped, go the whole way from home."""
        self._near.run(ids)
        if self._gap.dot(self._gap) <= CLOSED**2:
            return
        for i in ids[~(self._gap[ids] <= CLOSED)]:
            try:
                self.q[i] = self._chain.configuration(self._z[i])
            except OutOfReach:
                self.q[i] = np.nan


class CompiledLaw:
    """The controller with its memory, for N trials.

    Args:
        chain: the controller's model.
        cylinders: nominal cylinders.
        gains: see `HydraulicGains`.
        count: N.
        dt: sample time [s].
        use_compiler: False uses casadi's interpreter.
        seen: arrays (N, n) of coordinates and rates that `terms` reads in place.

    Attributes:
        at: the last terms.
        given: inputs of `step`, which are not copied if passed to it.
        told: (N, B, 10) declared inertial parameters of the moving bodies.
        theta: (N, B, 10) estimated inertial parameters.
        friction: (N, 2, k) estimated Coulomb [N] and viscous friction [N s/m], writable.
        deadband, supply: (N, k) overlap, share of the travel, and supply pressure [Pa], writable.
        notes: a sentence if there is no compiler.
    """

    def __init__(
        self, chain: ClosedChain, cylinders: Cylinders, gains: HydraulicGains, count: int, dt: float, *,
        use_compiler: bool = True, seen: tuple[Float, Float] | None = None,
    ) -> None:  # fmt: skip
        self.chain, self.cylinders, self.gains = chain, cylinders, gains
        n, k, nominal = len(chain.independent), len(chain.driven), parameters(chain.model)
        axes, zeros = tool_axes(chain), np.zeros
        m = len(axes)
        self._seen: tuple[Float, Float] = seen or (zeros((count, n)), zeros((count, n)))
        measured = Measured(zeros((count, n)), zeros((count, n)), *(zeros((count, size)) for size in (k, k, m, m)))
        reference = Reference(
            zeros((count, m)), zeros((count, m)), zeros((count, m, m)), zeros((count, m, m)), zeros((count, m)),
            zeros((count, n - m)), zeros((count, n - m)), zeros((count, n)),
        )  # fmt: skip
        self.given: tuple[Measured, Reference] = measured, reference
        self.told, self.theta = (np.tile(nominal, (count, 1, 1)) for _ in range(2))
        self._bounds = relative_bounds(self.told, gains.share)
        self.friction = np.tile(friction_parameters(cylinders), (count, 1, 1))
        self._memory = zeros((count, 3, k))
        self.deadband: Float = np.tile(cylinders.deadband, (count, 1))
        self.supply: Float = np.tile(cylinders.supply_pressure, (count, 1))
        contact = (gains.contact.force, gains.contact.sliding)
        self._scalars = np.array(
            [gains.body, gains.adaptation, *gains.friction, gains.joint, gains.force_corner, *contact, dt, 1.0]
        )  # fmt: skip
        self._demand = [Demand(*(zeros((count, k)) for _ in range(3))) for _ in range(2)]
        shapes = ((n, n), (n,), (n,), (m, n), (k, n), (k,), (k,), (m,), (m,), (n,))
        self.at = Terms(*(zeros((count, *shape)) for shape in shapes))
        knowledge = (
            *self._bounds,
            *relative_bounds(friction_parameters(cylinders), gains.friction_share),
            cylinder_table(cylinders), np.array(gains.velocity), np.array(gains.force), self._scalars,
        )  # fmt: skip
        given = [part for part in reference if part is not None]
        self._told_of = (*measured, *given)
        law, terms, closing = functions(chain, axes)
        seen_q, ahead = (
            Closing(chain, closing, z, use_compiler=use_compiler) for z in (self._seen[0], measured.z)
        )  # fmt: skip
        self._closings = seen_q, ahead
        own = [self.theta, self.friction, self._memory, self.deadband, self.supply]
        inputs = [ahead.q, *measured[1:], *given, *own, *knowledge]
        after = [np.zeros_like(memory) for memory in own[:3]]
        carried = {law.n_out() - 3 + i: len(self._told_of) + i for i in range(3)}
        shared = range(21, 27)  # common to all trials: bounds of friction, cylinders, gains, scalars
        self._steps = [
            Batch(law, inputs, [*out, *after], shared, carried=carried, use_compiler=use_compiler)
            for out in self._demand
        ]
        self._describe = Batch(terms, [seen_q.q, self._seen[1], self.told], list(self.at), use_compiler=use_compiler)
        self.notes = self._steps[0].notes
        self._everyone = np.arange(count)
        self._turn = 0

    def start(self) -> None:
        """Reset. The required force's filter starts at the first required force."""
        self._scalars[-1] = 1.0

    def tell(self, theta: Float) -> None:
        """Set inertial parameters (N, B, 10) of the machines, the start of terms, estimate and bounds."""
        self.told[:] = self.theta[:] = theta
        for own, bound in zip(self._bounds, relative_bounds(theta, self.gains.share), strict=True):
            own[:] = bound

    def adapt(self, on: bool) -> None:
        """Switch adaptation on, or off for contact with stiff surfaces, where it rings."""
        self._scalars[1:4] = (self.gains.adaptation, *self.gains.friction) if on else 0.0

    def terms(self, measured: Measured) -> Terms:
        """The model's terms at the measurement, in arrays reused by the next call."""
        for own, given in zip(self._seen, measured, strict=False):
            if own is not given:
                own[...] = given
        self._closings[0].run(self._everyone)
        self._describe.run(self._everyone)
        return self.at

    def step(self, measured: Measured, reference: Reference, ids: NDArray[np.int64]) -> Demand:
        """A sample for the trials in `ids`, in arrays reused by the call after next."""
        if measured is not self.given[0] or reference is not self.given[1]:
            for own, given in zip(self._told_of, (*measured, *reference), strict=True):
                own[...] = 0.0 if given is None else given
        self._closings[1].run(ids)
        self._turn ^= 1
        self._steps[self._turn].run(ids)
        self._scalars[-1] = 0.0
        return self._demand[self._turn]
