"""Audit of a demonstration: its figures, and warnings with evidence.

Reading refuses bad files (`checks`). A recording without motion is not `usable` (exit code 1 of `check`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from skillframe.demonstration import (
    COPY,
    GAP,
    LEVEL_TIME,
    NOTES,
    POSE,
    Contact,
    Demonstration,
    Flaw,
    NoiseFigures,
    angles_between,
    as_meta,
    contact_evidence,
    contact_strength,
    flaws_as_meta,
    free_air_level,
)
from skillframe.errors import InputError
from skillframe.frames import Float, norm
from skillframe_recordings.conditioning.offline import remove_bias
from skillframe_recordings.lateness import lateness
from skillframe_recordings.suspicions import AUDITS, broken_samples
from skillframe_recordings.thresholds import AUDIT

LEAST_BIAS = np.repeat([0.5, 0.05], 3)
"""Force [N] and torque [Nm] of a bias or drift that is reported: the noise of wrist sensors in motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemonstrationAudit:
    """Figures and warnings of one demonstration.

    Attributes:
        file: source.
        samples: number of rows.
        duration_s: first to last sample.
        rate_hz: median rate.
        jitter: standard deviation of the clock's steps over the period, without gaps.
        gaps: [start, length] of steps beyond three periods [s].
        path_m: path length of the tool point, sampled at 20 Hz.
        turned_rad: the same of the orientation.
        frames: names of points in the metadata.
        wrench: its metadata.
        bias: (6,) mean of the first 0.25 s, taken as free air [N, Nm].
        noise: (6,) scatter in the quietest quarter.
        noise_typical: (6,) median scatter.
        drift: (6,) free-air level at the end minus that at the start; None unless it ends in free air.
        spikes: number of outlying samples.
        peak_force_n: largest force.
        contact_threshold_n: force above the free-air level that counts as contact.
        contacts: [start, stop, peak] of every contact [s, s, N].
        stalls: [{what, start, stop}] of every stretch with one repeated value: wrench, channel or pose [s].
        faults: [{kind, what, start, stop, value}] of every bias step, copied stretch, saturation and jump.
        onsets_unseen: starts of contacts whose onset a stall or copy hides [s].
        wrench_late_s: delay of the wrench against the pose (`lateness`), None if unknown [s].
        notes: remarks of the reader.
        warnings: sentences with evidence.
        usable: whether it contains motion to learn from.
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
        """Return plain JSON values."""
        return dataclasses.asdict(self)


def audit(demonstration: Demonstration) -> DemonstrationAudit:
    """Return the audit of a demonstration in the contract's convention."""
    d = demonstration
    step = np.diff(d.time)
    period = float(np.median(step))
    contacts, found, wrong, live, touching, noise, level = contact_evidence(d)
    dark = [s.stop for s in found if s.what != POSE]
    dark += [f.stop for f in wrong if f.kind == COPY and f.what != POSE]
    unseen = [c.start for c in contacts if any(0.0 <= c.start - stop < LEVEL_TIME for stop in dark)]
    drift = None  # change of the free-air level, if both ends are in free air, at rest and sound
    ends = (d.time <= d.time[0] + LEVEL_TIME) | (d.time >= d.time[-1] - LEVEL_TIME)
    calm = contacts and d.time[-1] - contacts[-1].stop >= 2.0 * LEVEL_TIME and d.duration >= 4.0 * LEVEL_TIME
    if calm and np.all(live[ends]):
        drift = free_air_level(d.time, d.wrench, (float(d.time[-1]) - LEVEL_TIME, float(d.time[-1]))) - level
    # at 20 Hz, so that noise does not accumulate
    stride = max(1, min(round(d.rate / 20.0), len(d) // 2))
    pick = np.r_[np.arange(0, len(d) - 1, stride), len(d) - 1]
    path = float(norm(np.diff(d.position[pick], axis=0)).sum())
    turned = float(angles_between(d.pose.rotation[pick]).sum())
    usable = bool(path > AUDIT.path_m or turned > AUDIT.turn_rad)
    warnings = [text for suspicion in AUDITS for text in suspicion(d)]
    warnings += [f"stall: {stall.words()}: it counts as neither free air, contact nor noise" for stall in found]
    groups: dict[tuple[str, str, bool], list[Flaw]] = {}
    for f in sorted(wrong, key=lambda f: (f.kind, f.what, f.start)):
        groups.setdefault((f.kind, f.what, f.value > 0.0), []).append(f)
    warnings += [group[0].warning(len(group) - 1) for group in groups.values()]
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
        contacts=[list(contact) for contact in contacts], stalls=as_meta(found), faults=flaws_as_meta(wrong),
        onsets_unseen=unseen,
        wrench_late_s=None if late is None else late.seconds,
        notes=list(d.meta.get(NOTES, [])), warnings=warnings,
        usable=usable,
    )  # fmt: skip


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
            f"contact; {_cure(d)}"
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


def _cure(d: Demonstration) -> str:
    """Advice on a bias. `filter` is named only if it finds free air."""
    try:
        start, stop = remove_bias(d).stretch
    except InputError:
        return "name a stretch without contact to take it from: `skillframe filter --free-air FROM,TO`"
    return f"`skillframe filter` takes off what was read from {start:.2f} to {stop:.2f} s"


def compared(demonstrations: list[Demonstration], audits: list[DemonstrationAudit]) -> list[DemonstrationAudit]:
    """Return audits with warnings about the set: duplicates, and odd directions."""
    columns = [np.concatenate([d.position, d.quaternion, d.wrench], axis=1) for d in demonstrations]
    twins = [next(i for i in range(k + 1) if np.array_equal(columns[i], own)) for k, own in enumerate(columns)]
    repeats = [f"repeated: the same samples as {demonstrations[i].source}" * (i != k) for k, i in enumerate(twins)]
    said = zip(audits, repeats, _odd_ways(demonstrations), strict=True)
    return [dataclasses.replace(a, warnings=[*a.warnings, *filter(None, texts)]) for a, *texts in said]


def _odd_ways(demonstrations: list[Demonstration]) -> list[str]:
    """A sentence for each of three or more recordings whose direction from start to end is odd.

    Odd is more than 15 degrees from the others' mean, and three times the median angle.
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


def warnings_of(demonstrations: Sequence[Demonstration]) -> list[str]:
    """Return every warning of a set, prefixed by its file."""
    found = compared(list(demonstrations), [audit(d) for d in demonstrations])
    return [f"{each.file}: {text}" for each in found for text in each.warnings]
