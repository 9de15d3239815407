"""Rows 13, 23, 41 and 42 of the papers' results: learned searches beside a random walk and a spiral, on the same goals.

The fillet of the part, not its play, sets how hard the search is; the budget of time is ours, as the paper's is not
known. So the published shares are met by calibration; the lead over a random walk was not calibrated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import radians
from typing import Any, NamedTuple

import numpy as np
from skillframe_search.trials import NOBODY_KNEW, Task, demonstrations, document, goals, share, starts

from skillframe.demonstration.record import Demonstration
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.records import Document, Illustration, RowResult, RowRun
from skillframe.frames import Float
from skillframe.world.scene import Scene
from skillframe_papers.bars import ahead, counted, judged, reached, together
from skillframe_papers.rows.blocks import Trials, ran

GOALS, QUICK_GOALS = 40, 3
FIRST_GOALS = 30
"""Of the goals, those that methods get whose share says enough of it with so many."""
GIVEN, QUICK_GIVEN = 5, 3  # demonstrations
SHOWN_S, QUICK_SHOWN_S = 30.0, 4.0  # how long a person searches
BUDGETS = (3.0, 7.0, 13.4, 20.0)
QUICK_S, SOFT_S = 5.0, 13.4
"""What a quick run gives a search in place of 20 s, and every run at most on a soft arm."""
SOFT_N_M = 500.0
EARLY_S = 7.0
SHIFT = (0.006, 0.0, 0.0)
OFF = "peg, centre 6 mm off"
SHARES = {"peg": 0.75, "socket": 0.60}
LEAD = 0.30
FEWER = f" Random walk and ergodic control get the first {FIRST_GOALS} goals, and the lead is over the same ones."


class Tried(NamedTuple):
    """One method on one task: seconds to the find by goal, and the document it was."""

    seconds: Float
    document: Document


Key = tuple[tuple[str, float], ...]


def _key(job: RowRun) -> Key:
    return tuple(sorted(job.settings.items()))


def _task(key: Key, name: str) -> Task:
    values = dict(key)
    params = (("fillet", values["world.fillet"]), ("friction", values["world.friction"]))
    if name == "socket":
        return Task("socket", params, (0.003, 0.003, radians(5.0)))
    return Task("peg_in_hole", params, (0.004, 0.004, 0.0), SHIFT if name == OFF else NOBODY_KNEW)


class Method(NamedTuple):
    """A kind of skill and how it is made.

    Attributes:
        algorithm: of one that is learned.
        shown: the task that was shown. "": the one it is for.
        soft: on an arm of 500 N/m, planned for 13.4 s at most.
        feedforward: which forces it exerts. "": those that were learned.
    """

    kind: str
    algorithm: str = ""
    shown: str = ""
    soft: bool = False
    feedforward: str = ""

    def settings(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Of the learner, from those of a row."""
        given = {key: row[key] for key in ("time", "push", "speed", "stiffness")}
        if self.soft:
            given |= {"time": min(SOFT_S, row["time"]), "stiffness": SOFT_N_M}
        named = {"algorithm": self.algorithm, "feedforward": self.feedforward}
        return given | {key: value for key, value in named.items() if value}


WALK, SPIRAL = Method("random_walk"), Method("spiral")
SAMPLES, ERGODIC = Method("search", "sampling"), Method("search", "ergodic")
UNKNOWING = Method("search", "sampling", "peg")
"""Learned from somebody who believes that the hole is at the start."""
SOFT, CONSTANT = Method("search", "sampling", soft=True), Method("search", "sampling", "", True, "constant")
NAMES = {"random walk": WALK, "samples, tour": SAMPLES, "ergodic": ERGODIC, "spiral": SPIRAL}
QUICK_NAMES = ("random walk", "samples, tour")
NO_FORCES = "the same search, a constant push"


def shown_by(job: RowRun, task: Task, count: int = GIVEN) -> tuple[Demonstration, ...]:
    """Demonstrations of a task: `count` of a full run's, or those of a quick run."""
    seed = 1 + job.seed
    return demonstrations(task, QUICK_GIVEN, seed, QUICK_SHOWN_S) if job.quick else demonstrations(task, count, seed)


def budget_of(job: RowRun) -> float:
    """When a search's success is looked at [s]."""
    time = float(job.settings["time"])
    return min(QUICK_S, time) if job.quick else time


def searched(
    scene: Scene, given: Sequence[tuple[Document, Float]], *, duration_s: float, seed: int
) -> list[Float]:  # fmt: skip
    """Seconds to the find (N,), inf where there is none, of searches side by side, each with its goals (N, 3)."""
    trials = [
        Trials(each, starts(where), [np.random.default_rng([seed, i]) for i in range(len(where))])
        for each, where in given
    ]
    return [each.found for each in ran(load_robot_model("free_tool"), scene, trials, duration_s=duration_s)]


class Asked(NamedTuple):
    """A method on a task, on so many of its goals."""

    task: str
    method: Method
    first: int


_KEPT: dict[tuple[Key, int, Asked], Tried] = {}


def tried(job: RowRun, asked: Sequence[Asked]) -> list[Tried]:
    """Methods learned from five demonstrations, each on the same goals of its task, or on the first of them.

    Those of one world run side by side, and what rows of one process share is done once.
    """
    key = _key(job)
    missing = [each for each in dict.fromkeys(asked) if _kept(key, job.seed, each) is None]
    for world in dict.fromkeys(_task(key, each.task)[:2] for each in missing):
        _try(job, key, [each for each in missing if _task(key, each.task)[:2] == world])
    found = [one for each in asked if (one := _kept(key, job.seed, each)) is not None]
    for each, one in zip(asked, found, strict=True):
        told = share(one.seconds, _longest(job, each.task))
        job.tell(f"{each.task}, {each.method.kind} {each.method.algorithm}: {told:.0%}")
    return found


def _kept(key: Key, seed: int, asked: Asked) -> Tried | None:
    """What was tried before, on as many goals or on more."""
    for (where, known, before), found in _KEPT.items():
        if (where, known, before[:2]) == (key, seed, asked[:2]) and before.first >= asked.first:
            return Tried(found.seconds[: asked.first], found.document)
    return None


def _longest(job: RowRun, task: str) -> float:
    """Seconds that a search is planned for, and looked at."""
    return min(EARLY_S, float(job.settings["time"])) if task == OFF else budget_of(job)


def _try(job: RowRun, key: Key, asked: Sequence[Asked]) -> None:
    """Try methods on tasks of one world, and keep what came of them."""
    learned, where = list[Document](), list[Float]()
    for name, method, count in asked:
        task = _task(key, name)
        shown = shown_by(job, _task(key, method.shown) if method.shown else task)
        values = {**dict(key), "time": _longest(job, name)}
        learned.append(document(method.kind, task, shown, **method.settings(values)))
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
    return [name, method, *shares, *["-"] * (len(BUDGETS) - len(budgets)), counted(*_hits(tried, time))]


def _hits(tried: Tried, time: float) -> tuple[int, int]:
    """Goals found in time, and how many there were."""
    return int((tried.seconds <= time).sum()), len(tried.seconds)


HEAD = ("goal", "method", *(f"at {b:g} s" for b in BUDGETS), "found in the end")


def _goals(job: RowRun, method: Method) -> int:
    """How many goals a method gets where row 13 tries it."""
    first = method in (WALK, ERGODIC)
    return job.count(FIRST_GOALS if first else GOALS, QUICK_GOALS)


def _asked(job: RowRun, task: str, methods: Iterable[Method]) -> list[Asked]:
    return [Asked(task, each, _goals(job, each)) for each in methods]


def _all_quick(job: RowRun) -> list[Asked]:
    """What the quick rows 13, 14, 23, 41 and 42 read, in one simulation. A full run's rows ask for their own."""
    if not job.quick:
        return []
    return _asked(job, "peg", [WALK, SAMPLES, ERGODIC, SOFT, CONSTANT]) + _asked(job, OFF, _off_names(job).values())


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
    good = all(reached(*hits[name], least, quick=job.quick) for name, least in bars.items()) and lead >= LEAD
    documents = {name: done[name, "samples, tour"].document for name in bars}
    documents |= {"peg, ergodic": done["peg", "ergodic"].document} if not job.quick else {}
    return RowResult(
        ours=", ".join(f"{name} {counted(*each)}" for name, each in hits.items())
        + f" found in {time:g} s; random walk at least {100 * lead:.0f} points below",
        verdict="pass" if good else "fail", head=HEAD,
        pictures=[*(_figure_16(document, what) for what, document in documents.items()), _curves(done)],
        rows=[_line(job, n, m, each) for (n, m), each in done.items()],
        difference="The paper's budget, clearances, fillets and speeds are not known. A well-centred spiral is as good "
        f"as the learned search in the plane, or better.{'' if job.quick else FEWER}",
        values={**{name: ours / count for name, (ours, count) in hits.items()}, "lead_over_random_walk": lead},
    )  # fmt: skip


def _lead(ours: Tried, null: Tried, time: float) -> float:
    """By how much more of the null's goals ours finds in time."""
    return share(ours.seconds[: len(null.seconds)], time) - share(null.seconds, time)


def bars_of(job: RowRun) -> dict[str, float]:
    """By goal, the share that a learned search must find. A quick run has the peg alone."""
    return {name: least for name, least in SHARES.items() if name == "peg" or not job.quick}


def ergodic(job: RowRun) -> RowResult:
    """Row 42: share found by ergodic control, beside the random walk on the same goals, the first of row 13's."""
    time, count = budget_of(job), job.count(FIRST_GOALS, QUICK_GOALS)
    names = {"ergodic control": ERGODIC, "random walk": WALK}
    hits = {
        name: [_hits(each, time)[0] for each in tried(job, _asked(job, name, names.values()))] for name in bars_of(job)
    }
    shares = [judged(ours, count, SHARES[name], quick=job.quick) for name, (ours, _) in hits.items()]
    beside = all(ahead(ours, null, count, quick=job.quick) for ours, null in hits.values())
    return RowResult(
        ours="; ".join(f"{name} {counted(ours, count)}, random walk {null}" for name, (ours, null) in hits.items())
        + f", at {time:g} s",
        verdict=together(shares, beside), head=("goal", *names),
        rows=[(name, *(counted(each, count) for each in found)) for name, found in hits.items()],
        difference="Published shares are of both algorithms together, as far as the abstract says. Goals, budget and "
        "demonstrations are row 13's.",
        values={name: ours / count for name, (ours, _) in hits.items()},
    )  # fmt: skip


def _off_names(job: RowRun) -> dict[str, Method]:
    return {"spiral": SPIRAL, "samples, tour": SAMPLES} | ({"not told": UNKNOWING} if job.quick else {})


def off_centre(job: RowRun) -> dict[str, Tried]:
    """Searches for the peg's hole 6 mm off, in a quick run with one that nobody told where the hole is."""
    names = _off_names(job)
    return dict(zip(names, tried(job, _asked(job, OFF, names.values())), strict=True))


def spiral(job: RowRun) -> RowResult:
    """Row 23: a spiral, centred and off centre. A quick run, which has no time for the last goals, is off centre."""
    time, off, centred = budget_of(job), off_centre(job), dict[tuple[str, str], Tried]()
    for name in () if job.quick else ("peg", "socket"):
        (centred[name, "spiral"],) = tried(job, _asked(job, name, [SPIRAL]))
    done = {**centred, **{(OFF, method): off[method] for method in ("spiral", "samples, tour")}}
    (blind, count), (ours, _) = (_hits(done[OFF, m], EARLY_S) for m in ("spiral", "samples, tour"))
    good, values, said = ours >= blind + 0.15 * count, {"off_early_spiral": blind / count}, ""
    if not job.quick:
        hits = _hits(done["peg", "spiral"], time)
        values["centred"], good = hits[0] / hits[1], good and hits[0] == hits[1]
        said = f"centred {counted(*hits)} pegs in {time:g} s; "
    return RowResult(
        ours=f"{said}centre off, in {EARLY_S:g} s: spiral {counted(blind, count)}, learned {counted(ours, count)}",
        verdict="pass" if good else "fail", head=HEAD, rows=[_line(job, n, m, t) for (n, m), t in done.items()],
        difference="In the end a spiral reaches a wrong centre, too: it loses time, not goals.",
        values={**values, "off_early_learned": ours / count},
    )  # fmt: skip


def soft(job: RowRun) -> RowResult:
    """Row 41: the learned forces, and a constant push in their place, on an arm that gives way."""
    names = {"learned forces": SOFT, NO_FORCES: CONSTANT}
    time = min(SOFT_S, budget_of(job))
    done = dict(zip(names, tried(job, _asked(job, "peg", names.values())), strict=True))
    hits = {name: _hits(each, time)[0] for name, each in done.items()}
    (ours, null), count = hits.values(), len(done[NO_FORCES].seconds)
    enough = judged(ours, count, SHARES["peg"], quick=job.quick)
    return RowResult(
        ours=f"{counted(ours, count)} holes found in {time:g} s by an arm of {SOFT_N_M:g} N/m; null: {NO_FORCES}, "
        f"{null}",
        verdict=together([enough], ahead(ours, null, count, quick=job.quick)),
        head=("peg, soft arm", *(f"at {b:g} s" for b in BUDGETS if b <= time), "found"),
        rows=[
            (name, *(f"{share(each.seconds, b):.0%}" for b in BUDGETS if b <= time), counted(hits[name], count))
            for name, each in done.items()
        ],
        difference=f"Demonstrations and goals are row 13's. At {SOFT_N_M:g} N/m friction holds the tool some 4 mm "
        f"back. On the arm of {job.settings['stiffness']:g} N/m of the other rows this was not asked.",
        values={"learned": ours / count, "constant": null / count},
    )  # fmt: skip


def _figure_16(found: Document, what: str) -> Illustration:
    from skillframe_search.pictures import explain

    drawn = explain(found)[0]
    return drawn._replace(title=f"Exploration distribution and a search: {what} (Fig. 16)")


def _curves(done: dict[tuple[str, str], Tried]) -> Illustration:
    """Share found over time, by method."""
    from matplotlib.figure import Figure

    from skillframe.reports.drawing import BLUE, GREEN, GREY, RED, svg

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
