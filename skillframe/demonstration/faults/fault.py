"""A fault of a recording, in words and in metadata."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.stalls import POSE
from skillframe.errors import InputError

KEY = "faults"
"""Metadata key of faults found when the recording was first read: [{kind, what, start, stop, value}]."""
STEP, COPY, SATURATED, JUMP = "step", "copy", "saturation", "jump"  #: kinds of a fault
KINDS = (STEP, COPY, SATURATED, JUMP)
TOUCHES = {
    STEP: "what follows may have another bias; a hard touch between two samples can do the same, so all of it counts",
    COPY: "what happened then is not known; it counts as neither free air, contact nor noise",
    SATURATED: "the sensor's range ended, and the force was larger; it counts as contact, but not as noise",
    JUMP: "before and after it are two recordings, and no motion leads from one to the other",
}
"""Consequence of a fault by kind. A step changes nothing, as it may be a real contact."""


class Flaw(NamedTuple):
    """One stretch that is no valid measurement.

    Attributes:
        kind: "step", "copy", "saturation" or "jump".
        what: "wrench", one or more of its channels ("fx, tz"), or "pose".
        start, stop: its first and last sample [s]. A step lasts as long as its level; a jump has its two neighbours.
        value: size of a step [N, Nm] or jump [m], the value of saturation [N, Nm], or the start of a copy's original
            [s].
    """

    kind: str
    what: str
    start: float
    stop: float
    value: float

    @property
    def channels(self) -> list[str]:
        """Channels of the wrench that it affects."""
        return list(WRENCH) if self.what == "wrench" else [name for name in self.what.split(", ") if name in WRENCH]

    def words(self) -> str:
        """What and where, as a clause."""
        span = f"from {self.start:.2f} to {self.stop:.2f} s"
        if self.kind == STEP:
            verb = "step" if "," in self.what else "steps"
            size = f"{self.value:.3g} {self._unit} within one sample"
            return f"{self.what} {verb} by {size}, {span}, while the motion goes on"
        if self.kind == COPY:
            end = self.value + self.stop - self.start
            return f"the {self.what} {span} is that from {self.value:.2f} to {end:.2f} s bit for bit"
        if self.kind == SATURATED:
            way = "largest" if self.value > 0.0 else "least"
            return f"{self.what} stays at its {way} value, {self.value:.4g} {self._unit}, {span}"
        return f"the tool point jumps by {1e3 * self.value:.1f} mm between {self.start:.3f} and {self.stop:.3f} s"

    def warning(self, more: int = 0) -> str:
        """Sentence for the check: what, where, and the consequence, for this one and `more` like it."""
        others = f" (and {more} more)" if more else ""
        return f"{self.kind}: {self.words()}{others}: {TOUCHES[self.kind]}"

    @property
    def _unit(self) -> str:
        return "N" if self.what == "wrench" or self.what.startswith("f") else "Nm"

    def within(self, first: float, last: float) -> bool:
        """Whether it shows in a part of the recording [s]. A step shows by its ends."""
        if self.kind == STEP:
            return first < self.start <= last or first <= self.stop < last
        return self.stop > first and self.start < last

    @property
    def acts(self) -> bool:
        """Whether nothing may be concluded or learned from its stretch."""
        return self.kind != STEP


def kept(meta: Mapping[str, Any], source: str = "") -> list[Flaw]:
    """The faults that metadata name.

    Raises:
        InputError: they are not a list of {kind, what, start, stop, value}.
    """
    where = f"{source or 'metadata'}: {KEY}"
    try:
        found = [
            Flaw(str(f["kind"]), str(f["what"]), *(float(f[name]) for name in ("start", "stop", "value")))
            for f in meta.get(KEY, [])
        ]
    except (TypeError, KeyError, ValueError):
        raise InputError(
            where,
            f"is no list of faults: {meta[KEY]!r}"[:200],
            "give [{kind, what, start, stop, value}], or leave it out",
        ) from None
    for fault in found:
        if fault.kind not in KINDS or not (fault.channels or fault.what == POSE) or not fault.start <= fault.stop:
            raise InputError(where, f"holds {fault}", f"give kind = {' or '.join(KINDS)}, what, and start <= stop")
    return found


def moved(meta: Mapping[str, Any], seconds: float, source: str = "") -> dict[str, Any]:
    """Metadata whose faults are shifted with the clock."""
    found = [
        f._replace(start=f.start + seconds, stop=f.stop + seconds, value=f.value + seconds * (f.kind == COPY))
        for f in kept(meta, source)
    ]
    return {**meta, KEY: flaws_as_meta(found)} if found else dict(meta)


def flaws_as_meta(found: Sequence[Flaw]) -> list[dict[str, Any]]:
    """Plain values for metadata and `--json`."""
    return [fault._asdict() for fault in found]
