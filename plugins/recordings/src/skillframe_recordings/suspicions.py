"""Warnings with evidence about a demonstration, in the contract's convention. `AUDITS` lists all.

A spike is real if it is above half of its peak for three samples, or if the force levels 0.1 s after it and 0.1 to 0.2
s before it differ by 1 N and a fifth of the peak. Otherwise it is a landing if the force rises or falls through
intermediate samples and stops the tool: with the force's direction n, and the tool's velocity v- before and v+ after,

    -n v- > 5 mm/s,     n (v+ - v-) >= -n v- / 4,     both beyond three standard deviations of the velocities.

A quarter suffices, because a part that lands on its edge keeps turning about it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import (
    GAP,
    UNMEASURED,
    WORK_COSINE,
    WRENCH,
    Demonstration,
    Turning,
    alive,
    weight_evidence,
    work_cosine,
)
from skillframe.frames import Float, norm
from skillframe_recordings.orientation_doubts import tared, w_first
from skillframe_recordings.thresholds import AUDIT

Suspicion = Callable[[Demonstration], Iterator[str]]
Indices = NDArray[np.intp]


def clock(d: Demonstration) -> Iterator[str]:
    """Warn about gaps, jitter, a rate that contradicts the metadata, and implausible time units."""
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
    if not AUDIT.slow_hz <= d.rate <= AUDIT.fast_hz:
        yield f"rate: {d.rate:.3g} Hz over {d.duration:.4g} s suggests another unit of time; see --set units"
    stated = d.meta.get("rate")
    if isinstance(stated, int | float) and stated > 0 and abs(d.rate / stated - 1.0) > 0.05:
        yield f"rate: the metadata says {stated:g} Hz, the clock {d.rate:.4g} Hz"


def quaternions(d: Demonstration) -> Iterator[str]:
    """Warn about w-first quaternions if the metadata do not state the order.

    A wrong order rotates the whole curve and causes no jump. But a recorder that keeps w >= 0 changes all signs when w
    passes zero, and the number that never becomes negative is w.
    """
    if d.meta.get("quaternion") is not None:
        return
    kept, turns = kept_positive(d.quaternion)
    if kept == [0]:
        yield (
            f"quaternion: its sign is turned {turns} times so that qx is never negative, as recorders do for w: "
            "the values are probably w-first; store them as qx,qy,qz,qw"
        )


def kept_positive(q: Float) -> tuple[list[int], int]:
    """Return which numbers of (T, 4) stay positive through changes of sign, and the number of changes."""
    turns = int(np.count_nonzero((q[:-1] * q[1:]).sum(axis=1) < 0.0))
    kept = [i for i in range(4) if turns and q[:, i].min() >= -1e-6 and q[:, i].max() > 1e-6]
    return kept, turns


def motion(d: Demonstration) -> Iterator[str]:
    """Warn about implausible units of position."""
    far = float(np.abs(d.position).max())
    if far > AUDIT.far_m:
        yield f"position: up to {far:.4g} m from the base; is it in millimetres (--set units=mm)?"


def channels(d: Demonstration) -> Iterator[str]:
    """Warn about constant and identical channels."""
    for i, name in enumerate(WRENCH):
        if name not in d.meta.get(UNMEASURED, ()) and np.all(d.wrench[:, i] == d.wrench[0, i]):
            yield f"{name}: is exactly {d.wrench[0, i]:g} throughout"
    for i in range(6):
        for j in range(i + 1, 6):
            moves = np.any(d.wrench[:, i] != d.wrench[0, i])
            if moves and np.array_equal(d.wrench[:, i], d.wrench[:, j]):
                yield f"{WRENCH[i]} and {WRENCH[j]} are identical: was a column pasted twice?"


def held(d: Demonstration) -> Iterator[str]:
    """Warn about a wrench or pose that changes in steps of equal length, recorded at a lower rate.

    Pauses and values within the sensor's resolution do not count.
    """
    live = alive(d, found=())
    for what, values, counts in (
        ("pose: moves", np.concatenate([d.position, d.quaternion], axis=1), np.ones(len(d), dtype=bool)),
        ("wrench: changes", d.wrench, live),
    ):
        starts = np.flatnonzero(np.any(values[1:] != values[:-1], axis=1) & counts[1:]) + 1
        runs = np.diff(starts)
        if len(starts) >= AUDIT.held_steps and np.quantile(runs, 0.1) >= 2.0:
            rate = d.rate / runs.mean()
            yield f"{what} every {np.median(runs):.0f} samples only: its rate is about {rate:.3g} Hz"


def magnitudes(d: Demonstration) -> Iterator[str]:
    """Warn about implausible forces and torques."""
    force, torque = norm(d.wrench[:, :3]), norm(d.wrench[:, 3:])
    if force.max() > AUDIT.force_n:
        yield f"force: up to {force.max():.3g} N at t = {d.time[np.argmax(force)]:.3f} s; check its unit (--set units)"
    if not force.max() > 0.0:
        return
    strong = force > 0.3 * force.max()
    lever = float(np.median(torque[strong] / np.maximum(force[strong], 1e-9)))
    if lever > AUDIT.lever_m and torque.max() > 0.0:
        yield f"torque: a typical lever arm of {lever:.3g} m (|T| / |F|); check its unit (--set units=Nmm)"


def spikes(d: Demonstration) -> Iterator[str]:
    """Warn about forces that stand out for one or two samples, except landings."""
    found = broken_samples(d)
    if found.size:
        strength = norm(d.wrench[found, :3])
        worst = int(found[np.argmax(strength)])
        count = f"{found.size} sample{'s' * (found.size != 1)}"
        yield f"spikes: {count}, the largest {strength.max():.1f} N at t = {d.time[worst]:.3f} s"


def broken_samples(d: Demonstration) -> Indices:
    """Return samples whose force stands out and is no landing."""
    found, sigma = spike_indices(d.wrench[:, :3])
    return np.setdiff1d(found, landings(d, found, sigma))


def spike_indices(force: Float) -> tuple[Indices, float]:
    """Return samples of (T, 3) over 5 N and 12 robust sigmas from the median of nine, and that sigma."""
    width = 9
    if len(force) < width:
        return np.empty(0, dtype=np.intp), 0.0
    padded = np.pad(force, ((width // 2, width // 2), (0, 0)), mode="edge")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, width, axis=0), axis=-1)
    away = norm(force - around)
    sigma = 1.4826 * float(np.median(away))
    return np.flatnonzero(away > max(AUDIT.spike_n, AUDIT.spike_sigmas * sigma)), sigma


def landings(d: Demonstration, spikes: Indices, sigma: float) -> Indices:
    """Return the spikes at which the tool landed.

    Args:
        d: the recording.
        spikes: (K,) outlying samples in order.
        sigma: standard deviation of the force [N].
    """
    groups = np.split(spikes, np.flatnonzero(np.diff(spikes) > 2) + 1) if spikes.size else []
    landed = [group for group in groups if _landed(d, int(group[0]), int(group[-1]), sigma)]
    return np.concatenate(landed) if landed else np.empty(0, dtype=np.intp)


def _landed(d: Demonstration, first: int, last: int, sigma: float) -> bool:
    before = d.wrench[max(first - 2 - AUDIT.level_rows, 0) : max(first - 2, 1), :3]
    low, high = max(first - 3, 0), min(last + 4, len(d.time))
    pulse = d.wrench[low:high, :3] - np.median(before, axis=0)
    size = norm(pulse)
    peak = float(size.max())
    at, below = int(np.argmax(size)), np.flatnonzero(size < 0.5 * peak)
    width = below[below > at].min(initial=len(size)) - below[below < at].max(initial=-1) - 1  # above half of the peak
    if width >= AUDIT.resolved or _change(d, first, last) > max(AUDIT.level_change_n, AUDIT.level_change * peak):
        return True
    core = np.flatnonzero(size >= AUDIT.core * peak)
    least = max(AUDIT.flank * peak, AUDIT.flank_sigmas * sigma)
    sides = (int(core[0]) - 1, int(core[-1]) + 1)
    return any(0 <= i < len(size) and least <= size[i] for i in sides) and _stops(d, first, last, pulse.sum(axis=0))


def _change(d: Demonstration, first: int, last: int) -> float:
    """Change of the force level across two samples [N]."""
    count = max(3, round(AUDIT.level_s * d.rate))
    before = d.wrench[max(first - 2 * count, 0) : max(first - count, 1), :3]
    after = d.wrench[last + 1 : last + 1 + count, :3]
    if min(len(before), len(after)) < 3:
        return 0.0
    return float(norm(np.median(after, axis=0) - np.median(before, axis=0)))


def _stops(d: Demonstration, first: int, last: int, force: Float) -> bool:
    """Whether the tool moves against a force (3,) before two samples and has stopped after them."""
    length, along = norm(force), d.position @ force
    if not length > 0.0:
        return False
    count = max(5, round(AUDIT.velocity_s * d.rate))
    earlier, later = slice(max(first - 1 - count, 0), max(first - 1, 0)), slice(last + 2, last + 2 + count)
    before, after = (_speed(d.time[part], along[part] / length) for part in (earlier, later))
    approach, lost = -before[0], after[0] - before[0]
    least = max(AUDIT.approach_m_s, AUDIT.sure * before[1])
    return (
        approach > least
        and lost >= AUDIT.stopped * approach
        and lost > AUDIT.sure * float(np.hypot(before[1], after[1]))
    )


def _speed(time: Float, place: Float) -> tuple[float, float]:
    """Slope of a line through (T,) places [m/s] and its standard deviation, infinite for few samples."""
    if len(time) < 5:
        return 0.0, np.inf
    t = time - time.mean()
    slope = float(t @ place / (t @ t))
    rest = place - place.mean() - slope * t
    return slope, float(np.sqrt(rest @ rest / (len(t) - 2) / (t @ t)))


def frame_and_sign(d: Demonstration) -> Iterator[str]:
    """Warn about a wrench that seems to be in tool axes, or the teacher's.

    A passive environment does no net work on the tool. Both the force alone and the whole wrench must seem to: a
    lever's torque takes back its force's work, and torques about other points are meaningless. Friction below about 0.3
    is no evidence, since real snaps reach +0.2 with the force alone.
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
    clock, quaternions, w_first, motion, held, channels, magnitudes, spikes, frame_and_sign, tared,
)  # fmt: skip
