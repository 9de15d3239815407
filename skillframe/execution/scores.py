"""Scores of a trial: figures that plug-ins compute from its trace."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from skillframe.errors import SkillframeError
from skillframe.execution.trace import Trace
from skillframe.extend.records import ScoreType
from skillframe.extend.registry import registry


class ScoreFailed(SkillframeError):
    """A score that raised, or gave something else than a number. Says which and what."""


def scores_of(trace: Trace, names: Iterable[str]) -> dict[str, float]:
    """The scores of one trial, in SI units. NaN where a trial has no such figure.

    Args:
        trace: of the trial; its arrays are handed on read-only.
        names: of the scores.

    Raises:
        UnknownName: no plug-in has a score of that name.
        ScoreFailed: a score raises, or gives no number.
    """
    shown = read_only(trace)
    return {name: score_of(registry().score(name), shown) for name in names}


def score_of(score: ScoreType, trace: Trace) -> float:
    """One score of one trial.

    Raises:
        ScoreFailed: it raises, or gives no number.
    """
    try:
        with np.errstate(all="ignore"):
            value: Any = score.compute(trace)
    except (Exception, SystemExit) as error:  # foreign code
        raise ScoreFailed(
            f"score {score.name} raised {type(error).__name__}: {error}; correct its plug-in, or leave the score out"
        ) from error
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        raise ScoreFailed(f"score {score.name} gave {value!r:.60}, not a number; correct its plug-in, or leave it out")
    if math.isinf(value):
        raise ScoreFailed(
            f"score {score.name} gave {value}; NaN says that a trial has no such figure; correct its plug-in"
        )
    return float(value)


def score_notes(values: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Scores with unit and summary as plain JSON values: {"settling_time": {"value": 0.3, "unit": "s", ...}}."""
    return {name: {"value": None if math.isnan(value) else value, **about(name)} for name, value in values.items()}


def about(name: str) -> dict[str, str]:
    """Unit and summary of a score."""
    score = registry().score(name)
    return {"unit": score.unit, "summary": score.summary}


def read_only(trace: Trace) -> Trace:
    """The same trace, whose arrays refuse to be written to."""
    arrays = {
        field.name: _locked(getattr(trace, field.name))
        for field in dataclasses.fields(Trace)
        if field.name not in ("machine", "meta")
    }
    return dataclasses.replace(trace, **arrays, machine={name: _locked(a) for name, a in trace.machine.items()})


def _locked(array: Any) -> Any:
    view = array.view()
    view.setflags(write=False)
    return view
