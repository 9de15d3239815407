r"""From a recording to intervals of motion: blocks of 20 ms, then knots by path.

Pose and wrench are averaged over 20 ms (the quaternion's mean direction, which equals the mean rotation to second order
over so short a time), which removes position noise before anything is cut. Translation and rotation are then cut apart,
each by its own path: a new knot where the distance from the last knot reaches a step, so that standing still adds
nothing. For an interval \(k\),

    V_k = x_{k+1} - x_k   or   log(R_{k+1} R_k^T),    F_k = mean of the wrench while moving,    W_k = sum of F . dx

(the overview paper speaks of intervals without saying how they are cut; by path is our choice). The step is 2 mm
or 1 degree, 1 mm on paths under 20 mm, smaller where the whole motion is shorter than five of them, and larger where
the position noise asks for it or the path is long.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.record import Demonstration
from skillframe.errors import InputError
from skillframe.frames import Float, Pose, cross, matrix_from_quaternion, norm, rotate, rotation_vector
from skillframe_lmc.settings import Settings

BLOCK_S = 0.02
MOST_INTERVALS = 80  # a longer path gets longer steps: a person's wandering is correlated over 15 mm anyway
FEWEST_STEPS = 5.0  # a motion as short as it may be is still cut into this many
NOISE_STEPS = 12.0  # step >= 12 sigma keeps the direction's noise under atan(sqrt(2) / 12) = 7 degrees
MOVING_SHARE = 0.15  # of the typical speed; slower is standing still


class Track(NamedTuple):
    """A demonstration in blocks of 20 ms, in the axes of learning.

    Attributes:
        time: (B,) [s].
        position: (B, 3) of the learning point [m].
        quaternion: (B, 4), in base.
        rotation: (B, 3, 3), in the axes of learning.
        force: (B, 3) environment on tool [N].
        torque: (B, 3) the same, taken at the hand [Nm].
        samples: (B,) raw samples in each block.
        noise: standard deviations of a raw force [N] and torque [Nm] sample.
    """

    time: Float
    position: Float
    quaternion: Float
    rotation: Float
    force: Float
    torque: Float
    samples: Float
    noise: tuple[float, float]


class Motion(NamedTuple):
    """One part (translation or rotation) of one demonstration, cut into K intervals.

    Attributes:
        displacement: (K, 3) V [m or rad].
        load: (K, 3) mean force or torque of the environment on the tool [N or Nm].
        work: (K,) done by that load [J].
        load_min: below it an interval counts as free.
        excursion: largest distance from the start [m or rad].
        path: length through the knots [m or rad].
        duration: time spent moving [s].
    """

    displacement: Float
    load: Float
    work: Float
    load_min: float
    excursion: float
    path: float
    duration: float


def track(demonstration: Demonstration, at: Float, hand: Float, axes: str) -> Track:
    """Blocks of a demonstration at a learning point.

    Args:
        demonstration: as read.
        at: (3,) learning point in the tool frame.
        hand: (3,) point where the hand holds, in the tool frame.
        axes: "base" or "phase_start".

    Raises:
        InputError: values that are not finite, or fewer than two blocks.
    """
    where = demonstration.source or "demonstration"
    columns = np.column_stack(
        [demonstration.time, demonstration.position, _continuous(demonstration.quaternion), demonstration.wrench]
    )
    if not np.all(np.isfinite(columns)):
        raise InputError(where, "holds values that are not finite", "run skillframe demonstration check on it")
    means, counts = _block_means(columns)
    if len(means) < 3:
        raise InputError(where, f"is only {demonstration.duration:.3f} s long", "record more of the motion")
    quaternion = means[:, 4:8] / norm(means[:, 4:8])[:, None]
    rotation = matrix_from_quaternion(quaternion)
    tool = Pose(means[:, 1:4], rotation)
    force = means[:, 8:11]
    torque = means[:, 11:14] - cross(rotate(rotation, np.broadcast_to(hand, force.shape)), force)
    home = rotation[0].T if axes == "phase_start" else np.eye(3)
    vectors = [tool.at(at).position, force, torque]
    position, force, torque = (np.ascontiguousarray(v @ home.T) for v in vectors)
    return Track(means[:, 0], position, quaternion, home @ rotation, force, torque, counts, _noise(demonstration))


def _continuous(quaternion: Float) -> Float:
    """Quaternions without sign flips from sample to sample."""
    flips = (quaternion[1:] * quaternion[:-1]).sum(-1) < 0.0
    result: Float = quaternion * np.concatenate([[1.0], np.where(np.cumsum(flips) % 2, -1.0, 1.0)])[:, None]
    return result


def _block_means(columns: Float) -> tuple[Float, Float]:
    time = columns[:, 0]
    index = np.floor((time - time[0]) / BLOCK_S + 1e-6)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(index)) + 1])
    counts = np.diff(np.append(starts, len(time))).astype(float)
    return np.add.reduceat(columns, starts, axis=0) / counts[:, None], counts


def _noise(demonstration: Demonstration) -> tuple[float, float]:
    """Noise of a wrench sample: from the metadata, else from second differences (their median ignores spikes)."""
    stated = demonstration.meta.get("sensor")
    stated = stated if isinstance(stated, dict) else {}
    names, parts = ("force_noise", "torque_noise"), (slice(0, 3), slice(3, 6))
    found = [
        float(stated[name])
        if isinstance(stated.get(name), int | float)
        else _white_noise(demonstration.wrench[:, part])
        for name, part in zip(names, parts, strict=True)
    ]
    return found[0], found[1]


def _white_noise(values: Float) -> float:
    """Standard deviation of white noise on a smooth signal (T, n). For noise, second differences have sqrt(6) sigma."""
    if len(values) < 5:
        return 0.0
    second = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return float(np.median(np.abs(second), axis=0).max() / (0.6745 * np.sqrt(6.0)))


def translation(blocks: Track, settings: Settings) -> Motion:
    """The translational intervals of a demonstration."""
    x = blocks.position
    distance = norm(x - x[0])
    step = _translation_step(x, float(distance.max()), settings)
    knots = _knots(x, step)
    return _motion(blocks, knots, np.diff(x, axis=0), x[knots[1:]] - x[knots[:-1]], blocks.force, 0, distance, settings)


def rotation(blocks: Track, settings: Settings) -> Motion:
    """The rotational intervals of a demonstration, with increments in the axes of learning."""
    R = blocks.rotation
    distance = norm(rotation_vector(R @ R[0].T))
    chord = 2.0 * blocks.quaternion  # |2 q_1 - 2 q_0| is the angle between them, to third order
    coarse = _path(chord, settings.step_rad)
    excursion = float(distance.max())
    step = _widened(min(settings.step_rad, excursion / FEWEST_STEPS), coarse, _white_noise(chord), excursion)
    knots = _knots(chord, step)
    fine = rotation_vector(R[1:] @ np.swapaxes(R[:-1], -1, -2))
    whole = rotation_vector(R[knots[1:]] @ np.swapaxes(R[knots[:-1]], -1, -2))
    return _motion(blocks, knots, fine, whole, blocks.torque, 1, distance, settings)


def touching(motion: Motion) -> Motion:
    """The same motion without its intervals that are free of contact. Path and duration stay those of the whole."""
    keep = norm(motion.load) >= motion.load_min
    return motion._replace(displacement=motion.displacement[keep], load=motion.load[keep], work=motion.work[keep])


def _translation_step(x: Float, excursion: float, settings: Settings) -> float:
    path = _path(x, 0.5 * settings.step_m)
    short = min(0.5 * settings.step_m, excursion / FEWEST_STEPS)
    step = settings.step_m if path >= 10.0 * settings.step_m else short
    return _widened(step, path, _white_noise(x), excursion)


def _widened(step: float, path: float, noise: float, excursion: float) -> float:
    return max(step, path / MOST_INTERVALS, min(NOISE_STEPS * noise, excursion / 8.0))


def _path(points: Float, step: float) -> float:
    return float(norm(np.diff(points[_knots(points, step)], axis=0)).sum())


def _knots(points: Float, step: float) -> NDArray[np.intp]:
    """Indices where the distance from the last knot reaches the step. Plain floats make the fastest loop here."""
    rows, limit = points.tolist(), step * step
    knots, last = [0], rows[0]
    for i, row in enumerate(rows[1:], start=1):
        square = 0.0
        for a, b in zip(row, last, strict=True):
            square += (a - b) * (a - b)
        if square >= limit:
            knots.append(i)
            last = row
    return np.array(knots)


def _motion(
    blocks: Track, knots: NDArray[np.intp], fine: Float, whole: Float, load: Float, part: int, distance: Float,
    settings: Settings,
) -> Motion:  # fmt: skip
    between = 0.5 * (load[1:] + load[:-1])
    elapsed = np.diff(blocks.time)
    moving = moving_blocks(fine, elapsed)
    mean = _mean_between(between, moving, knots)
    work = _sum_between((between * fine).sum(-1, keepdims=True), knots)[:, 0]
    samples = max(float(np.median(_sum_between(blocks.samples[1:, None], knots))), 1.0) if len(knots) > 1 else 1.0
    path = float(norm(whole).sum())
    least = (settings.force_min_n, settings.torque_min_nm)[part]
    # 8 sigma of an interval's mean keeps its direction within 7 degrees; 5 % of the strong ones is what a bias may be
    strong = float(np.percentile(norm(mean), 90)) if len(mean) else 0.0
    load_min = max(least, 8.0 * blocks.noise[part] / np.sqrt(samples), 0.05 * strong)
    used = slice(knots[0], knots[-1])
    duration = float((elapsed * moving)[used].sum())
    return Motion(whole, mean, work, load_min, float(distance.max()), path, duration)


def moving_blocks(fine: Float, elapsed: Float) -> Float:
    """1 where the tool moves, 0 where it stands still: its speed over 0.1 s against that of half of the path."""
    place = np.concatenate([np.zeros((1, 3)), np.cumsum(fine, axis=0)])
    clock = np.concatenate([[0.0], np.cumsum(elapsed)])
    i = np.arange(len(fine))
    before, after = np.maximum(i - 2, 0), np.minimum(i + 3, len(fine))
    speed = norm(place[after] - place[before]) / (clock[after] - clock[before])
    order = np.argsort(speed)
    travelled = np.cumsum((speed * elapsed)[order])
    typical = speed[order][np.searchsorted(travelled, 0.5 * travelled[-1])] if len(order) else 0.0
    result: Float = (speed > MOVING_SHARE * typical).astype(float)
    return result


def _sum_between(values: Float, knots: NDArray[np.intp]) -> Float:
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    result: Float = total[knots[1:]] - total[knots[:-1]]
    return result


def _mean_between(values: Float, weight: Float, knots: NDArray[np.intp]) -> Float:
    weighed = _sum_between(values * weight[:, None], knots)
    total = _sum_between(weight[:, None], knots)
    plain = _sum_between(values, knots) / np.maximum(np.diff(knots), 1)[:, None]
    return np.where(total > 0.0, weighed / np.maximum(total, 1.0), plain)
