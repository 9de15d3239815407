r"""A casadi function of one trial, called for many trials at once on rows of numpy arrays.

Where there is a C compiler the function is written out as C with a loop over trials around it, and compiled into a
cache under the hash of its text; elsewhere casadi's own interpreter runs it, trial by trial. Both give the same numbers
up to rounding, and neither allocates. casadi's generated code keeps no state.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from skillframe.fmu.build import build_library
from skillframe.frames import Float

NOTE = "no C compiler: the control law runs in casadi's interpreter, some 5 times slower; pip install ziglang"
Ids = NDArray[np.int64]

_LOOP = """
#include <stdint.h>
__attribute__((visibility("default"))) void %(name)s_batch(
    const double *const *in, const int64_t *in_size, double *const *out, const int64_t *out_size,
    const int64_t *ids, int64_t count)
{
    const double *arg[%(arg)d];
    double *res[%(res)d], w[%(w)d];
    casadi_int iw[%(iw)d];
    for (int64_t n = 0; n < count; ++n) {
        for (int j = 0; j < %(n_in)d; ++j) arg[j] = in[j] + ids[n] * in_size[j];
        for (int j = 0; j < %(n_out)d; ++j) res[j] = out[j] + ids[n] * out_size[j];
        %(name)s(arg, res, iw, w, 0);
    }
}
"""


def source(function: ca.Function) -> str:
    """C text of a function and its loop over trials. Sizes are distances between trials, zero for shared inputs."""
    generator = ca.CodeGenerator(function.name(), {"with_header": False})
    generator.add(function)
    sizes = {
        "name": function.name(), "n_in": function.n_in(), "n_out": function.n_out(), "arg": max(function.sz_arg(), 1),
        "res": max(function.sz_res(), 1), "w": max(function.sz_w(), 1), "iw": max(function.sz_iw(), 1),
    }  # fmt: skip
    return str(generator.dump()) + _LOOP % sizes


class Batch:
    """A function bound to arrays.

    Args:
        function: of one trial; inputs and outputs are dense.
        inputs, outputs: arrays in its order, C-contiguous doubles; (N, ...) holds trials, row by row as the function's
            columns, and they are read and written at every call.
        shared: which inputs are one for all trials.
        use_compiler: False takes the interpreter.

    Attributes:
        notes: a sentence where there is no compiler.
    """

    def __init__(
        self, function: ca.Function, inputs: Sequence[Float], outputs: Sequence[Float], shared: Sequence[int] = (),
        *, use_compiler: bool = True,
    ) -> None:  # fmt: skip
        self._function, self._arrays = function, (list(inputs), list(outputs))
        self._shared = frozenset(shared)
        self._check()
        library = build_library(function.name(), source(function)) if use_compiler else None
        self.notes: tuple[str, ...] = () if library else (NOTE,)
        self._call = self._native(library) if library else self._interpreted()

    def __call__(self, ids: Ids) -> None:
        """Compute the outputs of some trials."""
        self._call(ids)

    def _check(self) -> None:
        inputs, outputs = self._arrays
        for j, array in enumerate([*inputs, *outputs]):
            if not array.flags.c_contiguous or array.dtype != np.float64:
                raise ValueError(f"array {j} of {self._function.name()} is not contiguous doubles")

    def _native(self, library: Path) -> Callable[[Ids], None]:
        call = ctypes.CDLL(str(library))[f"{self._function.name()}_batch"]
        call.restype = None
        tables = []
        for arrays, shared in zip(self._arrays, (self._shared, frozenset[int]()), strict=True):
            pointers = (ctypes.c_void_p * len(arrays))(*(a.ctypes.data for a in arrays))
            sizes = (ctypes.c_int64 * len(arrays))(
                *(0 if j in shared else a[0].size if len(a) else 0 for j, a in enumerate(arrays))
            )
            tables += [pointers, sizes]
        self._tables = tables  # the C code reads them at every call
        chosen, which = np.zeros(0, dtype=np.int64), (ctypes.c_void_p(), ctypes.c_int64())

        def run(ids: Ids) -> None:
            nonlocal chosen, which
            if chosen is not ids:  # mostly the same array again
                chosen, which = ids, (ctypes.c_void_p(ids.ctypes.data), ctypes.c_int64(len(ids)))
            call(*tables, *which)

        return run

    def _interpreted(self) -> Callable[[Ids], None]:
        count, buffers = len(self._arrays[1][0]), []
        for i in range(count):
            buffer, evaluate = self._function.buffer()
            for j, array in enumerate(self._arrays[0]):
                buffer.set_arg(j, (array if j in self._shared else array[i]).data)
            for j, array in enumerate(self._arrays[1]):
                buffer.set_res(j, array[i].data)
            buffers.append((buffer, evaluate))

        def run(ids: Ids) -> None:
            for i in ids:
                buffers[i][1]()

        return run
