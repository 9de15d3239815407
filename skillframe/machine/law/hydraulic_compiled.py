r"""The law of `hydraulic` with its memory, for N trials, in generated C.

`hydraulic_symbolic` writes one sample of it as casadi expressions from the very `pinocchio.Model`; `generated` makes C
of them and steps all trials in one call. The tests hold it against a law over arrays, trial by trial.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skillframe.frames import Float
from skillframe.machine.law.generated import Batch
from skillframe.machine.law.hydraulic import Demand, HydraulicGains, Measured, Reference, Terms, plane_axes
from skillframe.machine.law.hydraulic_symbolic import cylinder_table, functions
from skillframe.machine.law.vdc_actuator import Cylinders, friction_parameters
from skillframe.machine.law.vdc_adaptation import relative_bounds
from skillframe.machine.law.vdc_body import parameters
from skillframe.robot.chain import ClosedChain

_SHARED = tuple(range(21, 27))  # inputs of the law that are one for all: bounds of friction, cylinders, gains, scalars


class CompiledLaw:
    """The law with its memory, for N trials.

    Args:
        chain: the controller's model.
        cylinders: as the controller knows them.
        gains: see `HydraulicGains`.
        count: number of trials N.
        dt: sample time [s].
        use_compiler: False runs the same expressions in casadi's interpreter.
        seen: arrays (N, n) of coordinates and rates that `terms` reads where they are, such as those of the sensors.

    Attributes:
        at: the terms as of the last call of `terms`.
        given: what `step` goes by; who writes into these arrays and hands them over spares a copy.
        told: (N, B, 10) inertial parameters of every moving body, as `tell` said; the model's own to begin with.
        theta: (N, B, 10) the same as estimated.
        friction: (N, 2, k) estimated Coulomb [N] and viscous friction [N s/m]; write into it what is found otherwise.
        deadband, supply: (N, k) of the valves, share of their travel, and the pressure before them [Pa]; likewise.
        notes: a sentence where there is no compiler.
    """

    def __init__(
        self, chain: ClosedChain, cylinders: Cylinders, gains: HydraulicGains, count: int, dt: float, *,
        use_compiler: bool = True, seen: tuple[Float, Float] | None = None,
    ) -> None:  # fmt: skip
        self.chain, self.cylinders, self.gains = chain, cylinders, gains
        n, k, nominal = len(chain.independent), len(chain.driven), parameters(chain.model)
        zeros = np.zeros
        self._seen: tuple[Float, Float] = seen or (zeros((count, n)), zeros((count, n)))
        measured = Measured(zeros((count, n)), zeros((count, n)), *(zeros((count, m)) for m in (k, k, 2, 2)))
        reference = Reference(
            zeros((count, 2)), zeros((count, 2)), zeros((count, 2, 2)), zeros((count, 2, 2)), zeros((count, 2)),
            zeros((count, n - 2)), zeros((count, n - 2)), zeros((count, n)),
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
        self._bind(count, use_compiler)

    def _bind(self, count: int, use_compiler: bool) -> None:
        measured, reference = self.given
        n, k = measured.z.shape[1], measured.pressure_a.shape[1]
        self._demand = [Demand(*(np.zeros((count, k)) for _ in range(3))) for _ in range(2)]
        shapes = ((n, n), (n,), (n,), (2, n), (k, n), (k,), (k,), (2,), (2,))
        self.at = Terms(*(np.zeros((count, *shape)) for shape in shapes))
        axes, gains = plane_axes(self.chain), self.gains
        knowledge = (
            *self._bounds,
            *relative_bounds(friction_parameters(self.cylinders), gains.friction_share),
            cylinder_table(self.cylinders), np.array(gains.velocity), np.array(gains.force), self._scalars,
        )  # fmt: skip
        given = [part for part in reference if part is not None]
        self._told_of = (*measured, *given)
        own = [self.theta, self.friction, self._memory, self.deadband, self.supply]
        inputs = [*measured, *given, *own, *knowledge]
        law, terms = functions(self.chain, axes)
        after = [np.zeros_like(memory) for memory in own[:3]]
        carried = {law.n_out() - 3 + i: len(self._told_of) + i for i in range(3)}
        self._steps = [
            Batch(law, inputs, [*out, *after], _SHARED, carried=carried, use_compiler=use_compiler)
            for out in self._demand
        ]
        self._describe = Batch(terms, [*self._seen, self.told], list(self.at), use_compiler=use_compiler)
        self.notes = self._steps[0].notes
        self._everyone = np.arange(count)
        self._turn = 0

    def start(self) -> None:
        """Forget the past. The required force's filter begins at the first required force."""
        self._scalars[-1] = 1.0

    def tell(self, theta: Float) -> None:
        """Say what inertial parameters (N, B, 10) the machines have: terms, estimate and its bounds start from them."""
        self.told[:] = self.theta[:] = theta
        for own, bound in zip(self._bounds, relative_bounds(theta, self.gains.share), strict=True):
            own[:] = bound

    def adapt(self, on: bool) -> None:
        """Learn, as at first, or hold what was learned: in contact with stiff things learning rings (our trials)."""
        self._scalars[1:4] = (self.gains.adaptation, *self.gains.friction) if on else 0.0

    def terms(self, measured: Measured) -> Terms:
        """The model's terms where the machine is measured to be. The next call uses the arrays again."""
        for own, given in zip(self._seen, measured, strict=False):
            if own is not given:
                own[...] = given
        self._describe.run(self._everyone)
        return self.at

    def step(self, measured: Measured, reference: Reference, ids: NDArray[np.int64]) -> Demand:
        """A sample for the trials in `ids`, the other rows mean nothing. The call after next uses the arrays again."""
        if measured is not self.given[0] or reference is not self.given[1]:
            for own, given in zip(self._told_of, (*measured, *reference), strict=True):
                own[...] = 0.0 if given is None else given
        self._turn ^= 1
        self._steps[self._turn].run(ids)
        self._scalars[-1] = 0.0
        return self._demand[self._turn]
