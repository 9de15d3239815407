r"""Identification of friction and payload in air, by recursive least squares with priors.

In air f = 0, so the momentum's residual is \(r = \phi\,\theta + e\) with \(\theta = (dF_C, dF_v, dm)\): errors of
each cylinder's Coulomb and viscous friction and of the payload's mass. With the prior \(\theta_i \sim N(0, s_i^2)\),

    Lambda <- Lambda + phi^T V^-1 phi,   b <- b + phi^T V^-1 r,   theta = Lambda^-1 b,   Lambda_0 = diag(1/s_i^2)

is the ridge estimate of all rows so far (information form of recursive least squares; L. Ljung, System Identification,
1999, ch. 11). Only rows of joints with sliding pistons count. Learning stops before contact, where force would be taken
for friction. dF_C and dF_v are separated only as far as speeds differ; their sum at the used speeds matters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationSettings:
    """What is identified, and prior standard deviations.

    Attributes:
        coulomb: of each cylinder's Coulomb friction [N]; viscous: of its viscous friction [N s/m].
        payload: of the carried mass [kg].
        period: between rows [s].
        friction, load: False keeps that part nominal.
    """

    coulomb: float = 900.0
    viscous: float = 4000.0
    payload: float = 15.0
    period: float = 0.01
    friction: bool = True
    load: bool = True

    def __post_init__(self) -> None:
        for name in ("coulomb", "viscous", "payload", "period"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise SkillframeError(f"identification: {name} must be positive, got {getattr(self, name)}")


class Identification:
    """The recursion for N machines with k cylinders.

    Attributes:
        theta: (N, 2k + 1) Coulomb errors [N], viscous errors [N s/m], payload error [kg].
        rows: (N,) number of rows.
    """

    def __init__(self, count: int, cylinders: int, settings: IdentificationSettings) -> None:
        self._count, self._k, self._settings = count, cylinders, settings
        s = settings
        prior = np.repeat([s.coulomb, s.viscous, s.payload], [cylinders, cylinders, 1])
        self._known = np.repeat([not s.friction, not s.load], [2 * cylinders, 1])
        self._prior: Float = np.diag(1.0 / prior**2)
        self.start()

    def start(self) -> None:
        """Reset to the prior."""
        m = len(self._prior)
        self.theta: Float = np.zeros((self._count, m))
        self.rows: NDArray[np.int64] = np.zeros(self._count, dtype=np.int64)
        self._information = np.tile(self._prior, (self._count, 1, 1))
        self._vector = np.zeros((self._count, m))

    def update(self, regressors: Float, residual: Float, variance: Float, rows: NDArray[np.bool_]) -> None:
        """Add a row of every selected joint (N, n).

        `regressors` are phi (N, n, 2k + 1), `residual` r (N, n), `variance` that of r (n,) or (N, n).
        """
        phi = np.where(self._known, 0.0, regressors)
        weighted = np.swapaxes(phi * (rows / variance)[..., None], -1, -2)
        self._information = self._information + weighted @ phi
        self._vector = self._vector + (weighted @ residual[..., None])[..., 0]
        self.theta = np.asarray(np.linalg.solve(self._information, self._vector[..., None])[..., 0])
        self.rows = self.rows + rows.sum(axis=-1)

    @property
    def deviation(self) -> Float:
        """Standard deviation of theta (N, 2k + 1) for independent errors."""
        return np.sqrt(np.diagonal(np.linalg.inv(self._information), axis1=-2, axis2=-1))

    @property
    def coulomb(self) -> Float:
        """Errors of Coulomb friction (N, k) [N]."""
        return self.theta[:, : self._k]

    @property
    def viscous(self) -> Float:
        """Errors of viscous friction (N, k) [N s/m]."""
        return self.theta[:, self._k : 2 * self._k]

    @property
    def payload(self) -> Float:
        """Error of the carried mass (N,) [kg]."""
        return self.theta[:, -1]
