r"""Compliant axes: principal components of the demonstrations' mean directions, counted by a BIC-like criterion.

The environment caused motion that the desired direction does not explain, so the tool is compliant there. Each
demonstration gives its mean unit direction without the component along the desired direction (Fig. 14). The first d
principal axes about the origin are compliant, with d minimising

    BIC_d = r_d / sigma^2 + d (ln max(n, 2) + 2),     r_d = sum over j > d of s_j^2

for the singular values s and n demonstrations. The papers do not print their criterion; with two demonstrations a
literal BIC has no residual, hence the fixed sigma: 0.12 rad for rotations, and

    sigma = clip(0.3 sqrt(15 mm / L), 0.1, 0.3) min(|m| / 0.7, 1)

for translations over a mean path L, since wandering is correlated over 15 mm (30 mm/s for 0.5 s), and shrinks with the
mean direction |m| of motion to and fro. The constants suit simulated parts with up to 15 degrees of aim noise.

A tool that turns swings the learning point, and its mean direction is up to 28 degrees off the axis along which it gave
way. Where there is one axis of each, that of the translation is square to the turn's and to the push.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float, cross, norm, unit

TURNED = 0.12  # rad, of a rotation's mean axis
CORRELATION_M = 0.015
SPREAD, LEAST = 0.3, 0.1
"""Noise of a mean direction over one correlation length (its upper bound), and its lower bound."""
UNBENT = 0.7  # length of a mean direction below which its noise shrinks


class CompliantAxes(NamedTuple):
    """Compliant axes of one part.

    Attributes:
        axes: (d, 3), orthonormal and perpendicular to the desired direction.
        criterion: of 0, 1, 2 (, 3) axes by the motion.
    """

    axes: Float
    criterion: list[float]

    def square_to(self, turn: Float, push: Float) -> CompliantAxes:
        """The one axis square to the one axis of a turn (3,) and to a push (3,), unless those are near parallel."""
        both = cross(turn, push)
        return self if norm(both) < 0.5 else self._replace(axes=_signed(unit(both))[None])


def straightness(path: float, means: Float) -> float:
    """Noise of translational mean directions (sigma of the module's text).

    Args:
        path: mean path [m].
        means: (n, 3) mean unit directions of motion.
    """
    noise = float(np.clip(SPREAD * np.sqrt(CORRELATION_M / max(path, 1e-9)), LEAST, SPREAD))
    length = float(np.sqrt((means**2).sum(axis=-1).mean()))
    return noise * min(length / UNBENT, 1.0)


def compliant_axes(means: Float, direction: Float | None, sigma: float) -> CompliantAxes:
    """Compliant axes of one part by its motion.

    Args:
        means: (n, 3) mean unit directions of motion.
        direction: (3,) desired direction, or None.
        sigma: noise of a mean direction.
    """
    rows, most = means, 3
    if direction is not None:
        rows, most = means - (means @ direction)[:, None] * direction, 2
    _, values, vectors = np.linalg.svd(rows, full_matrices=True)
    squares = np.zeros(3)
    squares[: len(values)] = values**2
    price = np.log(max(len(rows), 2)) + 2.0
    criterion = [float(squares[d:].sum() / sigma**2 + d * price) for d in range(most + 1)]
    return CompliantAxes(np.array([_signed(v) for v in vectors[: int(np.argmin(criterion))]]).reshape(-1, 3), criterion)


def _signed(axis: Float) -> Float:
    result: Float = axis * np.copysign(1.0, axis[np.argmax(np.abs(axis))])
    return result
