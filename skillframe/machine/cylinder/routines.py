"""`macro_step` for a bank of cylinders: by numpy, or as casadi functions in casadi's own machine, without a compiler.

Both are made of the same equations and agree to rounding. A numpy call costs a microsecond whatever it does, an
operation of an expression some nanoseconds: casadi was 25 times faster for three cylinders and still twice for 96, so
it runs at every size, which also gives a cylinder the same bits in every batch. Numpy is for comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from types import SimpleNamespace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from skillframe.fmu.actuator import Float
from skillframe.machine.cylinder import equations as eq
from skillframe.machine.cylinder.macro_step import GIVEN, MEMORY, RESULT, SHOWN, STAGE, begin, finish, show, substep

Run = Callable[[], None]
_MODEL = {"begin": begin, "substep": substep, "finish": finish, "show": show}
_SIZES = {"begin": (len(eq.STATES), len(STAGE)), "substep": (len(STAGE),) * 2, "finish": (len(STAGE), len(RESULT)),
          "show": (len(eq.STATES), len(SHOWN))}  # fmt: skip


class Routines:
    """A bank's arrays, a row per cylinder, and what can be done with them.

    Args:
        p: parameters of `count` cylinders, from `equations.derive`.
        symbolic: False computes in numpy.

    Attributes:
        p: as given.
        state, memory, given: (count, ...) in, to be written by the caller.
        result, shown: (count, ...) out.
    """

    def __init__(self, p: SimpleNamespace, count: int, symbolic: bool = True) -> None:
        self.state, self.memory, self.given = (np.zeros((count, len(n))) for n in (eq.STATES, MEMORY, GIVEN))
        self.result, self.shown = np.zeros((count, len(RESULT))), np.zeros((count, len(SHOWN)))
        self._stages = [np.zeros((count, len(STAGE))) for _ in range(2)]
        self.p, self._bind = p, self._in_casadi(p, count) if symbolic else self._in_numpy
        one, two = self._stages
        self._begin, self.show = self._bind("begin", self.state, one), self._bind("show", self.state, self.shown)
        self._substeps = [self._bind("substep", one, two), self._bind("substep", two, one)]
        self._finish = [self._bind("finish", stage, self.result) for stage in self._stages]

    def step(self, active: NDArray[np.uint8]) -> None:
        """From `state`, `memory` and `given` to `result`. Cylinders that are not active do not slow others down."""
        with np.errstate(all="ignore"):
            self._begin()
            count = int((self._stages[0][:, STAGE.index("count")] * active).max(initial=0.0))
            for turn in range(count):
                self._substeps[turn % 2]()
            self._finish[count % 2]()

    def _in_numpy(self, name: str, given: Float, result: Float) -> Run:
        function = _MODEL[name]

        def run() -> None:
            with np.errstate(all="ignore"):
                result[...] = function(self.p, given.T, self.memory.T, self.given.T).T

        return run

    def _in_casadi(self, p: SimpleNamespace, count: int) -> Callable[[str, Float, Float], Run]:
        names = tuple(name for name, value in vars(p).items() if not isinstance(value, bool))
        flags = tuple((name, value) for name, value in vars(p).items() if isinstance(value, bool))
        table = np.zeros((count, len(names)))
        table.T[:] = [np.broadcast_to(getattr(p, name), (count,)) for name in names]

        def bind(name: str, given: Float, result: Float) -> Run:
            buffer, run = mapped(name, names, flags, count).buffer()
            for i, array in enumerate((table, given, self.memory, self.given)):
                buffer.set_arg(i, array.data)
            buffer.set_res(0, result.data)
            self._keep.append((buffer, table))
            call: Run = run
            return call

        self._keep: list[tuple[object, Float]] = []
        return bind


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
