"""The audit of a demonstration: what it holds, how clean it is, and what looks wrong, with evidence.

Refusals happen at reading (`checks`); here everything is a figure or a warning. A recording in which nothing moves
holds nothing to learn: it is not `usable`, and `demonstration check` answers no (exit code 1).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.conditioning.contact import (
    LEVEL_TIME,
    Contact,
    contact_intervals,
    contact_strength,
    free_air_level,
)
from skillframe.conditioning.lateness import lateness
from skillframe.conditioning.noise import LEAST_SAMPLES, NoiseFigures, has_window, noise_figures
from skillframe.demonstration.assemble import NOTES
from skillframe.demonstration.checks import GAP, angles_between
from skillframe.demonstration.faults import fault
from skillframe.demonstration.faults.fault import Flaw
from skillframe.demonstration.faults.find import alive, faults, pressing
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.stalls import POSE, as_meta, stalls
from skillframe.demonstration.suspicions import AUDITS, broken_samples
from skillframe.frames import Float, norm

LEAST_BIAS = np.repeat([0.5, 0.05], 3)
LEAST_PATH, LEAST_TURN = 1e-4, np.deg2rad(0.1)


@dataclass(frozen=True, slots=True, kw_only=True)
class DemonstrationAudit:
    """Figures and warnings of one demonstration.

    Attributes:
        file: where it was read from.
        samples: number of rows.
        duration_s: first to last sample.
        rate_hz: median rate.
        jitter: standard deviation of the clock's steps over the period, gaps left out.
        gaps: [start, length] of steps beyond three periods [s].
        path_m: length of the tool point's path, sampled at 20 Hz.
        turned_rad: the same of the attitude.
        frames: names of points that the metadata define.
        wrench: what the metadata say about it.
        bias: (6,) mean of the first 0.25 s, taken as free air [N, Nm].
        noise: (6,) scatter in the quietest quarter of the recording.
        noise_typical: (6,) median scatter.
        drift: (6,) free-air level at the end less that at the start; None unless it ends in free air.
        spikes: number of samples that stand out of their neighbours.
        peak_force_n: largest force.
        contact_threshold_n: force above the free-air level that counts as contact.
        contacts: [start, stop, peak] of every contact [s, s, N].
        stalls: [{what, start, stop}] of every stretch that repeats one value: the wrench, a channel, the pose [s].
        faults: [{kind, what, start, stop, value}] of every step of the bias, copied stretch, saturation and jump.
        onsets_unseen: starts of contacts that follow a stall or a copy, and so began nobody knows when [s].
        wrench_late_s: how late the wrench is against the pose (`lateness`), None where the recording does not tell [s].
        notes: what the reader did.
        warnings: sentences with evidence.
        usable: whether there is anything to learn from.
    """

    file: str
    samples: int
    duration_s: float
    rate_hz: float
    jitter: float
    gaps: list[list[float]]
    path_m: float
    turned_rad: float
    frames: list[str]
    wrench: dict[str, Any]
    bias: list[float]
    noise: list[float]
    noise_typical: list[float]
    drift: list[float] | None
    spikes: int
    peak_force_n: float
    contact_threshold_n: float
    contacts: list[list[float]]
    stalls: list[dict[str, Any]]
    faults: list[dict[str, Any]]
    onsets_unseen: list[float]
    wrench_late_s: float | None
    notes: list[str]
    warnings: list[str]
    usable: bool

    def as_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        return dataclasses.asdict(self)


def audit(demonstration: Demonstration) -> DemonstrationAudit:
    """Look through a demonstration.

    Args:
        demonstration: as read, in the contract's convention.
    """
    d = demonstration
    step = np.diff(d.time)
    period = float(np.median(step))
    found = stalls(d)
    wrong = faults(d, found)
    live = alive(d, found, wrong)
    touching = pressing(d, live, wrong)
    noise = _noise(d, live)
    level = free_air_level(d.time[live], d.wrench[live]) if np.any(live) else np.zeros(6)
    contacts = contact_intervals(d.time, d.wrench, noise, level, touching)
    dark = [s.stop for s in found if s.what != POSE]
    dark += [f.stop for f in wrong if f.kind == fault.COPY and f.what != POSE]
    unseen = [c.start for c in contacts if any(0.0 <= c.start - stop < LEVEL_TIME for stop in dark)]
    drift = _drift(d, contacts, level, live)
    path, turned = _travel(d)
    usable = path > LEAST_PATH or turned > LEAST_TURN
    warnings = [text for suspicion in AUDITS for text in suspicion(d)]
    warnings += [f"stall: {stall.words()}: it counts as neither free air, contact nor noise" for stall in found]
    warnings += _told(wrong)
    warnings += _wrench_warnings(d, noise, level, drift, contacts)
    late = lateness(d, live)
    if late is not None and late.counts:
        warnings.append(late.words())
    if unseen:
        at = ", ".join(f"{start:.2f}" for start in unseen)
        warnings.append(f"contact: from {at} s it follows a stall or a copy: when it began, nobody saw")
    if not usable:
        warnings.append(
            f"motion: the tool moves by {path * 1e3:.3f} mm and {np.rad2deg(turned):.3f} degrees: nothing to learn"
        )
    return DemonstrationAudit(
        file=d.source, samples=len(d), duration_s=d.duration, rate_hz=d.rate,
        jitter=float(np.std(step[step < GAP * period]) / period),
        gaps=[[float(d.time[i]), float(step[i])] for i in np.flatnonzero(step > GAP * period)],
        path_m=path, turned_rad=turned, frames=sorted(d.meta.get("frames", {})), wrench=dict(d.meta.get("wrench", {})),
        bias=level.tolist(), noise=noise.quiet.tolist(), noise_typical=noise.typical.tolist(),
        drift=None if drift is None else drift.tolist(), spikes=len(broken_samples(d)),
        peak_force_n=float(norm(d.wrench[:, :3]).max()),
        contact_threshold_n=contact_strength(d.time, d.wrench, noise, level, touching)[1],
        contacts=[list(contact) for contact in contacts], stalls=as_meta(found), faults=fault.as_meta(wrong),
        onsets_unseen=unseen,
        wrench_late_s=None if late is None else late.seconds,
        notes=list(d.meta.get(NOTES, [])), warnings=warnings,
        usable=usable,
    )  # fmt: skip


def _told(found: list[Flaw]) -> list[str]:
    """A sentence for every kind of fault and channel."""
    groups: dict[tuple[str, str, bool], list[Flaw]] = {}
    for f in sorted(found, key=lambda f: (f.kind, f.what, f.start)):
        groups.setdefault((f.kind, f.what, f.value > 0.0), []).append(f)
    return [group[0].warning(len(group) - 1) for group in groups.values()]


def _noise(d: Demonstration, live: NDArray[np.bool_]) -> NoiseFigures:
    """Noise figures, or zeros where a recording, or what does not stall of it, is too short for any."""
    if len(d) < LEAST_SAMPLES or not has_window(d.time, live):
        return NoiseFigures(np.zeros(6), np.zeros(6), float(d.time[0]))
    return noise_figures(d.time, d.wrench, live)


def _travel(d: Demonstration) -> tuple[float, float]:
    """Path [m] and turning [rad], at 20 Hz so that noise does not add up."""
    stride = max(1, min(round(d.rate / 20.0), len(d) // 2))
    pick = np.r_[np.arange(0, len(d) - 1, stride), len(d) - 1]
    path = float(norm(np.diff(d.position[pick], axis=0)).sum())
    return path, float(angles_between(d.pose.rotation[pick]).sum())


def _drift(d: Demonstration, contacts: list[Contact], level: Float, live: NDArray[np.bool_]) -> Float | None:
    """Change of the free-air level, if the recording ends at rest out of contact, and no stall is at an end of it."""
    if not np.all(live[(d.time <= d.time[0] + LEVEL_TIME) | (d.time >= d.time[-1] - LEVEL_TIME)]):
        return None
    if not contacts or d.time[-1] - contacts[-1].stop < 2.0 * LEVEL_TIME or d.duration < 4.0 * LEVEL_TIME:
        return None
    last = free_air_level(d.time, d.wrench, (float(d.time[-1]) - LEVEL_TIME, float(d.time[-1])))
    return last - level


def _wrench_warnings(
    d: Demonstration, noise: NoiseFigures, level: Float, drift: Float | None, contacts: list[Contact]
) -> list[str]:
    result = []
    force, torque = norm(level[:3]), norm(level[3:])
    if force > max(LEAST_BIAS[0], 5.0 * norm(noise.quiet[:3])) or torque > max(
        LEAST_BIAS[3], 5.0 * norm(noise.quiet[3:])
    ):
        result.append(
            f"bias: {force:.2f} N and {torque:.3f} Nm in the first {LEVEL_TIME:g} s: bias, weight, or it starts in "
            "contact; `skillframe condition` removes it"
        )
    if drift is not None and np.any(np.abs(drift) > np.maximum(LEAST_BIAS, 5.0 * noise.quiet)):
        result.append(
            f"drift: the free-air level moved by {norm(drift[:3]):.2f} N and {norm(drift[3:]):.3f} Nm "
            f"in {d.duration:.1f} s"
        )
    if not contacts and d.meta.get("contact") is not False:
        result.append(
            f"contact: none found beyond the {force:.2f} N of the first {LEVEL_TIME:g} s, which were taken for free air"
            if force > LEAST_BIAS[0]
            else "contact: none found; say contact = false in the metadata if there was none on purpose"
        )
    return result


def compared(demonstrations: list[Demonstration], audits: list[DemonstrationAudit]) -> list[DemonstrationAudit]:
    """Audits of one set, with warnings of what shows beside each other: a recording given twice, an odd way."""
    said = zip(audits, _repeats(demonstrations), _odd_ways(demonstrations), strict=True)
    return [dataclasses.replace(a, warnings=[*a.warnings, *filter(None, texts)]) for a, *texts in said]


def _repeats(demonstrations: list[Demonstration]) -> list[str]:
    """A sentence for each that holds what one before it holds: it counts as another although it tells nothing new."""
    names = [d.source for d in demonstrations]
    twins = [next(i for i in range(k + 1) if _same(demonstrations[i], d)) for k, d in enumerate(demonstrations)]
    return [f"repeated: the same samples as {names[i]}" if i != k else "" for k, i in enumerate(twins)]


def _same(one: Demonstration, other: Demonstration) -> bool:
    pairs = ((one.position, other.position), (one.quaternion, other.quaternion), (one.wrench, other.wrench))
    return all(np.array_equal(a, b) for a, b in pairs)


def _odd_ways(demonstrations: list[Demonstration]) -> list[str]:
    """A sentence where one of three or more goes another way than the rest.

    The way is the direction from the first to the last tool point; odd is more than 15 degrees from the others' mean
    and at least three times as far as their typical member.
    """
    ways = [d.position[-1] - d.position[0] for d in demonstrations]
    if len(ways) < 3 or min(float(norm(w)) for w in ways) < 0.01:
        return [""] * len(ways)
    unit = np.array([w / norm(w) for w in ways])
    rest = unit.sum(axis=0) - unit
    angles = np.arccos(np.clip((unit * rest).sum(axis=1) / np.maximum(norm(rest), 1e-9), -1.0, 1.0))
    odd = angles > max(np.deg2rad(15.0), 3.0 * float(np.median(angles)))
    said = [f"direction: {np.rad2deg(angle):.0f} degrees off the other recordings' mean" for angle in angles]
    return [text if is_odd else "" for text, is_odd in zip(said, odd, strict=True)]
