"""Every fault of a recording, what of its wrench is alive, and the refusal to learn from what did not happen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.faults import fault as record
from skillframe.demonstration.faults.copies import copies
from skillframe.demonstration.faults.fault import COPY, JUMP, SATURATED, Flaw
from skillframe.demonstration.faults.jumps import jumps
from skillframe.demonstration.faults.saturated import saturated
from skillframe.demonstration.faults.steps import steps
from skillframe.demonstration.once import Once
from skillframe.demonstration.record import Demonstration
from skillframe.demonstration.stalls import KEY as STALLS
from skillframe.demonstration.stalls import POSE, Stall, as_meta, every_stall, stalls
from skillframe.errors import InputError
from skillframe.frames import Float

Mask = NDArray[np.bool_]


def faults(demonstration: Demonstration, found: Sequence[Stall] | None = None) -> list[Flaw]:
    """Every fault of a demonstration, by start: those that its metadata name, and those that its samples show.

    Args:
        demonstration: as read.
        found: its stalls; looked for if not given.
    """
    d = demonstration
    held = stalls(d) if found is None else found
    return every_fault(d.time, np.concatenate([d.position, d.quaternion], axis=1), d.wrench, d.meta, held, d.source)


def every_fault(
    time: Float, pose: Float, wrench: Float, meta: Mapping[str, Any], held: Sequence[Stall], source: str = ""
) -> list[Flaw]:
    """Faults that metadata name and faults that samples show.

    Args:
        time: (T,) [s].
        pose: (T, 7) position and quaternion.
        wrench: (T, 6) as the sensor gave it [N, Nm].
        meta: of the recording.
        held: its stalls.
        source: its name, for messages.
    """
    known = record.kept(meta, source)
    shown = [f for f in _SHOWN(time, pose, wrench, held=list(held)) if not any(_same(f, k) for k in known)]
    found = [f for f in [*known, *shown] if f.within(float(time[0]), float(time[-1]))]
    return sorted(found, key=lambda f: (f.start, f.kind, f.what))


def _same(one: Flaw, other: Flaw) -> bool:
    return one.kind == other.kind and one.start <= other.stop and other.start <= one.stop


def _shown(time: Float, pose: Float, wrench: Float, held: Sequence[Stall]) -> list[Flaw]:
    found = [*copies(time, pose, wrench), *saturated(time, wrench)]
    skip = np.zeros(len(time), dtype=bool)
    spans: list[Stall | Flaw] = [*held, *found]
    for span in spans:
        skip |= (time >= span.start) & (time <= span.stop)
    found += [f for f in jumps(time, pose) if not any(s.what == POSE and _touch(s, f) for s in spans)]
    return found + steps(time, pose, wrench, skip)


_SHOWN = Once(_shown)


def _touch(one: Stall | Flaw, other: Flaw) -> bool:
    return one.start <= other.stop and other.start <= one.stop


def remembered(time: Float, pose: Float, wrench: Float, meta: Mapping[str, Any], source: str = "") -> dict[str, Any]:
    """Metadata with the stalls and faults of a wrench that is turned, or smoothed, later, and then hides them."""
    held = every_stall(time, pose, wrench, meta, source)
    return with_named(meta, held, every_fault(time, pose, wrench, meta, held, source))


def with_named(meta: Mapping[str, Any], held: Sequence[Stall], found: Sequence[Flaw]) -> dict[str, Any]:
    """Metadata that name these stalls and faults, and no others."""
    return {
        **{name: value for name, value in meta.items() if name not in (STALLS, record.KEY)},
        **({STALLS: as_meta(held)} if held else {}), **({record.KEY: record.as_meta(found)} if found else {}),
    }  # fmt: skip


def alive(
    demonstration: Demonstration, held: Sequence[Stall] | None = None, found: Sequence[Flaw] | None = None
) -> Mask:
    """Mask (T,) of samples whose wrench is what the sensor measured.

    Args:
        demonstration: as read.
        held: its stalls; looked for if not given.
        found: its faults; looked for if not given.
    """
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
    """Mask (T,) of samples that may be in contact: those alive, and those that saturate, whose force is larger.

    Args:
        demonstration: as read.
        live: its samples that are alive.
        found: its faults.
    """
    mask, time = live.copy(), demonstration.time
    for fault in (f for f in found if f.kind == SATURATED):
        mask |= (time >= fault.start) & (time <= fault.stop)
    for fault in (f for f in found if f.kind == COPY and f.what != POSE):
        mask &= (time < fault.start) | (time > fault.stop)
    return mask


def refuse_faults(demonstration: Demonstration) -> None:
    """Refuse to learn from a demonstration of which a part is not what happened, with the line that keeps the rest.

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
    part = f" --from {np.ceil(1e3 * first - 1e-6) / 1e3:.3f}" if first > d.time[0] else ""
    part += f" --to {np.floor(1e3 * last + 1e-6) / 1e3:.3f}" if last < d.time[-1] else ""
    raise InputError(
        name, f"{found[0].words()}{more}: {_consequence(found[0])}",
        f"cut it off (skillframe demonstration convert {name}{part} --out cut.npz), or record it again",
    )  # fmt: skip


def _consequence(found: Stall | Flaw) -> str:
    kind = found.kind if isinstance(found, Flaw) else ""
    if kind == JUMP:
        return "before and after it are two recordings, so nothing can be learned from the whole"
    if kind == SATURATED:
        return "the force was larger than what was recorded, so nothing can be learned from it"
    return "what happened then was not recorded, so nothing can be learned from it"


def longest_part(demonstration: Demonstration, found: Sequence[Stall | Flaw]) -> tuple[float, float]:
    """Start and stop of the longest part without a stall or fault, one sample apart from each [s].

    A jump parts two sound stretches.
    """
    step, last = 1.0 / demonstration.rate, float(demonstration.time[-1])
    begin, parts = float(demonstration.time[0]), []
    for stop, again in sorted(_gap(f, step) for f in found):
        parts.append((begin, stop))
        begin = max(begin, again)
    return max([*parts, (begin, last)], key=lambda part: part[1] - part[0])


def _gap(found: Stall | Flaw, step: float) -> tuple[float, float]:
    """Where what is sound ends and begins again [s]."""
    if isinstance(found, Flaw) and found.kind == JUMP:
        return found.start, found.stop
    return found.start - step, found.stop + step
