r"""An arm's own loop between commands and joint torques: late, of limited bandwidth, and stiff (our model, per joint).

    position:  q_f'' = w^2 (q_cmd - q_f) - 2 zeta w q_f'            velocity:  q_f'' = w (q'_cmd - q_f')
    tau = M(q) [ q_f'' + 2 s (q_f' - q') + s^2 (q_f - q) ] + h(q, q')                                         (1)

Commands come `delay_ticks` late and are held between two of them, so that the filter is stepped exactly. M and h are
the nominal robot's; its motors' limits are held elsewhere (`skillframe.control.motors`). The corner s of the servo is
what an arm yields with under load. Makers publish none of w, zeta, s: they are guesses, in
`skillframe.robot.interface`, to be measured on the arm.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import c_int64

import numpy as np

from skillframe.control.ticks import compiled
from skillframe.frames import Float
from skillframe.robot.interface import LOOP_DAMPING, SERVO, Admittance

REFRESH = 20
"""Ticks between two mass matrices: an arm hardly turns in 20 ms."""
LATE, STIFF = 2.0 * SERVO, SERVO**2
"""2 s and s^2."""


class InnerLoop:
    """The loops of N arms with n joints each. Rows are independent of each other.

    Args:
        arm: its figures.
        start: (N, n) joints at rest where the trials begin.
        mass_matrix: gives (N, n, n) of the nominal robots.
        dt: [s] of a tick.
    """

    def __init__(self, arm: Admittance, start: Float, mass_matrix: Callable[[], Float], dt: float) -> None:
        self._of_position = arm.kind == "position"
        w, self._mass_matrix = arm.bandwidth, mass_matrix
        # of (1): q_f'' and the servo's share in q_f' together
        self._back, self._fade = (-w * w, LATE - 2.0 * LOOP_DAMPING * w) if self._of_position else (w, LATE - w)
        self._place, self._speed = start.copy(), np.zeros_like(start)
        still = start if self._of_position else self._speed
        self._line = np.tile(still, (arm.delay_ticks + 1, 1, 1))
        self._position, self._velocity = np.zeros((2, *start.shape))
        self._asked, self._torque = np.zeros((2, *start.shape, 1))
        self._tick = 0
        self._step = _exact_step(arm, dt)
        self._ask = self._compiled() or self._ask_in_numpy

    def _compiled(self) -> Callable[..., int] | None:
        (a, b, u), (c, d, v) = self._step
        return compiled("inner", {
            "line": self._line, "position": self._position, "velocity": self._velocity, "place": self._place,
            "speed": self._speed, "asked": self._asked, "back": self._back, "fade": self._fade, "late": LATE,
            "stiff": STIFF, "a": a, "b": b, "u": u, "c": c, "d": d, "v": v, "of_position": int(self._of_position),
            "numbers": self._place.size,
        }, c_int64)  # fmt: skip

    def torque(self, command: Float, position: Float, velocity: Float, bias: Float) -> Float:
        """Joint torques (N, n) of a tick.

        Args:
            command: (N, n) that is sent now: joint positions, or velocities.
            position: (N, n) of the joints.
            velocity: (N, n) of the joints.
            bias: (N, n) gravity, Coriolis and centrifugal torques of the nominal robots.
        """
        length = len(self._line)
        self._line[self._tick % length] = command
        if self._tick % REFRESH == 0:
            self._mass = self._mass_matrix()
        self._tick += 1
        self._position[:], self._velocity[:] = position, velocity
        self._ask(self._tick % length)  # the oldest: sent `delay_ticks` ago
        np.matmul(self._mass, self._asked, out=self._torque)
        torque: Float = self._torque[..., 0] + bias
        return torque

    def _ask_in_numpy(self, heard_at: int) -> int:
        """The accelerations that are asked for at what is heard, and the filter a tick on."""
        heard, speed = self._line[heard_at], self._speed
        off = self._place - heard
        rate = self._back * (off if self._of_position else heard) + self._fade * speed
        self._asked[..., 0] = rate - LATE * self._velocity + STIFF * (self._place - self._position)
        (a, b, u), (c, d, v) = self._step
        if self._of_position:
            self._place[:], self._speed[:] = heard + a * off + b * speed, c * off + d * speed
        else:
            self._place[:], self._speed[:] = self._place + b * speed + u * heard, d * speed + v * heard
        return 0


def _exact_step(arm: Admittance, dt: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Rows (place, speed, command) of the filter's exact step for place and speed. A position's command is 0."""
    w = arm.bandwidth
    if arm.kind == "velocity":
        fade = float(np.exp(-w * dt))
        return (1.0, (1.0 - fade) / w, dt - (1.0 - fade) / w), (0.0, fade, 1.0 - fade)
    real, turn = LOOP_DAMPING * w, w * float(np.sqrt(1.0 - LOOP_DAMPING**2))
    fade, cosine, sine = float(np.exp(-real * dt)), float(np.cos(turn * dt)), float(np.sin(turn * dt)) / turn
    return (
        (fade * (cosine + real * sine), fade * sine, 0.0),
        (-fade * w * w * sine, fade * (cosine - real * sine), 0.0),
    )
