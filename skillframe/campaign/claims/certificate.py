"""What may be signed: a statement whose every figure follows from files beside it, and the check that it still does.

`certificate.json` is an in-toto Statement (version 1): `subject` names the skill, the claim and the fresh trials'
table by their hashes, `predicate` says what was claimed, how it was tested, what came out and what that means. Keys are
sorted and nothing in it depends on when or where it was written. Sign it with any tool.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from skillframe import __version__
from skillframe.campaign.claims.claim import Tested, certified, family, judge
from skillframe.campaign.claims.engine import rows_of_campaign
from skillframe.campaign.claims.procedure import CLAIM, FRESH, box_of, claims, level, read_claim
from skillframe.campaign.claims.question import LOOK, QUESTION, Question, read_question
from skillframe.campaign.claims.rounds import BORDER, looked, rounds_done
from skillframe.campaign.claims.searches import BREAK, FOUND, found_in
from skillframe.campaign.folder import load
from skillframe.campaign.provenance import file_hash
from skillframe.campaign.rows import Row
from skillframe.campaign.store import RESULTS
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import read_json

CERTIFICATE = "certificate.json"
TOLD = (BORDER, BREAK)
"""Searches that a certificate tells of, where they have ended."""
TYPE, PREDICATE = "https://in-toto.io/Statement/v1", "skillframe.certificate/v1"
AFRESH = "test it in another folder"
MEANS = (
    "a mean over the box, taken evenly, not a promise at each of its points",
    "in simulation, with the robot, the contact model and the sensors that the campaign's files describe",
    "quantities that are not in the box stayed at the values of campaign.toml",
    "no statement about the safety of people",
)


class Outcome(NamedTuple):
    """What a folder's last claim came to.

    Attributes:
        tested: its boxes in SI, up to the first that failed.
        best: the largest that passed, or None.
        claim: as written.
        place: its folder.
    """

    tested: tuple[Tested, ...]
    best: Tested | None
    claim: dict[str, Any]
    place: Path


def outcome(folder: Path, params: type | None = None) -> Outcome:
    """Judge the last claim by its fresh trials.

    Raises:
        InputError: no claim, or trials that are missing, changed, or not the claim's.
    """
    question, places = read_question(folder), claims(folder)
    if not places:
        raise InputError(folder, "holds no claim", "go on with skillframe campaign certify")
    place = places[-1]
    claim, rows = read_claim(place), rows_of_campaign(place / FRESH, params)
    _check_fresh(place, claim, params)
    if (claim["rate"], claim["alpha"]) != (question.rate, level(question, claim["number"])):
        raise InputError(folder / QUESTION, f"asks for another rate or confidence than {place.name} claims",
                         "ask it in another folder")  # fmt: skip
    names = list(question.ranges)
    points = np.array([[float(row[name]) for name in names] for row in rows])
    works = np.array([row["success"] for row in rows], dtype=bool)
    boxes = [box_of(each, names) for each in claim["boxes"]]
    tested = judge(boxes, points, works, float(claim["rate"]), float(claim["alpha"]))
    return Outcome(tested, certified(tested), claim, place)


def _check_fresh(place: Path, claim: dict[str, Any], params: type | None) -> None:
    """Refuse trials that are not those the claim announced: only independent fresh draws in its box carry it."""
    spec = load(place / FRESH, params)
    drawn = {name: list(axis.numbers) for name, axis in spec.vary.items() if axis.kind == "uniform"}
    same = drawn == {name: list(ends) for name, ends in claim["boxes"][-1].items()}
    if not same or (spec.trials, spec.seed) != (claim["trials"], claim["seed"]):
        raise InputError(place / FRESH, "are not the trials that the claim announced", AFRESH)
    boxes = [box_of(each, list(drawn)) for each in claim["boxes"]]
    nested = zip(boxes, family(boxes[-1]), strict=True)
    if not all(np.allclose(one, other, rtol=1e-9, atol=1e-12) for one, other in nested):  # units were converted once
        raise InputError(place / CLAIM, "was changed: its boxes do not lie in each other as a claim's do", AFRESH)


def write_certificate(folder: Path, found: Outcome | None, params: type | None = None) -> dict[str, Any]:
    """Write certificate.json, with what the folder's searches have come to. Returns its content."""
    rounds = rounds_done(folder, params) if found is None else int(found.claim["border_rounds"])
    told = tuple(stream for stream in TOLD if found_in(folder, stream) is not None)
    content = statement(folder, found, params, rounds, told)
    text = json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(folder / CERTIFICATE, text.encode())
    return content


def statement(
    folder: Path, found: Outcome | None, params: type | None = None, rounds: int = 0, told: tuple[str, ...] = ()
) -> dict[str, Any]:
    """The content of certificate.json.

    Args:
        folder: of the question.
        found: what the last claim came to; None if no box was worth claiming.
        params: the world's parameter dataclass; None looks it up.
        rounds: of the border that the proposal looked at.
        told: searches whose outcome belongs to the certificate.
    """
    question, seen = read_question(folder), looked(folder, params, rounds)
    spec = load(folder / LOOK, params)
    subject = [*sorted((folder / LOOK / "skills").iterdir()), folder / QUESTION, folder / LOOK / RESULTS]
    predicate: dict[str, Any] = {
        "certified": found is not None and found.best is not None, "skill": spec.labels[0], "robot": spec.robot_name,
        "world": spec.world, "rate": question.rate, "declared": {k: list(v) for k, v in question.ranges.items()},
        "looked_at": {"trials": len(seen.works), "successes": int(seen.works.sum()), "border_rounds": rounds},
        "means": list(MEANS),
        "skillframe": __version__, "fixed": dict(sorted(spec.fixed.items())),
    }  # fmt: skip
    for stream in told:
        subject.append(folder / FOUND[stream])
        predicate[stream] = found_in(folder, stream)
    if found is not None:
        subject += [found.place / CLAIM, found.place / FRESH / RESULTS]
        predicate |= _tested(question, found, rows_of_campaign(found.place / FRESH, params))
    named = [{"name": p.relative_to(folder).as_posix(), "digest": {"sha256": file_hash(p)}} for p in subject]
    return {"_type": TYPE, "predicateType": PREDICATE, "predicate": predicate, "subject": named}


def _tested(question: Question, found: Outcome, rows: list[Row]) -> dict[str, Any]:
    names = list(question.ranges)

    def said(each: Tested) -> dict[str, Any]:
        box = {name: [float(each.box.low[i]), float(each.box.high[i])] for i, name in enumerate(names)}
        return {"box": box, "trials": each.trials, "failures": each.failures, "passed": each.passed}

    claim, best = found.claim, found.best
    widths = np.array([high - low for low, high in question.ranges.values()])
    return {
        "claim": claim["number"], "alpha": claim["alpha"], "alpha_spent": claim["alpha_spent"],
        "confidence": 1.0 - claim["alpha_spent"], "tested": [said(each) for each in found.tested],
        "box": None if best is None else said(best)["box"],
        "share_of_declared": None if best is None else float(np.prod((best.box.high - best.box.low) / widths)),
        "failed_trials": [row["trial"] for row in rows if not row["success"]],
        "method": "one-sided exact binomial tests of nested boxes in fixed sequence, independent trials drawn after "
        "the claim was written",
    }  # fmt: skip


def check_certificate(folder: Path, params: type | None = None) -> list[str]:
    """What no longer fits a certificate, in sentences, or nothing if all does.

    Raises:
        InputError: there is no certificate, or the files that it names are damaged beyond reading.
    """
    path = folder / CERTIFICATE
    if not path.is_file():
        raise InputError(folder, "holds no certificate", "make one with skillframe campaign certify")
    fix = "make it again with skillframe campaign certify"
    content = read_json(path, fix)
    if not isinstance(content, dict) or content.get("predicateType") != PREDICATE:
        raise InputError(path, "is no certificate", fix)
    wrong = []
    for each in content["subject"]:
        file = folder / each["name"]
        if not file.is_file():
            wrong.append(f"{each['name']} is gone")
        elif file_hash(file) != each["digest"]["sha256"]:
            wrong.append(f"{each['name']} was changed")
    if wrong:
        return wrong
    again = outcome(folder, params) if content["predicate"].get("tested") else None
    named = tuple(stream for stream in TOLD if stream in content["predicate"])
    rounds = int(content["predicate"]["looked_at"]["border_rounds"])
    now = json.loads(json.dumps(statement(folder, again, params, rounds, named)["predicate"]))
    told = {key: value for key, value in content["predicate"].items() if key != "skillframe"}
    same = told == {key: value for key, value in now.items() if key != "skillframe"}
    return [] if same else ["the figures do not follow from the trials"]
