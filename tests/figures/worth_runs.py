"""Runs of the tables of `tests.figures.worth`: a set's methods in one simulation, and the tables of what they did."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skillframe.campaign.statistics import clopper_pearson
from skillframe.execution.executor import Setup, simulate
from skillframe.execution.prepare import load_robot_model
from skillframe.frames import Float
from skillframe.skill import Ended
from skillframe.world.scene import Scene
from tests.figures.worth_families import SHORT, starts
from tests.figures.worth_skills import LONGEST, Row, Rows

EACH, MOVED, ENOUGH = 3, 5, 4
INSIDE = Ended.START.value


def executed(
    scene: Scene, rows: dict[str, Row], turn: Float, rng: np.random.Generator, seed: int, longest: float = LONGEST,
    floors: Sequence[float] = SHORT,
) -> Any:  # fmt: skip
    """Whether each method's moved runs, and its run in place, reached the goal: lists by key.

    A start inside the fixture is no trial, so it is drawn again, before any method has run.
    """
    setup = Setup(robot=load_robot_model("free_tool"), scene=scene,
                  center_of_compliance=np.array(scene.tool.frames["tip"]))  # fmt: skip
    noise = np.random.default_rng([seed, 1]).spawn((MOVED + 1) * len(rows))
    draws = _draws(scene, turn, rng, floors)
    still = Rows([Row()] * (MOVED + 1))
    while (inside := simulate(still, setup, draws, noise[: MOVED + 1], duration_s=0.002).ended_by == INSIDE).any():
        again = _draws(scene, turn, rng, floors)
        draws = {key: np.where(inside, again[key], values) for key, values in draws.items()}
    tiled = {key: np.tile(values, len(rows)) for key, values in draws.items()}
    each = [row for row in rows.values() for _ in range(MOVED + 1)]
    good = simulate(Rows(each), setup, tiled, noise, duration_s=longest).success.reshape(-1, MOVED + 1)
    return {key: done.tolist() for key, done in zip(rows, good, strict=True)}


def _draws(scene: Scene, turn: Float, rng: np.random.Generator, floors: Sequence[float]) -> dict[str, Float]:
    """Starts, poses of the fixture and friction of the moved runs, and of the one in place."""
    count = MOVED + 1
    moved = (np.arange(count) < MOVED).astype(float)
    offsets = starts(scene, turn, rng, count, 0.003, floors)
    draws = {f"start.offset_{a}": offsets[:, i] for i, a in enumerate("xyz")}
    draws |= {f"fixture.offset_{a}": moved * rng.uniform(-0.002, 0.002, count) for a in "xyz"}
    draws |= {f"fixture.tilt_{a}": moved * np.radians(rng.uniform(-2.0, 2.0, count)) for a in "xyz"}
    return draws | {"world.friction": scene.friction * np.where(moved > 0.0, rng.uniform(0.8, 1.2, count), 1.0)}


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


NOT_NULLS = ("true push", "axis, push and turn", "LMC", "LMC, free across")
"""Rows that no null is: what is known to be right, and what LMC learned, with its rule before as an ablation."""


WHOEVER = "whoever shows it"


def whoever(results: dict[str, Any], people: Sequence[str]) -> dict[str, Any]:
    """A set's results, and those of methods that several people taught: runs that pass if all the people's sets do."""
    names = [{key.split("|")[1] for key in results if key.split("|")[0] == person} for person in people]
    common = set.intersection(*names) if len(people) > 1 else set()
    passed = {name: all(_whole([results[f"{person}|{name}"]]) for person in people) for name in sorted(common)}
    return {**results, **{f"{WHOEVER}|{name}": [good] * (MOVED + 1) for name, good in passed.items()}}


def side_by_side(runs: Sequence[dict[str, Any]], people: Sequence[str]) -> list[str]:
    """Tables in Markdown, a column a task: LMC beside its best null, then sets and runs of every method by person.

    A last person is all of them: an instance passes if the sets of all do.
    """
    by: dict[str, list[dict[str, Any]]] = {}
    for run in runs:
        by.setdefault(run["family"], []).append(whoever(run["results"], people))
    keys = list(dict.fromkeys(key for results in by.values() for each in results for key in each))
    shown = list(dict.fromkeys(key.split("|")[0] for key in keys))
    lines = ["| sets passed | " + " | ".join(["task", "LMC", "best of all others", "apart"]) + " |", "|---" * 5 + "|"]
    lines += [line for person in shown for task in by for line in _led(task, by[task], person)]
    for person in shown:
        mine = [key for key in keys if key.split("|")[0] == person]
        tasks = [task for task in by if any(key in each for each in by[task] for key in mine)]
        lines += ["", f"| {person or 'nothing learned'} | " + " | ".join(f"`{task}`" for task in tasks) + " |"]
        lines.append("|---" * (1 + len(tasks)) + "|")
        for key in mine:
            cells = [_cell([each[key] for each in by[task] if key in each]) for task in tasks]
            lines.append("| " + " | ".join([key.split("|")[1], *cells]) + " |")
    return lines


def _whole(sets: Sequence[Sequence[bool]]) -> int:
    return sum(sum(each[:MOVED]) >= ENOUGH for each in sets)


def _cell(sets: Sequence[Sequence[bool]]) -> str:
    """Sets passed of those shown, and runs."""
    if not sets:
        return ""
    of = "" if len(sets) == 20 else f" of {len(sets)}"
    return f"{_whole(sets)}{of}, {sum(sum(each[:MOVED]) for each in sets)}"


def _interval(sets: Sequence[Sequence[bool]]) -> str:
    low, high = clopper_pearson(_whole(sets), len(sets))
    return f"{_whole(sets)} of {len(sets)} ({100 * low:.0f}-{100 * high:.0f} %)"


def _led(task: str, results: Sequence[dict[str, Any]], person: str) -> list[str]:
    """A line of the table, if this person showed this task: LMC's interval beside that of the best of all others."""
    keys = dict.fromkeys(key for each in results for key in each if key.split("|")[0] in ("", person))
    sets = {key.split("|")[1]: [each[key] for each in results if key in each] for key in keys}
    if not person or "LMC" not in sets:
        return []
    nulls = {name: given for name, given in sets.items() if name not in NOT_NULLS and not name.startswith("without")}
    best = max(nulls, key=lambda name: _whole(nulls[name]) / len(nulls[name]))
    low, high = clopper_pearson(_whole(sets["LMC"]), len(sets["LMC"]))
    least, most = clopper_pearson(_whole(nulls[best]), len(nulls[best]))
    apart = "above" if low > most else "below" if high < least else ""
    cells = [person, f"`{task}`", _interval(sets["LMC"]), f"{best}: {_interval(nulls[best])}", apart]
    return ["| " + " | ".join(cells) + " |"]
