"""Functions for both numbers and casadi expressions, so that an equation is written once.

Arrays go to numpy and expressions to casadi. NaN stays NaN in both (casadi's own fmin and fmax would hide it). `where`
computes both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

__all__ = [
    "absolute", "both", "ceil", "clip", "copysign", "dot", "exp", "expm1", "maximum", "minimum", "sign", "sqrt",
    "square_sum", "stack", "tanh", "where",
]  # fmt: skip


def absolute(x: Any) -> Any:
    """|x|."""
    return ca.fabs(x) if isinstance(x, ca.SX) else np.abs(x)


def ceil(x: Any) -> Any:
    """The smallest integer not below x."""
    return ca.ceil(x) if isinstance(x, ca.SX) else np.ceil(x)


def sqrt(x: Any) -> Any:
    """Square root."""
    return ca.sqrt(x) if isinstance(x, ca.SX) else np.sqrt(x)


def exp(x: Any) -> Any:
    """e^x."""
    return ca.exp(x) if isinstance(x, ca.SX) else np.exp(x)


def expm1(x: Any) -> Any:
    """e^x - 1, exact for small x."""
    return ca.expm1(x) if isinstance(x, ca.SX) else np.expm1(x)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    return ca.tanh(x) if isinstance(x, ca.SX) else np.tanh(x)


def sign(x: Any) -> Any:
    """-1, 0 or 1."""
    return ca.sign(x) if isinstance(x, ca.SX) else np.sign(x)


def square_sum(x: Any) -> Any:
    """Sum of the squares of a vector's components, (..., 1) of arrays (..., n)."""
    return ca.sumsqr(x) if isinstance(x, ca.SX) else np.sum(np.square(x), axis=-1, keepdims=True)


def dot(x: Any, y: Any) -> Any:
    """Scalar product of two vectors, (...) of arrays (..., n)."""
    return ca.dot(x, y) if isinstance(x, ca.SX) else np.sum(x * y, axis=-1)


def both(one: Any, other: Any) -> Any:
    """Whether both conditions hold."""
    return ca.logic_and(one, other) if isinstance(one, ca.SX) else np.logical_and(one, other)


def copysign(x: Any, sign: Any) -> Any:
    """Magnitude of x with the sign of another."""
    return ca.copysign(x, sign) if isinstance(x, ca.SX) or isinstance(sign, ca.SX) else np.copysign(x, sign)


def where(condition: Any, one: Any, other: Any) -> Any:
    """`one` where the condition holds, `other` elsewhere."""
    return ca.if_else(condition, one, other) if isinstance(condition, ca.SX) else np.where(condition, one, other)


def maximum(x: Any, y: Any) -> Any:
    """The larger, or x where x is NaN."""
    return ca.if_else(x < y, y, x) if isinstance(x, ca.SX) or isinstance(y, ca.SX) else np.maximum(x, y)


def minimum(x: Any, y: Any) -> Any:
    """The smaller, or x where x is NaN."""
    return ca.if_else(y < x, y, x) if isinstance(x, ca.SX) or isinstance(y, ca.SX) else np.minimum(x, y)


def clip(x: Any, low: Any, high: Any) -> Any:
    """Limit x to two bounds."""
    return minimum(maximum(x, low), high)


def stack(parts: Sequence[Any]) -> Any:
    """One row for each part. A scalar fills its row."""
    if any(isinstance(part, ca.SX) for part in parts):
        return ca.vertcat(*parts)
    result = np.empty((len(parts), *np.broadcast(*parts).shape))
    for row, part in zip(result, parts, strict=True):
        row[...] = part
    return result
