r"""A simulated operator who teaches a hydraulic machine through a small master that reflects its force, scaled.

The hand is the teacher's (`teacher`), holding the master: stiffness k_h, aim that wanders, a largest push at which it
stops; and a tremor. The master is a mass, and between it and the machine lies a channel:

    m x_m'' = k_h (x_h + tremor - x_m) + b (x_h' - x_m') + clip(f^ / f_s)(t - T)                                   (1)
    X_d = X_0 + s L [quantised x_m, sent every packet, T late],      L of two equal poles                         (2)
    D (X' - [X_d']) + K (X - X_d) = f                                the machine's impedance, `control.hydraulic`  (3)

f^ is the machine's own estimate from its pressures. Against a stiff surface the machine stands still and f moves by
(K + j w D) X_d if X_d' is fed, by K X_d if it is not; back at the hand that is a displacement of f / (f_s k_h). So the
channel is stable for any delay if

    G = |K + j w D [if X_d' is fed]| s / (f_s k_h) < 1,                                                            (4)

the small-gain theorem (textbook), with w the corner of L, about the fastest motion that passes (our choice). That is
for a hand that holds; ours also lets itself be led sideways, which makes it softer below 1 / (2 pi x 0.25 s), and what
is left of the margin at the defaults (G = 0.33) is tested. All figures of operator and channel are ours, from trials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, pi, radians

import numpy as np

from skillframe.errors import InputError
from skillframe.frames import Float, Pose
from skillframe.signals.delay import CommandDelay, require_delay
from skillframe.signals.rates import RateFilter
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe.teaching.teacher import HANDS, Teacher, TeacherSettings
from skillframe.world.scene import Task

__all__ = ["Operator", "OperatorSettings", "TeleoperationChannel", "loop_gain", "require_stable_loop"]

BLOCK = 500
TREMOR_MEMORY = 0.2  # s; the tremor's bandwidth is 1 / (pi x 0.2 s) = 1.6 Hz (ours)


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorSettings:
    """The operator, the master, the channel and the machine's impedance while it is taught.

    Attributes:
        scale: s, motion of the machine over motion of the master.
        force_scale: f_s, force of the machine over force at the hand.
        delay_s: T, one way.
        hand_stiffness: k_h [N/m]; hand_damping: b [N s/m]; mass: m of the master with the hand [kg].
        speed: at which the machine's tool is to move [m/s]. force_max: largest push of the hand [N].
        aim_noise: standard deviation of the pushing direction per axis [rad].
        tremor: standard deviation at the hand per axis [m]; tremor_hz: its frequency.
        quantum: of the master's encoders [m]. packet_hz: how often position and force are sent.
        force_clip: largest force that the master can reflect, per axis [N].
        filter_hz: corner of L.
        stiffness, damping: K [N/m] and D [N s/m] of the machine, the same along all axes.
        feed_velocity: X_d' in equation (3).
        kind: of teacher, as it is written into a demonstration.
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
    """Refuse a set-up whose force reflection may swing up.

    Raises:
        InputError: says the gain.
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
    """One way between master and machine: sampled every packet, held and delayed. (N, 3) at every tick of dt [s]."""

    def __init__(self, settings: OperatorSettings, count: int, dt: float) -> None:
        self._every = max(1, round(1.0 / (settings.packet_hz * dt)))
        self._line = CommandDelay(np.full(count, round(settings.delay_s / dt)), 3)
        self._tick = 0
        self._sent: Float = np.zeros((count, 3))

    def step(self, value: Float) -> Float:
        """What arrives now, when this is there to be sent, or zero before the first packet."""
        if self._tick % self._every == 0:
            self._sent = value.copy()
        self._tick += 1
        return self._line.step(self._sent)


class Operator(Skill):
    """N operators at their masters. Their machines follow what they command.

    Args:
        task: what the operators know, in the fixture frame; its direction is where they push.
        fixture: true pose of the fixture per trial, (N, 3) and (N, 3, 3).
        settings: see `OperatorSettings`.

    Raises:
        InputError: a loop gain of 1 and more.
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
        """Take hold of the masters, whose present place stands for the machines' present place."""
        s, count, dt = self._settings, len(rngs), observation.dt
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())
        self._place, self._velocity = np.zeros((count, 3)), np.zeros((count, 3))
        self._there, self._back = TeleoperationChannel(s, count, dt), TeleoperationChannel(s, count, dt)
        self._reference = RateFilter(s.filter_hz, dt)
        self._reference.start(np.zeros((count, 3)))
        self._tremor = _Tremor(s, [rng.spawn(1)[0] for rng in rngs], dt)
        unit = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        self._impedance = Impedance(s.stiffness * unit, s.damping * unit)
        self._nothing, self._status, self._reason = (
            np.zeros((count, 6)),
            np.full(count, Status.RUNNING),
            no_reasons(count),
        )
        self._hand.start(self._at_master(observation), rngs)

    def step(self, observation: Observation) -> Command:
        """Move hands and masters one tick on, and the machines' desired places with them."""
        s = self._settings
        reflected = self._back.step(observation.wrench[:, :3]) / s.force_scale
        self._move(observation, np.clip(reflected, -s.force_clip, s.force_clip))
        counts = self._place if s.quantum == 0.0 else s.quantum * np.round(self._place / s.quantum)
        self._reference.step(s.scale * self._there.step(counts))
        twist = self._nothing.copy()
        if s.feed_velocity:
            twist[:, :3] = self._reference.rate
        pose = Pose(self._home.position + self._reference.value, self._home.rotation)
        return Command(pose, twist, self._impedance, self._nothing, self._status, self._reason)

    def _move(self, observation: Observation, reflected: Float) -> None:
        """Equation (1), one tick."""
        s, dt = self._settings, observation.dt
        hand = self._hand.step(self._at_master(observation))
        force = s.hand_stiffness * (hand.pose.position + self._tremor.step() - self._place)
        force += s.hand_damping * (hand.twist[:, :3] - self._velocity) + reflected
        self._velocity = self._velocity + dt / s.mass * force
        self._place = self._place + dt * self._velocity

    def _at_master(self, observation: Observation) -> Observation:
        """What the hand sees: the master, not the machine."""
        twist = self._nothing.copy()
        twist[:, :3] = self._velocity
        return Observation(
            observation.time, observation.dt, Pose(self._place, self._home.rotation), twist, self._nothing
        )


class _Tremor:
    """Narrow-band noise about a frequency, (N, 3) [m]: the real part of a turning vector that is kicked about."""

    def __init__(self, settings: OperatorSettings, rngs: Sequence[np.random.Generator], dt: float) -> None:
        self._rngs, self._next = list(rngs), BLOCK
        self._turn = np.exp((-1.0 / TREMOR_MEMORY + 2j * pi * settings.tremor_hz) * dt)
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
