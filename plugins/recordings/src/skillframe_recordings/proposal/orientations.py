r"""Format of a recorded orientation: quaternion or Euler order, rotation vector, or matrix.

Each format is tested on the rest of the recording, the surest test first:

- The tool must not jump (`checks`). Wrong Euler orders jump near gimbal lock or at half a turn.
- A recorder that keeps w positive changes the sign of all four numbers when w passes zero.
- A recorded angular velocity matches in base or tool axes, to a residual below 0.3.
- A recorded acceleration shows gravity at rest in base axes.
- Weight and bias of a turning sensor fit the force (`checks`) five times better.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from skillframe.demonstration import (
    LEAST_RESIDUAL,
    LEAST_TURN,
    QUATERNION,
    RESIDUAL_RATIO,
    SHARES,
    Columns,
    fit_weight_and_bias,
    refuse_jumps,
)
from skillframe.errors import InputError
from skillframe.frames import (
    Float,
    matrix_from_quaternion,
    norm,
    quaternion_from_matrix,
    rotate,
    rotation_matrix,
    rotation_vector,
)
from skillframe_recordings.suspicions import kept_positive
from skillframe_recordings.thresholds import PROPOSAL

SAMPLES = 400
"""Most samples to which weight and bias are fitted."""


class OrientationReading(NamedTuple):
    """A format ("wxyz", "ZYX", "vector") and its orientations (T, 3, 3) in base."""

    name: str
    rotation: Float


class Witness(NamedTuple):
    """Other signals of the recording, each (T, ...) or None, in SI units."""

    time: Float
    force: Float | None = None
    spin: Float | None = None
    acceleration: Float | None = None


class Choice(NamedTuple):
    """The proposed format, its reason, and whether data confirm it."""

    name: str
    rotation: Float
    reason: str
    sure: bool


def quaternion_readings(values: Float) -> list[OrientationReading]:
    """Return scalar last and scalar first, of four columns in file order."""
    return [
        OrientationReading("xyzw", matrix_from_quaternion(values)),
        OrientationReading("wxyz", matrix_from_quaternion(values[:, [1, 2, 3, 0]])),
    ]


def angle_readings(angles: Float) -> list[OrientationReading]:
    """Return the six orders of roll, pitch, yaw (T, 3) [rad] about moving axes. Fixed axes reverse them."""
    readings = []
    for order in permutations("XYZ"):
        turn: Float = np.broadcast_to(np.eye(3), (len(angles), 3, 3))
        for axis in map("XYZ".index, order):
            vector = np.zeros_like(angles)
            vector[:, axis] = angles[:, axis]
            turn = turn @ rotation_matrix(vector)
        readings.append(OrientationReading("".join(order), turn))
    return readings


def vector_reading(vector: Float) -> OrientationReading:
    """Return the format of a rotation vector (T, 3) [rad]."""
    return OrientationReading("vector", rotation_matrix(vector))


def choose(readings: Sequence[OrientationReading], prior: str, witness: Witness, raw: Float | None = None) -> Choice:
    """Return the format that the recording confirms, else the prior one.

    Args:
        readings: two or more formats.
        prior: name of the one that the header or convention suggests.
        witness: other signals.
        raw: (T, 4) quaternion in file order.
    """
    expected = next(r for r in readings if r.name == prior)
    smooth = []
    for r in readings:
        quaternion = quaternion_from_matrix(r.rotation)
        try:
            refuse_jumps(Columns({"t": witness.time, **dict(zip(QUATERNION, quaternion.T, strict=True))}, ""))
        except InputError:
            continue
        smooth.append(r)
    others = _others(smooth, expected if expected in smooth else (smooth or [expected])[0])
    if smooth and len(smooth) < len(readings) and not others:
        return Choice(smooth[0].name, smooth[0].rotation, "in every other order the tool would jump", True)
    candidates = smooth or list(readings)
    best = expected if expected in candidates else candidates[0]
    if not _others(candidates, best):
        return Choice(best.name, best.rotation, "the other orders give the same orientation to 1 degree", True)
    for name, reason in _verdicts(candidates, witness, raw):
        found = next(r for r in candidates if r.name == name)
        return Choice(found.name, found.rotation, reason, True)
    return Choice(best.name, best.rotation, "the recording does not determine the order", False)


def _others(readings: Sequence[OrientationReading], one: OrientationReading) -> list[OrientationReading]:
    return [
        r
        for r in readings
        if r is not one
        and float(norm(rotation_vector(np.swapaxes(r.rotation, -1, -2) @ one.rotation)).max()) > PROPOSAL.same_rad
    ]


def _verdicts(readings: Sequence[OrientationReading], witness: Witness, raw: Float | None) -> Iterator[tuple[str, str]]:
    if raw is not None:
        kept, turns = kept_positive(raw)
        if kept in ([0], [3]):
            name = "wxyz" if kept == [0] else "xyzw"
            which = "first" if kept == [0] else "last"
            yield name, f"its sign is turned {turns} times so that the {which} number is never negative, as w is kept"
    scores = (
        (_spin_left, PROPOSAL.spin_left, PROPOSAL.better, "the angular velocity's columns agree with it alone"),
        (
            _gravity_left,
            PROPOSAL.gravity_left,
            PROPOSAL.better,
            "the accelerometer's gravity stands still in base axes with it alone",
        ),
    )
    for score, most, ratio, reason in scores:
        found = [score(r.rotation, witness) for r in readings]
        if None not in found:
            order = np.argsort(np.array(found, dtype=float))
            first, second = (float(np.array(found, dtype=float)[i]) for i in order[:2])
            if first < most and second > ratio * first:
                yield readings[order[0]].name, reason
    yield from _by_weight(readings, witness)


def spin_of(rotation: Float, time: Float) -> Float:
    """Return the angular velocity (T, 3) in base axes from orientations."""
    turn = rotation_vector(np.swapaxes(rotation[:-1], -1, -2) @ rotation[1:]) / np.diff(time)[:, None]
    return np.concatenate([rotate(rotation[:-1], turn), rotate(rotation[-2:-1], turn[-1:])])


def _spin_left(rotation: Float, witness: Witness) -> float | None:
    if witness.spin is None or not norm(witness.spin).max() > 0.0:
        return None
    base = spin_of(rotation, witness.time)
    both = (base, rotate(np.swapaxes(rotation, -1, -2), base))
    size = float(np.sqrt((witness.spin**2).mean()))
    return min(float(np.sqrt(((own - witness.spin) ** 2).mean())) for own in both) / size


def _gravity_left(rotation: Float, witness: Witness) -> float | None:
    if witness.acceleration is None or not norm(witness.acceleration.mean(axis=0)) > 0.0:
        return None
    if norm(rotation_vector(rotation[0].T @ rotation)).max() < LEAST_TURN:
        return None
    turned = rotate(rotation, witness.acceleration)
    return float(np.sqrt(((turned - np.median(turned, axis=0)) ** 2).sum(axis=1).mean()) / norm(turned).mean())


def weight_left(force: Float, rotation: Float, frame: str) -> list[float]:
    """Return median residuals [N] of weight and bias over a quarter, half, three quarters and all."""
    pick = np.linspace(0, len(force) - 1, min(SAMPLES, len(force))).round().astype(int)
    force, rotation = force[pick], rotation[pick]
    parts = [slice(0, max(2, round(share * len(force)))) for share in SHARES]
    turned = [norm(rotation_vector(rotation[0].T @ rotation[part])).max() >= LEAST_TURN for part in parts]
    fits = [fit_weight_and_bias(force[part], rotation[part], frame)[1] for part in parts]
    return [fit if turns else np.inf for fit, turns in zip(fits, turned, strict=True)]


def _by_weight(readings: Sequence[OrientationReading], witness: Witness) -> Iterator[tuple[str, str]]:
    if witness.force is None:
        return
    force = witness.force
    fits = np.array([[weight_left(force, r.rotation, frame) for frame in ("tool", "base")] for r in readings])
    for part in range(fits.shape[2]):
        least = fits[:, :, part].min(axis=1)
        order = np.argsort(least)
        first, second = least[order[0]], least[order[1]]
        if np.isfinite(second) and second > max(LEAST_RESIDUAL, RESIDUAL_RATIO * first):
            left = f"to {first:.2f} N, otherwise to {second:.2f} N"
            yield readings[order[0]].name, f"weight and bias of the turning sensor explain the force {left}"
