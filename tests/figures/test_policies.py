"""Policies learned from whole demonstrations, executed end to end: nine starts of each of six policies a task.

Every policy comes from three demonstrations of its own, cut into phases by `wrench_hmm` without being told how many
there are; starts are drawn about those that were shown. The world says whether the task is done.

The coupler runs about its face. About the flange, 150 mm behind a face of 30 mm radius, a push rights it only while the
tilt and the error of the learned direction together stay below atan(30 / 150) = 11.3 degrees: 3.3 degrees of error
are left to a start of 8, and demonstrations of a hand that wavers by 8 teach no better. That row is shown as well.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.stats import binomtest
from skillframe_teaching.sessions import record
from skillframe_teaching.teacher import TeacherSettings

from skillframe.document.file import learned
from skillframe.execution.executor import Result, simulate
from skillframe.execution.prepare import load_robot_model, load_world, prepare
from skillframe.extend import Document, LearnOptions
from skillframe.extend.registry import registry

pytestmark = [pytest.mark.needs_plugins]
POLICIES, STARTS, EACH = 6, 9, 3
SHORT_SEED = 4100
AIM_NOISE = float(np.deg2rad(8.0))
ARM_TASKS = ("valley: slide, then along",)


class Whole(NamedTuple):
    """A task of several stages.

    Attributes:
        world, params: where it is done.
        spread: starts vary about those shown by so much, evenly both ways.
        center: of compliance when it runs; None: where it was learned.
        seed: of the first policy.
    """

    world: str
    params: dict[str, Any]
    spread: dict[str, float]
    center: str | None = None
    seed: int = 8000


TASKS = {
    "hose coupler: lower, interlock": Whole(
        "hose_coupler",
        {"interlock": 0.7},
        {"start.tilt_y": float(np.deg2rad(3.0)), "start.offset_x": 0.002},
        center="tip",
        seed=8100,  # detours are joined by a rule that was made on a policy of 8000
    ),
    "valley: slide, then along": Whole(
        "valley", {"wall_distance": 0.05}, {"start.offset_x": 0.01, "start.offset_y": 0.005}
    ),
    "corner: set down, push in": Whole(
        "corner",
        {},
        {"start.offset_x": 0.01, "start.offset_y": 0.01},
    ),
}


def taught(task: Whole, seed: int) -> Document:
    """A policy from three whole demonstrations."""
    scene, person = load_world(task.world, task.params), TeacherSettings(aim_noise=AIM_NOISE)
    shown = record(load_robot_model("free_tool"), scene, person, count=EACH, seed=seed, duration_s=20.0)
    return learned(registry().skill("policy"), shown.demonstrations, LearnOptions())


def executed(
    policy: Document, task: Whole, trials: int, seed: int, center: str | None, robot: str = "free_tool"
) -> Result:
    """A policy from starts about those that were shown, in turn."""
    scene = load_world(task.world, task.params)
    rng, shown = np.random.default_rng([seed, 1]), scene.task.starts
    draws = {key: rng.uniform(-by, by, trials) for key, by in task.spread.items()}
    for i in range(trials):
        for key, value in shown[i % len(shown)].items():
            draws.setdefault(key, np.zeros(trials))[i] += value
    skill, setup = prepare(load_robot_model(robot), scene, policy, center)
    rngs = [np.random.default_rng([seed, 2, i]) for i in range(trials)]
    return simulate(skill, setup, draws, rngs, duration_s=20.0)


def line(name: str, *cells: object) -> None:
    print(f"{name:<38}" + "".join(f"{cell!s:>24}" for cell in cells), flush=True)


def run_all(name: str) -> int:
    """Policies of a task, all from starts of their own. Prints a row for each centre of compliance."""
    task = TASKS[name]
    policies = [taught(task, task.seed + i) for i in range(POLICIES)]
    wins = {}
    for center in dict.fromkeys((task.center, None)):
        results = [executed(p, task, STARTS, task.seed + i, center) for i, p in enumerate(policies)]
        wins[center] = sum(int(r.success.sum()) for r in results)
        low, high = binomtest(wins[center], POLICIES * STARTS).proportion_ci(method="exact")
        peak = np.median(np.concatenate([r.peak_force_n for r in results]))
        line(
            name,
            center or "where learned",
            f"{wins[center]}/{POLICIES * STARTS}",
            f"{low:.3f} .. {high:.3f}",
            f"{peak:.0f} N",
        )
        for i, r in enumerate(results):
            if not r.success.all():
                line("", f"policy {i + 1}: {int(r.success.sum())}/{STARTS}", str(r.failure[~r.success][0]))
    return wins[task.center]


@pytest.mark.figures
@pytest.mark.parametrize("name", TASKS)
def test_policies_from_whole_demonstrations_do_the_whole_task(name):
    wins = run_all(name)
    assert binomtest(wins, POLICIES * STARTS).proportion_ci(method="exact").low > 0.9


@pytest.mark.figures
@pytest.mark.parametrize("name", ARM_TASKS)
def test_policies_learned_with_a_free_tool_run_on_an_arm(name):
    """Shown: the arm's joints add inertia and limits of their own, and nothing is learned again."""
    task, wins, reasons = TASKS[name], 0, set[str]()
    for i in range(POLICIES):
        seed = task.seed + i
        result = executed(taught(task, seed), task, STARTS, seed, task.center, "panda")
        wins += int(result.success.sum())
        reasons |= {str(f) for f in result.failure[~result.success]}
    low, high = binomtest(wins, POLICIES * STARTS).proportion_ci(method="exact")
    line(name, "panda", f"{wins}/{POLICIES * STARTS}", f"{low:.3f} .. {high:.3f}", *sorted(reasons))
    assert wins > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", TASKS)
@pytest.mark.figures
def test_a_policy_from_whole_demonstrations_does_the_whole_task(name):
    result = executed(taught(TASKS[name], SHORT_SEED), TASKS[name], 6, SHORT_SEED, TASKS[name].center)
    assert result.success.sum() >= 5  # a share of 0.9, which the figures show to be exceeded, gives 5 or 6 of 6 in 89 %
