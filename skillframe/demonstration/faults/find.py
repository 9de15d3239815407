"""All faults of a recording, its samples with a valid wrench, and the refusal to learn from faults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.content_cache import Once
from skillframe.demonstration.faults import fault as record
from skillframe.demonstration.faults.copies import copies
from skillframe.demonstration.faults.fault import COPY, JUMP, SATURATED, Flaw
from skillframe.demonstration.faults.saturated import saturated
from skillframe.demonstration.faults.steps import jumps, steps
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.stalls import KEY as STALLS
from skillframe.demonstration.stalls import POSE, Stall, as_meta, every_stall, stalls
from skillframe.errors import InputError
from skillframe.frames import Float

Mask = NDArray[np.bool_]


def faults(demonstration: Demonstration, found: Sequence[Stall] | None = None) -> list[Flaw]:
    """All faults of a demonstration, by start: those of its metadata and those of its samples."""
    d = demonstration
    held = stalls(d) if found is None else found
    return every_fault(d.time, np.concatenate([d.position, d.quaternion], axis=1), d.wrench, d.meta, held, d.source)


def every_fault(
    time: Float, pose: Float, wrench: Float, meta: Mapping[str, Any], held: Sequence[Stall], source: str = ""
) -> list[Flaw]:
    """Faults of the metadata and of time (T,) [s], pose (T, 7) and measured wrench (T, 6) [N, Nm]."""
    known = record.kept(meta, source)
    shown = [
        f
        for f in _SHOWN(time, pose, wrench, held=list(held))
        if not any((f.kind == k.kind and f.start <= k.stop and k.start <= f.stop) for k in known)
    ]
    found = [f for f in [*known, *shown] if f.within(float(time[0]), float(time[-1]))]
    return sorted(found, key=lambda f: (f.start, f.kind, f.what))


def _shown(time: Float, pose: Float, wrench: Float, held: Sequence[Stall]) -> list[Flaw]:
    found = [*copies(time, pose, wrench), *saturated(time, wrench)]
    skip = np.zeros(len(time), dtype=bool)
    spans: list[Stall | Flaw] = [*held, *found]
    for span in spans:
        skip |= (time >= span.start) & (time <= span.stop)
    found += [
        f
        for f in jumps(time, pose)
        if not any(s.what == POSE and (s.start <= f.stop and f.start <= s.stop) for s in spans)
    ]
    return found + steps(time, pose, wrench, skip)


_SHOWN = Once(_shown)


def remembered(time: Float, pose: Float, wrench: Float, meta: Mapping[str, Any], source: str = "") -> dict[str, Any]:
    """Metadata with the stalls and faults of a wrench, before rotation or smoothing hides them."""
    held = every_stall(time, pose, wrench, meta, source)
    return with_named(meta, held, every_fault(time, pose, wrench, meta, held, source))


def with_named(meta: Mapping[str, Any], held: Sequence[Stall], found: Sequence[Flaw]) -> dict[str, Any]:
    """Metadata that name exactly these stalls and faults."""
    return {
        **{name: value for name, value in meta.items() if name not in (STALLS, record.KEY)},
        **({STALLS: as_meta(held)} if held else {}), **({record.KEY: record.flaws_as_meta(found)} if found else {}),
    }  # fmt: skip


def alive(
    demonstration: Demonstration, held: Sequence[Stall] | None = None, found: Sequence[Flaw] | None = None
) -> Mask:
    """Mask (T,) of samples with a valid wrench."""
    time = demonstration.time
    held = stalls(demonstration) if held is None else held
    mask = np.ones(len(time), dtype=bool)
    flaws = faults(demonstration, held) if found is None else found
    spans: list[Stall | Flaw] = [*held, *(f for f in flaws if f.acts)]
    for span in spans:
        if span.what != POSE:
            mask &= (time < span.start) | (time > span.stop)
    return mask


def pressing(demonstration: Demonstration, live: Mask, found: Sequence[Flaw]) -> Mask:
    """Mask (T,) of samples that may be in contact: those alive, and those that saturate."""
    mask, time = live.copy(), demonstration.time
    for fault in (f for f in found if f.kind == SATURATED):
        mask |= (time >= fault.start) & (time <= fault.stop)
    for fault in (f for f in found if f.kind == COPY and f.what != POSE):
        mask &= (time < fault.start) | (time > fault.stop)
    return mask


def refuse_faults(demonstration: Demonstration) -> None:
    """Refuse to learn from a demonstration with stalls or faults. The message gives the command that keeps the rest.

    Raises:
        InputError: with the first stall or fault, and the longest part without any.
    """
    d = demonstration
    held = stalls(d)
    found: list[Stall | Flaw] = sorted([*held, *(f for f in faults(d, held) if f.acts)], key=lambda f: f.start)
    if not found:
        return
    name = d.source or "demonstration"
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    first, last = longest_part(d, found)
    part = f" --set from={np.ceil(1e3 * first - 1e-6) / 1e3:.3f}" if first > d.time[0] else ""
    part += f" --set to={np.floor(1e3 * last + 1e-6) / 1e3:.3f}" if last < d.time[-1] else ""
    raise InputError(
        name, f"{found[0].words()}{more}: {_consequence(found[0])}",
        f"cut it off (skillframe convert {name}{part} --out cut.npz), or record it again",
    )  # fmt: skip


def _consequence(found: Stall | Flaw) -> str:
    kind = found.kind if isinstance(found, Flaw) else ""
    if kind == JUMP:
        return "before and after it are two recordings, so nothing can be learned from the whole"
    if kind == SATURATED:
        return "the force was larger than what was recorded, so nothing can be learned from it"
    return "what happened then was not recorded, so nothing can be learned from it"


def longest_part(demonstration: Demonstration, found: Sequence[Stall | Flaw]) -> tuple[float, float]:
    """Start and stop of the longest part without stall or fault, one sample away from each [s]."""
    step, last = 1.0 / demonstration.rate, float(demonstration.time[-1])
    begin, parts = float(demonstration.time[0]), []
    gaps = [
        (f.start, f.stop) if isinstance(f, Flaw) and f.kind == JUMP else (f.start - step, f.stop + step) for f in found
    ]  # a jump's own samples are valid
    for stop, again in sorted(gaps):
        parts.append((begin, stop))
        begin = max(begin, again)
    return max([*parts, (begin, last)], key=lambda part: part[1] - part[0])
