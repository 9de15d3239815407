"""Rounds of a search as campaigns of their own: `border/3` holds the third round of the stream "border".

A round is a campaign of one skill whose ranges are `values` axes, so that storing, resuming, replaying and workers that
die are the campaign's own. Its seed follows from the campaign's seed, stream and number: no two rounds share a trial's
noise. Its scene is that of the trials that were looked at, which was checked at the ends of all ranges.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Generator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from skillframe.campaign.axes import Axis
from skillframe.campaign.claims.border import ToTry
from skillframe.campaign.claims.engine import Engine, Looked, rows_of_campaign, succeeded
from skillframe.campaign.claims.plan import FIX, METHOD, PLAN, Round, RoundPlan
from skillframe.campaign.claims.question import LOOK, Question, read_question
from skillframe.campaign.folder import SCENE, load, prepare, sweep, sweep_prepared
from skillframe.campaign.provenance import file_hash
from skillframe.campaign.runner import Progress, run_campaign
from skillframe.campaign.spec import CampaignSpec
from skillframe.campaign.store import RESULTS
from skillframe.campaign.summary import SUMMARY
from skillframe.errors import InputError
from skillframe.files.documents import read_json
from skillframe.frames import Float

BORDER = "border"
PAIRED = ("matter",)
"""Streams whose rounds share their noise, so that trials of one number are pairs."""
OTHERWISE = "was begun by another version of skillframe, which picked its trials otherwise"
Found = TypeVar("Found")


def seed_of(seed: int, stream: str, number: int) -> int:
    """The seed of a round: 48 bits that differ from those of every other round."""
    return int.from_bytes(hashlib.sha256(f"{seed} {stream} {number}".encode()).digest()[:6], "little")


def looked(folder: Path, params: type | None = None, rounds: int | None = None) -> Looked:
    """The trials that were looked at: even ones, then those of the border's rounds.

    Args:
        folder: of the question.
        params: the world's parameter dataclass; None looks it up.
        rounds: how many rounds of the border count; None for all that are complete.
    """
    question = read_question(folder)
    rows = rows_of_campaign(folder / LOOK, params)
    seen = Looked(question.scaled(rows), succeeded(rows))
    count = rounds_done(folder, params) if rounds is None else rounds
    for entry in RoundPlan(folder, list(question.ranges)).of(BORDER)[:count]:
        seen = seen.with_more(ended(folder, question, entry, params))
    return seen


def rounds_done(folder: Path, params: type | None) -> int:
    """How many rounds of the border are complete."""
    entries = RoundPlan(folder, list(read_question(folder).ranges)).of(BORDER)
    return sum(is_complete(folder / BORDER / str(entry.round), params) for entry in entries)


def ended(folder: Path, question: Question, entry: Round, params: type | None) -> Looked:
    """How a round's trials ended.

    Raises:
        InputError: they have not, or are not those of the plan.
    """
    rows = rows_of_campaign(folder / entry.stream / str(entry.round), params)
    drawn = np.array([[float(row[name]) for name in question.ranges] for row in rows])
    if drawn.shape != entry.points.shape or not np.array_equal(drawn, entry.points):
        place = folder / entry.stream / str(entry.round)
        raise InputError(place, f"are not the trials that {PLAN} announced", FIX)
    return Looked(question.scaled(rows), succeeded(rows))


def carry_out(
    folder: Path, stream: str, search: Generator[ToTry, Looked, Found], engine: Engine,
    unusual: Callable[[str], None] = lambda text: None,
) -> Found:  # fmt: skip
    """Run a search to its end: what it plans is written down, then run, then told to it.

    Rounds that the plan holds are taken from there. The border follows any points; the other searches follow their own.

    Args:
        folder: of the question.
        stream: what the rows are.
        search: yields batches in scaled quantities.
        engine: how trials run.
        unusual: told what workers have to say.

    Raises:
        InputError: another version of skillframe began it, and picked otherwise.
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
    """Hash of the tables that a stream's n-th round was computed from."""
    before = [folder / stream / str(i) / RESULTS for i in range(1, number)]
    hashes = [file_hash(path) for path in (folder / LOOK / RESULTS, *before)]
    return hashlib.sha256("".join(hashes).encode()).hexdigest()


def run_round(folder: Path, entry: Round, engine: Engine, unusual: Callable[[str], None]) -> None:
    """Run what is missing of a round."""
    place = folder / entry.stream / str(entry.round)
    if not place.exists():
        base = load(folder / LOOK, engine.params)
        prepare(_spec(base, entry, read_question(folder)), place, partial(scene_of, folder), engine.params)
    if is_complete(place, engine.params):
        sweep(place)  # a process that was killed while it wrote the summary left half of one
        return

    def tell(progress: Progress) -> None:
        if progress.note and not progress.usual:
            unusual(progress.note)

    run_campaign(place, engine.evaluate, replace(engine.options, traces=0), tell, engine.params)


def scene_of(folder: Path, spec: CampaignSpec) -> dict[str, Any]:
    """scene.json of the trials that were looked at, which holds for every campaign of the folder."""
    found: dict[str, Any] = read_json(folder / LOOK / SCENE, FIX)
    return found


def is_complete(place: Path, params: type | None) -> bool:
    """Whether all rows of a campaign are there, its table, and its summary, which is written last."""
    if not (place / RESULTS).is_file() or not (place / SUMMARY).is_file():
        return False
    try:
        rows_of_campaign(place, params)
    except InputError:
        return False
    return True


def _spec(base: CampaignSpec, entry: Round, question: Question) -> CampaignSpec:
    columns = dict(zip(question.ranges, entry.points.T, strict=True))
    axes = {name: Axis(kind="values", numbers=tuple(map(float, column))) for name, column in columns.items()}
    seed = seed_of(base.seed, entry.stream, 1 if entry.stream in PAIRED else entry.round)
    return replace(base, vary={**base.vary, **axes}, trials=len(entry.points), seed=seed)


def next_sobol(folder: Path, question: Question, params: type | None) -> Callable[[int, int], Float]:
    """Points first .. last - 1, scaled, of the sequence whose beginning was looked at."""
    from skillframe.campaign.sampling import draws

    base = load(folder / LOOK, params)

    def points(first: int, last: int) -> Float:
        drawn = draws(base, range(first, last))
        rows = [{name: drawn[name][i] for name in question.ranges} for i in range(last - first)]
        return question.scaled(rows)

    return points
