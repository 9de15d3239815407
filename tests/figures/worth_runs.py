"""Runs of the tables of `tests.figures.worth`: a set's methods in one simulation, and the tables of what they did."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from skillframe.campaign.statistics import clopper_pearson
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.frames import Float
from skillframe.world.scene import Scene
from tests.figures.worth_families import starts
from tests.figures.worth_skills import LONGEST, Row, Rows

EACH, MOVED, ENOUGH = 3, 5, 4


def executed(
    scene: Scene, rows: dict[str, Row], turn: Float, rng: np.random.Generator, seed: int, longest: float = LONGEST
) -> Any:  # fmt: skip
    """Whether each method's moved runs, and its run in place, reached the goal: lists by key."""
    count = MOVED + 1
    moved = np.arange(count) < MOVED
    offsets = starts(scene, turn, rng, count, 0.003)
    draws = {f"start.offset_{a}": offsets[:, i] for i, a in enumerate("xyz")}
    draws |= {f"fixture.offset_{a}": moved * rng.uniform(-0.002, 0.002, count) for a in "xyz"}
    draws |= {f"fixture.tilt_{a}": moved * np.radians(rng.uniform(-2.0, 2.0, count)) for a in "xyz"}
    draws["world.friction"] = scene.friction * np.where(moved, rng.uniform(0.8, 1.2, count), 1.0)
    setup = Setup(robot=load_robot_model("free_tool"), scene=scene,
                  center_of_compliance=np.array(scene.tool.frames["tip"]))  # fmt: skip
    noise = [g for _ in rows for g in np.random.default_rng([seed, 1]).spawn(count)]
    tiled = {key: np.tile(values, len(rows)) for key, values in draws.items()}
    each = [row for row in rows.values() for _ in range(count)]
    good = simulate(Rows(each), setup, tiled, noise, duration_s=longest).success.reshape(-1, count)
    return {key: done.tolist() for key, done in zip(rows, good, strict=True)}


def table(runs: Sequence[dict[str, Any]]) -> list[str]:
    """Lines of a table: moved runs, sets with their exact interval, and runs in place, by person and method."""
    lines = []
    for key in dict.fromkeys(key for run in runs for key in run["results"]):
        sets = [run["results"][key] for run in runs if key in run["results"]]
        whole = sum(sum(each[:MOVED]) >= ENOUGH for each in sets)
        low, high = clopper_pearson(whole, len(sets))
        counted = f"{sum(sum(each[:MOVED]) for each in sets)} of {MOVED * len(sets)}"
        kind, name = key.split("|")
        bounds = f"{100 * low:.0f}-{100 * high:.0f} %"
        in_place = f"in place {sum(each[MOVED] for each in sets)} of {len(sets)}"
        lines.append(f"{kind:16} {name:36} {counted:>10}   sets {whole:2} of {len(sets)} {bounds:>9}   {in_place}")
    return lines


def side_by_side(runs: Sequence[dict[str, Any]]) -> list[str]:
    """A table in Markdown: sets passed of those run, one column a task, and below it where LMC leads or is led."""
    families = list(dict.fromkeys(run["family"] for run in runs))
    by = {family: [run["results"] for run in runs if run["family"] == family and run["results"]] for family in families}
    keys = list(dict.fromkeys(key for results in by.values() for each in results for key in each))
    lines = ["| person | method | " + " | ".join(f"`{family}`" for family in families) + " |"]
    lines.append("|---" * (2 + len(families)) + "|")
    for key in keys:
        cells = [_cell([each[key] for each in by[family] if key in each]) for family in families]
        lines.append("| " + " | ".join([*key.split("|"), *cells]) + " |")
    people = dict.fromkeys(key.split("|")[0] for key in keys if key.endswith("|LMC") and " shown" not in key)
    return [*lines, "", *(line for family in families for line in _led(family, by[family], people))]


def _whole(sets: Sequence[Sequence[bool]]) -> int:
    return sum(sum(each[:MOVED]) >= ENOUGH for each in sets)


def _cell(sets: Sequence[Sequence[bool]]) -> str:
    if not sets:
        return "-"
    low, high = clopper_pearson(_whole(sets), len(sets))
    return f"{_whole(sets)} of {len(sets)} ({100 * low:.0f}-{100 * high:.0f})"


NOT_NULLS = ("true push", "axis, push and turn", "LMC", "LMC, free across")
"""Rows that no null is: what is known to be right, and what LMC learned."""


def _led(family: str, results: Sequence[dict[str, Any]], people: Iterable[str]) -> list[str]:
    """For each person: LMC's interval beside that of the best of all nulls, and whether they are apart."""
    lines = []
    for person in people:
        sets = {
            key.split("|")[1]: [each[key] for each in results if key in each]
            for key in dict.fromkeys(k for each in results for k in each)
            if key.split("|")[0] in ("", person)
        }
        nulls = {name: given for name, given in sets.items() if name not in NOT_NULLS}
        if not sets.get("LMC") or not nulls:
            continue
        best = max(nulls, key=lambda name: _whole(nulls[name]) / len(nulls[name]))
        low, _ = clopper_pearson(_whole(sets["LMC"]), len(sets["LMC"]))
        _, high = clopper_pearson(_whole(nulls[best]), len(nulls[best]))
        said = "above" if low > high else "not above"
        lines.append(
            f"{family}, {person}: LMC {_cell(sets['LMC'])} is {said} its best null, {best} {_cell(nulls[best])}"
        )
    return lines
