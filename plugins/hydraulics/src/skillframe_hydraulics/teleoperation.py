r"""A simulated operator who teaches a hydraulic machine through a small master with scaled force reflection.

The hand is the teacher's (`teacher`), with a limited push and tremor. Between the master's mass and the machine is a
channel:

    m x_m'' = k_h (x_h + tremor - x_m) + b (x_h' - x_m') + clip(f^ / f_s)(t - T)                                   (1)
    X_d = X_0 + s L [quantised x_m, sent every packet, T late],      L of two equal poles                         (2)
    D (X' - [X_d']) + K (X - X_d) = f                      the impedance, `law.hydraulic`  (3)

f^ is estimated from pressures. At a stiff surface f changes by (K + j w D) X_d if X_d' is fed forward, else by K X_d.
By the small-gain theorem the channel is stable for any delay if

    G = |K + j w D [if X_d' is fed]| s / (f_s k_h) < 1,                                                            (4)

with w the corner of L. The teacher's hand also yields sideways, which takes some margin; tests cover the defaults
(G = 0.33). All figures are assumptions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, pi, radians

import numpy as np
from skillframe_teaching.teacher import HANDS, Teacher, TeacherSettings

from skillframe.errors import InputError
from skillframe.frames import Float, Pose
from skillframe.signals import CommandDelay, RateFilter, require_delay
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe.world import Task

__all__ = ["Operator", "OperatorSettings", "TeleoperationChannel", "loop_gain", "require_stable_loop"]

BLOCK = 500
"""Random numbers drawn at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorSettings:
    """The operator, the master, the channel, and the machine's impedance while it is taught.

    Attributes:
        scale: s, motion of the machine over motion of the master.
        force_scale: f_s, force of the machine over force at the hand.
        delay_s: T, one way [s, 0s to 1s].
        hand_stiffness: k_h [N/m, 0 to 1e8].
        hand_damping: b [N s/m].
        mass: m of the master with the hand [kg].
        speed: of the machine's tool [m/s].
        force_max: largest push of the hand [N].
        aim_noise: standard deviation of the pushing direction per axis [rad, 0deg to 90deg].
        tremor: standard deviation at the hand per axis [m].
        tremor_hz: frequency of the tremor [Hz].
        quantum: of the master's encoders [m].
        packet_hz: rate of position and force packets, held between them [Hz, 0.01Hz to 100000Hz].
        force_clip: largest force that the master reflects, per axis [N].
        filter_hz: corner of L [Hz].
        stiffness: K of the machine, the same along all axes [N/m, 0 to 1e8].
        damping: D of the machine, the same along all axes [N s/m].
        feed_velocity: X_d' in equation (3).
        kind: of teacher, in a demonstration's metadata.
    """

    scale: float = 4.0
    force_scale: float = 1000.0
    delay_s: float = 0.05
    hand_stiffness: float = 1200.0
    hand_damping: float = 25.0
    mass: float = 0.3
    speed: float = 0.10
    force_max: float = 8.0
    aim_noise: float = radians(6.0)
    tremor: float = 3e-4
    tremor_hz: float = 9.0
    quantum: float = 3e-5
    packet_hz: float = 100.0
    force_clip: float = 12.0
    filter_hz: float = 2.5
    stiffness: float = 1e5
    damping: float = 1e5
    feed_velocity: bool = False
    kind: str = "teleoperation"

    def __post_init__(self) -> None:
        for name in ("aim_noise", "tremor", "quantum"):
            self._require(name, 0.0 <= getattr(self, name) < inf, "must not be negative")
        for name in (
            "scale", "force_scale", "hand_stiffness", "hand_damping", "mass", "speed", "force_max", "tremor_hz",
            "packet_hz", "force_clip", "filter_hz", "stiffness", "damping",
        ):  # fmt: skip
            self._require(name, 0.0 < getattr(self, name) < inf, "must be positive")
        require_delay(self.delay_s, "teleoperation: delay_s")

    def _require(self, name: str, fine: bool, text: str) -> None:
        if not fine:
            raise InputError(f"teleoperation: {name}", f"{text}, is {getattr(self, name)!r}", "give another value")


def loop_gain(settings: OperatorSettings) -> float:
    """G of equation (4)."""
    fed = 2.0 * pi * settings.filter_hz * settings.damping if settings.feed_velocity else 0.0
    return hypot(settings.stiffness, fed) * settings.scale / (settings.force_scale * settings.hand_stiffness)


def require_stable_loop(settings: OperatorSettings) -> None:
    """Refuse settings whose force reflection may be unstable.

    Raises:
        InputError: with the gain.
    """
    gain = loop_gain(settings)
    if gain < 1.0:
        return
    fed = f" with its velocity fed ({settings.damping:g} N s/m)" if settings.feed_velocity else ""
    raise InputError(
        "teleoperation",
        f"loop gain {gain:.2f} is not below 1, so tool and hand would swing up against each other: stiffness "
        f"{settings.stiffness:g} N/m{fed}, motion scale {settings.scale:g}, force scale {settings.force_scale:g}, "
        f"hand {settings.hand_stiffness:g} N/m",
        "lower the machine's stiffness or the motion scale, or raise the force scale"
        + ("; without the master's velocity the gain is lower" if settings.feed_velocity else ""),
    )


class TeleoperationChannel:
    """One direction of the channel: sampled per packet, held and delayed. (N, 3) at every tick of dt [s]."""

    def __init__(self, settings: OperatorSettings, count: int, dt: float) -> None:
        self._every = max(1, round(1.0 / (settings.packet_hz * dt)))
        self._line = CommandDelay(np.full(count, round(settings.delay_s / dt)), 3)
        self._tick = 0
        self._sent: Float = np.zeros((count, 3))

    def step(self, value: Float) -> Float:
        """The value that arrives when this one is sent, zero before the first packet."""
        if self._tick % self._every == 0:
            self._sent = value.copy()
        self._tick += 1
        return self._line.step(self._sent)


class Operator(Skill):
    """N operators at their masters, for the true pose of the `fixture` per trial, (N, 3) and (N, 3, 3).

    Raises:
        InputError: a loop gain of 1 or more.
    """

    def __init__(self, task: Task, fixture: Pose, settings: OperatorSettings) -> None:
        require_stable_loop(settings)
        person = TeacherSettings(
            kind="teleoperation", aim_noise=settings.aim_noise, speed=settings.speed / settings.scale,
            force_max=settings.force_max, tremor_force=0.0, tremor_torque=0.0,
        )  # fmt: skip
        hand = replace(HANDS["master"], stiffness=settings.hand_stiffness, damping=settings.hand_damping)
        self._hand, self._settings = Teacher(replace(task, hand="master"), fixture, person, hand), settings

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Hold the masters at the machines' present places."""
        s, count, dt = self._settings, len(rngs), observation.dt
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._place, self._velocity = np.zeros((count, 3)), np.zeros((count, 3))
        self._there, self._back = TeleoperationChannel(s, count, dt), TeleoperationChannel(s, count, dt)
        self._reference = RateFilter(s.filter_hz, dt)
        self._reference.start(np.zeros((count, 3)))
        self._tremor = _Tremor(s, [rng.spawn(1)[0] for rng in rngs], dt)
        unit = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        self._impedance = Impedance(s.stiffness * unit, s.damping * unit)
        self._nothing, self._reason = np.zeros((count, 6)), no_reasons(count)
        self._status = np.full(count, Status.RUNNING)
        self._hand.start(self._at_master(observation), rngs)

    def step(self, observation: Observation) -> Command:
        """Move hands, masters and desired places by one tick."""
        s, dt = self._settings, observation.dt
        reflected = self._back.step(observation.wrench[:, :3]) / s.force_scale
        reflected = np.clip(reflected, -s.force_clip, s.force_clip)
        hand = self._hand.step(self._at_master(observation))
        force = s.hand_stiffness * (hand.pose.position + self._tremor.step() - self._place)
        force += s.hand_damping * (hand.twist[:, :3] - self._velocity) + reflected
        self._velocity = self._velocity + dt / s.mass * force  # equation (1)
        self._place = self._place + dt * self._velocity
        counts = self._place if s.quantum == 0.0 else s.quantum * np.round(self._place / s.quantum)
        self._reference.step(s.scale * self._there.step(counts))
        twist = self._nothing.copy()
        if s.feed_velocity:
            twist[:, :3] = self._reference.rate
        pose = Pose(self._home.position + self._reference.value, self._home.rotation)
        return Command(pose, twist, self._impedance, self._nothing, self._status, self._reason)

    def _at_master(self, observation: Observation) -> Observation:
        twist = self._nothing.copy()
        twist[:, :3] = self._velocity
        return Observation(
            observation.time, observation.dt, Pose(self._place, self._home.rotation), twist, self._nothing
        )


class _Tremor:
    """Narrow-band noise (N, 3) [m]: the real part of a rotating vector with random increments."""

    def __init__(self, settings: OperatorSettings, rngs: Sequence[np.random.Generator], dt: float) -> None:
        self._rngs, self._next = list(rngs), BLOCK
        memory = 0.2  # s; the tremor's bandwidth is 1 / (pi x 0.2 s) = 1.6 Hz
        self._turn = np.exp((-1.0 / memory + 2j * pi * settings.tremor_hz) * dt)
        self._kick = settings.tremor * np.sqrt(1.0 - np.abs(self._turn) ** 2)
        self._state = np.zeros((len(self._rngs), 3), dtype=complex)
        self._noise: Float = np.zeros((BLOCK, len(self._rngs), 6))

    def step(self) -> Float:
        if self._next == BLOCK:
            for i, rng in enumerate(self._rngs):
                self._noise[:, i] = rng.standard_normal((BLOCK, 6))
            self._next = 0
        sample = self._noise[self._next]
        self._next += 1
        self._state = self._turn * self._state + self._kick * (sample[:, :3] + 1j * sample[:, 3:])
        return np.ascontiguousarray(self._state.real)
