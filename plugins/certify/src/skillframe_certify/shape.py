"""Shape of a claim and of a certificate as files, checked before use.

Values are checked elsewhere: a claim by its seed, which depends on the rest of it, and a certificate by recomputing it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from skillframe.config import build
from skillframe.errors import InputError

CLAIM_FORMAT, CLAIM_VERSION = "skillframe.claim", 2
TYPE, PREDICATE = "https://in-toto.io/Statement/v1", "skillframe.certificate/v2"
CERTIFICATE = "certificate.json"
AGAIN = "make it again with skillframe certify run"
ANEW = "start again with skillframe certify run FILE.toml --out FOLDER"
OLDER = "was made by an earlier skillframe, whose certificates did not bind all that was tested"


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A claim as written before its trials.

    Attributes:
        number: among the folder's claims, from 1.
        rate, alpha, alpha_spent: success probability, level of this claim, and of all claims of the folder so far.
        trials, seed: of the fresh campaign.
        entropy, entropy_from: 64 hexadecimal digits for the seed, and their origin, "system" or "caller".
        campaign: hash of the fresh campaign: its file, its skill, robot and world.
        skill, robot, world: names.
        files: hashes of the exploratory campaign's files.
        looked_at: hash of the exploratory campaign.
        boxes: quantity to its ends in SI, smallest box first.
        border_rounds: border rounds that the proposal used.
        distribution: of the samples, in words.
        other_axes: what varies besides the box.
        software: versions and code hashes (`provenance.software`).
    """

    format: str
    version: int
    number: int
    rate: float
    alpha: float
    alpha_spent: float
    trials: int
    seed: int
    entropy: str
    entropy_from: str
    campaign: str
    skill: str
    robot: str
    world: str
    files: dict[str, str]
    looked_at: str
    boxes: tuple[dict[str, tuple[float, float]], ...]
    border_rounds: int
    distribution: str
    other_axes: dict[str, Any]
    software: dict[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Digest:
    """A file's hash."""

    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """A file that a certificate rests on: its name in the folder, and its hash."""

    name: str
    digest: Digest


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """An in-toto statement. The check recomputes the predicate's values."""

    _type: str
    predicateType: str  # noqa: N815 - in-toto's name
    subject: tuple[Subject, ...]
    predicate: dict[str, Any]


def read_shape(content: Any, path: Path) -> Certificate:
    """Return a certificate of the right shape.

    Raises:
        InputError: the content is no certificate, of an earlier version, or names a file outside its folder.
    """
    told = content.get("predicateType") if isinstance(content, dict) else None
    if isinstance(told, str) and told != PREDICATE and told.startswith("skillframe.certificate/v1"):
        raise InputError(path, OLDER, AGAIN)
    if told != PREDICATE:
        raise InputError(path, "is no certificate", AGAIN)
    found: Certificate = _built(Certificate, content, path, AGAIN)
    if found._type != TYPE:
        raise InputError(path, "is no in-toto statement", AGAIN)
    for each in found.subject:
        parts = (PurePosixPath(each.name), PureWindowsPath(each.name))
        if any(part.is_absolute() or part.anchor or ".." in part.parts for part in parts) or "\0" in each.name:
            raise InputError(path, f"names {each.name!r}, which is no file of its folder", AGAIN)
    rounds = found.predicate.get("looked_at")
    rounds = rounds.get("border_rounds") if isinstance(rounds, dict) else None
    if type(rounds) is not int or rounds < 0:
        raise InputError(path, "does not say how many rounds of the border were run", AGAIN)
    return found


def check_claim(content: Any, path: Path) -> dict[str, Any]:
    """Return a claim of the right shape, as it stands in its file.

    Raises:
        InputError: the content is no claim, of an earlier version, or has an empty or infinite box.
    """
    if not isinstance(content, dict) or content.get("format") != CLAIM_FORMAT:
        raise InputError(path, "is no claim", ANEW)
    if type(content.get("version")) is int and content["version"] < CLAIM_VERSION:
        raise InputError(path, OLDER, ANEW)
    found = _built(Claim, content, path, ANEW)
    if found.version != CLAIM_VERSION:
        raise InputError(path, f"is a claim of version {found.version}, which this skillframe does not know", ANEW)
    names = [set(box) for box in found.boxes]
    if not names or any(each != names[0] for each in names):
        raise InputError(path, "has no boxes, or boxes of different quantities", ANEW)
    for name, (low, high) in (ends for box in found.boxes for ends in box.items()):
        if not (low < high and math.isfinite(abs(low) + abs(high))):  # their sum too: it gives the middle
            raise InputError(path, f"claims {name} from {low:g} to {high:g}, which is no range", ANEW)
    return content


def _built(cls: type, content: Mapping[str, Any], path: Path, fix: str) -> Any:
    try:
        return build(cls, content, str(path))
    except InputError as error:
        raise InputError(error.where, error.problem, fix) from None
