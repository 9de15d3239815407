"""Small valid example documents."""

from __future__ import annotations

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.extend import Document, LearnOptions
from skillframe.frames import Float

RATE, PUSH = 100.0, 10.0  # Hz, N


def example(algorithm: str = "sampling") -> Document:
    """A search document of an algorithm, learned from a synthetic search of a plane."""
    from skillframe.document import learned
    from skillframe.extend import registry

    settings = {"algorithm": algorithm, "speed": 0.015, "time": 4.0}
    return learned(registry().skill("search"), [searching()], LearnOptions(settings=settings))


def searching(seed: int = 3, deviation: tuple[float, float] = (0.004, 0.004), friction: float = 0.2) -> Demonstration:
    """20 s of an Ornstein-Uhlenbeck search of a plane with Coulomb friction and no sensor noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 1.0 / RATE)
    position = np.zeros((len(time), 3))
    position[:, :2] = _wander(rng, len(time)) * deviation
    velocity: Float = np.asarray(np.gradient(position, 1.0 / RATE, axis=0))
    speed = np.sqrt((velocity**2).sum(axis=1, keepdims=True))
    force = np.array([0.0, 0.0, PUSH]) - friction * PUSH * velocity / np.sqrt(speed**2 + 1e-8)
    wrench = np.concatenate([force, np.zeros_like(force)], axis=1)
    return Demonstration(
        time=time, position=position + np.array([0.4, 0.0, 0.2]),
        quaternion=np.tile((1.0, 0.0, 0.0, 0.0), (len(time), 1)),
        wrench=wrench, meta={"task": "search", "rate": RATE, "contact": True, "frames": {"tip": [0.0, 0.0, 0.2]}},
    )  # fmt: skip


def seating() -> Document:
    """A seating learned from two synthetic demonstrations of a plug."""
    from skillframe.document import learned
    from skillframe.extend import registry

    return learned(registry().skill("seat"), [seated(0.14), seated(-0.14, 1)], LearnOptions())


def seated(tilt: float, seed: int = 0) -> Demonstration:
    """10 mm down in air, tilted about y [rad], then 12 mm in contact, upright at the end, tip at (0.4, 0, 0.2)."""
    time = np.arange(0.0, 3.0, 1.0 / (2.0 * RATE))
    down = np.interp(time, [0.0, 0.5, 1.5, 3.0], [0.0, 0.0, 0.010, 0.022])
    angle = np.interp(time, [0.0, 1.5, 2.7], [tilt, tilt, 0.0])
    tip = np.array([0.4, 0.0, 0.222]) - down[:, None] * np.array([0.0, 0.0, 1.0])
    axis = np.stack([-np.sin(angle), 0.0 * angle, -np.cos(angle)], axis=1)
    noise = np.random.default_rng(seed).standard_normal((len(time), 6)) * np.repeat([0.05, 0.002], 3)
    noise[:, 2] += np.where(time > 1.5, PUSH, 0.0)
    half = 0.5 * angle
    return Demonstration(
        time=time, position=tip - 0.2 * axis, wrench=noise,
        quaternion=np.stack([np.cos(half), 0.0 * half, -np.sin(half), 0.0 * half], axis=1),
        meta={"task": "plug", "rate": 2.0 * RATE, "contact": True, "frames": {"tip": [0.0, 0.0, 0.2]}},
    )  # fmt: skip


def _wander(rng: np.random.Generator, count: int) -> Float:
    """(count, 2) random motion of unit variance: two Ornstein-Uhlenbeck filters of 0.5 s in series."""
    values, state, inner = np.empty((count, 2)), np.zeros(2), np.zeros(2)
    decay = 1.0 / (0.5 * RATE)
    for k in range(count):
        inner = inner - inner * decay + np.sqrt(2.0 * decay) * rng.standard_normal(2)
        state = state + (inner - state) * decay
        values[k] = state
    deviation: Float = values / np.maximum(values.std(axis=0), 1e-9)
    return deviation
