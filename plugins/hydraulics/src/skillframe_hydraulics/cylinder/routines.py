"""`macro_step` for a bank of cylinders, as casadi functions in casadi's interpreter, or in numpy for comparison.

Both agree to rounding. casadi is faster at every size, because a numpy call has a fixed cost of a microsecond; using it
always gives a cylinder the same bits in every batch.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from types import SimpleNamespace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from skillframe.fmu import Float
from skillframe_hydraulics.cylinder import equations as eq
from skillframe_hydraulics.cylinder.macro_step import GIVEN, MEMORY, RESULT, SHOWN, STAGE, begin, finish, show, substep

Run = Callable[[], None]
_MODEL = {"begin": begin, "substep": substep, "finish": finish, "show": show}
_SIZES = {"begin": (len(eq.STATES), len(STAGE)), "substep": (len(STAGE),) * 2, "finish": (len(STAGE), len(RESULT)),
          "show": (len(eq.STATES), len(SHOWN))}  # fmt: skip


class Routines:
    """Arrays of a bank, a row per cylinder, and their operations.

    Attributes:
        p: parameters of the cylinders, from `equations.derive`.
        state, memory, given: (count, ...) inputs, written by the caller.
        result, shown: (count, ...) outputs.
    """

    def __init__(self, p: SimpleNamespace, count: int, symbolic: bool = True) -> None:
        self.state, self.memory, self.given = (np.zeros((count, len(n))) for n in (eq.STATES, MEMORY, GIVEN))
        self.result, self.shown = np.zeros((count, len(RESULT))), np.zeros((count, len(SHOWN)))
        self._stages = [np.zeros((count, len(STAGE))) for _ in range(2)]
        self.p, self._keep = p, list[object]()
        if symbolic:
            self._names = tuple(name for name, value in vars(p).items() if not isinstance(value, bool))
            self._flags = tuple((name, value) for name, value in vars(p).items() if isinstance(value, bool))
            self._table = np.zeros((count, len(self._names)))
            self._table.T[:] = [np.broadcast_to(getattr(p, name), (count,)) for name in self._names]
        self._symbolic = symbolic
        one, two = self._stages
        self._begin, self.show = self._bind("begin", self.state, one), self._bind("show", self.state, self.shown)
        self._substeps = [self._bind("substep", one, two), self._bind("substep", two, one)]
        self._finish = [self._bind("finish", stage, self.result) for stage in self._stages]

    def step(self, active: NDArray[np.uint8]) -> None:
        """Compute `result` from `state`, `memory` and `given`. Inactive cylinders add no internal steps."""
        with np.errstate(all="ignore"):
            self._begin()
            count = int((self._stages[0][:, STAGE.index("count")] * active).max(initial=0.0))
            for turn in range(count):
                self._substeps[turn % 2]()
            self._finish[count % 2]()

    def _bind(self, name: str, given: Float, result: Float) -> Run:
        """A function of the model that reads and writes these arrays, in casadi or in numpy."""
        if not self._symbolic:
            function = _MODEL[name]

            def run() -> None:
                with np.errstate(all="ignore"):
                    result[...] = function(self.p, given.T, self.memory.T, self.given.T).T

            return run
        buffer, evaluate = mapped(name, self._names, self._flags, len(given)).buffer()
        for i, array in enumerate((self._table, given, self.memory, self.given)):
            buffer.set_arg(i, array.data)
        buffer.set_res(0, result.data)
        self._keep.append(buffer)
        call: Run = evaluate
        return call


@lru_cache(maxsize=64)
def mapped(name: str, names: tuple[str, ...], flags: tuple[tuple[str, bool], ...], count: int) -> ca.Function:
    """A function of `macro_step` for `count` cylinders: parameters, state or stage, memory, given."""
    before, after = _SIZES[name]
    table = ca.SX.sym("p", len(names))
    vectors = [ca.SX.sym(what, size) for what, size in (("y", before), ("m", len(MEMORY)), ("g", len(GIVEN)))]
    p = SimpleNamespace(**{key: table[i] for i, key in enumerate(names)}, **dict(flags))
    result = _MODEL[name](p, *vectors)
    assert result.numel() == after
    single = ca.Function(name, [table, *vectors], [ca.densify(result)], {"cse": True})
    return single if count == 1 else single.map(count, "serial")
