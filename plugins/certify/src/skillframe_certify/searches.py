"""Three searches of a folder: the border, the smallest failing disturbance and the most influential quantity.

    plan.jsonl      rounds, each written before it runs
    border/1 ...    rounds of the border; result in border.json
    break/1 ...     rounds of the search for a small disturbance, confirm/1 ... fresh trials at its end; breaking.json
    matter/1 ...    fresh trials over the ranges, then the same with a quantity fixed; matter.json

Each may be interrupted at any moment and continues when it is called again.
"""

from __future__ import annotations

import json
from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.campaign import load
from skillframe.errors import InputError
from skillframe.extend import quantities
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe.frames import Float
from skillframe_certify import border, breaking_point, sensitivity
from skillframe_certify.border import Border, ToTry
from skillframe_certify.engine import Engine, Looked, Say
from skillframe_certify.plan import METHOD, PLAN, RoundPlan
from skillframe_certify.question import LOOK, MOST_MAPPED, Question, mapped_question, read_question
from skillframe_certify.rounds import BORDER, carry_out, ended, looked, next_sobol, rows_hash, scene_of, seed_of

BREAK, CONFIRM, MATTER = "break", "confirm", "matter"
FOUND = {BORDER: "border.json", BREAK: "breaking.json", MATTER: "matter.json"}
"""File of each search's result."""


def nominal(folder: Path, question: Question) -> dict[str, float]:
    """Return each quantity's nominal value in SI, or the middle of its range if it has none."""
    scene = scene_of(folder, load(folder / LOOK))
    known: dict[str, Any] = {each.name: each.nominal for each in quantities().values()}
    known |= {f"world.{name}": value for name, value in scene["params"].items()} if "params" in scene else {}
    return {
        name: float(value) if isinstance(value := known.get(name), int | float) else 0.5 * (low + high)
        for name, (low, high) in question.ranges.items()
    }


def map_border(folder: Path, engine: Engine, say: Say = print) -> dict[str, Any]:
    """Find the border of success and return the content of border.json."""
    found = carry_out(folder, BORDER, _border(folder, engine.params, say), engine, say)
    question = read_question(folder)
    names = list(question.ranges)
    seen = looked(folder, engine.params)
    ranks = sensitivity.ranks(seen)
    return _written(folder, BORDER, {
        **seen.counts, "explored": found.explored,
        "doubt": found.doubt, "settled": found.settled, "share_that_works": found.share,
        "smallest_island": 3.0 / found.explored,  # rule of three: of the volume, with 95 % confidence
        "reaches": {name: list(found.edges[i]) for i, name in enumerate(names)},
        "index": {name: float(ranks[i]) for i, name in enumerate(names)},
    })  # fmt: skip


def _border(folder: Path, params: type | None, say: Say) -> Generator[ToTry, Looked, Border]:
    question = mapped_question(folder)
    seen = looked(folder, params, rounds=0).require_trials()
    budget = max(border.BUDGET[len(question.ranges)], 2 * len(seen.works))
    return border.search(seen, len(seen.works), next_sobol(folder, question, params), budget, say)


def find_break(folder: Path, engine: Engine, say: Say = print) -> dict[str, Any]:
    """Find a small failing disturbance and return the content of breaking.json."""
    question = read_question(folder)
    found = carry_out(folder, BREAK, _breaking(folder, engine.params, say), engine, say)
    confirmed, tried = carry_out(folder, CONFIRM, _confirming(found.points), engine, say)
    content: dict[str, Any] = {
        "trials": found.trials, "undisturbed_failures": found.undisturbed, "nominal": nominal(folder, question),
        "confirmations": tried, "confirmed": confirmed is not None, "fresh_trials": breaking_point.AGAIN,
    }  # fmt: skip
    if confirmed is not None:
        away = found.points[confirmed] - question.scaled(nominal(folder, question))[0]
        values = question.in_si(found.points[confirmed])
        content |= {
            "size": float(np.sqrt(np.sum(away**2))), "round": confirmed + 1,
            "point": {name: float(values[i]) for i, name in enumerate(question.ranges)},
        }  # fmt: skip
    return _written(folder, BREAK, content)


def _breaking(folder: Path, params: type | None, say: Say) -> Generator[ToTry, Looked, breaking_point.BreakingPoints]:
    question = read_question(folder)
    origin = question.scaled(nominal(folder, question))[0]
    outside = next((n for n, x in zip(question.ranges, origin, strict=True) if abs(x) > 1.0), None)
    if outside is not None:
        raise InputError(
            f"vary.{outside}", "does not contain its nominal value, from which a disturbance is measured",
            "widen the range, or fix the quantity in [set]",
        )  # fmt: skip
    seen = looked(folder, params, rounds=0).require_trials()
    return breaking_point.search(seen, origin, breaking_point.BUDGET[len(question.ranges)], say)


def _confirming(points: Float) -> Generator[ToTry, Looked, tuple[int | None, list[int]]]:
    """Try three failing points with fresh noise, smallest first, until more than half of the trials at one fail."""
    tried: list[int] = []
    for number, point in enumerate(points[:3]):
        again = yield ToTry(np.tile(point, (breaking_point.AGAIN, 1)), 0)
        tried.append(int(np.sum(again.fails)))
        if tried[-1] > breaking_point.AGAIN // 2:
            return number, tried
    return None, tried


def rank(folder: Path, engine: Engine, say: Say = print) -> dict[str, Any]:
    """Rank the quantities, test the first two, and return the content of matter.json."""
    question = mapped_question(folder)
    held = carry_out(folder, MATTER, _matter(folder, engine.params, say), engine, say)
    where, seen = nominal(folder, question), looked(folder, engine.params, rounds=0)
    return _written(folder, MATTER, {
        "looked_at": seen.counts,
        "index": _ranks(folder, engine.params),
        "held": [{**each._asdict(), "change": list(each.change), "at": where[each.name]} for each in held],
    })  # fmt: skip


def _ranks(folder: Path, params: type | None) -> dict[str, float]:
    question, seen = read_question(folder), looked(folder, params, rounds=0).require_trials()
    found = sensitivity.ranks(seen)
    return {name: float(found[i]) for i, name in enumerate(question.ranges)}


def _matter(folder: Path, params: type | None, say: Say) -> Generator[ToTry, Looked, tuple[sensitivity.Frozen, ...]]:
    question = mapped_question(folder)
    at = question.scaled(nominal(folder, question))[0]
    seed = seed_of(load(folder / LOOK, params).seed, MATTER, 0)
    return sensitivity.search(_ranks(folder, params), list(question.ranges), at, seed, say)


def _written(folder: Path, stream: str, content: dict[str, Any]) -> dict[str, Any]:
    text = json.dumps(content, indent=2, sort_keys=True, allow_nan=False) + "\n"
    write_whole(folder / FOUND[stream], text.encode())
    return content


def found_in(folder: Path, stream: str) -> dict[str, Any] | None:
    """Return the result of a search, or None if it has not ended."""
    path = folder / FOUND[stream]
    if not path.is_file():
        return None
    fix = "remove it and type the command that wrote it again"
    content: Any = read_json(path, fix)
    if not isinstance(content, dict):
        raise InputError(path, "is not what a search writes", fix)
    return content


def check_plan(folder: Path, params: type | None = None) -> list[str]:
    """Recompute the plan from the rows and return sentences on differences."""
    question = read_question(folder)
    plan = RoundPlan(folder, list(question.ranges))
    wrong: list[str] = []

    def quiet(text: str) -> None:
        """Ignore a progress message."""

    searches: dict[str, Any] = {}
    if len(question.ranges) <= MOST_MAPPED:
        searches[BORDER] = _border(folder, params, quiet)
    if plan.of(BREAK):
        searches[BREAK] = _breaking(folder, params, quiet)
    if plan.of(MATTER):
        searches[MATTER] = _matter(folder, params, quiet)
    for stream, search in searches.items():
        wrong += _disagreements(folder, question, plan, stream, search, params)
    return wrong


def other_methods(folder: Path) -> str | None:
    """Return a sentence if other versions picked rounds of the plan, else None."""
    rounds = [e for e in RoundPlan(folder, list(read_question(folder).ranges)).entries if e.method != METHOD]
    if not rounds:
        return None
    return f"{PLAN}: {len(rounds)} rounds were picked by another version of skillframe, and are not computed again"


def _disagreements(
    folder: Path,
    question: Question,
    plan: RoundPlan,
    stream: str,
    search: Generator[ToTry, Looked, Any],
    params: type | None,
) -> list[str]:
    entries = plan.of(stream)
    if not entries:
        return []
    batch, wrong = next(search, None), []
    if batch is None:
        return [f"{PLAN}: rounds of {stream} do not follow from the trials before them, from which none does"]
    for entry in entries:
        where = f"{PLAN}: round {entry.round} of {stream}"
        points = np.array([question.in_si(point) for point in batch.points])
        same = points.shape == entry.points.shape and np.array_equal(points, entry.points)
        if not same and entry.method == METHOD:
            wrong.append(f"{where} is not what follows from the trials before it")
        if entry.rows != rows_hash(folder, stream, entry.round):
            wrong.append(f"{where} was computed from other tables than those that are there")
        try:
            batch = search.send(ended(folder, question, entry, params))
        except StopIteration:
            break
    return wrong
