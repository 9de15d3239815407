"""The certificate: a statement whose figures all follow from files beside it, and its check.

`certificate.json` is an in-toto Statement (version 1). `subject` names the claim, the fresh campaign and its results by
hashes. `predicate` holds the claim, the test, the code and the outcome. Keys are sorted, and nothing depends on time or
machine. Any tool can sign it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from skillframe.campaign import (
    CAMPAIGN,
    CODE,
    COPIES,
    RESULTS,
    RanAgain,
    Row,
    campaign_hash,
    file_hash,
    file_hashes,
    is_trial,
    load,
    read_content,
    results_text,
)
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe_certify.binding import CALLER, check_campaign, check_rows
from skillframe_certify.claim import Tested, certified, family, judge
from skillframe_certify.engine import rows_of_campaign
from skillframe_certify.procedure import CLAIM, FRESH, box_of, claims, level, read_claim
from skillframe_certify.question import LOOK, QUESTION, Question, read_question
from skillframe_certify.rounds import BORDER, looked, rounds_done
from skillframe_certify.searches import BREAK, FOUND, found_in
from skillframe_certify.shape import ANEW, PREDICATE, TYPE, read_shape
from skillframe_certify.shape import CERTIFICATE as CERTIFICATE

TOLD = (BORDER, BREAK)
"""Searches that a certificate reports once they have ended."""
MEANS = (
    "a mean over the box, taken evenly, not a promise at each of its points",
    "in simulation, with the robot, the contact model and the sensors that the campaign's files describe",
    "quantities that are not in the box stayed at the values of campaign.toml",
    "no statement about the safety of people",
    "other folders are not known: certifying in several, seeing such trials beforehand, or removing claims that "
    "failed, and showing the best, certifies falsely more often",
    "plug-ins are trusted code: it guards against mistakes, not against a plug-in that is made to deceive",
)
CHOSEN = "the entropy of the fresh seed was chosen by the author of the claim, who could have known the trials before"


class Outcome(NamedTuple):
    """Outcome of a folder's last claim.

    Attributes:
        tested: its boxes in SI, up to the first that failed.
        best: the largest box that passed, or None.
        claim: as written.
        place: its folder.
        again: its trials that ran more than once, or None.
    """

    tested: tuple[Tested, ...]
    best: Tested | None
    claim: dict[str, Any]
    place: Path
    again: RanAgain | None = None


def outcome(folder: Path, params: type | None = None) -> Outcome:
    """Return the outcome of the last claim by its fresh trials.

    Raises:
        InputError: there is no claim, or trials are missing, changed, or of another claim.
    """
    question, places = read_question(folder), claims(folder)
    if not places:
        raise InputError(folder, "holds no claim", "go on with skillframe certify run")
    place = places[-1]
    claim = read_claim(place)
    if (claim["rate"], claim["alpha"]) != (question.rate, level(question, claim["number"])):
        raise InputError(folder / QUESTION, f"has another rate or confidence than {place.name}",
                         "put it back as it was")  # fmt: skip
    names = list(question.ranges)
    if any(set(box) != set(names) for box in claim["boxes"]):
        raise InputError(place / CLAIM, f"claims boxes of other quantities than {QUESTION}", ANEW)
    boxes = [box_of(each, names) for each in claim["boxes"]]
    meant = family(boxes[-1])  # equal up to the rounding of units
    if len(boxes) != len(meant) or not all(
        np.allclose(one, other, rtol=1e-9, atol=1e-12) for one, other in zip(boxes, meant, strict=True)
    ):
        raise InputError(place / CLAIM, "claims boxes that do not lie in each other as a claim's do", ANEW)
    check_campaign(folder, place / FRESH, claim, params)
    rows, again = rows_of_campaign(place / FRESH, params), check_rows(place / FRESH, claim, params)
    points = np.array([[float(row[name]) for name in names] for row in rows])
    works = np.array([row["success"] for row in rows], dtype=bool)
    refused = np.array([not is_trial(row) for row in rows], dtype=bool)
    tested = judge(boxes, points, works, float(claim["rate"]), float(claim["alpha"]), refused)
    return Outcome(tested, certified(tested), claim, place, again)


def write_certificate(folder: Path, found: Outcome | None, params: type | None = None) -> dict[str, Any]:
    """Write certificate.json, including the results of searches, and return its content."""
    rounds = rounds_done(folder, params) if found is None else int(found.claim["border_rounds"])
    told = tuple(stream for stream in TOLD if found_in(folder, stream) is not None)
    content = statement(folder, found, params, rounds, told)
    text = json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"
    write_whole(folder / CERTIFICATE, text.encode())
    return content


def statement(
    folder: Path, found: Outcome | None, params: type | None = None, rounds: int = 0, told: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the content of certificate.json.

    Args:
        folder: of the question.
        found: outcome of the last claim; None if no box was worth claiming.
        params: the world's parameter dataclass; None looks it up.
        rounds: border rounds that the proposal used.
        told: searches whose results belong to the certificate.
    """
    question, seen = read_question(folder), looked(folder, params, rounds)
    spec = load(folder / LOOK, params)
    subject = [*_files(folder / LOOK), folder / QUESTION]
    if found is None:
        noted = read_content(folder / LOOK, campaign_hash(spec), spec).environments
        version = noted[-1].get("skillframe", "") if noted else ""
    else:
        version = str(found.claim["software"].get("skillframe", ""))
    predicate: dict[str, Any] = {
        "certified": found is not None and found.best is not None, "skill": spec.labels[0], "robot": spec.robot_name,
        "world": spec.world, "rate": question.rate, "declared": {k: list(v) for k, v in question.ranges.items()},
        "looked_at": {**seen.counts, "border_rounds": rounds},
        "means": list(MEANS), "skillframe": version,
        "fixed": dict(sorted(spec.fixed.items())), "duration_s": spec.duration_s,
    }  # fmt: skip
    for stream in told:
        subject.append(folder / FOUND[stream])
        predicate[stream] = found_in(folder, stream)
    if found is not None:
        subject += [found.place / CLAIM, *_files(found.place / FRESH)]
        predicate |= _tested(question, found, rows_of_campaign(found.place / FRESH, params))
    named = [{"name": p.relative_to(folder).as_posix(), "digest": {"sha256": file_hash(p)}} for p in subject]
    return {"_type": TYPE, "predicateType": PREDICATE, "predicate": predicate, "subject": named}


def _files(place: Path) -> list[Path]:
    if not (place / RESULTS).is_file():
        raise InputError(place, f"has no {RESULTS}", f"type skillframe campaign resume {place}")
    return [place / CAMPAIGN, *(place / name for name in file_hashes(place, COPIES)), place / RESULTS]


def _tested(question: Question, found: Outcome, rows: list[Row]) -> dict[str, Any]:
    names = list(question.ranges)

    def said(each: Tested) -> dict[str, Any]:
        box = {name: [float(each.box.low[i]), float(each.box.high[i])] for i, name in enumerate(names)}
        return {"box": box, "trials": each.trials, "failures": each.failures, "refused": each.refused,
                "passed": each.passed}  # fmt: skip

    claim, best = found.claim, found.best
    widths = np.array([high - low for low, high in question.ranges.values()])
    software = claim["software"]
    own = [name.removesuffix(CODE) for name in software if name.endswith(CODE)]
    return {
        "claim": claim["number"], "alpha": claim["alpha"], "alpha_spent": claim["alpha_spent"],
        "confidence": 1.0 - claim["alpha_spent"], "tested": [said(each) for each in found.tested],
        "box": None if best is None else said(best)["box"],
        "share_of_declared": None if best is None else float(np.prod((best.box.high - best.box.low) / widths)),
        "failed_trials": [row["trial"] for row in rows if is_trial(row) and not row["success"]],
        "other_axes": claim["other_axes"], "campaign": claim["campaign"],
        "plugins": [{"name": n, "version": software.get(n, ""), "sha256": software[n + CODE]} for n in sorted(own)],
        "software": claim["software"], "seed_drawn_by": claim["entropy_from"],
        **({"means": [*MEANS, CHOSEN]} if claim["entropy_from"] == CALLER else {}),
        **({} if found.again is None else {"ran_again": found.again._asdict()}),
        "method": "one-sided exact binomial tests of nested boxes in fixed sequence, independent trials sampled after "
        "the claim was written",
    }  # fmt: skip


class Examined(NamedTuple):
    """A certificate compared with its files.

    Attributes:
        predicate: recomputed from the trials, or None if that is impossible.
        wrong: sentences on what does not fit.
    """

    predicate: dict[str, Any] | None
    wrong: tuple[str, ...]


def examine(folder: Path, params: type | None = None) -> Examined:
    """Recompute a certificate from its claim and trials, and compare.

    Raises:
        InputError: there is no certificate, its shape is wrong, or files that it names cannot be read.
    """
    path = folder / CERTIFICATE
    if not path.is_file():
        raise InputError(folder, "holds no certificate", "make one with skillframe certify run")
    content = read_json(path, "make it again with skillframe certify run")
    given = read_shape(content, path)
    lost: list[str] = []
    for each in given.subject:
        file = folder / each.name
        if not file.is_file():
            lost.append(f"{each.name} is gone")
        elif file_hash(file) != each.digest.sha256:
            lost.append(f"{each.name} was changed")
    if lost:
        return Examined(None, tuple(lost))
    found = outcome(folder, params) if claims(folder) else None
    named = tuple(stream for stream in TOLD if stream in given.predicate and (folder / FOUND[stream]).is_file())
    rounds = int(given.predicate["looked_at"]["border_rounds"]) if found is None else int(found.claim["border_rounds"])
    now = json.loads(json.dumps(statement(folder, found, params, rounds, named)))
    wrong = _tables(folder, found, params)
    told, meant = ({each["name"] for each in said["subject"]} for said in (content, now))
    wrong += [f"the certificate leaves out {name}" for name in sorted(meant - told)]
    wrong += [f"the certificate names {name}, which is none of its files" for name in sorted(told - meant)]
    if told == meant and content["subject"] != now["subject"]:
        wrong.append("the certificate names a file twice, or in another order")
    says, follows = content["predicate"], now["predicate"]
    other = sorted(key for key in says.keys() | follows.keys() if _plain(says, key) != _plain(follows, key))
    wrong += [f"the figures do not follow from the trials: {', '.join(other)}"] if other else []
    return Examined(now["predicate"], tuple(wrong))


def _tables(folder: Path, found: Outcome | None, params: type | None) -> list[str]:
    places = [folder / LOOK, *([found.place / FRESH] if found is not None else [])]
    return [
        f"{(place / RESULTS).relative_to(folder)} does not follow from the rows beside it" for place in places
        if (place / RESULTS).read_bytes() != results_text(load(place, params), rows_of_campaign(place, params)).encode()
    ]  # fmt: skip


def _plain(values: dict[str, Any], key: str) -> str:
    """A value as text that distinguishes true, 1 and 1.0, or "" for an absent key."""
    return json.dumps(values[key], sort_keys=True) if key in values else ""


def check_certificate(folder: Path, params: type | None = None) -> list[str]:
    """Return sentences on what does not fit a certificate. Raises as `examine`."""
    return list(examine(folder, params).wrong)
