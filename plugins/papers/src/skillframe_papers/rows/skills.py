"""Rows 27 to 30 of the papers' results: learned skills executed, and where a compliant push must turn about.

Each skill runs from starts spread over what was shown, beside the same push with what the row claims taken away. Draws
of one set of demonstrations share their learned push and mostly stand or fall together: sets are counted, too.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cache
from math import radians
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skillframe.demonstration.record import Demonstration
from skillframe.document.file import new_document
from skillframe.document.source import learned
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.records import Document, LearnOptions, RowResult, RowRun
from skillframe.extend.registry import registry
from skillframe.teaching.sessions import record
from skillframe.teaching.teacher import TeacherSettings
from skillframe_papers.bars import ahead, counted, judged, together
from skillframe_papers.rows.blocks import Trials, successes

SEED = 64_000
SETS, QUICK_SETS = 6, 1
SHARE = 0.9
LONGEST_S, QUICK_LONGEST_S = 15.0, 6.0
REACH_M, SPREAD_DEG = 0.06, 8.0
TILTS_DEG = (4.0, 8.0, 12.0)
WRIST, TIP = [0.0, 0.0, 0.0], [0.0, 0.0, 0.2]
STIFF_N_M, STIFF_NM_RAD, STIFF_TURN_NM_RAD = 1000.0, 20.0, 100.0


class Ran(NamedTuple):
    """Successes of trials, by set and start."""

    success: NDArray[np.bool_]

    @property
    def hits(self) -> int:
        """Of all trials."""
        return int(self.success.sum())

    @property
    def trials(self) -> int:
        """How many."""
        return int(self.success.size)

    @property
    def sets(self) -> str:
        """Sets whose every trial succeeded."""
        return f"{int(self.success.all(axis=1).sum())} of {len(self.success)}"


Key = tuple[tuple[str, float], ...]


@cache
def _shown(key: Key, seed: int, count: int, world: str) -> tuple[Demonstration, ...]:
    """Demonstrations from the world's starts in turn."""
    values = dict(key)
    scene = load_world(world, {"friction": values["world.friction"]})
    person = TeacherSettings(aim_noise=radians(values["teacher.aim_noise_deg"]))
    return tuple(record(load_robot_model("free_tool"), scene, person, count=count, seed=seed).demonstrations)


@cache
def _learned(key: Key, seed: int, sets: int, world: str, each: int) -> tuple[Document, ...]:
    """A skill from each set of two demonstrations, from `each` of them."""
    given, kind = _shown(key, seed, 2 * sets, world), registry().skill("lmc")
    return tuple(learned(kind, given[2 * i : 2 * i + each], LearnOptions()) for i in range(sets))


def skills_of(job: RowRun, world: str, each: int = 2, first: int = SEED) -> tuple[Document, ...]:
    """A skill from each set of demonstrations: `each` of two, with a seed from `first` on."""
    key = tuple(sorted(job.settings.items()))
    return _learned(key, first + job.seed, job.count(SETS, QUICK_SETS), world, each)


def run(
    job: RowRun, world: str, given: Mapping[str, Sequence[Document]], starts: Mapping[str, Sequence[float]], robot: str,
    center: str | None = None,
) -> dict[str, Ran]:  # fmt: skip
    """Every document from every start, by the name of what it is."""
    scene = load_world(world, {"friction": job.settings["world.friction"]})
    draws = {name: np.array(values) for name, values in starts.items()}
    count = len(next(iter(draws.values())))
    trials = [
        Trials(each, draws, [np.random.default_rng([job.seed, i]) for i in range(count)])
        for documents in given.values() for each in documents
    ]  # fmt: skip
    longest = QUICK_LONGEST_S if job.quick else LONGEST_S
    done = iter(successes(load_robot_model(robot), scene, trials, duration_s=longest, center=center))
    return {name: Ran(np.array([next(done) for _ in documents])) for name, documents in given.items()}


def stiff(document: Document, part: str, stiffness: float) -> Document:
    """The document with one part ("translation", "rotation") as stiff in every direction."""
    made = copy.deepcopy(dict(document))
    for phase in made["phases"]:
        phase[part] |= {
            "stiffness": (stiffness * np.eye(3)).tolist(), "compliant_axes": [], "fully_compliant": False,
        }  # fmt: skip
    return made


def _judged(job: RowRun, found: Mapping[str, Ran], null: str, words: str, difference: str) -> RowResult:
    """The first method's share against the bar, and its lead over a null."""
    ours = next(iter(found.values()))
    share = judged(ours.hits, ours.trials, SHARE, quick=job.quick)
    beside = ahead(ours.hits, found[null].hits, ours.trials, quick=job.quick)
    return RowResult(
        ours=f"{counted(ours.hits, ours.trials)} {words}; null: {null}, {found[null].hits}",
        verdict=together([share], beside), difference=difference, head=("skill", "trials", "sets without a failure"),
        rows=[(name, counted(each.hits, each.trials), each.sets) for name, each in found.items()],
        values={"share": ours.hits / ours.trials},
    )  # fmt: skip


def region(job: RowRun) -> RowResult:
    """Row 27: learned pushes from starts all over the valley."""
    offsets = np.linspace(-REACH_M, REACH_M, job.count(13, 5)).tolist()
    skills, starts = skills_of(job, "valley"), {"start.offset_x": offsets}
    none = "the same pushes, stiff"
    given = {
        "learned": skills, none: [stiff(s, "translation", STIFF_N_M) for s in skills],
        **({} if job.quick else {"by hand: straight down, free across": [by_hand()]}),
    }  # fmt: skip
    found = run(job, "valley", given, starts, "free_tool")
    return _judged(
        job, found, none, f"runs from {len(offsets)} starts within {1e3 * REACH_M:g} mm of the bottom reach it",
        "Demonstrations start 40 mm to either side. The push by hand shows that here compliance does it, and that "
        "whoever knows the valley needs no demonstration.",
    )  # fmt: skip


def _tilts(job: RowRun) -> dict[str, list[float]]:
    return {"start.tilt_y": np.radians(np.linspace(-SPREAD_DEG, SPREAD_DEG, job.count(5, 2))).tolist()}


STIFF_TURN = "the same, stiff in rotation"


@cache
def _pegs(key: Key, seed: int, quick: bool) -> dict[int, dict[str, Ran]]:
    """By number of demonstrations: pegs learned from so many and run by an arm, and the same with a stiff attitude.

    All turn about their tips, and run side by side.
    """
    job = RowRun(settings=dict(key), seed=seed, quick=quick)
    given = dict[str, Sequence[Document]]()
    for each in (1, 2):
        skills = skills_of(job, "peg_in_hole", each)
        given |= {f"learned from {each}": skills, f"{each}": [stiff(s, "rotation", STIFF_TURN_NM_RAD) for s in skills]}
    hand = {} if quick else {"by hand: straight down, free along x, turning about y": [by_hand(turn="y")]}
    found = run(job, "peg_in_hole", given | hand, _tilts(job), "panda", "tip")
    return {
        each: {f"learned from {each}": found[f"learned from {each}"], STIFF_TURN: found[f"{each}"]}
        | {name: found[name] for name in hand}
        for each in (1, 2)
    }


def peg(job: RowRun) -> RowResult:
    """Row 28: pegs learned from two demonstrations, inserted by an arm from varying starting orientation."""
    found = _pegs(tuple(sorted(job.settings.items())), job.seed, job.quick)[2]
    return _judged(
        job, found, STIFF_TURN, f"runs of a Panda insert from tilts within {SPREAD_DEG:g} degrees",
        "Learned with a free tool from +8 and -8 degrees, steered about the tip.",
    )  # fmt: skip


def single(job: RowRun) -> RowResult:
    """Row 29: the same from one demonstration, which started from one side."""
    found = _pegs(tuple(sorted(job.settings.items())), job.seed, job.quick)[1]
    return _judged(
        job, found, STIFF_TURN,
        f"runs of a Panda insert from tilts within {SPREAD_DEG:g} degrees, learned from one demonstration",
        "The demonstration starts at +8 degrees.",
    )  # fmt: skip


def by_hand(axes: str = "x", turn: str = "", at: Sequence[float] = TIP) -> Document:
    """An LMC document: straight down, free along some axes, turning freely about some, at a point of the tool."""

    def part(direction: Any, free: str, stiffness: float, speed: float) -> dict[str, Any]:
        held = np.array([0.0 if axis in free else stiffness for axis in "xyz"])
        return {
            "desired_direction": direction, "speed": speed, "fully_compliant": False,
            "compliant_axes": [np.eye(3)["xyz".index(axis)].tolist() for axis in free],
            "stiffness": np.diag(held).tolist(), "damping": np.diag([40.0 if speed else 0.3] * 3).tolist(),
            "evidence": {},
        }  # fmt: skip

    phase = {
        "translation": part([0.0, 0.0, -1.0], axes, STIFF_N_M, 0.02), "rotation": part(None, turn, STIFF_NM_RAD, 0.0),
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
    reach = {name: _largest(tilts, success) for name, success in found.items()}
    tip, wrist = reach["tip, rotation alone"], reach["wrist, rotation alone"]
    return RowResult(
        ours=f"rotation alone inserts up to {tip:g} degrees about the tip, and up to {wrist:g} about the wrist"
        + ("" if job.quick else f"; with x free, {reach['wrist, and free along x']:g} about the wrist"),
        verdict="pass" if tip >= TILTS_DEG[-1] and wrist < TILTS_DEG[0] else "fail",
        head=("centre of compliance", "largest tilt, both signs [degrees]", *(f"{tilt:+g}" for tilt in tilts)),
        rows=[(name, f"{reach[name]:g}", *("in" if good else "no" for good in found[name])) for name in cases],
        difference=f"Null: the wrist in the tip's place. Tilts of {', '.join(f'{t:g}' for t in tried)} degrees. "
        "The push is made by hand; nothing is learned.",
        values={"tip_deg": tip, "wrist_deg": wrist},
    )  # fmt: skip


def _largest(tilts: Sequence[float], success: NDArray[np.bool_]) -> float:
    """Largest tilt up to which both signs insert. 0: not even the smallest."""
    reach = 0.0
    for tilt in sorted({abs(t) for t in tilts}):
        if not all(good for t, good in zip(tilts, success, strict=True) if abs(t) == tilt):
            break
        reach = tilt
    return reach
