"""What every exporter must do: write text that holds finite numbers, says what the phase says, and nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from skillframe.conformance.material import example_phase
from skillframe.conformance.problems import attempt
from skillframe.conformance.watch import left_behind, watched
from skillframe.errors import InputError
from skillframe.extend.outputs import Axes
from skillframe.extend.records import ExporterType, MovingImpedance

NOT_FINITE = re.compile(r"(?<![\w.])[-+.]?(nan|inf|infinity)(?![\w.])", re.IGNORECASE)
LINES = ("an example of skillframe", "push along -z at 20 mm/s; free along x; turns freely about y")
OTHER = {
    "stiffness": np.diag([0.0, 400.0, 400.0, 10.0, 0.0, 10.0]), "damping": np.diag([50.0, 90.0, 90.0, 3.0, 2.0, 3.0]),
    "twist": np.array([0.0, 0.0, -0.01, 0.0, 0.0, 0.0]), "lead_force": 10.0, "lead_torque": 1.0,
}  # fmt: skip
"""What is changed, a field at a time: settings that none of it changes say nothing of the skill."""


@dataclass(frozen=True, slots=True)
class _Phases:
    """Phases to try one exporter with, in its axes."""

    exporter: ExporterType

    def peg(self) -> MovingImpedance:
        return example_phase(axes=self.exporter.axes)

    def stiff(self) -> MovingImpedance:
        return example_phase(axes=self.exporter.axes, stiffness=np.diag([900.0] * 3 + [30.0] * 3))

    def limp(self) -> MovingImpedance:
        return example_phase(axes=self.exporter.axes, stiffness=np.zeros((6, 6)), twist=np.zeros(6))

    def slanted(self) -> MovingImpedance:
        axis = np.array([0.6, 0.0, 0.8])
        gains = np.zeros((6, 6))
        gains[:3, :3] = 700.0 * (np.eye(3) - np.outer(axis, axis))
        return example_phase(axes=self.exporter.axes, stiffness=gains)

    def all(self) -> dict[str, MovingImpedance]:
        return {
            "a push that is free along x": self.peg(), "a push that is stiff all over": self.stiff(),
            "a phase without stiffness and motion": self.limp(), "a free axis between the axes": self.slanted(),
        }  # fmt: skip


def check_exporter(exporter: ExporterType) -> list[str]:
    """Problems of an exporter, tried on phases that are written down. Empty if it conforms."""
    if problems := attempt("record", lambda: _record(exporter)):
        return problems
    with watched() as seen:
        problems = attempt("writes", lambda: _writes(exporter))
        problems += attempt("repeats", lambda: _repeats(exporter))
        problems += attempt("holds the skill", lambda: _holds_the_skill(exporter))
    return problems + [f"leaves nothing behind: {text}" for text in left_behind(seen)]


def _record(exporter: ExporterType) -> Iterator[str]:
    if exporter.axes not in get_args(Axes):
        yield f"axes is {exporter.axes!r}; give 'base' or 'tool'"
    if not isinstance(exporter.checked, str) or not exporter.checked.strip():
        yield "checked is empty; say which version of the controller its names and types were checked against"
    if isinstance(exporter.notes, str) or not all(isinstance(note, str) for note in exporter.notes):
        yield f"notes is {exporter.notes!r:.60}; give a tuple of lines"


def _text(exporter: ExporterType, phase: MovingImpedance, lines: Sequence[str] = LINES) -> str | None:
    """What it writes, or None if it refuses."""
    try:
        text: str = exporter.write(phase, list(lines))
    except InputError:
        return None
    return text


def _writes(exporter: ExporterType) -> Iterator[str]:
    """Text with finite numbers for every phase that it does not refuse, and it refuses not all of them."""
    refused = 0
    for name, phase in _Phases(exporter).all().items():
        text = _text(exporter, phase)
        refused += text is None
        if text is not None and (not isinstance(text, str) or not text.strip()):
            yield f"gave {text!r:.60} for {name}; give the text of a file, or raise InputError"
            return
        if text is not None and (found := NOT_FINITE.search(text)):
            line = next(line for line in text.splitlines() if NOT_FINITE.search(line))
            yield f"writes {found[0]!r} for {name} ({line.strip():.60}); a controller would take it for a number"
            return
    if refused == len(_Phases(exporter).all()):
        yield "refuses every example, a push along an axis with gains along the axes too"


def _repeats(exporter: ExporterType) -> Iterator[str]:
    """The same phase gives the same text, whatever was written before."""
    phases = _Phases(exporter)
    first = _text(exporter, phases.peg())
    _text(exporter, phases.stiff())
    if _text(exporter, phases.peg()) != first:
        yield "writes another text for the same phase, after another one was written; keep nothing between calls"


def _holds_the_skill(exporter: ExporterType) -> Iterator[str]:
    """Some of what the phase says is in the settings: it is not the lines alone that change."""
    before = _text(exporter, _Phases(exporter).peg())
    others = [_text(exporter, example_phase(axes=exporter.axes, **{key: value})) for key, value in OTHER.items()]
    if before is not None and all(text == before for text in others):
        yield f"the settings stay the same whatever the phase's {', '.join(OTHER)} are; write what the skill learned"
