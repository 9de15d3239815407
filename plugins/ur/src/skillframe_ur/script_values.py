"""Values of URScript and what can be done with them: numbers, strings, truth values, lists, matrices and poses.

Lists and matrices are arrays of one and two dimensions, poses tuples of six numbers. Operations are those of the
maker's script manual, chapter "Matrix and Array Expressions"; others raise a `TypeError`.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

Array = np.ndarray


def number(value: Any) -> Any:
    """The value, which has to be a number."""
    if type(value) is int and abs(value) >= 2**31:
        raise TypeError("a whole number has 32 bits")
    if type(value) is float or type(value) is int:
        return value
    raise TypeError(f"{value!r} is no number")


def truth(value: Any) -> bool:
    """The value, which has to be True or False."""
    if type(value) is bool:
        return value
    raise TypeError(f"{value!r} is neither True nor False")


def array(values: list[Any]) -> Any:
    """A list of numbers, or a matrix of rows of them."""
    made = np.array(values)
    if made.dtype.kind not in "fi" or made.ndim not in (1, 2):
        raise TypeError(f"{values!r:.60} is no list of numbers")
    return made.astype(float)


def pose(values: list[Any]) -> tuple[float, ...]:
    """A pose of six numbers."""
    if len(values) != 6:
        raise TypeError(f"a pose of {len(values)} numbers")
    return tuple(float(number(each)) for each in values)


def copied(value: Any) -> Any:
    """A copy: an assignment and a call of a function copy lists."""
    return value.copy() if type(value) is Array else value


def kept(last: Any, value: Any) -> Any:
    """A copy of a variable's next value, which keeps its type and size."""
    if type(last) is not type(value) or (type(value) is Array and last.shape != value.shape):
        raise TypeError("the variable would change its type or size")
    return value.copy() if type(value) is Array else value


def element(value: Any, *place: int) -> float:
    """An element of a list, pose or matrix."""
    for each in place:
        if type(each) is not int or each < 0:
            raise TypeError(f"{each!r} is no index")
    if type(value) is Array and value.ndim == len(place):
        found: float = value.item(place)
        return found
    if type(value) is tuple and len(place) == 1:
        return float(value[place[0]])
    raise TypeError(f"a value of this kind has no element {list(place)}")


def put(value: Any, new: Any, *place: int) -> None:
    """Replace an element of a list or matrix."""
    if type(value) is not Array:
        raise TypeError("only elements of lists and matrices are assigned")
    element(value, *place)
    value[place] = number(new)


def _size(value: Any) -> int:
    """0 for a number, 1 for a list, 2 for a matrix."""
    if type(value) is Array:
        return value.ndim
    number(value)
    return 0


def _elementwise(sign: str, calculate: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """An operation on numbers, and on the elements of lists and matrices where the manual promises it."""

    def calculated(a: Any, b: Any) -> Any:
        if type(a) is float and type(b) is float:
            return calculate(a, b)
        sizes = _size(a), _size(b)
        if sizes not in ((0, 0), (1, 1), (0, 1), (1, 0), (2, 0), (0, 2)):
            raise TypeError(f"{sign!r} between values with {sizes[0]} and {sizes[1]} dimensions is not in the manual")
        if sizes == (1, 1) and len(a) != len(b):
            raise TypeError(f"{sign!r} between lists of {len(a)} and {len(b)} elements")
        return calculate(a, b)

    return calculated


def _quotient(a: Any, b: Any) -> Any:
    if type(a) is int and type(b) is int:
        raise TypeError("a quotient of whole numbers is not in the manual")
    if not np.all(b):
        raise ZeroDivisionError("division by zero")
    return a / b


_by_elements = _elementwise("*", operator.mul)


def _times(a: Any, b: Any) -> Any:
    if type(a) is Array and type(b) is Array and a.ndim == 2:
        return a @ b
    return _by_elements(a, b)


def _compared(compare: Callable[[Any, Any], bool]) -> Callable[[Any, Any], bool]:
    return lambda a, b: compare(number(a), number(b))


def norm(value: Any) -> float:
    """Euclidean norm of a list or pose, or the size of a number."""
    if type(value) is float:
        return abs(value)
    return math.sqrt(sum(each * each for each in (value if type(value) is tuple else value.tolist())))


OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "plus": _elementwise("+", operator.add), "minus": _elementwise("-", operator.sub), "times": _times,
    "over": _elementwise("/", _quotient), "below": _compared(operator.lt), "above": _compared(operator.gt),
    "at_most": _compared(operator.le), "at_least": _compared(operator.ge), "equal": _compared(operator.eq),
    "number": number, "truth": truth, "array": array, "pose": pose, "copied": copied, "kept": kept,
    "element": element, "put": put,
}  # fmt: skip
"""What a translated program calls."""
MATHEMATICS: Mapping[str, Callable[..., Any]] = {
    "sin": math.sin, "cos": math.cos, "sqrt": math.sqrt, "atan2": math.atan2, "norm": norm,
    "transpose": lambda matrix: matrix.T.copy(), "inv": np.linalg.inv, "length": len,
}  # fmt: skip
"""Functions of the manual's module urmath."""
