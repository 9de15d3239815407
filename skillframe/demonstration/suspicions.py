"""What data only suggest: sentences with their evidence, never refusals. Thresholds are our choice.

Each function looks at one demonstration in the contract's convention and yields warnings; `AUDITS` lists them all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from skillframe.demonstration.attitude_doubts import tared, w_first
from skillframe.demonstration.checks import GAP
from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.contradiction import WORK_COSINE, Turning, weight_evidence, work_cosine
from skillframe.demonstration.faults.find import alive
from skillframe.demonstration.landings import Indices, landings
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm

Suspicion = Callable[[Demonstration], Iterator[str]]
HELD_LEAST = 10  # steps of a held pose from which its rate is told
FARTHEST = 20.0
PAST_HALF = 0.05  # of the scalar part, 6 degrees beyond half a turn: less is no change of sign that means anything
LARGEST_FORCE, LONGEST_LEVER = 2e4, 3.0
UNMEASURED = "unmeasured"
"""Metadata: names of wrench channels that nobody measured, as across a machine's plane; zero says nothing there."""
SPIKE_SIGMAS, SPIKE_FORCE, SPIKE_WIDTH = 12.0, 5.0, 9


def clock(d: Demonstration) -> Iterator[str]:
    """Gaps, jitter, a rate that contradicts the metadata, a unit of time that cannot be."""
    step = np.diff(d.time)
    period = float(np.median(step))
    gaps = np.flatnonzero(step > GAP * period)
    if gaps.size:
        longest = int(gaps[np.argmax(step[gaps])])
        yield (
            f"gaps: {gaps.size} of more than {GAP:g} periods, the longest {step[longest]:.3g} s "
            f"at t = {d.time[longest]:.3f} s"
        )
    jitter = float(np.std(step[step < GAP * period]) / period)
    if jitter > 0.1:
        yield f"jitter: steps of the clock scatter by {jitter:.0%} of the period"
    if not 5.0 <= d.rate <= 2e4:
        yield f"rate: {d.rate:.3g} Hz over {d.duration:.4g} s looks like another unit of time; see --units"
    stated = d.meta.get("rate")
    if isinstance(stated, int | float) and stated > 0 and abs(d.rate / stated - 1.0) > 0.05:
        yield f"rate: the metadata says {stated:g} Hz, the clock {d.rate:.4g} Hz"


def quaternions(d: Demonstration) -> Iterator[str]:
    """Values that look w-first where neither header nor metadata say the order.

    A wrong order is a rotation of the whole curve, as smooth and as fast as the right one, so that no jump tells it.
    A recorder that writes w >= 0 does: it turns the sign of all four where w passes zero, and the one number that stays
    on its side is w. Without such a turn only likelihood is left.
    """
    if d.meta.get("quaternion") is not None:
        return
    q = d.quaternion
    first, last = q[:, 0], q[:, 3]
    kept, turns = kept_positive(q)
    if kept == [0]:
        yield (
            f"quaternion: its sign is turned {turns} times so that qx is never negative, as recorders do for w: "
            "the values look w-first; store them as qx,qy,qz,qw"
        )
    elif kept == [3]:
        return
    elif np.abs(first).min() > 0.9:
        yield (
            f"quaternion: the first value stays near 1 (|qx| >= {np.abs(first).min():.3f}): the tool is turned half "
            'about x, or the values are w-first; say quaternion = "xyzw" in the metadata if they are right'
        )
    elif (first.min() >= 0.0 or first.max() <= 0.0) and last.min() < -PAST_HALF and last.max() > PAST_HALF:
        yield "quaternion: qx never changes sign, but qw does: the values may be w-first"


def kept_positive(q: Float) -> tuple[list[int], int]:
    """Which numbers of (T, 4) stay on the positive side although the sign is turned now and then, and how often."""
    turns = int(np.count_nonzero((q[:-1] * q[1:]).sum(axis=1) < 0.0))
    kept = [i for i in range(4) if turns and q[:, i].min() >= -1e-6 and q[:, i].max() > 1e-6]
    return kept, turns


def motion(d: Demonstration) -> Iterator[str]:
    """Positions in another unit."""
    far = float(np.abs(d.position).max())
    if far > FARTHEST:
        yield f"position: up to {far:.4g} m from the base; is it in millimetres (--units mm)?"


def channels(d: Demonstration) -> Iterator[str]:
    """Channels that stand still, are copies of each other, or hold their value between fewer true samples."""
    for i, name in enumerate(WRENCH):
        if name not in d.meta.get(UNMEASURED, ()) and np.all(d.wrench[:, i] == d.wrench[0, i]):
            yield f"{name}: is exactly {d.wrench[0, i]:g} throughout"
    for i in range(6):
        for j in range(i + 1, 6):
            moves = np.any(d.wrench[:, i] != d.wrench[0, i])
            if moves and np.array_equal(d.wrench[:, i], d.wrench[:, j]):
                yield f"{WRENCH[i]} and {WRENCH[j]} are identical: was a column pasted twice?"
    live = alive(d, found=())
    both = live[1:] & live[:-1]
    if not np.any(both):
        return
    held = float(np.mean(np.all(d.wrench[1:] == d.wrench[:-1], axis=1)[both]))
    if held > 0.5:
        yield f"wrench: {held:.0%} of the samples repeat the one before: its rate is about {d.rate * (1 - held):.3g} Hz"


def held_pose(d: Demonstration) -> Iterator[str]:
    """A pose that moves in steps of the same length: it was recorded slower than the rest, which a pause is not."""
    pose = np.concatenate([d.position, d.quaternion], axis=1)
    starts = np.flatnonzero(np.any(pose[1:] != pose[:-1], axis=1)) + 1
    if len(starts) < HELD_LEAST:
        return
    runs = np.diff(starts)
    if np.quantile(runs, 0.1) >= 2.0:
        yield f"pose: moves every {np.median(runs):.0f} samples only: its rate is about {d.rate / runs.mean():.3g} Hz"


def magnitudes(d: Demonstration) -> Iterator[str]:
    """Forces and torques that no tool stands."""
    force, torque = norm(d.wrench[:, :3]), norm(d.wrench[:, 3:])
    if force.max() > LARGEST_FORCE:
        yield f"force: up to {force.max():.3g} N at t = {d.time[np.argmax(force)]:.3f} s; check its unit (--units)"
    if not force.max() > 0.0:
        return
    strong = force > 0.3 * force.max()
    lever = float(np.median(torque[strong] / np.maximum(force[strong], 1e-9)))
    if lever > LONGEST_LEVER and torque.max() > 0.0:
        yield f"torque: a typical lever arm of {lever:.3g} m (|T| / |F|); check its unit (--units Nmm)"


def spikes(d: Demonstration) -> Iterator[str]:
    """Forces that stand out of their neighbours for one or two samples, but for those of a tool that lands."""
    found = broken_samples(d)
    if found.size:
        strength = norm(d.wrench[found, :3])
        worst = int(found[np.argmax(strength)])
        count = f"{found.size} sample{'s' * (found.size != 1)}"
        yield f"spikes: {count}, the largest {strength.max():.1f} N at t = {d.time[worst]:.3f} s"


def broken_samples(d: Demonstration) -> Indices:
    """Samples whose force stands out, and that no landing of the tool explains."""
    found, sigma = spike_indices(d.wrench[:, :3])
    return np.setdiff1d(found, landings(d, found, sigma))


def spike_indices(force: Float) -> tuple[Indices, float]:
    """Samples of (T, 3) over 5 N and 12 robust sigmas away from the median of nine around them, and that sigma."""
    if len(force) < SPIKE_WIDTH:
        return np.empty(0, dtype=np.intp), 0.0
    half = SPIKE_WIDTH // 2
    padded = np.pad(force, ((half, half), (0, 0)), mode="edge")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, SPIKE_WIDTH, axis=0), axis=-1)
    away = norm(force - around)
    sigma = 1.4826 * float(np.median(away))
    return np.flatnonzero(away > max(SPIKE_FORCE, SPIKE_SIGMAS * sigma)), sigma


def frame_and_sign(d: Demonstration) -> Iterator[str]:
    """A wrench that looks like one of tool axes, or like the teacher's own.

    A passive environment does no work on the tool on balance. Both the force alone and the whole wrench must seem to:
    a lever's force does work that its torque takes back, and a torque about another point than the tool's does none
    that means anything. Friction below 0.3 or so is not enough to tell the teacher's wrench (our choice: recordings of
    real snaps reach +0.2 with the force alone).
    """
    evidence = weight_evidence(d.wrench[:, :3], d.pose.rotation, "base")
    if evidence is not None:
        yield f'wrench frame: {evidence}; is it in tool axes (wrench.frame = "tool")?'
    force, path = work_cosine(d.position, d.wrench[:, :3], d.time)
    whole, _ = work_cosine(d.position, d.wrench[:, :3], d.time, Turning(d.pose.rotation, d.wrench[:, 3:]))
    if min(force, whole) > WORK_COSINE and path > 0.02:
        yield (
            f"wrench sign: it pushes the tool along ({force:+.0%} of |F||dx| over {path * 1e3:.0f} mm, {whole:+.0%} "
            "with the torque's work), which a passive environment cannot: the teacher's force "
            '(wrench.sign = "teacher"), weight or bias in it, or another frame'
        )


AUDITS: Sequence[Suspicion] = (
    clock, quaternions, w_first, motion, held_pose, channels, magnitudes, spikes, frame_and_sign, tared,
)  # fmt: skip
