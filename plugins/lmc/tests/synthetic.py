r"""Recordings written down from statics: what a learner must make of them is known in closed form.

A tool that slides along the unit vector t on a plane with unit normal n feels f = N (n - mu t), whatever pushes it.
Nothing here is learned from skillframe but the record itself and the exponential of rotations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, quaternion_from_matrix, rotation_matrix

DOWN = np.diag([1.0, -1.0, -1.0])  # tool z axis points down


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How a recording is written down."""

    rate: float = 500.0
    speed: float = 0.03
    noise_m: float = 0.0
    noise_n: float = 0.0
    seed: int = 0
    meta: tuple[tuple[str, Any], ...] = ()

    def with_meta(self, **meta: Any) -> Recipe:
        return replace(self, meta=tuple(meta.items()))


def recording(
    position: Float, rotation: Float, wrench: Float, recipe: Recipe, time: Float | None = None
) -> Demonstration:
    """A demonstration from arrays over time, with sensor noise."""
    rng = np.random.default_rng(recipe.seed)
    n = len(position)
    noise = rng.normal(size=(n, 6)) * np.repeat([recipe.noise_n, 0.05 * recipe.noise_n], 3)
    return Demonstration(
        time=np.arange(n) / recipe.rate if time is None else time,
        position=position + recipe.noise_m * rng.normal(size=(n, 3)),
        quaternion=quaternion_from_matrix(rotation),
        wrench=wrench + noise,
        meta=dict(recipe.meta),
    )


def straight(direction: Sequence[float], length: float, force: Sequence[float], recipe: Recipe) -> Demonstration:
    """A straight motion at constant speed under a constant force."""
    t = np.array(direction) / np.linalg.norm(direction)
    n = max(int(length / recipe.speed * recipe.rate), 10)
    position = np.array([0.4, 0.1, 0.3]) + np.linspace(0.0, length, n)[:, None] * t
    wrench = np.concatenate([np.tile(np.array(force, dtype=float), (n, 1)), np.zeros((n, 3))], axis=1)
    return recording(position, np.tile(DOWN, (n, 1, 1)), wrench, recipe)


def slide(
    slope: float, friction: float, recipe: Recipe | None = None, *, side: float = 1.0, normal_force: float = 8.0,
    length: float = 0.05,
) -> Demonstration:  # fmt: skip
    """Sliding down one side of a valley along y, the slope in degrees."""
    a = np.radians(slope)
    along = np.array([side * np.cos(a), 0.0, -np.sin(a)])
    normal = np.array([side * np.sin(a), 0.0, np.cos(a)])
    return straight(along, length, normal_force * (normal - friction * along), recipe or Recipe())


def valley(slope: float, friction: float, recipe: Recipe | None = None, **more: Any) -> list[Demonstration]:
    """One slide down each side."""
    return [slide(slope, friction, recipe, side=side, **more) for side in (1.0, -1.0)]


def wavering(slope: float, friction: float, sigma: float, seed: int, *, length: float = 0.05) -> list[Demonstration]:
    """A valley whose slides meander along y as a person's direction noise (OU, 0.5 s, sigma in degrees) makes them."""
    return [
        _wavering(slope, friction, np.radians(sigma), side, seed * 2 + i, length) for i, side in enumerate((1.0, -1.0))
    ]


def _wavering(slope: float, friction: float, sigma: float, side: float, seed: int, length: float) -> Demonstration:
    recipe = Recipe(noise_m=5e-5, noise_n=0.3, seed=seed)
    rng = np.random.default_rng([9, seed])
    a, dt, tau = np.radians(slope), 1.0 / recipe.rate, 0.5
    along = np.array([side * np.cos(a), 0.0, -np.sin(a)])
    normal = np.array([side * np.sin(a), 0.0, np.cos(a)])
    across = np.array([0.0, 1.0, 0.0])
    n = int(length / recipe.speed * recipe.rate)
    wander = np.zeros(n)
    wander[0] = sigma * rng.normal()
    for k in range(1, n):
        wander[k] = wander[k - 1] * (1.0 - dt / tau) + sigma * np.sqrt(2.0 * dt / tau) * rng.normal()
    heading = np.cos(wander)[:, None] * along + np.sin(wander)[:, None] * across
    position = np.cumsum(recipe.speed * dt * heading, axis=0)
    force = 8.0 * (normal - friction * heading)
    return recording(position, np.tile(DOWN, (n, 1, 1)), np.concatenate([force, 0.0 * force], axis=1), recipe)


def turning(
    axis: Sequence[float], angle: float, torque: Sequence[float], recipe: Recipe | None = None, *,
    force: Sequence[float] = (0.0, 0.0, 0.0), pitch: float = 0.0, arm: Sequence[float] = (0.0, 0.0, 0.0),
) -> Demonstration:  # fmt: skip
    """Turning by an angle about a fixed axis through a point of the tool, advancing by a pitch [m/rad]."""
    recipe = recipe or Recipe()
    unit = np.array(axis) / np.linalg.norm(axis)
    n = max(int(angle / 0.3 * recipe.rate), 10)
    angles = np.linspace(0.0, angle, n)
    rotation = rotation_matrix(angles[:, None] * unit) @ DOWN
    pivot = np.array([0.4, 0.1, 0.3]) + angles[:, None] * pitch * unit
    position = pivot - rotation @ np.array(arm)
    wrench = np.tile(np.concatenate([force, torque]).astype(float), (n, 1))
    return recording(position, rotation, wrench, recipe)


def levering(recipe: Recipe | None = None, *, reach: float = 0.2, force: float = 10.0) -> Demonstration:
    """A rod turned over an edge at its tip: the edge drives the wrist along an arc. It is recorded at the wrist.

    The edge holds the tip, so the hand's pure torque makes the wrist move along v = w x r; the edge pushes along v.
    """
    recipe = recipe or Recipe()
    n = int(2.5 * recipe.rate)
    angles = np.linspace(0.0, np.radians(50.0), n)
    rotation = rotation_matrix(angles[:, None] * np.array([0.0, 1.0, 0.0])) @ DOWN
    tip = np.array([0.0, 0.0, reach])
    lever = rotation @ tip  # wrist to tip, base
    along = np.cross(np.array([0.0, 1.0, 0.0]), -lever)
    push = force * along / np.linalg.norm(along, axis=1)[:, None]
    wrench = np.concatenate([push, np.cross(lever, push)], axis=1)
    return recording(np.array([0.4, 0.1, 0.3]) - lever, rotation, wrench, recipe)


def pair_of_alignments(recipe: Recipe | None = None, tilt: float = 8.0) -> list[Demonstration]:
    """A tool pressed down while the hand turns it upright, from +tilt and from -tilt degrees about y, at the wrist."""
    return [_alignment(sign * np.radians(tilt), recipe or Recipe()) for sign in (1.0, -1.0)]


def _alignment(tilt: float, recipe: Recipe) -> Demonstration:
    n = int(2.0 * recipe.rate)
    angles = np.linspace(tilt, 0.0, n)
    rotation = rotation_matrix(angles[:, None] * np.array([0.0, 1.0, 0.0])) @ DOWN
    depth = np.linspace(0.0, 0.04, n)
    tip = np.array([0.4, 0.0, 0.2]) - depth[:, None] * np.array([0.0, 0.0, 1.0])
    wrist = tip - rotation @ np.array([0.0, 0.0, 0.2])
    force = np.tile([0.0, 0.0, 6.0], (n, 1))
    torque = np.tile([0.0, np.sign(tilt) * 0.6, 0.0], (n, 1))  # resists the turn to upright
    named = replace(recipe, meta=(("frames", {"tip": [0.0, 0.0, 0.2]}), *recipe.meta))
    return recording(wrist, rotation, np.concatenate([force, torque], axis=1), named)


def rotated(demonstration: Demonstration, turn: Float) -> Demonstration:
    """The same recording in another base."""
    R = demonstration.pose.rotation
    wrench = demonstration.wrench
    return replace(
        demonstration,
        position=demonstration.position @ turn.T,
        quaternion=quaternion_from_matrix(turn @ R),
        wrench=np.concatenate([wrench[:, :3] @ turn.T, wrench[:, 3:] @ turn.T], axis=1),
    )


def moved(demonstration: Demonstration, shift: Sequence[float]) -> Demonstration:
    """The same recording somewhere else."""
    return replace(demonstration, position=demonstration.position + np.array(shift))


def slowed(demonstration: Demonstration, factor: float) -> Demonstration:
    """The same recording, slower by a factor."""
    return replace(demonstration, time=demonstration.time * factor)


def stronger(demonstration: Demonstration, factor: float) -> Demonstration:
    """The same recording with every force and torque scaled."""
    return replace(demonstration, wrench=demonstration.wrench * factor)


def with_pause(demonstration: Demonstration, at: float, seconds: float) -> Demonstration:
    """The same recording with a pause: the tool stands still under the force it had."""
    n = int(at * len(demonstration))
    extra = int(seconds * demonstration.rate)
    index = np.concatenate([np.arange(n), np.full(extra, n), np.arange(n, len(demonstration))])
    step = 1.0 / demonstration.rate
    return replace(
        demonstration,
        time=np.arange(len(index)) * step,
        position=demonstration.position[index],
        quaternion=demonstration.quaternion[index],
        wrench=demonstration.wrench[index],
    )


def resampled(demonstration: Demonstration, rate: float) -> Demonstration:
    """The same recording at another rate."""
    time = np.arange(0.0, demonstration.duration, 1.0 / rate)

    def along(values: Float) -> Float:
        clock = demonstration.time - demonstration.time[0]
        return np.stack([np.interp(time, clock, values[:, k]) for k in range(values.shape[1])], axis=1)

    quaternion = along(demonstration.quaternion)
    return replace(
        demonstration,
        time=time,
        position=along(demonstration.position),
        quaternion=quaternion / np.linalg.norm(quaternion, axis=1)[:, None],
        wrench=along(demonstration.wrench),
    )
