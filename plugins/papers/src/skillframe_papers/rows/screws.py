"""Row 34 of the papers' results: one phase pushes and turns at once, its speeds coupled by the pitch of what was shown.

A cap with two pins goes over a rim, down a steep lead-in and along to a stop (world `bayonet`). Coulomb's law says that
neither the push nor the turn passes alone. Nulls are the learned phase without its turn, and without its push. Beside
them stand the learned phase with speeds that no pitch couples, and a push and turn made by hand.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from math import radians
from typing import Any

import numpy as np

from skillframe.demonstration.record import Demonstration
from skillframe.document.source import learned
from skillframe.errors import SkillframeError
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.records import Document, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.frames import Float
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe.world.scene import Scene
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.blocks import Trials, successes
from skillframe_papers.rows.skills import Ran

SEED, EACH = 68_000, 3
SETS, QUICK_SETS = 4, 1
STARTS, QUICK_STARTS = 6, 2
SHARE, LONGEST_S = 0.9, 14.0
PEOPLE, ATTEMPTS = 10, 4
"""Simulated people who are asked at most, and how often each tries a demonstration again."""
GENTLE_N = 4.0
"""How hard people and pushes press: with 8 N the drop into the groove ends most demonstrations by their force."""
TURNED_RAD, ASIDE_M = radians(6.0), 0.001
FAST_M_S, FAST_RAD_S = 0.02, radians(5.0)
OURS, PUSH, TURN = "learned: push and turn", "the same, without its turn", "the same, without its push"
LOOSE, HAND = "the same, its speeds not coupled", "by hand: push and turn"
NULLS = (PUSH, TURN)


def without(document: Document, part: str) -> Document:
    """A document whose phase does not move in one part ("translation", "rotation"), and gives way in it as before."""
    made = copy.deepcopy(dict(document))
    for phase in made["phases"]:
        phase[part] |= {"desired_direction": None, "speed": 0.0}
        phase["pitch"] = None
    return made


def paced(document: Document, ways: Mapping[str, Any] | None = None) -> Document:
    """A document at the learner's largest speeds, which no pitch couples. It takes other directions if given some."""
    made = copy.deepcopy(dict(document))
    for phase in made["phases"]:
        phase["pitch"] = None
        for part, speed in (("translation", FAST_M_S), ("rotation", FAST_RAD_S)):
            phase[part]["speed"] = speed if phase[part]["desired_direction"] is not None or ways else 0.0
            if ways:
                phase[part] |= {"desired_direction": ways[part], "compliant_axes": [], "fully_compliant": False}
    return made


def _hand(document: Document) -> Document:
    """Straight down and about the hole's axis, held by the default stiffness in all else."""
    made = paced(document, {"translation": [0.0, 0.0, -1.0], "rotation": [0.0, 0.0, 1.0]})
    for phase in made["phases"]:
        for part, stiffness in (("translation", 1000.0), ("rotation", 20.0)):
            phase[part]["stiffness"] = (stiffness * np.eye(3)).tolist()
    return made


def says(document: Document) -> bool:
    """Whether a document has one phase that pushes and turns, coupled by its pitch."""
    phases = document["phases"]
    parts = [phases[0][part] for part in ("translation", "rotation")]
    if len(phases) != 1 or phases[0]["pitch"] is None or any(p["desired_direction"] is None for p in parts):
        return False
    nu, turn = (float(p["speed"]) for p in parts)
    return bool(np.isclose(nu, turn * phases[0]["pitch"], rtol=1e-3))


def _draws(count: int, seed: int) -> dict[str, Float]:
    rng = np.random.default_rng([seed, 1])
    most = {"start.tilt_z": TURNED_RAD, "start.offset_x": ASIDE_M, "start.offset_y": ASIDE_M}
    return {key: rng.uniform(-by, by, count) for key, by in most.items()}


def _shown(scene: Scene, person: TeacherSettings, seed: int) -> tuple[list[Demonstration], int]:
    """Three demonstrations of the first person who can give them, and how many people before could not."""
    for failed in range(PEOPLE):
        try:
            given = record(
                load_robot_model("free_tool"), scene, person, count=EACH, seed=seed + 100 * failed, attempts=ATTEMPTS
            )
        except SkillframeError:
            continue
        return list(given.demonstrations), failed
    raise SkillframeError(
        f"world bayonet: none of {PEOPLE} people can show it {EACH} times; lower teacher.aim_noise_deg"
    )


def screw(job: RowRun) -> RowResult:
    """Row 34: caps locked by a Panda, and whether push, turn and pitch were told."""
    scene = load_world("bayonet", {"friction": job.settings["world.friction"]})
    person = TeacherSettings(aim_noise=radians(job.settings["teacher.aim_noise_deg"]), force_max=GENTLE_N)
    sets, count = job.count(SETS, QUICK_SETS), job.count(STARTS, QUICK_STARTS)
    taught, trials, told, unable = list[dict[str, Document]](), list[Trials](), 0, 0
    for i in range(sets):
        seed = SEED + 1000 * job.seed + i
        shown, failed = _shown(scene, person, seed)
        unable += failed
        given = learned(
            registry().skill("lmc"), shown,
            LearnOptions(at="tip", settings={"lead_force_n": GENTLE_N, "lead_force_max_n": GENTLE_N}),
        )  # fmt: skip
        told += says(given)
        ways = {OURS: given, PUSH: without(given, "rotation"), TURN: without(given, "translation")}
        if not job.quick:
            ways |= {LOOSE: paced(given), HAND: _hand(given)}
        taught.append(ways)
        trials += [
            Trials(each, _draws(count, seed), [np.random.default_rng([seed, 2, k]) for k in range(count)])
            for each in ways.values()
        ]
    done = iter(successes(load_robot_model("panda"), scene, trials, duration_s=LONGEST_S, center="tip"))
    won = dict[str, list[list[bool]]]()
    for i, ways in enumerate(taught):
        for name in ways:
            won.setdefault(name, []).append(next(done).tolist())
        job.tell(f"set {i}: {', '.join(f'{name} {sum(hits[-1])}' for name, hits in won.items())} of {count}")
    return _told(job, {name: Ran(np.array(hits)) for name, hits in won.items()}, told, unable)


def _told(job: RowRun, found: Mapping[str, Ran], told: int, unable: int) -> RowResult:
    """The row, from successes by method, sets that say push, turn and pitch, and people who could not show it."""
    ours = found[OURS]
    sets, trials = len(ours.success), ours.trials
    shares = [judged(told, sets, SHARE, quick=job.quick), judged(ours.hits, trials, SHARE, quick=job.quick)]
    beside = all(ahead(ours.hits, found[name].hits, trials, quick=job.quick) for name in NULLS)
    shown = [name for name in (LOOSE, HAND) if name in found]
    as_good = [name for name in shown if not ahead(ours.hits, found[name].hits, trials, quick=job.quick)]
    return RowResult(
        ours=f"push, turn and pitch in {counted(told, sets)} sets of {EACH}; {counted(ours.hits, trials)} runs of a "
        "Panda lock the cap; nulls: " + ", ".join(f"{name} {found[name].hits}" for name in NULLS),
        verdict=together(shares, beside), values={"share": ours.hits / trials, "told": told / sets},
        head=("skill", "trials", "sets without a failure"),
        rows=[(name, counted(each.hits, each.trials), each.sets) for name, each in found.items()],
        difference=f"The world is ours. {unable} people who could not show it {EACH} times were replaced. "
        + (f"Not behind by 95 % intervals: {', '.join(as_good) or 'none of those shown'}." if shown else ""),
    )  # fmt: skip
