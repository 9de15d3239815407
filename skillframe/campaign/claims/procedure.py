"""From a question to a certificate, in a folder that can be resumed at any moment.

    question.json    what is asked; written once
    look/            a campaign: trials to look at, which carry no claim
    claim1/claim.json   boxes, rate, level and number of trials, written before the trials
    claim1/fresh/    a campaign: independent trials in the largest box, which alone carry the claim
    certificate.json what may be signed, or why nothing may

Each step writes its outcome before the next one begins and is never computed again, so that an interrupted folder ends
as an undisturbed one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.campaign.axes import Axis
from skillframe.campaign.claims.border import cloud
from skillframe.campaign.claims.box import Box, peel
from skillframe.campaign.claims.claim import family, fresh_trials
from skillframe.campaign.claims.engine import Engine, Looked, Notify
from skillframe.campaign.claims.question import LOOK, Question
from skillframe.campaign.claims.rounds import is_complete, rounds_done, scene_of
from skillframe.campaign.claims.surrogate import Surrogate
from skillframe.campaign.folder import COPIES, campaign_hash, load, prepare, sweep_prepared
from skillframe.campaign.provenance import file_hashes
from skillframe.campaign.runner import run_campaign
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import read_json

CLAIM, FRESH = "claim.json", "fresh"
MOST_CLAIMS = 4
"""Of a folder (ours): together they are falsely certified with at most 1.875 times the level."""
SLACK = 4.0
"""A proposed box may hold predicted failures of a SLACK-th of what the rate allows (ours)."""
LIKELY = 0.8
"""A place counts as working from this predicted success probability on (ours): 0.5 had fewer boxes certified."""


def look(folder: Path, engine: Engine, notify: Notify | None = None) -> None:
    """Run what is missing of the trials to look at."""
    sweep_prepared(folder / LOOK)
    if not is_complete(folder / LOOK, engine.params):
        run_campaign(folder / LOOK, engine.evaluate, engine.options, notify, engine.params)


def propose(question: Question, seen: Looked) -> Box | None:
    """The largest box that is worth claiming, or None."""
    if not seen.works.any():
        return None
    if seen.works.all():
        ones = np.ones(len(question.ranges))
        return Box(-ones, ones)
    even = cloud(len(question.ranges))
    predicted = Surrogate(seen.points, seen.works).success(even) > LIKELY
    return peel(even, predicted, (1.0 - question.rate) / SLACK)


def claims(folder: Path) -> list[Path]:
    """The folders of its claims, in their order."""
    return sorted((path.parent for path in folder.glob(f"claim*/{CLAIM}")), key=lambda path: int(path.name[5:]))


def level(question: Question, number: int) -> float:
    """Chance of a false claim that a folder's claim, from 1, may spend: half of that before it."""
    return question.alpha / 2.0 ** (number - 1)


def write_claim(folder: Path, question: Question, box: Box, params: type) -> Path:
    """Write the next claim down, before its first trial. Returns its folder."""
    number = len(claims(folder)) + 1
    if number > MOST_CLAIMS:
        raise InputError(
            folder, f"has spent its level on {MOST_CLAIMS} claims", "ask again in a new folder, with another seed"
        )
    alpha = level(question, number)
    boxes = [_in_si(question, each) for each in family(box)]
    spec = load(folder / LOOK, params)
    place = folder / f"claim{number}"
    if (place / FRESH).exists():
        raise InputError(place, "holds trials that are older than their claim", "test it in another folder")
    content = {
        "format": "skillframe.claim", "version": 1, "number": number, "rate": question.rate, "alpha": alpha,
        "alpha_spent": question.alpha * (2.0 - 2.0 ** (1 - number)), "trials": fresh_trials(question.rate, alpha),
        "seed": spec.seed + number, "skill": spec.labels[0], "robot": spec.robot_name, "world": spec.world,
        "files": file_hashes(folder / LOOK, COPIES), "looked_at": campaign_hash(spec), "boxes": boxes,
        "border_rounds": rounds_done(folder, params),
        "distribution": "even over the box, independent; other axes as declared",
        "other_axes": {name: axis.plain() for name, axis in spec.vary.items() if name not in question.ranges},
    }  # fmt: skip
    place.mkdir(exist_ok=True)
    write_whole(place / CLAIM, (json.dumps(content, indent=2, sort_keys=True) + "\n").encode())
    return place


def read_claim(place: Path) -> dict[str, Any]:
    """A claim as written. Its boxes are dicts of quantity to [low, high] in SI, the smallest first."""
    content: dict[str, Any] = read_json(place / CLAIM, "a claim cannot be repaired: start again in another folder")
    return content


def run_fresh(folder: Path, place: Path, engine: Engine, notify: Notify | None = None) -> None:
    """Run what is missing of a claim's fresh trials."""
    target = place / FRESH
    for written in (folder, place):
        sweep_prepared(written)
    if not target.exists():
        claim = read_claim(place)
        spec = load(folder / LOOK, engine.params)
        largest = claim["boxes"][-1]
        axes = {name: Axis(kind="uniform", numbers=(float(a), float(b))) for name, (a, b) in largest.items()}
        fresh = replace(spec, vary={**spec.vary, **axes}, trials=int(claim["trials"]), seed=int(claim["seed"]))
        prepare(fresh, target, partial(scene_of, folder), engine.params)
    run_campaign(target, engine.evaluate, engine.options, notify, engine.params)


def box_of(content: Mapping[str, Any], names: list[str]) -> Box:
    """A box in SI from a claim's."""
    ends = np.array([content[name] for name in names], dtype=float)
    return Box(ends[:, 0], ends[:, 1])


def _in_si(question: Question, box: Box) -> dict[str, list[float]]:
    low, high = question.in_si(box.low), question.in_si(box.high)
    return {name: [float(low[i]), float(high[i])] for i, name in enumerate(question.ranges)}
