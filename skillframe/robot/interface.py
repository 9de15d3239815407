r"""Command interface of an arm (torque, velocity or position) and its speed in contact.

Velocity and position interfaces use an admittance controller. Its damping D must outweigh the contact stiffness k_e
over the delay T_tot from wrench to motion (`tests/oracle/stiff_wall.py`):

    T_tot = T + 1/(2 rate) + lag + 2/s,     lag = 2 zeta/w (position), 1/w (velocity)
    D_min = min(0.57 k_e T_tot + 0.15 sqrt(k_e M), k_e T_tot),     D = 1.5 k_e T_tot

T is the transport delay, w the bandwidth of the inner loop, s the corner of the servo below it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Literal

from skillframe.errors import InputError
from skillframe.signals import require_delay

TICK_HZ = 1000.0
"""Rate of the simulated robot and its servos, for any command rate."""
LOOP_DAMPING = 0.8
"""Damping ratio of a position loop."""
SERVO = 2.0 * math.pi * 30.0
"""Corner s of a position loop's servo [rad/s]: 30 Hz."""
MARGIN = 1.5
"""D over k_e T_tot, 2.6 times the stability limit."""
VIRTUAL_MASS, VIRTUAL_INERTIA = 5.0, 0.05
"""M [kg, kg m^2], which smooths sensor noise."""
TAUGHT_SPEED = 0.02
"""Usual speed of a taught contact motion [m/s]."""
LEAST_SPEED = 5e-4
"""Speed below which an arm is refused [m/s]."""
LEVER = 0.045
"""Least distance from centre of compliance to contact [m]."""
DEFAULTS = {"delay_s": 0.008, "bandwidth_hz": 15.0, "contact_stiffness": 5e4, "push_n": 20.0, "push_nm": 2.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """[control] of robot.toml. None takes the default. Only rate and delay apply to torque interfaces.

    Attributes:
        rate_hz: of the impedance loop, or of the arm's commands [Hz, 1 to 100kHz].
        interface: what the arm takes.
        delay_s: from a command to its torque, or for velocities and positions to the first measured motion [s].
        bandwidth_hz: of the arm's inner loop [Hz].
        contact_stiffness: of part, tool, sensor and arm in series [N/m].
        contact_turning_stiffness: the same about the centre of compliance [Nm/rad].
        push_n: largest force that the controller adds to the contact [N].
        push_nm: largest torque that the controller adds to the contact [N m].
    """

    rate_hz: float = TICK_HZ
    interface: Literal["torque", "velocity", "position"] = "torque"
    delay_s: float | None = None
    bandwidth_hz: float | None = None
    contact_stiffness: float | None = None
    contact_turning_stiffness: float | None = None
    push_n: float | None = None
    push_nm: float | None = None

    @property
    def late_s(self) -> float:
        """Delay from a command to its torque [s], 0 for other interfaces."""
        return self.delay_s or 0.0 if self.interface == "torque" else 0.0

    @property
    def tick_hz(self) -> float:
        """Rate of the simulated robot [Hz]."""
        return self.rate_hz if self.interface == "torque" else TICK_HZ

    def pace(self, speed: float | None = None) -> float:
        """Duration of a skill over that of its teaching (see `Admittance.slow_down`)."""
        return 1.0 if self.interface == "torque" else self.admittance.slow_down(speed)

    def figures(self) -> dict[str, float | str]:
        """Interface and derived values by name, in SI units."""
        return {"takes": "torque", "rate_hz": self.rate_hz} if self.interface == "torque" else self.admittance.figures()

    def guided(self) -> Control:
        """The torque interface, for a teacher's hand."""
        return self if self.interface == "torque" else Control()

    @property
    def admittance(self) -> Admittance:
        """Derived values of an arm that takes velocities or positions."""
        return Admittance(self)


class Admittance:
    """Derived values of an arm that takes velocities or positions.

    Attributes:
        kind, rate: interface and command rate [Hz]; delay: T [s]; bandwidth: w [rad/s]; stiffness: k_e [N/m].
        push: largest push [N, Nm].
        total_delay: T_tot [s].
        damping: D [Ns/m].
    """

    def __init__(self, control: Control) -> None:
        given = {name: getattr(control, name) for name in DEFAULTS}
        values = {name: DEFAULTS[name] if value is None else value for name, value in given.items()}
        self.kind, self.rate = control.interface, control.rate_hz
        self.delay, self.bandwidth = values["delay_s"], 2.0 * math.pi * values["bandwidth_hz"]
        self.stiffness, self.push = values["contact_stiffness"], (values["push_n"], values["push_nm"])
        self._turning = control.contact_turning_stiffness
        lag = (2.0 * LOOP_DAMPING if self.kind == "position" else 1.0) / self.bandwidth
        self.total_delay = self.delay + 0.5 / self.rate + lag + 2.0 / SERVO
        self.damping = MARGIN * self.stiffness * self.total_delay

    def turning_damping(self, lever: float = 0.0) -> float:
        """Rotational damping D_r = 1.5 k_r T_tot [Nms/rad], for a contact at `lever` [m] (`LEVER` or more).

        K_r is k_e lever^2 by default. The mobility is 1/D + lever^2/D_r; with less D_r the tool would bounce.
        """
        given = self._turning
        return MARGIN * (self.stiffness * max(lever, LEVER) ** 2 if given is None else given) * self.total_delay

    @property
    def ticks(self) -> int:
        """Simulation steps between two commands."""
        return round(TICK_HZ / self.rate)

    @property
    def delay_ticks(self) -> int:
        """The delay in simulation steps."""
        return round(self.delay * TICK_HZ)

    @property
    def speed(self) -> float:
        """Speed of the tool under the largest push [m/s]."""
        return self.push[0] / self.damping

    def slow_down(self, speed: float | None = None) -> float:
        """Duration of a skill at a speed [m/s] (default `TAUGHT_SPEED`) over that of its teaching."""
        return max(1.0, (TAUGHT_SPEED if speed is None else speed) / self.speed)

    def told(self, lever: float = 0.0) -> str:
        """The values as one line of text. `lever`: see `turning_damping`."""
        return (
            f"takes a {self.kind} {self.rate:g} times a second and answers {1e3 * self.total_delay:.0f} ms late; "
            f"damping {self.damping:.0f} Ns/m and {self.turning_damping(lever):.2g} Nms/rad for contacts of "
            f"{self.stiffness:.2g} N/m; at most {1e3 * self.speed:.1f} mm/s at {self.push[0]:g} N, so skills take "
            f"{self.slow_down():.1f} times as long as taught"
        )

    def figures(self) -> dict[str, float | str]:
        """The values by name."""
        return {
            "takes": self.kind, "rate_hz": self.rate, "total_delay_s": self.total_delay, "damping": self.damping,
            "turning_damping": self.turning_damping(), "speed_m_s": self.speed, "slow_down": self.slow_down(),
        }  # fmt: skip

    def doubts(self) -> Iterator[str]:
        """Warnings about slow or late arms that still work."""
        if self.speed < 3e-3:  # m/s
            yield (
                f"at {self.push[0]:g} N the tool moves at {1e3 * self.speed:.2g} mm/s, "
                f"{self.slow_down():.0f} times slower than taught"
            )
        if self.total_delay > 0.08:  # s
            yield f"the arm answers {1e3 * self.total_delay:.0f} ms late, where 20 to 80 ms are usual"


def check_control(control: Control, where: str) -> None:
    """Refuse impossible values, and an arm that is stable only at a standstill.

    Raises:
        InputError: names the key.
    """
    given = {f.name: getattr(control, f.name) for f in fields(control) if f.name != "interface"}
    extra = [name for name, value in given.items() if value is not None and name != "rate_hz"]
    if control.interface == "torque":
        require_delay(control.late_s, f"{where}: control.delay_s")
        if extra := [name for name in extra if name != "delay_s"]:
            text = f"is for arms that take velocities or positions, and the interface is {control.interface!r}"
            raise InputError(f"{where}: control.{extra[0]}", text, 'leave it out, or set interface = "position"')
        return
    for name in extra:
        value = given[name]
        if not (0.0 <= value < math.inf) or (value == 0.0 and name != "delay_s"):
            raise InputError(f"{where}: control.{name}", f"is {value:g}", "give a positive, finite number")
    ticks = TICK_HZ / control.rate_hz
    if abs(ticks - round(ticks)) > 1e-9 or ticks < 1.0:
        text = f"is {control.rate_hz:g}, and the simulated arm's {TICK_HZ:g} Hz is no whole multiple of it"
        raise InputError(f"{where}: control.rate_hz", text, "give 125, 200, 250, 500 or 1000")
    found = control.admittance
    late = found.delay * TICK_HZ
    if abs(late - round(late)) > 1e-6 or found.delay > 1.0:
        text = f"is {found.delay:g} s, not a whole number of milliseconds up to 1 s"
        raise InputError(f"{where}: control.delay_s", text, "round it up")
    if found.bandwidth > 2.0 * math.pi * 200.0:
        text = f"is {found.bandwidth / (2.0 * math.pi):g} Hz, faster than an arm's inner loop"
        raise InputError(f"{where}: control.bandwidth_hz", text, "give 200 at most")
    if found.speed < LEAST_SPEED:
        text = (
            f"an arm that answers {1e3 * found.total_delay:.0f} ms late needs a damping of {found.damping:.3g} Ns/m "
            f"against a contact of {found.stiffness:.2g} N/m, and {found.push[0]:g} N then move it at "
            f"{1e3 * found.speed:.2g} mm/s: it cannot be stable and move"
        )
        least = LEAST_SPEED * found.damping
        fix = (
            f"shorten delay_s, mount the tool softly (a lower contact_stiffness), or give push_n = {least:.0f} or more"
        )
        raise InputError(f"{where}: control", text, fix)
