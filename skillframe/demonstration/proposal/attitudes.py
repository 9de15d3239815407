r"""Which reading of an attitude the motion bears out: the order of a quaternion or of Euler angles, vector, matrix.

Every reading is tried on what the recording holds besides, the surest first; thresholds are our choice.

- The tool must not jump (`checks`). A wrong order of Euler angles jumps near gimbal lock, or where an angle passes
  half a turn.
- A recorder that keeps w positive turns the sign of all four numbers where w passes zero.
- An angular velocity in the file is that of the attitude, in base or in tool axes: what is left is below 0.3 of it.
- An accelerometer in the file shows gravity standing still in base axes.
- Weight and bias of a sensor on the turning tool explain the force (`contradiction`) five times better.
- What the tool touches does no work on it: over the motion in contact a wrench in tool axes opposes it (-0.3 of
  \(\int |F| |dx|\) or less) in one reading and is at least 0.6 away in all others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from skillframe.demonstration.checks import refuse_jumps
from skillframe.demonstration.columns import QUATERNION, Columns
from skillframe.demonstration.contradiction import (
    LEAST_RESIDUAL,
    LEAST_TURN,
    RESIDUAL_RATIO,
    SHARES,
    fit_weight_and_bias,
    work_cosine,
)
from skillframe.demonstration.suspicions import kept_positive
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

SAME = np.deg2rad(1.0)
SPIN_LEFT, GRAVITY_LEFT, BETTER = 0.3, 0.2, 2.0
WORK, WORK_APART = -0.3, 0.6
SAMPLES = 400


class AttitudeReading(NamedTuple):
    """One way of reading an attitude's columns: its name ("wxyz", "ZYX", "vector"), and (T, 3, 3) in base."""

    name: str
    rotation: Float


class Witness(NamedTuple):
    """What a recording holds beside its attitude, each (T, ...) or None, in SI units."""

    time: Float
    position: Float | None = None
    force: Float | None = None
    spin: Float | None = None
    acceleration: Float | None = None


class Choice(NamedTuple):
    """The reading that is proposed, why, and whether the data bear it out."""

    name: str
    rotation: Float
    reason: str
    sure: bool


def quaternion_readings(values: Float) -> list[AttitudeReading]:
    """Scalar last and scalar first of four columns in the file's order."""
    return [
        AttitudeReading("xyzw", matrix_from_quaternion(values)),
        AttitudeReading("wxyz", matrix_from_quaternion(values[:, [1, 2, 3, 0]])),
    ]


def angle_readings(angles: Float) -> list[AttitudeReading]:
    """The six orders of roll, pitch, yaw (T, 3) [rad] about moving axes. About fixed ones the same six are reversed."""
    return [AttitudeReading("".join(order), _moving(angles, order)) for order in permutations("XYZ")]


def _moving(angles: Float, order: Sequence[str]) -> Float:
    result: Float = np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    for axis in order:
        vector = np.zeros_like(angles)
        vector[:, "XYZ".index(axis)] = angles[:, "XYZ".index(axis)]
        result = result @ rotation_matrix(vector)
    return result


def vector_reading(vector: Float) -> AttitudeReading:
    """A rotation vector (T, 3) [rad]."""
    return AttitudeReading("vector", rotation_matrix(vector))


def choose(readings: Sequence[AttitudeReading], prior: str, witness: Witness, raw: Float | None = None) -> Choice:
    """The reading that the recording bears out, or the prior one where nothing tells.

    Args:
        readings: two or more.
        prior: the name of that which header or custom suggest.
        witness: what the file holds besides.
        raw: (T, 4) of a quaternion in the file's order.
    """
    expected = next(r for r in readings if r.name == prior)
    jumps = {r.name: _jump(r.rotation, witness.time) for r in readings}
    smooth = [r for r in readings if not jumps[r.name]]
    others = _others(smooth, expected if expected in smooth else (smooth or [expected])[0])
    if smooth and len(smooth) < len(readings) and not others:
        return Choice(smooth[0].name, smooth[0].rotation, "in every other order the tool would jump", True)
    candidates = smooth or list(readings)
    best = expected if expected in candidates else candidates[0]
    if not _others(candidates, best):
        return Choice(best.name, best.rotation, "the other orders give the same attitude to 1 degree", True)
    for name, reason in _verdicts(candidates, witness, raw):
        found = next(r for r in candidates if r.name == name)
        return Choice(found.name, found.rotation, reason, True)
    return Choice(best.name, best.rotation, "nothing in the recording tells the order", False)


def _others(readings: Sequence[AttitudeReading], one: AttitudeReading) -> list[AttitudeReading]:
    return [r for r in readings if r is not one and _apart(r.rotation, one.rotation) > SAME]


def _apart(one: Float, other: Float) -> float:
    """Largest angle between two attitudes over time, but for a turn that is constant."""
    return float(norm(rotation_vector(np.swapaxes(one, -1, -2) @ other)).max())


def _jump(rotation: Float, time: Float) -> bool:
    quaternion = quaternion_from_matrix(rotation)
    try:
        refuse_jumps(Columns({"t": time, **dict(zip(QUATERNION, quaternion.T, strict=True))}, ""))
    except InputError:
        return True
    return False


def _verdicts(readings: Sequence[AttitudeReading], witness: Witness, raw: Float | None) -> Iterator[tuple[str, str]]:
    """Names of readings with reasons, the surest first."""
    if raw is not None:
        kept, turns = kept_positive(raw)
        if kept in ([0], [3]):
            name = "wxyz" if kept == [0] else "xyzw"
            which = "first" if kept == [0] else "last"
            yield name, f"its sign is turned {turns} times so that the {which} number is never negative, as w is kept"
    scores = (
        (_spin_left, SPIN_LEFT, BETTER, "the angular velocity's columns agree with it alone"),
        (_gravity_left, GRAVITY_LEFT, BETTER, "the accelerometer's gravity stands still in base axes with it alone"),
    )
    for score, most, ratio, reason in scores:
        found = [score(r.rotation, witness) for r in readings]
        if None not in found:
            order = np.argsort(np.array(found, dtype=float))
            first, second = (float(np.array(found, dtype=float)[i]) for i in order[:2])
            if first < most and second > ratio * first:
                yield readings[order[0]].name, reason
    yield from _by_weight(readings, witness)
    yield from _by_work(readings, witness)


def spin_of(rotation: Float, time: Float) -> Float:
    """Angular velocity (T, 3) in base axes between samples of an attitude."""
    turn = rotation_vector(np.swapaxes(rotation[:-1], -1, -2) @ rotation[1:]) / np.diff(time)[:, None]
    return np.concatenate([rotate(rotation[:-1], turn), rotate(rotation[-2:-1], turn[-1:])])


def _spin_left(rotation: Float, witness: Witness) -> float | None:
    """Share of a recorded angular velocity that the attitude's does not explain, in the axes that suit it best."""
    if witness.spin is None or not norm(witness.spin).max() > 0.0:
        return None
    base = spin_of(rotation, witness.time)
    both = (base, rotate(np.swapaxes(rotation, -1, -2), base))
    size = float(np.sqrt((witness.spin**2).mean()))
    return min(float(np.sqrt(((own - witness.spin) ** 2).mean())) for own in both) / size


def _gravity_left(rotation: Float, witness: Witness) -> float | None:
    """Scatter in base axes of what an accelerometer shows, as a share of it."""
    if witness.acceleration is None or not norm(witness.acceleration.mean(axis=0)) > 0.0:
        return None
    if norm(rotation_vector(rotation[0].T @ rotation)).max() < LEAST_TURN:
        return None
    turned = rotate(rotation, witness.acceleration)
    return float(np.sqrt(((turned - np.median(turned, axis=0)) ** 2).sum(axis=1).mean()) / norm(turned).mean())


def weight_left(force: Float, rotation: Float, frame: str) -> list[float]:
    """Median residuals [N] of weight and bias over the first quarter, half, three quarters and all, where it turns."""
    pick = np.linspace(0, len(force) - 1, min(SAMPLES, len(force))).round().astype(int)
    force, rotation = force[pick], rotation[pick]
    parts = [slice(0, max(2, round(share * len(force)))) for share in SHARES]
    turned = [norm(rotation_vector(rotation[0].T @ rotation[part])).max() >= LEAST_TURN for part in parts]
    fits = [fit_weight_and_bias(force[part], rotation[part], frame)[1] for part in parts]
    return [fit if turns else np.inf for fit, turns in zip(fits, turned, strict=True)]


def _by_weight(readings: Sequence[AttitudeReading], witness: Witness) -> Iterator[tuple[str, str]]:
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


def _by_work(readings: Sequence[AttitudeReading], witness: Witness) -> Iterator[tuple[str, str]]:
    if witness.force is None or witness.position is None:
        return
    force = witness.force - witness.force[witness.time <= witness.time[0] + 0.25].mean(axis=0)
    if work_cosine(witness.position, force, witness.time)[0] < WORK:
        return  # it opposes the motion as it is, in base axes
    shares = [work_cosine(witness.position, rotate(r.rotation, force), witness.time)[0] for r in readings]
    order = np.argsort(shares)
    if shares[order[0]] < WORK and shares[order[1]] > shares[order[0]] + WORK_APART:
        yield (
            readings[order[0]].name,
            f"in contact a force in tool axes then opposes the motion ({shares[order[0]]:+.0%} of |F||dx|), "
            f"otherwise {shares[order[1]]:+.0%}",
        )
