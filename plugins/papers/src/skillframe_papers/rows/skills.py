"""Rows 27 to 30 and 37: learned skills executed, and the centre of a compliant rotation.

Each skill runs from starts spread over the demonstrated ones, beside the same push without the claimed property.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration import Demonstration
from skillframe.document import new_document
from skillframe.extend import Document, RowResult, RowRun, registry
from skillframe_papers.bars import no_better
from skillframe_papers.rows.harness import (
    HEAD,
    Key,
    Ran,
    TaughtSet,
    compared,
    executed,
    key_of,
    leads,
    lines,
    lmc,
    not_behind,
    shown,
    stiff,
    successes,
    teacher,
    world,
)

REACH_M, SPREAD_DEG = 0.06, 8.0  # starts of runs: aside of the valley's bottom, and tilted
TILTS_DEG = (4.0, 8.0, 12.0)
WRIST, TIP = [0.0, 0.0, 0.0], [0.0, 0.0, 0.2]
STIFF_N_M, STIFF_TURN_NM_RAD = 1000.0, 100.0


@cache
def _shown(key: Key, seed: int, count: int, name: str) -> tuple[Demonstration, ...]:
    job = RowRun(settings=dict(key))
    return tuple(shown(world(job, name), teacher(job), count=count, seed=seed))


@cache
def _learned(key: Key, seed: int, sets: int, name: str, each: int) -> tuple[Document, ...]:
    given = _shown(key, seed, 2 * sets, name)
    return tuple(lmc(given[2 * i : 2 * i + each]) for i in range(sets))


def skills_of(job: RowRun, name: str, each: int = 2, first: int = 64_000) -> tuple[Document, ...]:
    """A skill from each set: `each` of two demonstrations, with seeds from `first` on."""
    return _learned(key_of(job), first + job.seed, job.count(6, 1), name, each)


def run(
    job: RowRun, name: str, given: Mapping[str, Sequence[Document]], starts: Mapping[str, Sequence[float]], robot: str,
    center: str | None = None,
) -> dict[str, Ran]:  # fmt: skip
    """Results of every document from every start, by name."""
    draws = {quantity: np.array(values) for quantity, values in starts.items()}
    sets = [TaughtSet({way: each}, draws, (job.seed,)) for way, documents in given.items() for each in documents]
    longest = 6.0 if job.quick else 15.0
    return successes(executed(job, world(job, name), sets, robot=robot, duration_s=longest, center=center))


def result(job: RowRun, found: Mapping[str, Ran], words: str, difference: str) -> RowResult:
    """The first method's share against the threshold, and its lead over the others, its nulls."""
    (_, ours), *others = found.items()
    level_with = not_behind(job, ours, dict(others))
    nulls = ", ".join(f"{name} {each}" for name, each in others)
    return RowResult(
        ours=f"{ours} {words}; nulls: {nulls}{no_better(level_with)}",
        verdict=compared(job, [ours], not level_with), difference=difference, head=HEAD, rows=lines(found),
        values={"share": ours.share},
    )  # fmt: skip


def region(job: RowRun) -> RowResult:
    """Row 27: learned pushes from starts all over the valley."""
    offsets = np.linspace(-REACH_M, REACH_M, job.count(13, 5)).tolist()
    skills, starts = skills_of(job, "valley"), {"start.offset_x": offsets}
    given = {
        "learned": skills, "the same pushes, stiff": [stiff(s, "translation", STIFF_N_M) for s in skills],
        "by hand: straight down, free across": [by_hand()],
    }  # fmt: skip
    found = run(job, "valley", given, starts, "free_tool")
    return result(
        job, found, f"runs from {len(offsets)} starts within {1e3 * REACH_M:g} mm of the bottom reach it",
        "Demonstrations start 40 mm to either side. The push by hand, run once from each start, shows that here "
        "compliance does it, and that whoever knows the valley needs no demonstration.",
    )  # fmt: skip


def _tilts(count: int) -> dict[str, list[float]]:
    return {"start.tilt_y": np.radians(np.linspace(-SPREAD_DEG, SPREAD_DEG, count)).tolist()}


@cache
def _pegs(key: Key, seed: int, quick: bool) -> dict[int, dict[str, Ran]]:
    """By number of demonstrations: pegs learned and run by an arm, and the same with stiff orientation.

    All turn about their tips, and run side by side.
    """
    job = RowRun(settings=dict(key), seed=seed, quick=quick)
    given = dict[str, Sequence[Document]]()
    for each in (1, 2):
        skills = skills_of(job, "peg_in_hole", each)
        given |= {f"learned from {each}": skills, f"{each}": [stiff(s, "rotation", STIFF_TURN_NM_RAD) for s in skills]}
    hand = {"by hand: straight down, free along x, turning about y": [by_hand(turn="y")]}
    found = run(job, "peg_in_hole", given | hand, _tilts(job.count(5, 2)), "panda", "tip")
    return {
        each: {f"learned from {each}": found[f"learned from {each}"], "the same, stiff in rotation": found[f"{each}"]}
        | {name: found[name] for name in hand}
        for each in (1, 2)
    }


def peg(job: RowRun) -> RowResult:
    """Row 28: pegs learned from two demonstrations, inserted by an arm from varying starting orientation."""
    return result(
        job, _pegs(key_of(job), job.seed, job.quick)[2],
        f"runs of a Panda insert from tilts within {SPREAD_DEG:g} degrees",
        "Learned with a free tool from +8 and -8 degrees, steered about the tip. The push by hand runs once from each "
        "start.",
    )  # fmt: skip


def single(job: RowRun) -> RowResult:
    """Row 29: the same from one demonstration, which started from one side."""
    return result(
        job, _pegs(key_of(job), job.seed, job.quick)[1],
        f"runs of a Panda insert from tilts within {SPREAD_DEG:g} degrees, learned from one demonstration",
        "The demonstration starts at +8 degrees. The push by hand runs once from each start.",
    )  # fmt: skip


def by_hand(axes: str = "x", turn: str = "", at: Sequence[float] = TIP) -> Document:
    """An LMC document: straight down, compliant along some axes and about some, at a point of the tool."""

    def part(direction: Any, free: str, stiffness: float, speed: float) -> dict[str, Any]:
        held = np.array([0.0 if axis in free else stiffness for axis in "xyz"])
        return {
            "desired_direction": direction, "speed": speed, "fully_compliant": False,
            "compliant_axes": [np.eye(3)["xyz".index(axis)].tolist() for axis in free],
            "stiffness": np.diag(held).tolist(), "damping": np.diag([40.0 if speed else 0.3] * 3).tolist(),
            "evidence": {},
        }  # fmt: skip

    phase = {
        "translation": part([0.0, 0.0, -1.0], axes, STIFF_N_M, 0.02), "rotation": part(None, turn, 20.0, 0.0),
        "pitch": None, "stop": {"stall_s": 0.6, "lead_force_n": 20.0},
    }  # fmt: skip
    frame = {"work_at": list(at), "learned_at": list(at), "center_of_compliance": list(at), "axes": "base",
             "frames": {"tip": TIP, "wrist": WRIST}}  # fmt: skip
    return new_document(registry().skill("lmc"), {"frame": frame, "phases": [phase]})


def centre(job: RowRun) -> RowResult:
    """Row 30: rotation alone aligns a peg about its tip, and not about the wrist."""
    tried = (TILTS_DEG[0], TILTS_DEG[-1]) if job.quick else TILTS_DEG
    tilts = [sign * tilt for tilt in tried for sign in (1.0, -1.0)]
    starts = {"start.tilt_y": np.radians(tilts).tolist()}
    cases = {"tip, rotation alone": ("", "tip"), "wrist, rotation alone": ("", "wrist")}
    if not job.quick:
        cases |= {"tip, and free along x": ("x", "tip"), "wrist, and free along x": ("x", "wrist")}
    found = dict[str, NDArray[np.bool_]]()
    for at in ("tip", "wrist"):
        there = {name: [by_hand(axes, turn="y")] for name, (axes, where) in cases.items() if where == at}
        found |= {name: e.success[0] for name, e in run(job, "peg_in_hole", there, starts, "free_tool", at).items()}
    reach = {name: largest(tilts, success) for name, success in found.items()}
    tip, wrist = reach["tip, rotation alone"], reach["wrist, rotation alone"]
    return RowResult(
        ours=f"rotation alone inserts up to {tip:g} degrees about the tip, and up to {wrist:g} about the wrist"
        + ("" if job.quick else f"; with x free, {reach['wrist, and free along x']:g} about the wrist")
        + f"; {len(tilts)} tilts, each run once",
        verdict="pass" if tip >= TILTS_DEG[-1] and wrist < TILTS_DEG[0] else "fail",
        head=("centre of compliance", "largest tilt, both signs [degrees]", *(f"{tilt:+g}" for tilt in tilts)),
        rows=[(name, f"{reach[name]:g}", *("in" if good else "no" for good in found[name])) for name in cases],
        difference=f"Null: the wrist in the tip's place. Tilts of {', '.join(f'{t:g}' for t in tried)} degrees. "
        "The push is made by hand; nothing is learned.",
        values={"tip_deg": tip, "wrist_deg": wrist},
    )  # fmt: skip


def largest(tilts: Sequence[float], success: NDArray[np.bool_]) -> float:
    """Largest tilt up to which both signs insert, or 0."""
    reach = 0.0
    for tilt in sorted({abs(t) for t in tilts}):
        if not all(good for t, good in zip(tilts, success, strict=True) if abs(t) == tilt):
            break
        reach = tilt
    return reach


ONE, RIGID, HAND = "learned from one demonstration", "the same push, stiff", "by hand: straight down"


def one(job: RowRun) -> RowResult:
    """Row 37: valley and coupler, each from one demonstration that starts from one side, run from both."""
    valleys, couplers = (skills_of(job, name, 1, 72_000) for name in ("valley", "hose_coupler"))
    starts = {"start.offset_x": np.linspace(-REACH_M, REACH_M, job.count(13, 3)).tolist()}
    ways = {ONE: valleys, RIGID: [stiff(s, "translation", STIFF_N_M) for s in valleys]}
    found = {"valley": run(job, "valley", ways | ({} if job.quick else {HAND: [by_hand()]}), starts, "free_tool")}
    ways = {ONE: couplers, RIGID: [stiff(s, "rotation", STIFF_TURN_NM_RAD) for s in couplers]}
    ways |= {} if job.quick else {HAND: [by_hand(turn="y")]}
    found["hose coupler"] = run(job, "hose_coupler", ways, _tilts(job.count(4, 2)), "free_tool", "tip")
    turns = sum(each["phases"][0]["rotation"]["desired_direction"] is not None for each in couplers)
    said = f" Of {len(couplers)} sets of the coupler {turns} learn a direction of turning, as if it had to be turned."
    return of_one(job, found, said)


def of_one(job: RowRun, found: Mapping[str, Mapping[str, Ran]], said: str) -> RowResult:
    """Row 37 of what ran in each world."""
    return RowResult(
        ours="; ".join(f"{name} {each[ONE]}, stiff {each[RIGID].hits}" for name, each in found.items()),
        verdict=compared(
            job, [each[ONE] for each in found.values()], all(leads(job, e[ONE], e[RIGID]) for e in found.values())
        ),
        values={name.replace(" ", "_"): each[ONE].share for name, each in found.items()}, head=("world", *HEAD),
        rows=[(name, *line) for name, runs in found.items() for line in lines(runs)],
        difference="Every demonstration starts 40 mm to one side, or tilted by +8 degrees. The coupler is steered at "
        "its tip, and stiff is stiff in rotation there. Pushes by hand show what compliance alone does."
        + said,
    )  # fmt: skip
