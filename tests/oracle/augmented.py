r"""Force, friction and payload in one Kalman filter that never stops learning: a comparison, not a recommendation.

The state is \((f, dF_C, dF_v, dm)\), nine numbers for a crane of three cylinders; all of them wander, and the residual
of the momentum observer shows them through \(r = J^T f + \phi\,\theta + e\) (`momentum`). Three equations a tick cannot
tell a constant push from a constant friction error: what keeps them apart is how differently they change, which a
filter must assume. `identification` asks the task instead: in air f is zero, afterwards theta stands. filterpy's
filter, trial by trial, at the rate of the rows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from skillframe_hydraulics.force.identification import IdentificationSettings

from skillframe.frames import Float


@dataclass(frozen=True, slots=True, kw_only=True)
class AugmentedSettings:
    """Noise of the filter; our choice.

    Attributes:
        noise: (n,) standard deviation of the residual's rows [Nm or N].
        force_walk: of the force [N/sqrt(s)].
        forget: time in which friction and payload may drift by their prior [s].
        prior: of friction and payload, and the period of the rows.
        told: while the task says "in air", the force is pinned to zero.
    """

    noise: tuple[float, ...] = (220.0, 160.0, 170.0)
    force_walk: float = 3000.0
    forget: float = 100.0
    prior: IdentificationSettings = field(default_factory=IdentificationSettings)
    told: bool = False


class AugmentedForceFilter:
    """The filter for one trial of a machine with k cylinders and a force of two components.

    Attributes:
        theta: (2k + 1,) as in `Identification`.
    """

    def __init__(self, cylinders: int, settings: AugmentedSettings | None = None) -> None:
        from filterpy.kalman import KalmanFilter

        self._settings = s = settings or AugmentedSettings()
        prior = np.repeat([s.prior.coulomb, s.prior.viscous, s.prior.payload], [cylinders, cylinders, 1])
        period = s.prior.period
        self._kalman: Any = KalmanFilter(dim_x=len(prior) + 2, dim_z=len(s.noise))
        self._kalman.P = np.diag(np.concatenate([[1.0, 1.0], prior]) ** 2)
        self._kalman.R = np.diag(np.square(s.noise))
        walk = np.concatenate([np.full(2, s.force_walk), prior / np.sqrt(s.forget)])
        self._kalman.Q = np.diag(walk**2 * period)

    def step(self, jacobian: Float, regressors: Float, residual: Float, in_air: bool) -> Float:
        """Force (2,) after one row of every joint: J (2, n), phi (n, 2k + 1), r (n,)."""
        self._kalman.predict()
        if in_air and self._settings.told:
            self._pin()
        self._kalman.update(residual[:, None], H=np.concatenate([jacobian.T, regressors], axis=-1))
        return np.array(self._kalman.x[:2, 0])

    def _pin(self) -> None:
        self._kalman.x[:2] = 0.0
        self._kalman.P[:2, :] = 0.0
        self._kalman.P[:, :2] = 0.0

    @property
    def theta(self) -> Float:
        """(2k + 1,) errors of friction and payload."""
        return np.array(self._kalman.x[2:, 0])
