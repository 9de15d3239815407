"""Checks of a score: a reproducible number for any trace, which stays unchanged."""

from __future__ import annotations

import copy
import math
import re
import time
from collections.abc import Iterator, Sequence

from skillframe.execution import ScoreFailed, Trace, read_only, score_of
from skillframe.extend import ScoreType
from skillframe_testkit.checks.material import example_trace
from skillframe_testkit.checks.problems import attempt
from skillframe_testkit.checks.watch import left_behind, watched


def check_score(score: ScoreType, traces: Sequence[Trace] | None = None) -> list[str]:
    """Problems of a score, with example traces and given ones."""
    if problems := attempt("record", lambda: _record(score)):
        return problems
    tried = {
        "a success": example_trace(), "a failure": example_trace(success=False, trial=1),
        "a trial of one sample": example_trace(success=False, duration_s=0.0, trial=2),
        "a trial that diverged": example_trace(success=False, diverged=True, trial=3),
        **{f"trace {i} of those given": read_only(trace) for i, trace in enumerate(traces or ())},
    }  # fmt: skip
    with watched() as seen:
        problems = attempt("figures", lambda: _figures(score, tried))
        if not problems:
            problems += attempt("repeats", lambda: _repeats(score, list(tried.values())))
            problems += attempt("trace", lambda: _leaves_the_trace(score))
            problems += attempt("time", lambda: _in_time(score))
    return problems + [f"leaves nothing behind: {text}" for text in left_behind(seen)]


def _record(score: ScoreType) -> Iterator[str]:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", score.name):
        yield f"the name is {score.name!r}; use letters, digits and underscores, for it names a column"
    if not isinstance(score.unit, str) or not score.unit.strip():
        yield f"unit is {score.unit!r}; give the unit of the figure in SI, or '1' if it has none"


def _figures(score: ScoreType, tried: dict[str, Trace]) -> Iterator[str]:
    for name, trace in tried.items():
        try:
            value = score_of(score, trace)
        except ScoreFailed as error:
            yield f"{name}: {str(error).partition(';')[0].removeprefix(f'score {score.name} ')}"
            continue
        if name == "a success" and math.isnan(value):
            yield "a success: gives nan, which means that this trial has no such figure; a plain slide has one"


def _repeats(score: ScoreType, traces: Sequence[Trace]) -> Iterator[str]:
    first = [score_of(score, trace) for trace in traces]
    last = [score_of(score, trace) for trace in reversed(traces)][::-1]
    for one, other in zip(first, last, strict=True):
        if not (one == other or (math.isnan(one) and math.isnan(other))):
            yield f"gives {one:g}, and {other:g} for the same trace after others; keep nothing between calls"
            return


def _leaves_the_trace(score: ScoreType) -> Iterator[str]:
    trace = example_trace()
    before = copy.deepcopy(trace.meta)
    score_of(score, trace)
    if trace.meta != before:
        yield "changes the trace's metadata, which is stored after it; work on a copy"


def _in_time(score: ScoreType) -> Iterator[str]:
    """Half a second of processor time for the longest default run, eight minutes for 1,000 trials."""
    trace = example_trace(duration_s=20.0)
    began = time.process_time()
    score_of(score, trace)
    took = time.process_time() - began
    if took > 0.5:
        yield f"takes {took:.2g} s of processor time for a run of 20 s; stay below 0.5 s"
