r"""Exploration distribution: one Gaussian over the places that the blindfolded teacher searched ([5]).

Coordinates of the tool against its start: two displacements along the surface, tilts about these axes, and the turn
about the normal. Those that varied less than 0.5 mm or 1 degree are not searched. The lever of 23 mm makes 1 mm as
large as 2.5 degrees, about equal misses.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe_search.contact import Samples

COORDINATES = ("across_1", "across_2", "tilt_1", "tilt_2", "turn")
LEVER = 0.023  # m per rad
CUT = 3.5  # standard deviations: the limit of the search


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """A Gaussian over the searched coordinates.

    Attributes:
        coordinates: names of `COORDINATES`, in that order.
        mean: (k,) [m, rad].
        covariance: (k, k).
    """

    coordinates: tuple[str, ...]
    mean: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]

    @property
    def columns(self) -> list[int]:
        """Indices of the searched `COORDINATES`."""
        return [COORDINATES.index(name) for name in self.coordinates]

    @property
    def scale(self) -> Float:
        """(k,) metres per unit of each coordinate."""
        return np.array([LEVER if column >= 2 else 1.0 for column in self.columns])

    @property
    def center(self) -> Float:
        """(k,) mean in metres, angles through the lever."""
        return np.array(self.mean) * self.scale

    @property
    def spread(self) -> Float:
        """(k, k) covariance in square metres, angles through the lever."""
        return np.array(self.covariance) * np.outer(self.scale, self.scale)

    def draw(self, rng: np.random.Generator, count: int, cut: float = CUT) -> Float:
        """(count, k) samples [m] within `cut` standard deviations."""
        kept = np.zeros((0, len(self.mean)))
        while len(kept) < count:
            more = rng.standard_normal((2 * count + 16, len(self.mean)))
            kept = np.concatenate([kept, more[norm(more) <= cut]])[:count]
        return self.center + kept @ np.linalg.cholesky(self.spread).T


def coordinates_of(place: Float, axes: Float) -> Float:
    """(n, 5) coordinates of displacements and rotation vectors (n, 6), or of their rates."""
    return np.concatenate([place[:, :3] @ axes[:2].T, place[:, 3:] @ axes.T], axis=1)


def explored(samples: Samples, axes: Float) -> Exploration:
    """The Gaussian over samples in contact.

    Raises:
        InputError: none of the coordinates was searched.
    """
    values = coordinates_of(samples.place, axes)
    least = np.array([5e-4, 5e-4, radians(1.0), radians(1.0), radians(1.0)])  # m, rad
    columns = np.flatnonzero(values.std(axis=0) > least)
    if not len(columns):
        raise InputError(
            "search", "the demonstrations hold no search: the tool stayed within 0.5 mm and 1 degree of one place",
            "record a search that moves along the surface",
        )  # fmt: skip
    covariance = np.atleast_2d(np.cov(values[:, columns].T))
    return Exploration(
        coordinates=tuple(COORDINATES[c] for c in columns),
        mean=tuple(float(m) for m in values[:, columns].mean(axis=0)),
        covariance=tuple(tuple(float(c) for c in row) for row in covariance),
    )
