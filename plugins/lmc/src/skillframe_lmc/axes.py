r"""Compliant axes: principal components of the demonstrations' mean directions, their number by a BIC-like criterion.

Motion that the desired direction does not explain was caused by the environment, so the tool must give way there. Each
demonstration gives one row, the mean of its unit directions of motion, less its component along the desired direction
if that exists (green crosses in Fig. 14). Distances are taken about the origin, not the mean; of the principal axes
the first d are compliant, with d minimising

    BIC_d = r_d / sigma^2 + d (ln max(n, 2) + 2),     r_d = sum over j > d of s_j^2

for the singular values s and n demonstrations. The papers take "inspiration from BIC" without printing it; with two
demonstrations a literal BIC is degenerate (no residual), hence the fixed sigma, which is ours: 0.12 rad for rotations,
and

    sigma = max(clip(0.3 sqrt(15 mm / L), 0.08, 0.3), min(0.6 sin alpha*, 0.18)) min(|m| / 0.7, 1)

for translations over a mean path L, because a person's wandering is correlated over 15 mm and averages out beyond;
because the pyramids' opening alpha* that the demonstrations needed to agree on a direction says how much they wandered;
and because to and fro shortens a mean direction (|m|, root mean square over the demonstrations), its sideways part and
its noise alike: unbent wandering leaves means of 0.7 and more. The constants separate the two in simulated valleys,
pegs, couplers and funnels with up to 15 degrees of aim noise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skillframe.frames import Float


class CompliantAxes(NamedTuple):
    """The compliant axes of one part.

    Attributes:
        axes: (d, 3), orthonormal and square to the desired direction.
        criterion: what the motion says of 0, 1, 2 (, 3) axes.
        by_faces: whether the axes are those of faces (`faces`) and not of the motion.
    """

    axes: Float
    criterion: list[float]
    by_faces: bool = False

    def unless(self, faces: Float) -> CompliantAxes:
        """These, or axes (d, 3) of faces if there are any."""
        return CompliantAxes(np.array([_signed(v) for v in faces]), self.criterion, True) if len(faces) else self


SPREAD, LEAST = 0.3, 0.08
"""Noise of a mean direction over one correlation length, which is also its most; and its least."""
BY_PYRAMID, MOST_BY_PYRAMID = 0.6, 0.18
UNBENT = 0.7  # length of a mean direction below which its noise shrinks with it


def straightness(path: float, correlation: float, pyramid: float | None = None, means: Float | None = None) -> float:
    """Noise of translational mean directions, see the module's text.

    Args:
        path: mean path [m].
        correlation: length over which a person's wandering is correlated [m].
        pyramid: alpha* [rad], where the demonstrations agree on a direction.
        means: (n, 3) mean unit direction of motion of each demonstration.
    """
    noise = float(np.clip(SPREAD * np.sqrt(correlation / max(path, 1e-9)), LEAST, SPREAD))
    if pyramid is not None:
        noise = max(noise, min(BY_PYRAMID * float(np.sin(pyramid)), MOST_BY_PYRAMID))
    length = UNBENT if means is None else float(np.sqrt((means**2).sum(axis=-1).mean()))
    return noise * min(length / UNBENT, 1.0)


def compliant_axes(means: Float, direction: Float | None, sigma: float) -> CompliantAxes:
    """The compliant axes of one part, by its motion.

    Args:
        means: (n, 3) mean unit direction of motion of each demonstration.
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
    """An axis has no sign. Let its largest component be positive."""
    result: Float = axis * np.copysign(1.0, axis[np.argmax(np.abs(axis))])
    return result
