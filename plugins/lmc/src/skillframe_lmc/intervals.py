r"""Cut a recording into intervals of motion: blocks of 20 ms, then knots by path.

Pose and wrench are means over 20 ms (the normalised mean quaternion is the mean rotation to second order), which
removes position noise. Translation and rotation are cut by their own paths, with a knot where the distance from the
last one reaches a step, so that rest adds nothing. For an interval \(k\),

    V_k = x_{k+1} - x_k   or   log(R_{k+1} R_k^T),    F_k = mean of the wrench while moving,    W_k = sum of F . dx

The overview paper does not state how intervals are cut. The step is 2 mm or 1.1 degrees, 1 mm on paths under 20 mm,
smaller for motions shorter than five of them, and larger for position noise or long paths.
"""

from __future__ import annotations

from math import dist
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration, measures_torque
from skillframe.errors import InputError
from skillframe.frames import Float, Pose, continuous, cross, matrix_from_quaternion, norm, rotate, rotation_vector
from skillframe_lmc.settings import LEVER_M, Settings

BLOCK_S = 0.02
MOST_INTERVALS = 80  # longer paths get longer steps
FEWEST_STEPS = 5.0  # of the shortest motion
NOISE_STEPS = 12.0  # step >= 12 sigma keeps the direction's noise under atan(sqrt(2) / 12) = 7 degrees
LENGTH_BLOCKS = 5  # 0.1 s between the points by which a length is taken
MOVING_SHARE = 0.15  # of the typical speed; slower is rest


class Track(NamedTuple):
    """A demonstration in blocks of 20 ms, in the axes of learning.

    Attributes:
        time: (B,) [s].
        position: (B, 3) of the learning point [m].
        quaternion: (B, 4), in base.
        rotation: (B, 3, 3), in the axes of learning.
        force: (B, 3) environment on tool [N].
        torque: (B, 3) the same, at the teacher's grip [Nm].
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
    """Translation or rotation of one demonstration, cut into K intervals.

    Attributes:
        displacement: (K, 3) V [m or rad].
        load: (K, 3) mean force or torque of the environment on the tool [N or Nm].
        work: (K,) done by that load [J].
        load_min: smaller loads count as free.
        excursion: largest distance from the start [m or rad].
        path: length through the knots [m or rad].
        duration: time in motion [s].
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
        hand: (3,) the teacher's grip in the tool frame.
        axes: "base" or "phase_start".

    Raises:
        InputError: values that are not finite, or fewer than two blocks.
    """
    where = demonstration.source or "demonstration"
    columns = np.column_stack(
        [demonstration.time, demonstration.position, continuous(demonstration.quaternion), demonstration.wrench]
    )
    if not np.all(np.isfinite(columns)):
        raise InputError(where, "holds values that are not finite", "run skillframe check on it")
    means, counts = _block_means(columns)
    if len(means) < 3:
        raise InputError(where, f"is only {demonstration.duration:.3f} s long", "record more of the motion")
    quaternion = means[:, 4:8] / norm(means[:, 4:8])[:, None]
    rotation = matrix_from_quaternion(quaternion)
    tool = Pose(means[:, 1:4], rotation)
    force = means[:, 8:11]
    torque = means[:, 11:14] - cross(rotate(rotation, np.broadcast_to(hand, force.shape)), force)
    if not measures_torque(demonstration.meta):
        torque = np.zeros_like(force)
    home = rotation[0].T if axes == "phase_start" else np.eye(3)
    vectors = [tool.at(at).position, force, torque]
    position, force, torque = (np.ascontiguousarray(v @ home.T) for v in vectors)
    return Track(means[:, 0], position, quaternion, home @ rotation, force, torque, counts, _noise(demonstration))


def at_point(blocks: Track, shift: Float, lever: Float) -> Track:
    """A track at another point of the tool, with the torque there.

    Args:
        blocks: at the learning point.
        shift: (3,) from the learning point to the other point, in the tool frame [m].
        lever: (3,) from the other point to the teacher's hand, in the tool frame [m].
    """
    turned = (rotate(blocks.rotation, np.broadcast_to(each, blocks.force.shape)) for each in (shift, lever))
    moved, arm = turned
    torque = blocks.torque + cross(arm, blocks.force) if np.any(blocks.torque) else blocks.torque
    return blocks._replace(position=blocks.position + moved, torque=torque)


def _block_means(columns: Float) -> tuple[Float, Float]:
    time = columns[:, 0]
    index = np.floor((time - time[0]) / BLOCK_S + 1e-6)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(index)) + 1])
    counts = np.diff(np.append(starts, len(time))).astype(float)
    return np.add.reduceat(columns, starts, axis=0) / counts[:, None], counts


def _noise(demonstration: Demonstration) -> tuple[float, float]:
    """Noise of a wrench sample, from the metadata or else from second differences."""
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
    """Standard deviation of white noise on a smooth signal (T, n), from second differences."""
    if len(values) < 5:
        return 0.0
    second = values[2:] - 2.0 * values[1:-1] + values[:-2]
    return float(np.median(np.abs(second), axis=0).max() / (0.6745 * np.sqrt(6.0)))


def translation(blocks: Track, settings: Settings) -> Motion:
    """Translational intervals of a demonstration."""
    x = blocks.position
    distance = norm(x - x[0])
    step = settings.step_m * (1.0 if _length(x) >= 10.0 * settings.step_m else 0.5)
    knots = cut(x, step)
    return _motion(blocks, knots, np.diff(x, axis=0), x[knots[1:]] - x[knots[:-1]], blocks.force, 0, distance, settings)


def cut(points: Float, step: float) -> NDArray[np.intp]:
    """Indices of the knots of a path (B, n), a step apart, or less on short paths and more on noisy or long ones."""
    excursion = float(norm(points - points[0]).max())
    step = min(step, excursion / FEWEST_STEPS)
    noise = min(NOISE_STEPS * _white_noise(points), excursion / 8.0)
    return _knots(points, max(step, _length(points) / MOST_INTERVALS, noise))


def rotation(blocks: Track, settings: Settings) -> Motion:
    """Rotational intervals of a demonstration, in the axes of learning."""
    R = blocks.rotation
    distance = norm(rotation_vector(R @ R[0].T))
    chord = 2.0 * blocks.quaternion  # |2 q_1 - 2 q_0| is the angle between them, to third order
    knots = cut(chord, settings.step_m / LEVER_M)
    fine = rotation_vector(R[1:] @ np.swapaxes(R[:-1], -1, -2))
    whole = rotation_vector(R[knots[1:]] @ np.swapaxes(R[knots[:-1]], -1, -2))
    return _motion(blocks, knots, fine, whole, blocks.torque, 1, distance, settings)


def touching(motion: Motion) -> Motion:
    """The motion without free intervals, its path and duration unchanged."""
    keep = norm(motion.load) >= motion.load_min
    return motion._replace(displacement=motion.displacement[keep], load=motion.load[keep], work=motion.work[keep])


def _length(points: Float) -> float:
    """Length of a path (B, n), without what its blocks' noise adds."""
    return float(norm(np.diff(points[::LENGTH_BLOCKS], axis=0)).sum())


def _knots(points: Float, step: float) -> NDArray[np.intp]:
    """Indices where the distance from the last knot reaches the step, in plain floats for speed."""
    rows = points.tolist()
    knots, last = [0], rows[0]
    for i, row in enumerate(rows[1:], start=1):
        if dist(row, last) >= step:
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
    least = settings.force_min_n * (1.0, LEVER_M)[part]
    # 8 sigma of an interval's mean keeps its direction within 7 degrees; 5 % of the strong ones allows for a bias
    strong = float(np.percentile(norm(mean), 90)) if len(mean) else 0.0
    load_min = max(least, 8.0 * blocks.noise[part] / np.sqrt(samples), 0.05 * strong)
    used = slice(knots[0], knots[-1])
    duration = float((elapsed * moving)[used].sum())
    return Motion(whole, mean, work, load_min, float(distance.max()), path, duration)


def moving_blocks(fine: Float, elapsed: Float) -> Float:
    """1 where the tool moves, 0 at rest, by its speed over 0.1 s."""
    place = np.concatenate([np.zeros((1, fine.shape[1])), np.cumsum(fine, axis=0)])
    clock = np.concatenate([[0.0], np.cumsum(elapsed)])
    i = np.arange(len(fine))
    before, after = np.maximum(i - 2, 0), np.minimum(i + 3, len(fine))
    speed = norm(place[after] - place[before]) / (clock[after] - clock[before])
    result: Float = (speed > MOVING_SHARE * typical_speed(speed * elapsed, elapsed)).astype(float)
    return result


def typical_speed(length: Float, elapsed: Float) -> float:
    """Speed below which half of a path was travelled, by lengths (K,) of its parts and the times they took, or 0."""
    order = np.argsort(length / elapsed)
    travelled = np.cumsum(length[order])
    if not len(order):
        return 0.0
    half = order[np.searchsorted(travelled, 0.5 * travelled[-1])]
    return float(length[half] / elapsed[half])


def _sum_between(values: Float, knots: NDArray[np.intp]) -> Float:
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    result: Float = total[knots[1:]] - total[knots[:-1]]
    return result


def _mean_between(values: Float, weight: Float, knots: NDArray[np.intp]) -> Float:
    weighed = _sum_between(values * weight[:, None], knots)
    total = _sum_between(weight[:, None], knots)
    plain = _sum_between(values, knots) / np.maximum(np.diff(knots), 1)[:, None]
    return np.where(total > 0.0, weighed / np.maximum(total, 1.0), plain)
