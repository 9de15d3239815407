r"""Friction and payload found in air, by recursive least squares with priors. Afterwards they are held.

In air f = 0, so the residual of the momentum is \(r = \phi\,\theta + e\) with \(\theta = (dF_C, dF_v, dm)\): errors of
each cylinder's Coulomb and viscous friction and of the payload's mass. With the prior \(\theta_i \sim N(0, s_i^2)\),

    Lambda <- Lambda + phi^T V^-1 phi,   b <- b + phi^T V^-1 r,   theta = Lambda^-1 b,   Lambda_0 = diag(1/s_i^2)

is the ridge estimate of all rows so far, exactly (the information form of recursive least squares; L. Ljung, System
Identification, 1999, ch. 11). Only rows of joints whose pistons slide count. The phase of the task says when: a
threshold on the force mistook stiction for contact (our trials), and a filter that goes on learning in contact takes
force for friction. dF_C and dF_v are told apart only as far as speeds differ; their sum at the speeds used counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import SkillframeError
from skillframe.frames import Float


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationSettings:
    """What is identified, and how sure one is beforehand (standard deviations; our choice for the crane).

    Attributes:
        coulomb: of each cylinder's Coulomb friction [N]; viscous: of its viscous friction [N s/m].
        payload: of the carried mass [kg].
        period: a row is taken in as often as this [s]; residuals at 1 kHz hold hardly more.
        friction, load: False leaves that part at its nominal value.
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
    """The recursion for N machines with k cylinders in lock-step.

    Attributes:
        theta: (N, 2k + 1) Coulomb errors [N], viscous errors [N s/m], payload error [kg]; held between updates.
        rows: (N,) rows taken in.
    """

    def __init__(self, count: int, cylinders: int, settings: IdentificationSettings) -> None:
        self._count, self._k, self._settings = count, cylinders, settings
        s = settings
        prior = np.repeat([s.coulomb, s.viscous, s.payload], [cylinders, cylinders, 1])
        self._known = np.repeat([not s.friction, not s.load], [2 * cylinders, 1])
        self._prior: Float = np.diag(1.0 / prior**2)
        self.start()

    def start(self) -> None:
        """Back to the prior."""
        m = len(self._prior)
        self.theta: Float = np.zeros((self._count, m))
        self.rows: NDArray[np.int64] = np.zeros(self._count, dtype=np.int64)
        self._information = np.tile(self._prior, (self._count, 1, 1))
        self._vector = np.zeros((self._count, m))

    def update(self, regressors: Float, residual: Float, variance: Float, rows: NDArray[np.bool_]) -> None:
        """Take in one row of every joint that counts.

        Args:
            regressors: phi (N, n, 2k + 1).
            residual: r (N, n).
            variance: of r (n,) or (N, n).
            rows: (N, n) which joints' rows count.
        """
        phi = np.where(self._known, 0.0, regressors)
        weighted = np.swapaxes(phi * (rows / variance)[..., None], -1, -2)
        self._information = self._information + weighted @ phi
        self._vector = self._vector + (weighted @ residual[..., None])[..., 0]
        self.theta = np.asarray(np.linalg.solve(self._information, self._vector[..., None])[..., 0])
        self.rows = self.rows + rows.sum(axis=-1)

    @property
    def deviation(self) -> Float:
        """(N, 2k + 1) standard deviation of theta if rows' errors were independent."""
        return np.sqrt(np.diagonal(np.linalg.inv(self._information), axis1=-2, axis2=-1))

    @property
    def coulomb(self) -> Float:
        """(N, k) errors of Coulomb friction [N]."""
        return self.theta[:, : self._k]

    @property
    def viscous(self) -> Float:
        """(N, k) errors of viscous friction [N s/m]."""
        return self.theta[:, self._k : 2 * self._k]

    @property
    def payload(self) -> Float:
        """(N,) error of the carried mass [kg]."""
        return self.theta[:, -1]
