r"""What an arm takes as commands, torques, velocities or positions, and what follows for its speed in contact.

An arm that takes velocities or positions answers late. Its compliance is then made by an admittance law whose damping
D has to outweigh the stiffness k_e of what it may touch over the whole delay T_tot from wrench to motion. The figures
are ours, from the exact monodromy of the loop in one dimension (`tests/oracle/stiff_wall.py`):

    T_tot = T + 1/(2 rate) + lag + 2/s,     lag = 2 zeta/w (position), 1/w (velocity)
    D_min = min(0.57 k_e T_tot + 0.15 sqrt(k_e M), k_e T_tot),     D = 1.5 k_e T_tot

T is the transport delay, w the inner loop's bandwidth, s the corner of the servo below it, which yields under load. A
push of F then moves the tool at F / D at most, and a skill that was taught at 20 mm/s takes so many times longer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Literal

from skillframe.errors import InputError
from skillframe.signals.delay import require_delay

TICK_HZ = 1000.0
"""Of the simulated robot and its servos, whatever the rate of commands."""
LOOP_DAMPING, SERVO_HZ = 0.8, 30.0
"""Damping ratio of a position loop, and corner of the servo below it [Hz]: ours, nothing is published."""
SERVO = 2.0 * math.pi * SERVO_HZ
"""s [rad/s]."""
MARGIN = 1.5
"""D over k_e T_tot: 2.6 times the least that is stable; the peak at touch-down is then 1.2 times the push."""
VIRTUAL_MASS, VIRTUAL_INERTIA = 5.0, 0.05
"""M of the law [kg, kg m^2]: ours. It smooths sensor noise and hardly bears on stability."""
TAUGHT_SPEED = 0.02
"""[m/s] at which people show a motion in contact; time limits of skills are made for it (ours)."""
LEAST_SPEED, SLOW_SPEED, LONG_DELAY = 5e-4, 3e-3, 0.08
"""Below the first an arm cannot be used, below the second, or above the third, `robots check` warns [m/s, s]."""
LEVER = 0.045
"""[m] from the centre of compliance to a contact, at least: turns a stiffness into one against turning (ours)."""
DEFAULTS = {"delay_s": 0.008, "bandwidth_hz": 15.0, "contact_stiffness": 5e4, "push_n": 20.0, "push_nm": 2.0}
LARGEST_DELAY, LARGEST_BANDWIDTH = 1.0, 200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """[control] of robot.toml. What is None takes the default. All but rate and delay is for velocities and positions.

    Attributes:
        rate_hz: of the impedance loop, or of the commands that the arm takes [Hz, 1 to 100kHz]; none here is faster.
        interface: what the arm takes.
        delay_s: from a command to its torque, none by default; where the arm takes velocities or positions, from a
            command to the first motion, the sensor's own included [s].
        bandwidth_hz: of the arm's inner loop [Hz].
        contact_stiffness: of part, tool, sensor and arm in series [N/m].
        contact_turning_stiffness: the same about the centre of compliance [Nm/rad].
        push_n: largest force that the law adds to the contact [N].
        push_nm: largest torque that the law adds to the contact [N m].
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
        """Delay from a command to its torque, where the arm takes torques [s]."""
        return self.delay_s or 0.0 if self.interface == "torque" else 0.0

    @property
    def tick_hz(self) -> float:
        """Of the simulated robot [Hz]."""
        return self.rate_hz if self.interface == "torque" else TICK_HZ

    def pace(self, speed: float | None = None) -> float:
        """How many times longer than taught a skill takes. 1 for torques. `speed` as of `Admittance.slow_down`."""
        return 1.0 if self.interface == "torque" else self.admittance.slow_down(speed)

    def figures(self) -> dict[str, float | str]:
        """What the arm takes and what follows, for files and scripts, in SI units."""
        return {"takes": "torque", "rate_hz": self.rate_hz} if self.interface == "torque" else self.admittance.figures()

    def guided(self) -> Control:
        """The arm in a person's hands, who moves it against no loop of its own: as with torques."""
        return self if self.interface == "torque" else Control()

    @property
    def admittance(self) -> Admittance:
        """What follows for an arm that takes velocities or positions."""
        return Admittance(self)


class Admittance:
    """Figures of an arm that takes velocities or positions.

    Args:
        control: as declared; its interface is not "torque".

    Attributes:
        kind, rate: what it takes, and how often a second; delay: T [s]; bandwidth: w [rad/s]; stiffness: k_e [N/m].
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
        """D_r = 1.5 k_r T_tot [Nms/rad]. K_r is k_e lever^2 where robot.toml gives none.

        A contact that far from the centre of compliance is moved by force and torque together; its mobility is
        1/D + lever^2/D_r, and the tool would bounce if it turned more easily than it shifts.

        Args:
            lever: from the centre of compliance to where the tool touches, `LEVER` at least [m].
        """
        given = self._turning
        return MARGIN * (self.stiffness * max(lever, LEVER) ** 2 if given is None else given) * self.total_delay

    @property
    def ticks(self) -> int:
        """Ticks of the simulated robot between two commands."""
        return round(TICK_HZ / self.rate)

    @property
    def delay_ticks(self) -> int:
        """The delay in ticks of the simulated robot."""
        return round(self.delay * TICK_HZ)

    @property
    def speed(self) -> float:
        """At which the largest push moves the tool [m/s]."""
        return self.push[0] / self.damping

    def slow_down(self, speed: float | None = None) -> float:
        """How many times longer than taught a skill takes, 1 at least.

        Args:
            speed: at which the skill moves, `TAUGHT_SPEED` where it is not known [m/s].
        """
        return max(1.0, (TAUGHT_SPEED if speed is None else speed) / self.speed)

    def told(self, lever: float = 0.0) -> str:
        """The figures in a line, for people. `lever` as of `turning_damping`."""
        return (
            f"takes a {self.kind} {self.rate:g} times a second and answers {1e3 * self.total_delay:.0f} ms late; "
            f"damping {self.damping:.0f} Ns/m and {self.turning_damping(lever):.2g} Nms/rad for contacts of "
            f"{self.stiffness:.2g} N/m; at most {1e3 * self.speed:.1f} mm/s at {self.push[0]:g} N, so skills take "
            f"{self.slow_down():.1f} times as long as taught"
        )

    def figures(self) -> dict[str, float | str]:
        """The same, by name."""
        return {
            "takes": self.kind, "rate_hz": self.rate, "total_delay_s": self.total_delay, "damping": self.damping,
            "turning_damping": self.turning_damping(), "speed_m_s": self.speed, "slow_down": self.slow_down(),
        }  # fmt: skip

    def doubts(self) -> Iterator[str]:
        """What is slow and still works, in sentences."""
        if self.speed < SLOW_SPEED:
            yield (
                f"at {self.push[0]:g} N the tool moves at {1e3 * self.speed:.2g} mm/s, "
                f"{self.slow_down():.0f} times slower than taught"
            )
        if self.total_delay > LONG_DELAY:
            yield f"the arm answers {1e3 * self.total_delay:.0f} ms late, where 20 to 80 ms are usual"


def check_control(control: Control, where: str) -> None:
    """Refuse what no arm can be told, and an arm that would be stable only if it stood still.

    Raises:
        InputError: says which key, and what to give.
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
        _check_value(f"{where}: control.{name}", given[name], may_be_zero=name == "delay_s")
    ticks = TICK_HZ / control.rate_hz
    if abs(ticks - round(ticks)) > 1e-9 or ticks < 1.0:
        text = f"is {control.rate_hz:g}, and the simulated arm's {TICK_HZ:g} Hz is no whole multiple of it"
        raise InputError(f"{where}: control.rate_hz", text, "give 125, 200, 250, 500 or 1000")
    found = control.admittance
    late = found.delay * TICK_HZ
    if abs(late - round(late)) > 1e-6 or found.delay > LARGEST_DELAY:
        text = f"is {found.delay:g} s, not a whole number of milliseconds up to {LARGEST_DELAY:g} s"
        raise InputError(f"{where}: control.delay_s", text, "round it up")
    if found.bandwidth > 2.0 * math.pi * LARGEST_BANDWIDTH:
        text = f"is {found.bandwidth / (2.0 * math.pi):g} Hz, faster than an arm's inner loop"
        raise InputError(f"{where}: control.bandwidth_hz", text, f"give {LARGEST_BANDWIDTH:g} at most")
    if found.speed < LEAST_SPEED:
        raise InputError(f"{where}: control", *_standing(found))


def _check_value(where: str, value: float, may_be_zero: bool) -> None:
    if not (0.0 <= value < math.inf) or (value == 0.0 and not may_be_zero):
        raise InputError(where, f"is {value:g}", "give a positive, finite number")


def _standing(found: Admittance) -> tuple[str, str]:
    """Why an arm cannot be used, and what to do."""
    text = (
        f"an arm that answers {1e3 * found.total_delay:.0f} ms late needs a damping of {found.damping:.3g} Ns/m "
        f"against a contact of {found.stiffness:.2g} N/m, and {found.push[0]:g} N then move it at "
        f"{1e3 * found.speed:.2g} mm/s: it cannot be stable and move"
    )
    least = LEAST_SPEED * found.damping
    fix = f"shorten delay_s, mount the tool softly (a lower contact_stiffness), or give push_n = {least:.0f} or more"
    return text, fix
