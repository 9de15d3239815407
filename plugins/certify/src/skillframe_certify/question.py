"""What a certificate is to show of a skill, and its exploratory trials: a campaign in the same folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.campaign import Axis, CampaignSpec, Describe, Expect, Stop, pick_label, prepare
from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.files.documents import read_json
from skillframe.frames import Float
from skillframe_certify.real_trials import is_real

QUESTION, LOOK = "question.json", "look"
FORMAT, VERSION = "skillframe.question", 1
LOOKS = {1: 64, 2: 128, 3: 256, 4: 512, 5: 64, 6: 64}
"""Exploratory trials by the number of ranges. Above `MOST_MAPPED` only a breaking point is sought, mainly by its own
rays.
"""
MOST_MAPPED = 4
"""Most ranges of a border, a box or a ranking; a breaking point may have as many as `LOOKS` names."""
USUAL = 0.95
"""Default rate and confidence."""
FIX = "start again with skillframe certify run FILE.toml --out FOLDER"


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What a certificate is to show of a skill.

    Attributes:
        rate: least success probability in the box.
        confidence: of the claim.
        ranges: quantity to the ends of its declared range (SI).
    """

    rate: float
    confidence: float
    ranges: dict[str, tuple[float, float]]

    @property
    def alpha(self) -> float:
        """Probability of a false first claim."""
        return 1.0 - self.confidence

    def scaled(self, rows: Mapping[str, Any] | list[dict[str, Any]]) -> Float:
        """Points (n, d) of rows, with each range scaled to -1 to 1."""
        given = [rows] if isinstance(rows, Mapping) else rows
        ends = np.array(list(self.ranges.values()))
        points = np.array([[float(row[name]) for name in self.ranges] for row in given]).reshape(-1, len(self.ranges))
        result: Float = 2.0 * (points - ends[:, 0]) / (ends[:, 1] - ends[:, 0]) - 1.0
        return result

    def in_si(self, scaled: Float) -> Float:
        """The inverse of `scaled`, for (d,)."""
        ends = np.array(list(self.ranges.values()))
        result: Float = ends[:, 0] + (scaled + 1.0) * (ends[:, 1] - ends[:, 0]) / 2.0
        return result


def begin(
    spec: CampaignSpec, out: Path, describe: Describe, params: type, *, rate: float, confidence: float,
    skill: str | None = None, look: int | None = None, most: int = MOST_MAPPED,
) -> Question:  # fmt: skip
    """Write the question into a new folder and prepare its exploratory trials.

    Args:
        spec: the campaign with the ranges.
        out: the folder, absent or empty.
        describe: as of `campaign.folder.prepare`.
        params: the world's parameter dataclass.
        rate: least success probability.
        confidence: of the claim.
        skill: its label or the label's beginning; None for the first.
        look: exploratory trials; None for `LOOKS`.
        most: ranges that may be declared.

    Raises:
        InputError: axes that are not ranges, too many ranges, or a folder that is not empty.
        UnknownName: no such skill.
    """
    _check(rate, confidence)
    ranges: dict[str, tuple[float, float]] = {}
    for name, axis in sorted(spec.vary.items()):
        if axis.kind in ("uniform", "sobol"):
            ranges[name] = (float(axis.numbers[0]), float(axis.numbers[1]))
        elif axis.kind == "normal":
            mean, spread = float(axis.numbers[0]), float(axis.numbers[1])
            ranges[name] = (mean - 2.0 * spread, mean + 2.0 * spread)  # two standard deviations to either side
        elif axis.kind != "choice":
            raise InputError(
                f"vary.{name}", f"is a {axis.kind} axis, which has no fresh samples",
                "make it uniform, normal or choice",
            )  # fmt: skip
    if not 1 <= len(ranges) <= most:
        raise InputError("vary", f"declares {len(ranges)} ranges", few_ranges(most))
    degenerate = next((name for name, (low, high) in ranges.items() if not low < high), None)
    if degenerate is not None:
        raise InputError(f"vary.{degenerate}", "has no width", "give a standard deviation above 0, or fix it in [set]")
    label = pick_label(spec.labels, skill)
    question = Question(rate=rate, confidence=confidence, ranges=ranges)
    one = replace(
        spec, skills=(spec.skills[spec.labels.index(label)],), trials=look or LOOKS[len(ranges)], stop=Stop(),
        race=None, expect=Expect(),
        vary={**spec.vary, **{n: Axis(kind="sobol", numbers=ends) for n, ends in ranges.items()}},
    )  # fmt: skip
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(out, "exists and is not an empty folder", "choose another --out")
    prepare(one, out / LOOK, describe, params)
    _write(out, question)
    return question


def ask_again(folder: Path, rate: float, confidence: float) -> None:
    """Change a folder's rate and confidence. Its trials stay.

    Raises:
        InputError: the rate or confidence is outside [0.5, 1).
    """
    _check(rate, confidence)
    _write(folder, replace(read_question(folder), rate=rate, confidence=confidence))


def _write(folder: Path, question: Question) -> None:
    content = {"format": FORMAT, "version": VERSION, **asdict(question)}
    write_whole(folder / QUESTION, (json.dumps(content, indent=2, sort_keys=True) + "\n").encode())


def _check(rate: float, confidence: float) -> None:
    for name, value in (("--rate", rate), ("--confidence", confidence)):
        if not 0.5 <= value < 1.0:
            raise InputError(name, f"is {value:g}", "give a number from 0.5 up to, and not, 1")


def few_ranges(most: int) -> str:
    """Return advice on the number of ranges."""
    if most > MOST_MAPPED:
        return f"a breaking point has 1 to {most}: put the others under [set]"
    others = f"put the others under [set] (certify find-failure has 1 to {max(LOOKS)})"
    return f"a border, a box and a rank have 1 to {most}: {others}"


def mapped_question(folder: Path) -> Question:
    """Return the question of a folder for a border, a box or a ranking.

    Raises:
        InputError: the folder has no readable question, or more ranges than `MOST_MAPPED`.
    """
    question = read_question(folder)
    if len(question.ranges) > MOST_MAPPED:
        raise InputError(
            folder, f"was begun by certify find-failure with {len(question.ranges)} ranges", few_ranges(MOST_MAPPED)
        )
    return question


def read_question(folder: Path) -> Question:
    """Return the question of a folder.

    Raises:
        InputError: the folder has no question, or it is damaged.
    """
    path = folder / QUESTION
    if is_real(folder):
        raise InputError(
            folder, "holds real trials, whose place skillframe cannot choose",
            f"see their interval, valid at every look: skillframe report {folder} --out page.html",
        )  # fmt: skip
    if not path.is_file():
        raise InputError(folder, "holds no question", FIX)
    content = read_json(path, FIX)
    try:
        if content["format"] != FORMAT or content["version"] != VERSION:
            raise KeyError
        ranges = {str(k): (float(v[0]), float(v[1])) for k, v in content["ranges"].items()}
        return Question(rate=float(content["rate"]), confidence=float(content["confidence"]), ranges=ranges)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError):
        raise InputError(path, "is damaged", FIX) from None
