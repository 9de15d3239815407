"""Checks of an exporter: its text has finite numbers that depend on the phase, and nothing else."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any, get_args

import numpy as np

from skillframe.errors import InputError
from skillframe.extend import Axes, ExporterType, MovingImpedance
from skillframe_testkit.checks.material import example_phase
from skillframe_testkit.checks.problems import attempt
from skillframe_testkit.checks.watch import left_behind, watched

NOT_FINITE = re.compile(r"(?<![\w.])[-+.]?(nan|inf|infinity)(?![\w.])", re.IGNORECASE)
LINES = ("an example of skillframe", "push along -z at 20 mm/s; free along x; turns freely about y")


def check_exporter(exporter: ExporterType) -> list[str]:
    """Problems of an exporter, with example phases. Of a program only the record is checked."""
    if (problems := attempt("record", lambda: _record(exporter))) or exporter.axes is None:
        return problems  # no example fits every robot's program
    with watched() as seen:
        problems = attempt("writes", lambda: _writes(exporter))
        problems += attempt("repeats", lambda: _repeats(exporter))
        problems += attempt("holds the skill", lambda: _holds_the_skill(exporter))
    return problems + [f"leaves nothing behind: {text}" for text in left_behind(seen)]


def _phases(exporter: ExporterType) -> dict[str, MovingImpedance]:
    """Example phases in an exporter's axes."""
    axis, gains = np.array([0.6, 0.0, 0.8]), np.zeros((6, 6))
    gains[:3, :3] = 700.0 * (np.eye(3) - np.outer(axis, axis))
    changes: dict[str, dict[str, Any]] = {
        "a push that is free along x": {},
        "a push that is stiff all over": {"stiffness": np.diag([900.0] * 3 + [30.0] * 3)},
        "a phase without stiffness and motion": {"stiffness": np.zeros((6, 6)), "twist": np.zeros(6)},
        "a free axis between the axes": {"stiffness": gains},
    }
    return {name: example_phase(axes=exporter.axes, **change) for name, change in changes.items()}


def _record(exporter: ExporterType) -> Iterator[str]:
    if exporter.axes not in (*get_args(Axes), None):
        yield f"axes is {exporter.axes!r}; give 'base' or 'tool', or None for a program"
    if not isinstance(exporter.checked, str) or not exporter.checked.strip():
        yield "checked is empty; say which version of the controller its names and types were checked against"
    if isinstance(exporter.notes, str) or not all(isinstance(note, str) for note in exporter.notes):
        yield f"notes is {exporter.notes!r:.60}; give a tuple of lines"


def _text(exporter: ExporterType, phase: MovingImpedance, lines: Sequence[str] = LINES) -> str | None:
    try:
        text: str = exporter.write(phase, list(lines))
    except InputError:
        return None
    return text


def _writes(exporter: ExporterType) -> Iterator[str]:
    refused = 0
    for name, phase in _phases(exporter).items():
        text = _text(exporter, phase)
        refused += text is None
        if text is not None and (not isinstance(text, str) or not text.strip()):
            yield f"gave {text!r:.60} for {name}; give the text of a file, or raise InputError"
            return
        if text is not None and (found := NOT_FINITE.search(text)):
            line = next(line for line in text.splitlines() if NOT_FINITE.search(line))
            yield f"writes {found[0]!r} for {name} ({line.strip():.60}); a controller would take it for a number"
            return
    if refused == len(_phases(exporter)):
        yield "refuses every example, a push along an axis with gains along the axes too"


def _repeats(exporter: ExporterType) -> Iterator[str]:
    one, other, *_ = _phases(exporter).values()
    first = _text(exporter, one)
    _text(exporter, other)
    if _text(exporter, one) != first:
        yield "writes another text for the same phase, after another one was written; keep nothing between calls"


def _holds_the_skill(exporter: ExporterType) -> Iterator[str]:
    changed: dict[str, Any] = {
        "stiffness": np.diag([0.0, 400.0, 400.0, 10.0, 0.0, 10.0]),
        "damping": np.diag([50.0, 90.0, 90.0, 3.0, 2.0, 3.0]),
        "twist": np.array([0.0, 0.0, -0.01, 0.0, 0.0, 0.0]), "lead_force": 10.0, "lead_torque": 1.0,
    }  # fmt: skip
    before = _text(exporter, example_phase(axes=exporter.axes))
    others = [_text(exporter, example_phase(axes=exporter.axes, **{key: value})) for key, value in changed.items()]
    if before is not None and all(text == before for text in others):
        yield f"the settings stay the same whatever the phase's {', '.join(changed)} are; write what the skill learned"
