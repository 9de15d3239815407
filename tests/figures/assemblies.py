"""All of AutoMate's assemblies in one table: `python -m tests.figures.assemblies FOLDER...`.

FOLDER is filled by `skillframe benchmark automate`; of an assembly in several, the last counts. Assemblies that do not
run count as not seated. A run that ends as seated predicts success with the share of such runs that are; Brier's score
compares it with what happened.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from skillframe_benchmarks.assembly import DONE, TRIALS, by_level
from skillframe_benchmarks.counts import cause

from skillframe.campaign.statistics import clopper_pearson

OFTEN = 0.9
CLAIM = "seated, "


class Trial(NamedTuple):
    """One trial: its assembly, level and method, whether it is seated, whether it ended as seated, and its cause."""

    name: str
    level: str
    method: str
    seated: bool
    claims: bool
    why: str


def trials(place: Path) -> Iterator[Trial]:
    """The trials of an assembly."""
    if not (place / TRIALS).exists():
        return
    plan, parts = (json.loads((place / name).read_text()) for name in (DONE, "parts.json"))
    for level, rows in by_level(place / TRIALS, plan["levels"], plan["trials"]).items():
        for row in rows:
            seated = bool(row["success"])
            claims = seated or CLAIM in row["failure"]
            why = "" if seated else _why(row, parts["depth_m"])
            yield Trial(place.name, level, row["skill"].removesuffix(".skill.json"), seated, claims, why)


def _why(row: dict[str, Any], depth: float) -> str:
    return f"{'ended as seated' if CLAIM in row['failure'] else row['ended_by']}, {cause(row, depth)}"


def shown(found: list[Trial], every: int) -> Iterator[str]:
    """A paragraph for each level and method, of `every` assemblies."""
    for level, method in sorted({(one.level, one.method) for one in found}):
        mine = [one for one in found if (one.level, one.method) == (level, method)]
        names = sorted({one.name for one in mine})
        rates = {name: _share([one.seated for one in mine if one.name == name]) for name in names}
        often = sum(rate >= OFTEN for rate in rates.values())
        yield f"{level}, {method}: {len(names)} of {every} ran, {sum(one.seated for one in mine)} of {len(mine)} seated"
        yield f"  mean of the {every}: {sum(rates.values()) / every:.2%}; at least {OFTEN:.0%} of {often}"
        yield f"  below: {', '.join(f'{name} {rate:.0%}' for name, rate in rates.items() if rate < OFTEN)}"
        claims = [one for one in mine if one.claims]
        wrong = [one for one in claims if not one.seated]
        low, high = clopper_pearson(len(wrong), len(claims))
        yield f"  ended as seated: {len(claims)}, falsely {len(wrong)} ({low:.2%} to {high:.2%})"
        yield f"    of: {', '.join(f'{name} {n}' for name, n in Counter(one.name for one in wrong).most_common())}"
        yield f"  Brier's score {_brier(mine):.4f}, of the mean rate alone {_brier(mine, False):.4f}"
        yield "  causes: " + "; ".join(
            f"{n} {why}" for why, n in Counter(one.why for one in mine if not one.seated).most_common()
        )


def _share(values: list[bool]) -> float:
    return sum(values) / max(len(values), 1)


def _brier(mine: list[Trial], by_claim: bool = True) -> float:
    """Mean square of the error of the predicted success, whose shares come from the other assemblies."""
    total = 0.0
    for one in mine:
        others = [o.seated for o in mine if o.name != one.name and (o.claims == one.claims or not by_claim)]
        total += (_share(others) - one.seated) ** 2
    return total / len(mine)


if __name__ == "__main__":
    places = {done.parent.name: done.parent for each in sys.argv[1:] for done in sorted(Path(each).glob(f"*/{DONE}"))}
    print("\n".join(shown([one for place in places.values() for one in trials(place)], len(places))))
