"""Rows 13, 23, 41 and 42: learned searches against a random walk and a spiral, on the same goals.

The part's fillet sets the difficulty, and the time budget is assumed, so the published shares are met by calibration;
the lead over a random walk is not.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import radians
from typing import Any, NamedTuple

import numpy as np
from skillframe_search.trials import NOBODY_KNEW, Task, demonstrations, document, goals, share, starts

from skillframe.demonstration import Demonstration
from skillframe.execution import load_robot_model
from skillframe.extend import Document, Illustration, RowResult, RowRun
from skillframe.frames import Float
from skillframe.world import Scene
from skillframe_papers.bars import judged, no_better, reached, together
from skillframe_papers.rows.blocks import Trials, ran
from skillframe_papers.rows.harness import Key, Ran, compared, generators, key_of, leads, not_behind

GOALS, QUICK_GOALS = 40, 3
FIRST_GOALS = 30
"""Goals of methods whose share needs no more."""
BUDGETS = (3.0, 7.0, 13.4, 20.0)
SOFT_S = 13.4
"""Time limit of a soft arm."""
SOFT_N_M = 500.0
EARLY_S = 7.0
SHIFT = (0.006, 0.0, 0.0)
OFF = "peg, centre 6 mm off"
SHARES = {"peg": 0.75, "socket": 0.60}
FEWER = f" Random walk and ergodic control get the first {FIRST_GOALS} goals, and the lead is over the same ones."


class Tried(NamedTuple):
    """Seconds to the find by goal, and the document."""

    seconds: Float
    document: Document


def _task(key: Key, name: str) -> Task:
    values = dict(key)
    params = (("fillet", values["world.fillet"]), ("friction", values["world.friction"]))
    if name == "socket":
        return Task("socket", params, (0.003, 0.003, radians(5.0)))
    return Task("peg_in_hole", params, (0.004, 0.004, 0.0), SHIFT if name == OFF else NOBODY_KNEW)


class Method(NamedTuple):
    """An algorithm of search and its settings.

    Attributes:
        algorithm: of the skill `search`.
        shown: the demonstrated task; "": the one it is for.
        soft: on an arm of 500 N/m, planned for 13.4 s at most.
        feedforward: kind of exerted forces; "": learned.
    """

    algorithm: str
    shown: str = ""
    soft: bool = False
    feedforward: str = ""

    def settings(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Settings of the learner, from those of a row."""
        given = {key: row[key] for key in ("time", "push", "speed", "stiffness")}
        if self.soft:
            given |= {"time": min(SOFT_S, row["time"]), "stiffness": SOFT_N_M}
        named = {"algorithm": self.algorithm, "feedforward": self.feedforward}
        return given | {key: value for key, value in named.items() if value}


WALK, SPIRAL = Method("random_walk"), Method("spiral")
SAMPLES, ERGODIC = Method("sampling"), Method("ergodic")
UNKNOWING = Method("sampling", "peg")
"""Learned from a teacher who believes that the hole is at the start."""
SOFT, CONSTANT = Method("sampling", soft=True), Method("sampling", "", True, "constant")
NAMES = {"random walk": WALK, "samples, tour": SAMPLES, "ergodic": ERGODIC, "spiral": SPIRAL}
QUICK_NAMES = ("random walk", "samples, tour", "spiral")
CENTRED = "a centred spiral that nobody taught"
NO_FORCES = "the same search, a constant push"


def shown_by(job: RowRun, task: Task) -> tuple[Demonstration, ...]:
    """Five demonstrations of a task, in a quick run three of 4 s."""
    seed = 1 + job.seed
    return demonstrations(task, 3, seed, 4.0) if job.quick else demonstrations(task, 5, seed)


def budget_of(job: RowRun) -> float:
    """Time limit of a success [s], 5 s in a quick run."""
    time = float(job.settings["time"])
    return min(5.0, time) if job.quick else time


def searched(
    scene: Scene, given: Sequence[tuple[Document, Float]], *, duration_s: float, seed: int
) -> list[Float]:  # fmt: skip
    """Seconds to the find (N,), inf without one, of searches side by side, each with its goals (N, 3)."""
    trials = [Trials(each, starts(where), generators(len(where), seed)) for each, where in given]
    return [each.found for each in ran(load_robot_model("free_tool"), scene, trials, duration_s=duration_s)]


class Asked(NamedTuple):
    """A method on a task, on so many of its goals."""

    task: str
    method: Method
    first: int


_KEPT: dict[tuple[Key, int, Asked], Tried] = {}


def tried(job: RowRun, asked: Sequence[Asked]) -> list[Tried]:
    """Methods learned from five demonstrations, on the first goals of their task.

    Those of one world run side by side, cached for the process.
    """
    key = key_of(job)
    missing = [each for each in dict.fromkeys(asked) if _kept(key, job.seed, each) is None]
    for world in dict.fromkeys(_task(key, each.task)[:2] for each in missing):
        _try(job, key, [each for each in missing if _task(key, each.task)[:2] == world])
    found = [one for each in asked if (one := _kept(key, job.seed, each)) is not None]
    for each, one in zip(asked, found, strict=True):
        told = share(one.seconds, _longest(job, each.task))
        job.tell(f"{each.task}, {each.method.algorithm}: {told:.0%}")
    return found


def _kept(key: Key, seed: int, asked: Asked) -> Tried | None:
    for (where, known, before), found in _KEPT.items():
        if (where, known, before[:2]) == (key, seed, asked[:2]) and before.first >= asked.first:
            return Tried(found.seconds[: asked.first], found.document)
    return None


def _longest(job: RowRun, task: str) -> float:
    """Longest planned duration [s]."""
    return min(EARLY_S, float(job.settings["time"])) if task == OFF else budget_of(job)


def _try(job: RowRun, key: Key, asked: Sequence[Asked]) -> None:
    learned, where = list[Document](), list[Float]()
    for name, method, count in asked:
        task = _task(key, name)
        shown = shown_by(job, _task(key, method.shown) if method.shown else task)
        values = {**dict(key), "time": _longest(job, name)}
        learned.append(document(task, shown, **method.settings(values)))
        where.append(goals(count, task, 100 + job.seed))
    times = [min(_longest(job, each.task), SOFT_S) if each.method.soft else _longest(job, each.task) for each in asked]
    scene = _task(key, asked[0].task).scene
    found = searched(scene, list(zip(learned, where, strict=True)), duration_s=max(times), seed=5 + job.seed)
    for each, seconds, made, time in zip(asked, found, learned, times, strict=True):
        _KEPT[key, job.seed, each] = Tried(np.where(seconds <= time, seconds, np.inf), made)


def _line(job: RowRun, name: str, method: str, tried: Tried) -> list[str]:
    time = _longest(job, name)
    budgets = [b for b in BUDGETS if b <= time]
    shares = [f"{share(tried.seconds, b):.0%}" for b in budgets]
    return [name, method, *shares, *["-"] * (len(BUDGETS) - len(budgets)), str(_hits(tried, time))]


def _hits(tried: Tried, time: float) -> Ran:
    return Ran(tried.seconds <= time)


HEAD = ("goal", "method", *(f"at {b:g} s" for b in BUDGETS), "found in the end")


def _asked(job: RowRun, task: str, methods: Iterable[Method]) -> list[Asked]:
    """Methods with their goals in row 13."""
    most = {WALK: FIRST_GOALS, ERGODIC: FIRST_GOALS}
    return [Asked(task, each, job.count(most.get(each, GOALS), QUICK_GOALS)) for each in methods]


def _all_quick(job: RowRun) -> list[Asked]:
    """All that the quick rows 13, 14, 23, 41 and 42 read, for one simulation."""
    if not job.quick:
        return []
    return _asked(job, "peg", [WALK, SAMPLES, SPIRAL, ERGODIC, SOFT, CONSTANT]) + _asked(
        job, OFF, _off_names(job).values()
    )


def found(job: RowRun) -> RowResult:
    """Row 13: share of holes and sockets found, beside the baselines."""
    time, bars = budget_of(job), bars_of(job)
    methods = {name: NAMES[name] for name in (QUICK_NAMES if job.quick else NAMES)}
    done = dict[tuple[str, str], Tried]()
    for name in bars:
        asked = _asked(job, name, methods.values())
        done |= zip(((name, m) for m in methods), tried(job, [*asked, *_all_quick(job)]), strict=False)
    hits = {name: _hits(done[name, "samples, tour"], time) for name in bars}
    lead = min(_lead(done[name, "samples, tour"], done[name, "random walk"], time) for name in bars)
    spirals = {name: _hits(done[name, "spiral"], time) for name in bars}
    level_with = [f"{CENTRED} ({n} {spirals[n]})" for n in bars if not leads(job, hits[n], spirals[n])]
    enough = [reached(hits[n].hits, hits[n].trials, least, quick=job.quick) for n, least in bars.items()]
    good = all(enough) and lead >= 0.30
    documents = {name: done[name, "samples, tour"].document for name in bars}
    documents |= {"peg, ergodic": done["peg", "ergodic"].document} if not job.quick else {}
    return RowResult(
        ours=", ".join(f"{name} {each}" for name, each in hits.items())
        + f" found in {time:g} s; random walk at least {100 * lead:.0f} points below"
        + no_better(level_with),
        verdict="pass" if good and not level_with else "fail", head=HEAD,
        pictures=[*(_figure_16(document, what) for what, document in documents.items()), _curves(done)],
        rows=[_line(job, n, m, each) for (n, m), each in done.items()],
        difference="The paper's budget, clearances, fillets and speeds are not known. In the plane a spiral with the "
        f"right centre leaves nothing to learn.{'' if job.quick else FEWER}",
        values={**{name: each.share for name, each in hits.items()}, "lead_over_random_walk": lead},
    )  # fmt: skip


def _lead(ours: Tried, null: Tried, time: float) -> float:
    return share(ours.seconds[: len(null.seconds)], time) - share(null.seconds, time)


def bars_of(job: RowRun) -> dict[str, float]:
    """Required share of a learned search by goal, the peg alone in a quick run."""
    return {name: least for name, least in SHARES.items() if name == "peg" or not job.quick}


def ergodic(job: RowRun) -> RowResult:
    """Row 42: share found by ergodic control, beside the random walk on the same goals, the first of row 13's."""
    time, count = budget_of(job), job.count(FIRST_GOALS, QUICK_GOALS)
    names = {"ergodic control": ERGODIC, "random walk": WALK, CENTRED: SPIRAL}
    hits = {
        task: [_hits(each, time) for each in tried(job, [Asked(task, each, count) for each in names.values()])]
        for task in bars_of(job)
    }
    shares = [judged(ours.hits, ours.trials, SHARES[task], quick=job.quick) for task, (ours, *_) in hits.items()]
    level_with = [
        f"{null} ({task})" for task, (ours, *others) in hits.items()
        for null in not_behind(job, ours, dict(zip(list(names)[1:], others, strict=True)))
    ]  # fmt: skip
    return RowResult(
        ours="; ".join(
            f"{task} {ours}, random walk {walk.hits}, centred spiral {spiral.hits}"
            for task, (ours, walk, spiral) in hits.items()
        )
        + f", at {time:g} s{no_better(level_with)}",
        verdict=together(shares, not level_with), head=("goal", *names),
        rows=[(name, *map(str, found)) for name, found in hits.items()],
        difference="Published shares are of both algorithms together, as far as the abstract says. Goals, budget and "
        "demonstrations are row 13's.",
        values={task: each[0].share for task, each in hits.items()},
    )  # fmt: skip


def _off_names(job: RowRun) -> dict[str, Method]:
    return {"spiral": SPIRAL, "samples, tour": SAMPLES} | ({"not given": UNKNOWING} if job.quick else {})


def off_centre(job: RowRun) -> dict[str, Tried]:
    """Searches for the peg's hole 6 mm off, in a quick run with an unknowing one."""
    names = _off_names(job)
    return dict(zip(names, tried(job, _asked(job, OFF, names.values())), strict=True))


def spiral(job: RowRun) -> RowResult:
    """Row 23: a spiral, centred (full run only) and off centre."""
    time, off, centred = budget_of(job), off_centre(job), dict[tuple[str, str], Tried]()
    for name in () if job.quick else ("peg", "socket"):
        (centred[name, "spiral"],) = tried(job, _asked(job, name, [SPIRAL]))
    done = {**centred, **{(OFF, method): off[method] for method in ("spiral", "samples, tour")}}
    blind, ours = (_hits(done[OFF, m], EARLY_S) for m in ("spiral", "samples, tour"))
    lead, values, said = leads(job, ours, blind), {"off_early_spiral": blind.share}, ""
    good = lead
    if not job.quick:
        hits = _hits(done["peg", "spiral"], time)
        values["centred"], good = hits.share, good and hits.share == 1.0
        said = f"centred {hits} pegs in {time:g} s; "
    return RowResult(
        ours=f"{said}centre off, in {EARLY_S:g} s: spiral {blind}, learned {ours}"
        + no_better([] if lead else ["the same spiral, off centre"]),
        verdict="pass" if good else "fail", head=HEAD, rows=[_line(job, n, m, t) for (n, m), t in done.items()],
        difference="In the end a spiral reaches a wrong centre, too: it loses time, not goals.",
        values={**values, "off_early_learned": ours.share},
    )  # fmt: skip


def soft(job: RowRun) -> RowResult:
    """Row 41: the learned forces, and a constant push in their place, on a compliant arm."""
    names = {"learned forces": SOFT, NO_FORCES: CONSTANT}
    time = min(SOFT_S, budget_of(job))
    done = dict(zip(names, tried(job, _asked(job, "peg", names.values())), strict=True))
    hits = {name: _hits(each, time) for name, each in done.items()}
    ours, null = hits.values()
    return RowResult(
        ours=f"{ours} holes found in {time:g} s by an arm of {SOFT_N_M:g} N/m; null: {NO_FORCES}, {null.hits}",
        verdict=compared(job, [ours], leads(job, ours, null), SHARES["peg"]),
        head=("peg, soft arm", *(f"at {b:g} s" for b in BUDGETS if b <= time), "found"),
        rows=[
            (name, *(f"{share(each.seconds, b):.0%}" for b in BUDGETS if b <= time), str(hits[name]))
            for name, each in done.items()
        ],
        difference=f"Demonstrations and goals are row 13's. At {SOFT_N_M:g} N/m friction holds the tool some 4 mm "
        f"back. On the arm of {job.settings['stiffness']:g} N/m of the other rows this was not computed.",
        values={"learned": ours.share, "constant": null.share},
    )  # fmt: skip


def _figure_16(found: Document, what: str) -> Illustration:
    from skillframe_search.pictures import explain

    drawn = explain(found)[0]
    return drawn._replace(title=f"Exploration distribution and a search: {what} (Fig. 16)")


def _curves(done: dict[tuple[str, str], Tried]) -> Illustration:
    from matplotlib.figure import Figure
    from skillframe_segmenter.drawing import BLUE, GREEN, GREY, RED, svg

    figure = Figure(figsize=(7.4, 3.4))
    colours = {"random walk": GREY, "samples, tour": BLUE, "ergodic": RED, "spiral": GREEN}
    for canvas, name in zip(figure.subplots(1, 2, sharey=True), ("peg", "socket"), strict=True):
        for (n, method), each in done.items():
            if n == name:
                found = np.sort(each.seconds[np.isfinite(each.seconds)])
                shares = np.arange(len(found) + 1) / len(each.seconds)
                times = np.concatenate([[0.0], found, [22.0]])
                canvas.step(times, [*shares, shares[-1]], where="post", color=colours[method], label=method)
        canvas.set(title=name, xlabel="time [s]", ylim=(0.0, 1.02))
        canvas.axhline({"peg": 0.85, "socket": 0.67}[name], color="#1d2025", lw=1.2, ls=":")
    figure.axes[0].set_ylabel("share found")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), frameon=False, ncols=4, loc="outside upper center")
    caption = "The same goals for every method. Dotted: the published share, whose budget of time is not known."
    return Illustration("Share found over time", caption, svg(figure))
