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
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.campaign.axes import Axis
from skillframe.campaign.claims.box import Box, peel
from skillframe.campaign.claims.claim import family, fresh_trials
from skillframe.campaign.claims.question import LOOK, Question, read_question
from skillframe.campaign.claims.surrogate import Surrogate
from skillframe.campaign.folder import COPIES, Describe, campaign_hash, load, prepare
from skillframe.campaign.provenance import file_hashes
from skillframe.campaign.rows import Row
from skillframe.campaign.runner import Options, Progress, run_campaign
from skillframe.campaign.store import ordered, read_content
from skillframe.campaign.trouble import Evaluate
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe.frames import Float

CLAIM, FRESH = "claim.json", "fresh"
CLOUD = 8192
SLACK = 4.0
"""A proposed box may hold predicted failures of a SLACK-th of what the rate allows (ours)."""


class Engine(NamedTuple):
    """How trials run.

    Attributes:
        evaluate: a chunk of them.
        describe: a scene, as `campaign.folder.prepare` asks.
        params: the world's parameter dataclass.
        options: workers and the like.
    """

    evaluate: Evaluate
    describe: Describe
    params: type
    options: Options


class Looked(NamedTuple):
    """Trials that were looked at: scaled points (n, d), and whether each succeeded (n,)."""

    points: Float
    works: NDArray[np.bool_]


Notify = Callable[[Progress], None]


def look(folder: Path, engine: Engine, notify: Notify | None = None) -> None:
    """Run what is missing of the trials to look at."""
    run_campaign(folder / LOOK, engine.evaluate, engine.options, notify, engine.params)


def looked(folder: Path, params: type | None = None) -> Looked:
    """The trials that were looked at."""
    rows = rows_of_campaign(folder / LOOK, params)
    return Looked(read_question(folder).scaled(rows), np.array([row["success"] for row in rows], dtype=bool))


def propose(question: Question, seen: Looked) -> Box | None:
    """The largest box that is worth claiming, or None."""
    if not seen.works.any():
        return None
    if seen.works.all():
        ones = np.ones(len(question.ranges))
        return Box(-ones, ones)
    from scipy.stats import qmc

    dimension = len(question.ranges)
    cloud = 2.0 * qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(0)).random(CLOUD) - 1.0
    predicted = Surrogate(seen.points, seen.works).mean(cloud) > 0.0
    return peel(cloud, predicted, (1.0 - question.rate) / SLACK)


def claims(folder: Path) -> list[Path]:
    """The folders of its claims, in their order."""
    return sorted((path.parent for path in folder.glob(f"claim*/{CLAIM}")), key=lambda path: int(path.name[5:]))


def write_claim(folder: Path, question: Question, box: Box, params: type) -> Path:
    """Write the next claim down, before its first trial. Returns its folder."""
    number = len(claims(folder)) + 1
    alpha = question.alpha / 2.0 ** (number - 1)
    boxes = [_in_si(question, each) for each in family(box)]
    spec = load(folder / LOOK, params)
    place = folder / f"claim{number}"
    content = {
        "format": "skillframe.claim", "version": 1, "number": number, "rate": question.rate, "alpha": alpha,
        "alpha_spent": question.alpha * (2.0 - 2.0 ** (1 - number)), "trials": fresh_trials(question.rate, alpha),
        "seed": spec.seed + number, "skill": spec.labels[0], "robot": spec.robot_name, "world": spec.world,
        "files": file_hashes(folder / LOOK, COPIES), "looked_at": campaign_hash(spec), "boxes": boxes,
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
    if not target.exists():
        claim = read_claim(place)
        spec = load(folder / LOOK, engine.params)
        largest = claim["boxes"][-1]
        axes = {name: Axis(kind="uniform", numbers=(float(a), float(b))) for name, (a, b) in largest.items()}
        fresh = replace(spec, vary={**spec.vary, **axes}, trials=int(claim["trials"]), seed=int(claim["seed"]))
        prepare(fresh, target, engine.describe, engine.params)
    run_campaign(target, engine.evaluate, engine.options, notify, engine.params)


def rows_of_campaign(folder: Path, params: type | None = None) -> list[Row]:
    """All rows of a complete campaign in the order of its trials.

    Raises:
        InputError: rows are missing, damaged or another campaign's.
    """
    spec = load(folder, params)
    rows = ordered(spec, read_content(folder, campaign_hash(spec), spec).done.values(), None)
    if len(rows) != spec.trials:
        raise InputError(folder, f"has {len(rows)} of {spec.trials} trials", "go on with skillframe campaign certify")
    return rows


def box_of(content: Mapping[str, Any], names: list[str]) -> Box:
    """A box in SI from a claim's."""
    ends = np.array([content[name] for name in names], dtype=float)
    return Box(ends[:, 0], ends[:, 1])


def _in_si(question: Question, box: Box) -> dict[str, list[float]]:
    low, high = question.in_si(box.low), question.in_si(box.high)
    return {name: [float(low[i]), float(high[i])] for i, name in enumerate(question.ranges)}
