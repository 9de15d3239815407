"""From a question to a certificate, in a folder that can be resumed at any moment.

    question.json    the question; written once
    look/            a campaign: exploratory trials, which support no claim
    claim1/claim.json   boxes, rate, level, number of trials, their seed and their campaign, written before the trials
    claim1/fresh/    a campaign: independent trials in the largest box, which alone support the claim
    certificate.json the result

Each step writes its result once before the next begins, so an interrupted folder ends like an uninterrupted one.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.campaign import (
    COPIES,
    Axis,
    campaign_hash,
    environment,
    file_hashes,
    installed,
    load,
    prepare,
    run_campaign,
    software,
    sweep_prepared,
)
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe_certify.binding import (
    CALLER,
    SYSTEM,
    check_campaign,
    check_software,
    draw_entropy,
    expected,
    others,
    seed_of,
)
from skillframe_certify.border import cloud
from skillframe_certify.box import Box, peel
from skillframe_certify.claim import family, fresh_trials
from skillframe_certify.engine import Engine, Looked, Notify
from skillframe_certify.question import LOOK, Question
from skillframe_certify.rounds import is_complete, rounds_done, scene_of
from skillframe_certify.shape import ANEW, CERTIFICATE, CLAIM_FORMAT, CLAIM_VERSION, check_claim
from skillframe_certify.surrogate import Surrogate

CLAIM, FRESH = "claim.json", "fresh"
MOST_CLAIMS = 4
"""Most claims of a folder; together their false-claim probability is at most 1.875 times the level."""
SLACK = 4.0
"""A proposed box may hold predicted failures of a SLACK-th of what the rate allows."""


def look(folder: Path, engine: Engine, notify: Notify | None = None) -> None:
    """Run the missing exploratory trials."""
    sweep_prepared(folder / LOOK)
    if not is_complete(folder / LOOK, engine.params):
        run_campaign(folder / LOOK, engine.evaluate, engine.options, notify, engine.params)


def propose(question: Question, seen: Looked) -> Box | None:
    """Return the largest box worth claiming, or None. Raises as `Looked.require_trials`."""
    if not seen.require_trials().works.any():
        return None
    if seen.works.all():
        ones = np.ones(len(question.ranges))
        return Box(-ones, ones)
    even = cloud(len(question.ranges))
    predicted = Surrogate(seen.points, seen.works).success(even) > 0.8  # lower values certify fewer boxes
    return peel(even, predicted, (1.0 - question.rate) / SLACK)


def cleared(folder: Path, question: Question, box: Box, engine: Engine) -> Box:
    """Return the box, or the largest part found in which no start is in collision.

    Checks its corners and 512 even points (about 3 ms each), and cuts the box until all of them are clear.

    Raises:
        InputError: nothing is left; names a quantity and a value at which a start is in collision.
    """
    if engine.starts is None:
        return box
    base, names = load(folder / LOOK, engine.params), list(question.ranges)
    points = np.concatenate([cloud(len(names), 512), np.array([*product((-1.0, 1.0), repeat=len(names))])])
    told: list[str] = []
    for _ in range(40):
        at = np.array([question.in_si(box.at(point)) for point in points])
        axes = {name: Axis(kind="values", numbers=tuple(map(float, at[:, i]))) for i, name in enumerate(names)}
        told = engine.starts(replace(base, vary={**base.vary, **axes}, trials=len(points)))
        outside = np.array([not text for text in told])
        if outside.all():
            return box
        worst = int(np.argmin(outside))
        part = peel(points, outside, 0.0)
        if part is None:
            break
        box = Box(box.at(part.low), box.at(part.high))
    i = int(np.argmax(np.abs(points[worst])))  # the quantity furthest from the middle of its range
    name, value = names[i], float(at[worst][i])
    raise InputError(
        f"vary.{name}", f"holds {value:.4g}, where {told[worst]}, and no box without such starts was found",
        "narrow the range, or begin further away with [set] start.offset_z",
    )  # fmt: skip


def claims(folder: Path) -> list[Path]:
    """Return the folders of the claims in order."""
    found = (path.parent for path in folder.glob(f"claim*/{CLAIM}"))
    return sorted((p for p in found if re.fullmatch("claim[1-9][0-9]?", p.name)), key=lambda path: int(path.name[5:]))


def level(question: Question, number: int) -> float:
    """Return the level of a folder's claim, numbered from 1: half that of the one before."""
    return question.alpha / 2.0 ** (number - 1)


def write_claim(folder: Path, question: Question, box: Box, params: type, entropy: str | None = None) -> Path:
    """Write the next claim before its first trial, and return its folder.

    Args:
        folder: of the question.
        question: what is asked.
        box: proposed, scaled.
        params: the world's parameter dataclass.
        entropy: text for a reproducible fresh seed, for tests and documentation. The certificate states that it was
            chosen, since its author could know the trials. None samples system entropy.
    """
    number = len(claims(folder)) + 1
    if number > MOST_CLAIMS:
        raise InputError(
            folder, f"has spent its level on {MOST_CLAIMS} claims, and their certificate says what came of the last",
            "improve the skill; a new folder for the same skill would hide that these claims failed",
        )  # fmt: skip
    alpha = level(question, number)
    boxes = list[dict[str, list[float]]]()
    for each in family(box):
        low, high = question.in_si(each.low), question.in_si(each.high)
        boxes.append({name: [float(low[i]), float(high[i])] for i, name in enumerate(question.ranges)})
    spec = load(folder / LOOK, params)
    place = folder / f"claim{number}"
    if (place / FRESH).exists():
        raise InputError(place, "holds trials that are older than their claim", f"move {place / FRESH} away")
    content: dict[str, Any] = {
        "format": CLAIM_FORMAT, "version": CLAIM_VERSION, "number": number, "rate": question.rate, "alpha": alpha,
        "alpha_spent": question.alpha * (2.0 - 2.0 ** (1 - number)), "trials": fresh_trials(question.rate, alpha),
        "entropy": draw_entropy() if entropy is None else entropy,
        "entropy_from": SYSTEM if entropy is None else CALLER, "skill": spec.labels[0],
        "robot": spec.robot_name, "world": spec.world,
        "files": file_hashes(folder / LOOK, COPIES), "looked_at": campaign_hash(spec), "boxes": boxes,
        "border_rounds": rounds_done(folder, params),
        "distribution": "even over the box, independent; other axes as declared",
        "other_axes": {name: axis.plain() for name, axis in spec.vary.items() if name not in question.ranges},
        "software": software(environment()),
    }  # fmt: skip
    content = json.loads(json.dumps(content))
    content["seed"] = seed_of(content)
    content["campaign"] = campaign_hash(expected(folder, content, params))
    place.mkdir(exist_ok=True)
    (folder / CERTIFICATE).unlink(missing_ok=True)  # of a failed claim; the next certificate covers both
    write_whole(place / CLAIM, (json.dumps(content, indent=2, sort_keys=True) + "\n").encode())
    return place


def read_claim(place: Path) -> dict[str, Any]:
    """Return a claim as written, with boxes as quantity to [low, high] in SI, smallest first.

    Raises:
        InputError: it is damaged, of an earlier version, or was changed after it was written.
    """
    content = check_claim(read_json(place / CLAIM, ANEW), place / CLAIM)
    if content["seed"] != seed_of(content) or f"claim{content['number']}" != place.name:
        raise InputError(
            place / CLAIM, "was changed after it was written: its seed does not follow from the rest", ANEW
        )
    return content


def run_fresh(folder: Path, place: Path, engine: Engine, notify: Notify | None = None) -> None:
    """Run the missing fresh trials of a claim.

    Raises:
        InputError: campaign, files or code differ from those that the claim announced.
    """
    target, claim = place / FRESH, read_claim(place)
    for written in (folder, place):
        sweep_prepared(written)
    if not target.exists():
        prepare(expected(folder, claim, engine.params), target, partial(scene_of, folder), engine.params)
    check_campaign(folder, target, claim, engine.params)
    if is_complete(target, engine.params):
        return
    check_software(place, claim, installed())
    run_campaign(target, engine.evaluate, engine.options, notify, engine.params)
    check_software(place, claim, installed())  # nothing may change while workers run


def other_software(place: Path) -> list[str]:
    """Return the differences between a claim's code and the installed code."""
    return list(others(read_claim(place)["software"], installed()))


def box_of(content: Mapping[str, Any], names: list[str]) -> Box:
    """Return a claim's box as a box in SI."""
    ends = np.array([content[name] for name in names], dtype=float)
    return Box(ends[:, 0], ends[:, 1])
