"""Row 34: one phase pushes and turns at once, coupled by the demonstrated pitch.

A cap with two pins goes over a rim, down a lead-in and along to a stop (world `bayonet`), which neither push nor turn
passes alone. Nulls: without its turn, without its push. Beside them: uncoupled speeds, and a hand-written push and
turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import radians

import numpy as np
from skillframe_teaching.teacher import TeacherSettings

from skillframe.campaign import clopper_pearson
from skillframe.demonstration import Demonstration
from skillframe.errors import SkillframeError
from skillframe.extend import Document, RowResult, RowRun
from skillframe.world import Scene
from skillframe_papers.rows.harness import (
    HEAD,
    SHARE,
    Ran,
    TaughtSet,
    changed,
    compared,
    executed,
    leads,
    lines,
    lmc,
    not_behind,
    seeds,
    shown,
    successes,
    teacher,
    world,
)

EACH = 3
GENTLE_N = 4.0
"""Force of teachers and pushes; with 8 N the drop into the groove ends most demonstrations."""
FASTEST = {"translation": 0.02, "rotation": radians(5.0)}
"""The learner's largest speeds [m/s, rad/s]."""
OURS, PUSH, TURN = "learned: push and turn", "the same, without its turn", "the same, without its push"
LOOSE, HAND = "the same, its speeds not coupled", "by hand: push and turn"


def without(document: Document, part: str) -> Document:
    """A document whose phase does not move in one part ("translation", "rotation"), compliance unchanged."""
    return changed(document, **{part: {"desired_direction": None, "speed": 0.0}}, pitch=None)


def paced(document: Document) -> Document:
    """A document at the learner's largest speeds, uncoupled."""
    (phase,) = document["phases"]
    moving = {part: phase[part]["desired_direction"] is not None for part in FASTEST}
    return changed(document, pitch=None, **{p: {"speed": FASTEST[p] if moving[p] else 0.0} for p in FASTEST})


def by_hand(document: Document) -> Document:
    """A push straight down and a turn about the vertical at the largest speeds, stiff, in the document's frame."""
    ways = {"translation": ([0.0, 0.0, -1.0], 1000.0), "rotation": ([0.0, 0.0, 1.0], 20.0)}
    return changed(document, pitch=None, **{
        part: {"speed": FASTEST[part], "desired_direction": way, "compliant_axes": [], "fully_compliant": False,
               "stiffness": (stiffness * np.eye(3)).tolist()}
        for part, (way, stiffness) in ways.items()
    })  # fmt: skip


def says(document: Document) -> bool:
    """Whether a document has one phase that pushes and turns, coupled by its pitch."""
    phases = document["phases"]
    parts = [phases[0][part] for part in ("translation", "rotation")]
    if len(phases) != 1 or phases[0]["pitch"] is None or any(p["desired_direction"] is None for p in parts):
        return False
    nu, turn = (float(p["speed"]) for p in parts)
    return bool(np.isclose(nu, turn * phases[0]["pitch"], rtol=1e-3))


def _shown(scene: Scene, person: TeacherSettings, seed: int) -> tuple[list[Demonstration], int]:
    """Three demonstrations of the first able teacher of ten, with four attempts each, and how many failed before."""
    for failed in range(10):
        try:
            return shown(scene, person, count=EACH, seed=seed + 100 * failed, attempts=4), failed
        except SkillframeError:
            continue
    raise SkillframeError(f"world bayonet: none of 10 people can show it {EACH} times; lower teacher.aim_noise_deg")


def screw(job: RowRun) -> RowResult:
    """Row 34: caps locked by a Panda, and whether push, turn and pitch were learned."""
    scene, person = world(job, "bayonet"), teacher(job, force_max=GENTLE_N)
    sets, told, unable = list[TaughtSet](), list[bool](), 0
    for seed in seeds(job, 68_000, job.count(4, 1)):
        demonstrations, failed = _shown(scene, person, seed)
        unable += failed
        given = lmc(demonstrations, at="tip", settings={"lead_force_n": GENTLE_N, "lead_force_max_n": GENTLE_N})
        told.append(says(given))
        ways = {OURS: given, PUSH: without(given, "rotation"), TURN: without(given, "translation")}
        if not job.quick:
            ways |= {LOOSE: paced(given), HAND: by_hand(given)}
        rng, most = np.random.default_rng([seed, 1]), {"tilt_z": radians(6.0), "offset_x": 0.001, "offset_y": 0.001}
        draws = {f"start.{key}": rng.uniform(-by, by, job.count(6, 2)) for key, by in most.items()}
        sets.append(TaughtSet(ways, draws, (seed, 2)))
    found = successes(executed(job, scene, sets, robot="panda", duration_s=14.0, center="tip"))
    return result(job, found, Ran(np.array(told)), unable)


def result(job: RowRun, found: Mapping[str, Ran], told: Ran, unable: int) -> RowResult:
    """Row 34 of runs by way, of sets that teach the whole motion, and of people who could not show it."""
    ours, nulls = found[OURS], {name: found[name] for name in (PUSH, TURN)}
    as_good = not_behind(job, ours, {name: found[name] for name in (LOOSE, HAND) if name in found})
    return RowResult(
        ours=f"push, turn and pitch in {told} sets of {EACH}; {ours} runs of a Panda lock the cap; nulls: "
        + ", ".join(f"{name} {each.hits}" for name, each in nulls.items())
        + ("; so few sets do not show 90 % of sets" if clopper_pearson(told.hits, told.trials).low < SHARE else "")
        + (f"; by 95 % intervals not fewer: {', '.join(f'{n} {found[n]}' for n in as_good)}" if as_good else ""),
        verdict=compared(job, [told, ours], all(leads(job, ours, each) for each in nulls.values())),
        values={"share": ours.share, "told": told.share}, head=HEAD, rows=lines(found),
        difference=f"The world is ours. {unable} people who could not show it {EACH} times were replaced.",
    )  # fmt: skip
