"""Settings of an environment, and its action and observation spaces.

An action of six numbers between -1 and 1 moves the target of the impedance controller from the observed tool pose:

    x_d = x + reach_m a[0:3]        R_d = exp(reach_rad a[3:6]) R        base axes                      (1)

so the push is at most stiffness times reach, 20 N and 5 Nm by default. With `variable_stiffness` six more numbers
choose the diagonal of the stiffness along the base axes, logarithmic between two bounds:

    K = low (high / low)^((a + 1) / 2)                                                                 (2)

The controller's damping is critical.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from skillframe.campaign import Axis, parse_axis
from skillframe.errors import InputError, UnknownName
from skillframe.extend import quantities, unknown
from skillframe.frames import Float

ROBOTS = {"pallets": "hiab_xs031", "edge": "free_tool"}
"""Robot by world, where it is not the Panda."""
LARGEST = {"position": 100.0, "quaternion": 1.0, "twist": 1e3, "wrench": 1e6}
"""Bounds of observations [m, 1, m/s and rad/s, N and Nm], to which a diverging trial is clipped."""
SOFTEST, STIFFEST = np.repeat([100.0, 5.0], 3), np.repeat([3000.0, 150.0], 3)
"""(6,) bounds of `variable_stiffness` [N/m, Nm/rad]."""
INDEPENDENT = ("uniform", "normal", "choice")
STARTS = ("task", "nominal")
REWARDS = ("progress", "sparse")


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvSettings:
    """How a world is made into an environment.

    Attributes:
        rate_hz: actions a second; the controller's rate is a multiple of it.
        duration_s: longest episode [simulated s]; more where the robot's interface is slow, as with `run`.
        reach_m, reach_rad: largest motion of the target by an action, along or about each base axis.
        stiffness: along and about every axis [N/m, Nm/rad].
        variable_stiffness: actions have six more numbers for the stiffness.
        reward: "progress" towards the goal, or "sparse"; `environments` has the equations.
        starts: "task": a random start of the world's demonstrations; "nominal": the start of a plain `run`.
        vary: variation between trials, `{"fixture.tilt_y": {"uniform": [-0.1, 0.1]}}`, as in campaign.toml.

    Raises:
        InputError, UnknownName: a value that cannot be used.
    """

    rate_hz: float = 20.0
    duration_s: float = 20.0
    reach_m: float = 0.02
    reach_rad: float = 0.1
    stiffness: tuple[float, float] = (1000.0, 50.0)
    variable_stiffness: bool = False
    reward: str = "progress"
    starts: str = "task"
    vary: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        for name in ("rate_hz", "duration_s", "reach_m", "reach_rad"):
            _require_positive(name, getattr(self, name))
        if len(self.stiffness) != 2:
            raise InputError("stiffness", f"holds {len(self.stiffness)} numbers", "give two: N/m and Nm/rad")
        for value in self.stiffness:
            _require_positive("stiffness", value)
        for name, known in (("reward", REWARDS), ("starts", STARTS)):
            if getattr(self, name) not in known:
                raise UnknownName(name, str(getattr(self, name)), known)

    @property
    def axes(self) -> dict[str, Axis]:
        """Varied quantities by name, in sampling order."""
        axes = {name: parse_axis(value, f"vary.{name}") for name, value in sorted((self.vary or {}).items())}
        for name, axis in axes.items():
            if name not in quantities():
                raise unknown(name, quantities(), "vary")
            if axis.kind not in INDEPENDENT:
                raise InputError(f"vary.{name}", f"{axis.kind} is a design of campaigns", "draw it: uniform, normal")
        return axes

    def action_space(self) -> spaces.Box:
        """(6,) numbers of equation (1), or (12,) with those of equation (2)."""
        return spaces.Box(-1.0, 1.0, (12 if self.variable_stiffness else 6,), np.float32)

    def gains(self, actions: Float) -> Float:
        """(N, 6, 6) stiffness of actions (N, 6 or 12)."""
        if not self.variable_stiffness:
            return np.broadcast_to(np.diag(np.repeat(self.stiffness, 3)), (len(actions), 6, 6))
        diagonal = SOFTEST * (STIFFEST / SOFTEST) ** ((actions[:, 6:] + 1.0) / 2.0)
        matrices: Float = diagonal[:, :, None] * np.eye(6)
        return matrices


def observation_space() -> spaces.Dict:
    """Observations of a skill at the tool's tip, in base axes.

    `position` [m] and `quaternion` (x, y, z, w) of the tip, its `twist` [m/s, rad/s], and `wrench` [N, Nm] of the
    environment on the tool at the tip, filtered and tared as by the robot's sensor.
    """
    sizes = {"position": 3, "quaternion": 4, "twist": 6, "wrench": 6}
    return spaces.Dict({k: spaces.Box(-LARGEST[k], LARGEST[k], (n,), np.float64) for k, n in sizes.items()})


def _require_positive(name: str, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not (math.isfinite(value) and value > 0.0):
        raise InputError(name, f"is {value!r}", "give a number above zero")
