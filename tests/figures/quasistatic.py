r"""Whole demonstrations written down from quasi-statics: a hand that wavers pushes a tool, Coulomb contacts decide.

The hand aims along d_0 with an Ornstein-Uhlenbeck error (0.5 s) and pushes with 9 N, which varies by 2 N. On a plane
with normal n the tool moves along the tangential part of the push if that exceeds friction, and feels
F = N (n - mu t). Sensor noise 0.5 N, 0.01 Nm, 0.05 mm, 1e-4 rad at 250 Hz. Truth is known: the times of the changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, quaternion_from_matrix, rotation_matrix

RATE = 250.0
DT = 1.0 / RATE
DOWN = np.diag([1.0, -1.0, -1.0])


class Made(NamedTuple):
    """A demonstration and the times at which its phases truly change."""

    demonstration: Demonstration
    changes: list[float]


@dataclass(kw_only=True)
class Hand:
    """A person: aim noise per axis [rad], speed [m/s], friction of what he pushes on."""

    rng: np.random.Generator
    noise: float = np.deg2rad(8.0)
    friction: float = 0.2
    rotation: Float = field(default_factory=lambda: DOWN.copy())
    position: Float = field(default_factory=lambda: np.array([0.5, 0.1, 0.3]))
    aim: Float = field(default_factory=lambda: np.zeros(3))
    force: float = 0.0
    rows: list[tuple[Float, Float, Float]] = field(default_factory=list)
    changes: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.speed = self.rng.uniform(0.025, 0.04)
        self.aim = self.noise * self.rng.normal(size=3)

    def mark(self) -> None:
        self.changes.append(len(self.rows) * DT)

    def push(self, direction: Float) -> tuple[Float, float]:
        """Where the hand aims now, and how hard it pushes."""
        self.aim += -self.aim * DT / 0.5 + self.noise * np.sqrt(2.0 * DT / 0.5) * self.rng.normal(size=3)
        self.force += -self.force * DT / 0.5 + 2.0 * np.sqrt(2.0 * DT / 0.5) * self.rng.normal()
        aimed = direction + self.aim
        return aimed / np.linalg.norm(aimed), max(3.0, 9.0 + self.force)

    def tick(self, velocity: Float, force: Float, torque: Float | None = None, turning: Float | None = None) -> None:
        self.position = self.position + velocity * DT
        if turning is not None:
            self.rotation = rotation_matrix(turning * DT) @ self.rotation
        torque = np.zeros(3) if torque is None else torque
        self.rows.append((self.position, self.rotation, np.concatenate([force, torque])))

    def move_free(self, direction: Float, length: float) -> None:
        start = self.position
        while (self.position - start) @ direction < length:
            aimed, _ = self.push(direction)
            self.tick(self.speed * aimed, np.zeros(3))

    def slide(self, direction: Float, normals: list[Float], along: Float, length: float) -> None:
        """Push along `direction` on one plane, or in the groove of two, until `along` has progressed by `length`."""
        start = self.position
        for _ in range(int(20.0 * RATE)):
            if (self.position - start) @ along >= length:
                return
            aimed, size = self.push(direction)
            self.tick(*contact(self.speed * aimed, size * aimed, normals, self.friction))

    def dwell(self, direction: Float, normals: list[Float], seconds: float) -> None:
        for _ in range(int(seconds * RATE)):
            aimed, size = self.push(direction)
            self.tick(np.zeros(3), -size * 0.5 * (aimed + direction) @ stack(normals))

    def finish(self) -> Made:
        position = np.array([r[0] for r in self.rows])
        rotation = np.array([r[1] for r in self.rows])
        wrench = np.array([r[2] for r in self.rows])
        n = len(position)
        shake = rotation_matrix(1e-4 * self.rng.normal(size=(n, 3)))
        noisy = wrench + self.rng.normal(size=(n, 6)) * np.repeat([0.5, 0.01], 3)
        demonstration = Demonstration(
            time=np.arange(n) * DT, position=position + 5e-5 * self.rng.normal(size=(n, 3)),
            quaternion=quaternion_from_matrix(shake @ rotation), wrench=noisy,
        )  # fmt: skip
        return Made(demonstration, self.changes)


def stack(normals: list[Float]) -> Float:
    """Projector on the span of the normals: what they can carry."""
    q, _ = np.linalg.qr(np.array(normals).T)
    return q @ q.T


def contact(velocity: Float, push: Float, normals: list[Float], friction: float) -> tuple[Float, Float]:
    """Velocity and contact force of a tool pushed against planes."""
    carried = push @ stack(normals)
    tangential = push - carried
    loads = np.linalg.lstsq(np.array(normals).T, -carried, rcond=None)[0]
    if loads.min() <= 0.0:  # it leaves one plane
        keep = [n for n, load in zip(normals, loads, strict=True) if load > 0.0]
        return contact(velocity, push, keep, friction) if keep else (velocity, np.zeros(3))
    hold = friction * loads.sum()
    size = np.linalg.norm(tangential)
    if size <= hold:
        return np.zeros(3), -push
    t = tangential / size
    return (velocity @ t) * t, -carried - hold * t


Z = np.array([0.0, 0.0, 1.0])


def valley(seed: int, side: float, *, noise: float = 8.0, slope: float = 45.0, friction: float = 0.2) -> Made:
    """Down one side of a valley along y, then along it."""
    rng = np.random.default_rng([41, seed, int(side > 0)])
    hand = Hand(rng=rng, noise=np.deg2rad(noise), friction=friction)
    a = np.deg2rad(slope)
    normals = [np.array([s * np.sin(a), 0.0, np.cos(a)]) for s in (side, -side)]
    hand.move_free(-Z, rng.uniform(0.008, 0.02))
    hand.mark()
    hand.slide(-Z, normals[:1], side * np.array([1.0, 0.0, 0.0]), rng.uniform(0.03, 0.045))
    hand.mark()
    hand.slide(np.array([0.0, 0.8, -0.6]), normals, np.array([0.0, 1.0, 0.0]), rng.uniform(0.05, 0.08))
    return hand.finish()


def lower_and_slide(seed: int, index: int = 0, *, noise: float = 8.0) -> Made:
    """Down onto a table, then along it."""
    rng = np.random.default_rng([42, seed, index])
    hand = Hand(rng=rng, noise=np.deg2rad(noise))
    hand.move_free(-Z, rng.uniform(0.03, 0.05))
    hand.mark()
    hand.slide(np.array([0.8, 0.0, -0.6]), [Z], np.array([1.0, 0.0, 0.0]), rng.uniform(0.06, 0.08))
    return hand.finish()


def hose(seed: int, index: int = 0, *, noise: float = 8.0) -> Made:
    """Down onto the other coupler, then turned about the flange's axis to interlock."""
    rng = np.random.default_rng([43, seed, index])
    hand = Hand(rng=rng, noise=np.deg2rad(noise))
    hand.move_free(-Z, rng.uniform(0.03, 0.05))
    hand.mark()
    angle, rate = rng.uniform(0.5, 0.8), rng.uniform(0.25, 0.4)
    for _ in range(int(angle / rate * RATE)):
        aimed, size = hand.push(-Z)
        axis = Z + hand.aim
        hand.tick(
            np.zeros(3), -size * aimed @ stack([Z]), torque=-hand.friction * size * 0.02 * Z,
            turning=rate * axis / np.linalg.norm(axis) * np.array([0.1, 0.1, 1.0]),
        )  # fmt: skip
    return hand.finish()


def peg(seed: int, index: int = 0, *, noise: float = 8.0) -> Made:
    """Down with 8 degrees of tilt, aligned by turning on the rim, inserted by 5 cm. Recorded at the wrist."""
    rng = np.random.default_rng([44, seed, index])
    hand = Hand(rng=rng, noise=np.deg2rad(noise))
    tilt = (1.0 if index % 2 else -1.0) * np.deg2rad(8.0)
    hand.rotation = rotation_matrix(np.array([0.0, tilt, 0.0])) @ DOWN
    hand.move_free(-Z, rng.uniform(0.03, 0.05))
    hand.mark()
    turned, rate = 0.0, rng.uniform(0.1, 0.15)
    while turned < abs(tilt):
        aimed, size = hand.push(-Z)
        turning = -np.sign(tilt) * rate * np.array([0.0, 1.0, 0.0])
        lever = hand.rotation @ np.array([0.0, 0.0, 0.2]) + np.array([np.sign(tilt) * 0.0165, 0.0, 0.0])
        force = -size * aimed @ stack([Z])
        hand.tick(np.cross(turning, -lever), force, torque=np.cross(lever, force), turning=turning)
        turned += rate * DT
    hand.mark()
    start = hand.position
    while (start - hand.position) @ Z < 0.05:
        aimed, size = hand.push(-Z)
        sideways = -size * aimed * np.array([1.0, 1.0, 0.0])
        force = sideways + hand.friction * np.linalg.norm(sideways) * Z
        hand.tick(-hand.speed * Z, force, torque=np.cross(np.array([0.0, 0.0, -0.18]), force))
    return hand.finish()


def wipe(seed: int, index: int = 0, *, noise: float = 8.0) -> Made:
    """Down onto a table that leans by up to 50 degrees, round and round on it, and up again."""
    rng = np.random.default_rng([47, seed, index])
    hand = Hand(rng=rng, noise=np.deg2rad(noise))
    leaning = rng.normal(size=3) * np.array([1.0, 1.0, 0.0])
    normal = rotation_matrix(rng.uniform(0.0, 0.9) * leaning / np.linalg.norm(leaning)) @ Z
    across = np.cross(normal, rng.normal(size=3))
    across /= np.linalg.norm(across)
    hand.speed = rng.uniform(0.1, 0.2)
    hand.move_free(-normal, rng.uniform(0.1, 0.2))
    hand.mark()
    wide, narrow = rng.uniform(0.03, 0.08) * np.array([1.0, rng.uniform(0.5, 1.0)])
    period, turns = rng.uniform(1.0, 2.5), rng.uniform(2.2, 5.0)
    for angle in np.arange(0.0, 2.0 * np.pi * turns, 2.0 * np.pi * DT / period):
        aimed, size = hand.push(-normal)
        stroke = -wide * np.sin(angle) * across + narrow * np.cos(angle) * np.cross(normal, across)
        length = float(np.linalg.norm(stroke))
        pushed = 0.5 * aimed + stroke / length
        hand.tick(*contact(2.0 * np.pi / period * length * pushed, size * pushed, [normal], hand.friction))
    hand.mark()
    hand.move_free(normal, rng.uniform(0.1, 0.2))
    return hand.finish()


@cache
def demonstrations(task: str, seed: int, count: int = 3, first: int = 0, **options: float) -> list[Made]:
    """`count` demonstrations of a task, the valley's sides in turn."""
    if task == "valley":
        return [valley(100 * seed + first + i, 1.0 if i % 2 == 0 else -1.0, **options) for i in range(count)]
    make = {"ls": lower_and_slide, "hose": hose, "peg": peg, "wipe": wipe}[task]
    return [make(seed, first + i, **options) for i in range(count)]
