"""Functions in C over arrays that stay where they are: what the loop does number by number, without numpy's overhead.

A file of ours is built once (`skillframe.fmu.build`) and called with a record of addresses and figures. It does the
same operations in the same order as the numpy beside it, so that results are the same to the last bit; without a
compiler that numpy runs. Products of matrices are left to numpy everywhere: their rounding is its library's own.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.fmu.build import build_source


@cache
def library(source: Path) -> ctypes.CDLL | None:
    """The built file, or None where it cannot be built: no compiler, or no place to keep what it makes."""
    try:
        path = build_source(source)
        return None if path is None else ctypes.CDLL(str(path))
    except OSError:
        return None


class Record:
    """Addresses of arrays, integers and figures in the order of a struct in C, for functions that are given it.

    Args:
        fields: by name: an array of 8 bytes a number is an address, an `int` an int64_t, a `float` a double.
    """

    def __init__(self, fields: Mapping[str, NDArray[Any] | int | float]) -> None:
        names = [(name, _kind(value)) for name, value in fields.items()]
        told = type("Told", (ctypes.Structure,), {"_fields_": names})
        self._told = told(*(x.ctypes.data if isinstance(x, np.ndarray) else x for x in fields.values()))
        self._told.kept = dict(fields)  # a function that is bound keeps the arrays alive

    def bound(self, built: ctypes.CDLL, name: str, *more: type) -> Callable[..., int]:
        """A function of a file that takes this record, and `more` numbers, and gives an integer."""
        found = built[name]
        found.argtypes, found.restype = [ctypes.c_void_p, *more], ctypes.c_int64
        return partial(found, ctypes.byref(self._told))


def _kind(value: NDArray[Any] | int | float) -> type:
    if isinstance(value, np.ndarray):
        return ctypes.c_void_p
    return ctypes.c_int64 if isinstance(value, int) else ctypes.c_double
