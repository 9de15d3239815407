r"""Batch evaluation of a casadi function of one trial on rows of numpy arrays.

With a C compiler the function and a loop over trials are compiled into a cache by the hash of the text; otherwise
casadi's interpreter runs it trial by trial. Both agree to rounding and do not allocate. Generated code has no state.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from skillframe.fmu import build_library
from skillframe.frames import Float

NOTE = "no C compiler: the control law runs in casadi's interpreter, some 5 times slower; pip install ziglang"
Ids = NDArray[np.int64]

_LOOP = """
#include <stdint.h>
#include <string.h>
typedef struct {
    const double *const *in;
    double *const *out;
    const int64_t *in_step, *out_step, *carried, *ids;
    int64_t n_carried, count;
} Call;
__attribute__((visibility("default"))) void %(name)s_batch(const Call *c)
{
    const double *arg[%(arg)d];
    double *res[%(res)d], w[%(w)d];
    casadi_int iw[%(iw)d];
    for (int64_t n = 0; n < c->count; ++n) {
        for (int j = 0; j < %(n_in)d; ++j) arg[j] = c->in[j] + c->ids[n] * c->in_step[j];
        for (int j = 0; j < %(n_out)d; ++j) res[j] = c->out[j] + c->ids[n] * c->out_step[j];
        %(name)s(arg, res, iw, w, 0);
        for (const int64_t *p = c->carried; p < c->carried + 3 * c->n_carried; p += 3)
            memcpy((double *)c->in[p[1]] + c->ids[n] * c->in_step[p[1]],
                   c->out[p[0]] + c->ids[n] * c->out_step[p[0]], p[2] * sizeof(double));
    }
}
"""


class _Call(ctypes.Structure):
    """The struct of the C text. `kept` holds references to its data."""

    kept: object
    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("into", "out", "in_step", "out_step", "carried", "ids")),
        *((name, ctypes.c_int64) for name in ("n_carried", "count")),
    ]  # fmt: skip


@lru_cache(maxsize=16)
def source(function: ca.Function) -> str:
    """C text of a function and its loop over trials, cached by function.

    Sizes are distances between trials, zero for shared inputs.
    """
    generator = ca.CodeGenerator(function.name(), {"with_header": False})
    generator.add(function)
    sizes = {
        "name": function.name(), "n_in": function.n_in(), "n_out": function.n_out(), "arg": max(function.sz_arg(), 1),
        "res": max(function.sz_res(), 1), "w": max(function.sz_w(), 1), "iw": max(function.sz_iw(), 1),
    }  # fmt: skip
    return str(generator.dump()) + _LOOP % sizes


def matrix_symbol(name: str, rows: int, columns: int) -> tuple[ca.SX, ca.SX]:
    """A symbol in numpy's order, and its matrix (rows, columns)."""
    symbol = ca.SX.sym(name, columns, rows)
    return symbol, symbol.T


def dense_function(name: str, inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]) -> ca.Function:
    """A function with dense outputs, row by row as in numpy."""
    return ca.Function(name, list(inputs), ca.cse([ca.densify(x.T) for x in outputs]))


class Batch:
    """A function bound to arrays.

    Args:
        function: of one trial, with dense inputs and outputs.
        inputs, outputs: arrays of doubles in its order, each row of (N, ...) C-contiguous, in the order of the
            function's columns. They are used in place at every call.
        shared: indices of inputs common to all trials.
        carried: outputs that are a trial's memory, and the inputs that they are copied to after a call.
        use_compiler: False uses the interpreter.

    Attributes:
        run: computes the outputs of the given trials.
        notes: a sentence if there is no compiler.
    """

    def __init__(
        self, function: ca.Function, inputs: Sequence[Float], outputs: Sequence[Float], shared: Sequence[int] = (),
        *, carried: Mapping[int, int] | None = None, use_compiler: bool = True,
    ) -> None:  # fmt: skip
        self._function, self._arrays = function, (list(inputs), list(outputs))
        self._shared, self._carried = frozenset(shared), dict(carried or {})
        for j, array in enumerate([*inputs, *outputs]):
            row = array if j in self._shared else array[:1]
            if not row.flags.c_contiguous or array.dtype != np.float64:
                raise ValueError(f"array {j} of {function.name()} is not contiguous doubles")
        library = build_library(function.name(), source(function)) if use_compiler else None
        self.notes: tuple[str, ...] = () if library else (NOTE,)
        self.run: Callable[[Ids], None] = self._native(library) if library else self._interpreted()

    def _native(self, library: Path) -> Callable[[Ids], None]:
        call = ctypes.CDLL(str(library))[f"{self._function.name()}_batch"]
        call.restype = None
        inputs, outputs = self._arrays
        steps = ([0 if j in self._shared else _step(a) for j, a in enumerate(inputs)], [_step(a) for a in outputs])
        carried = [n for out, into in self._carried.items() for n in (out, into, self._function.numel_out(out))]
        addresses = [[a.ctypes.data for a in arrays] for arrays in self._arrays]
        tables: list[Any] = [(ctypes.c_void_p * len(numbers))(*numbers) for numbers in addresses]
        tables += [(ctypes.c_int64 * len(numbers))(*numbers) for numbers in (*steps, carried)]
        told = _Call(*map(ctypes.addressof, tables), None, len(self._carried), 0)
        told.kept = tables, self._arrays  # the C code reads them at every call
        at, chosen = ctypes.c_void_p(ctypes.addressof(told)), np.zeros(0, dtype=np.int64)

        def run(ids: Ids) -> None:
            nonlocal chosen
            if chosen is not ids:  # mostly the same array
                chosen, told.ids, told.count = ids, ids.ctypes.data, len(ids)
            call(at)

        return run

    def _interpreted(self) -> Callable[[Ids], None]:
        (inputs, outputs), buffers = self._arrays, []
        for i in range(len(outputs[0])):
            buffer, evaluate = self._function.buffer()
            for j, array in enumerate(inputs):
                buffer.set_arg(j, (array if j in self._shared else array[i : i + 1]).data)
            for j, array in enumerate(outputs):
                buffer.set_res(j, array[i : i + 1].data)
            buffers.append((buffer, evaluate))
        carried = [(inputs[into], outputs[out]) for out, into in self._carried.items()]

        def run(ids: Ids) -> None:
            for i in ids:
                buffers[i][1]()
            for memory, after in carried:
                memory[ids] = after[ids]

        return run


def _step(array: Float) -> int:
    return array.strides[0] // array.itemsize if len(array) else 0
