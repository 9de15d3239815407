"""Rounds of a search as campaigns: `border/3` holds the third round of the stream "border".

A round is a campaign of one skill whose ranges are `values` axes, so campaigns provide storage, resuming, replay and
worker recovery. Its seed is a hash of the campaign's seed, stream and number, so rounds share no noise. Its scene is
that of the exploratory trials, which was checked at the ends of all ranges.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Generator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from skillframe.campaign import (
    RESULTS,
    SCENE,
    SUMMARY,
    Axis,
    CampaignSpec,
    Progress,
    file_hash,
    load,
    prepare,
    run_campaign,
    sweep,
    sweep_prepared,
)
from skillframe.errors import InputError
from skillframe.files.documents import read_json
from skillframe.frames import Float
from skillframe_certify.border import ToTry
from skillframe_certify.engine import Engine, Looked, ends_of, rows_of_campaign
from skillframe_certify.plan import FIX, METHOD, PLAN, Round, RoundPlan
from skillframe_certify.question import LOOK, Question, read_question

BORDER = "border"
PAIRED = ("matter",)
"""Streams whose rounds share their noise, so that trials of one number are pairs."""
OTHERWISE = "was begun by another version of skillframe, which picked its trials otherwise"
Found = TypeVar("Found")


def seed_of(seed: int, stream: str, number: int) -> int:
    """Return the seed of a round: 48 bits, distinct for each round."""
    return int.from_bytes(hashlib.sha256(f"{seed} {stream} {number}".encode()).digest()[:6], "little")


def looked(folder: Path, params: type | None = None, rounds: int | None = None) -> Looked:
    """Return the exploratory trials, then those of the border's rounds.

    Args:
        folder: of the question.
        params: the world's parameter dataclass; None looks it up.
        rounds: border rounds to include; None for all complete ones.
    """
    question = read_question(folder)
    rows = rows_of_campaign(folder / LOOK, params)
    seen = Looked(question.scaled(rows), *ends_of(rows))
    count = rounds_done(folder, params) if rounds is None else rounds
    for entry in RoundPlan(folder, list(question.ranges)).of(BORDER)[:count]:
        seen = seen.with_more(ended(folder, question, entry, params))
    return seen


def rounds_done(folder: Path, params: type | None) -> int:
    """Return the number of complete border rounds."""
    entries = RoundPlan(folder, list(read_question(folder).ranges)).of(BORDER)
    return sum(is_complete(folder / BORDER / str(entry.round), params) for entry in entries)


def ended(folder: Path, question: Question, entry: Round, params: type | None) -> Looked:
    """Return the outcomes of a round's trials.

    Raises:
        InputError: trials are missing or differ from the plan.
    """
    rows = rows_of_campaign(folder / entry.stream / str(entry.round), params)
    drawn = np.array([[float(row[name]) for name in question.ranges] for row in rows])
    if drawn.shape != entry.points.shape or not np.array_equal(drawn, entry.points):
        place = folder / entry.stream / str(entry.round)
        raise InputError(place, f"are not the trials that {PLAN} announced", FIX)
    return Looked(question.scaled(rows), *ends_of(rows))


def carry_out(
    folder: Path, stream: str, search: Generator[ToTry, Looked, Found], engine: Engine,
    unusual: Callable[[str], None] = lambda text: None,
) -> Found:  # fmt: skip
    """Run a search to its end: write each batch to the plan, run it, and send the outcomes.

    Planned rounds are read from the plan. The border search accepts any points there; the others accept only their own.

    Raises:
        InputError: another version of skillframe began the search and picks differently.
    """
    question = read_question(folder)
    for place in (folder, folder / stream):
        sweep_prepared(place)
    plan = RoundPlan(folder, list(question.ranges))
    try:
        batch = next(search)
        number = 0
        while True:
            number += 1
            known = plan.of(stream)
            points = np.array([question.in_si(point) for point in batch.points])
            if number <= len(known):
                entry = known[number - 1]
                if stream != BORDER and entry.method != METHOD and not np.array_equal(points, entry.points):
                    raise InputError(folder / stream, OTHERWISE, "go on with that version, or start again elsewhere")
            else:
                entry = plan.append(stream, points, batch.explored, rows_hash(folder, stream, number))
            run_round(folder, entry, engine, unusual)
            batch = search.send(ended(folder, question, entry, engine.params))
    except StopIteration as end:
        found: Found = end.value
        return found


def rows_hash(folder: Path, stream: str, number: int) -> str:
    """Return the hash of the tables that a stream's n-th round is computed from."""
    before = [folder / stream / str(i) / RESULTS for i in range(1, number)]
    hashes = [file_hash(path) for path in (folder / LOOK / RESULTS, *before)]
    return hashlib.sha256("".join(hashes).encode()).hexdigest()


def run_round(folder: Path, entry: Round, engine: Engine, unusual: Callable[[str], None]) -> None:
    """Run the missing trials of a round."""
    place = folder / entry.stream / str(entry.round)
    if not place.exists():
        base = load(folder / LOOK, engine.params)
        columns = dict(zip(read_question(folder).ranges, entry.points.T, strict=True))
        axes = {name: Axis(kind="values", numbers=tuple(map(float, column))) for name, column in columns.items()}
        seed = seed_of(base.seed, entry.stream, 1 if entry.stream in PAIRED else entry.round)
        spec = replace(base, vary={**base.vary, **axes}, trials=len(entry.points), seed=seed)
        prepare(spec, place, partial(scene_of, folder), engine.params)
    if is_complete(place, engine.params):
        sweep(place)  # a process killed while it wrote the summary leaves half of it
        return

    def tell(progress: Progress) -> None:
        if progress.note and not progress.usual:
            unusual(progress.note)

    run_campaign(place, engine.evaluate, replace(engine.options, traces=0), tell, engine.params)


def scene_of(folder: Path, spec: CampaignSpec) -> dict[str, Any]:
    """Return scene.json of the exploratory trials, valid for every campaign of the folder."""
    found: dict[str, Any] = read_json(folder / LOOK / SCENE, FIX)
    return found


def is_complete(place: Path, params: type | None) -> bool:
    """Return whether a campaign has all its rows, its table, and its summary, which is written last."""
    if not (place / RESULTS).is_file() or not (place / SUMMARY).is_file():
        return False
    try:
        rows_of_campaign(place, params)
    except InputError:
        return False
    return True


def next_sobol(folder: Path, question: Question, params: type | None) -> Callable[[int, int], Float]:
    """Return a function for points first .. last - 1, scaled, of the exploratory Sobol sequence."""
    from skillframe.campaign import draws

    base = load(folder / LOOK, params)

    def points(first: int, last: int) -> Float:
        drawn = draws(base, range(first, last))
        rows = [{name: drawn[name][i] for name in question.ranges} for i in range(last - first)]
        return question.scaled(rows)

    return points
