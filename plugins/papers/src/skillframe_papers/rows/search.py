"""Rows 13 and 23 of the papers' results: learned searches beside a random walk and a spiral, on the same goals.

The fillet of the part, not its play, sets how hard the search is; the budget of time is ours, as the paper's is not
known. So the published shares are met by calibration; the lead over a random walk was not calibrated.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from typing import Any, NamedTuple

import numpy as np
from skillframe_search.trials import NOBODY_KNEW, Task, demonstrations, document, goals, share, starts

from skillframe.campaign.statistics import clopper_pearson
from skillframe.execution.prepare import load_robot_model
from skillframe.extend.records import Document, Illustration, RowResult, RowRun
from skillframe.frames import Float
from skillframe_papers.bars import reached
from skillframe_papers.rows.blocks import Trials, ran

GOALS, QUICK_GOALS = 60, 5
GIVEN = 5  # demonstrations
BUDGETS = (3.0, 7.0, 13.4, 20.0)
EARLY_S = 7.0
SHIFT = (0.006, 0.0, 0.0)
OFF = "peg, centre 6 mm off"
SHARES = {"peg": 0.75, "socket": 0.60}


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


Method = tuple[str, str]
"""Kind of skill, and the algorithm of one that is learned."""
WALK, SAMPLES, ERGODIC, SPIRAL = ("random_walk", ""), ("search", "sampling"), ("search", "ergodic"), ("spiral", "")


def searched(learned: Sequence[Document], task: Task, where: Float, *, duration_s: float, seed: int) -> list[Float]:
    """Seconds to the find (N,), inf where there is none, of searches side by side: goals (N, 3) the same for all."""
    given = [
        Trials(each, starts(where), [np.random.default_rng([seed, i]) for i in range(len(where))]) for each in learned
    ]
    return [each.found for each in ran(load_robot_model("free_tool"), task.scene, given, duration_s=duration_s)]


_KEPT: dict[tuple[Key, int, int, str, Method], Tried] = {}


def _tried(job: RowRun, name: str, methods: Sequence[Method]) -> list[Tried]:
    """Methods learned from five demonstrations, on the same goals. What rows of one process share is done once."""
    key, count = _key(job), job.count(GOALS, QUICK_GOALS)
    values, task, taken = dict(key), _task(key, name), [(key, job.seed, count, name, each) for each in methods]
    if name == OFF:
        values["time"] = min(EARLY_S, values["time"])  # planned for what is looked at
    settings: dict[str, Any] = {k: values[k] for k in ("time", "push", "speed", "stiffness")}
    missing, learned = [each for each in taken if each not in _KEPT], list[Document]()
    for *_, (kind, how) in missing:
        own = settings | ({"algorithm": how} if how else {})
        learned.append(document(kind, task, demonstrations(task, GIVEN, 1 + job.seed), **own))
    if missing:
        where = goals(count, task, 100 + job.seed)
        found = searched(learned, task, where, duration_s=values["time"] + 2.0, seed=5 + job.seed)
        _KEPT.update(zip(missing, map(Tried, found, learned), strict=True))
    for (*_, method), tried in ((each, _KEPT[each]) for each in taken):
        job.tell(f"{name}, {' '.join(method).strip()}: {share(tried.seconds, job.settings['time']):.0%}")
    return [_KEPT[each] for each in taken]


def _line(job: RowRun, name: str, method: str, tried: Tried) -> list[str]:
    time = EARLY_S if name == OFF else job.settings["time"]
    budgets = [b for b in BUDGETS if b <= time]
    hits = int((tried.seconds <= time + 2.0).sum())
    low, high = clopper_pearson(hits, len(tried.seconds))
    shares = [f"{share(tried.seconds, b):.0%}" for b in budgets]
    return [name, method, *shares, *["-"] * (len(BUDGETS) - len(budgets)), f"{low:.0%} to {high:.0%}"]


HEAD = ("goal", "method", *(f"at {b:g} s" for b in BUDGETS), "95 % interval")


def found(job: RowRun) -> RowResult:
    """Row 13: share of holes and sockets found, beside the baselines."""
    time = float(job.settings["time"])
    methods = {"random walk": WALK, "samples, tour": SAMPLES}
    if not job.quick:
        methods |= {"ergodic": ERGODIC, "spiral": SPIRAL}
    bars = {name: least for name, least in SHARES.items() if name == "peg" or not job.quick}
    tried = dict[tuple[str, str], Tried]()
    for name in bars:
        tried |= zip(((name, m) for m in methods), _tried(job, name, list(methods.values())), strict=True)
    shares = {name: share(tried[name, "samples, tour"].seconds, time) for name in bars}
    lead = min(shares[name] - share(tried[name, "random walk"].seconds, time) for name in bars)
    good = all(_reached(job, shares[name], least) for name, least in bars.items()) and lead >= 0.30
    documents = {name: tried[name, "samples, tour"].document for name in bars}
    documents |= {"peg, ergodic": tried["peg", "ergodic"].document} if not job.quick else {}
    return RowResult(
        ours=", ".join(f"{name} {found:.0%}" for name, found in shares.items())
        + f" at {time:g} s; random walk at least {100 * lead:.0f} points below",
        verdict="pass" if good else "fail", head=HEAD,
        pictures=[*(_figure_16(document, what) for what, document in documents.items()), _curves(tried)],
        rows=[_line(job, n, m, each) for (n, m), each in tried.items()],
        difference="The paper's budget, clearances, fillets and speeds are not known. A well-centred spiral is as good "
        "as the learned search in the plane, or better.",
        values={**shares, "lead_over_random_walk": lead},
    )  # fmt: skip


def _reached(job: RowRun, found: float, bar: float) -> bool:
    count = job.count(GOALS, QUICK_GOALS)
    return reached(round(found * count), count, bar, quick=job.quick)


def spiral(job: RowRun) -> RowResult:
    """Row 23: a spiral, centred and off centre."""
    time = float(job.settings["time"])
    tried = {("peg", "spiral"): _tried(job, "peg", [SPIRAL])[0]}
    tried[OFF, "spiral"], tried[OFF, "samples, tour"] = _tried(job, OFF, [SPIRAL, SAMPLES])
    if not job.quick:
        (tried["socket", "spiral"],) = _tried(job, "socket", [SPIRAL])
    centred = share(tried["peg", "spiral"].seconds, time)
    spiral, learned = (share(tried[OFF, m].seconds, EARLY_S) for m in ("spiral", "samples, tour"))
    good = centred == 1.0 and learned >= spiral + 0.15
    return RowResult(
        ours=f"centred {centred:.0%} at {time:g} s; centre off, at {EARLY_S:g} s: spiral {spiral:.0%}, learned "
        f"{learned:.0%}",
        verdict="pass" if good else "fail", head=HEAD, rows=[_line(job, n, m, t) for (n, m), t in tried.items()],
        difference="In the end a spiral reaches a wrong centre, too: it loses time, not goals.",
        values={"centred": centred, "off_early_spiral": spiral, "off_early_learned": learned},
    )  # fmt: skip


def _figure_16(found: Document, what: str) -> Illustration:
    from skillframe_search.pictures import explain

    drawn = explain(found)[0]
    return drawn._replace(title=f"Exploration distribution and a search: {what} (Fig. 16)")


def _curves(tried: dict[tuple[str, str], Tried]) -> Illustration:
    """Share found over time, by method."""
    from matplotlib.figure import Figure

    from skillframe.reports.drawing import BLUE, GREEN, GREY, RED, svg

    figure = Figure(figsize=(7.4, 3.4))
    colours = {"random walk": GREY, "samples, tour": BLUE, "ergodic": RED, "spiral": GREEN}
    for canvas, name in zip(figure.subplots(1, 2, sharey=True), ("peg", "socket"), strict=True):
        for (n, method), each in tried.items():
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
