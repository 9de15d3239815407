"""One assembly of the benchmark: a world of two meshes, two demonstrations, a skill per method, and a campaign.

Results in the assembly's folder are kept, so that an interrupted run goes on.
"""

from __future__ import annotations

import json
import math
import shutil
import time
import warnings
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from skillframe_parts.found import values
from skillframe_parts.load import load
from skillframe_teaching import sessions
from skillframe_teaching.teacher import TeacherSettings

from skillframe import Campaign, CampaignResults, Recording, record
from skillframe.api import demonstrations_of, robot_of, scene_of
from skillframe.campaign import Options, evaluate, run_campaign
from skillframe.campaign import load as load_campaign
from skillframe.demonstration import Demonstration
from skillframe.errors import SkillframeError, SkillframeWarning
from skillframe.extend import make_scene, no_progress, registry
from skillframe.files import write_whole
from skillframe_benchmarks.assets import Pair
from skillframe_benchmarks.methods import METHODS, WITHOUT_DEMONSTRATION, Method
from skillframe_benchmarks.places import fitting

SCORES = ("automate_height", "automate_distance")
UPRIGHT, IN_PLACE = {"world.tilt": "2deg"}, {"world.sideways": "0.5mm"}
"""Required ends of a demonstration, against parts left slanting or far along an open slot."""
FEW = 5
"""Attempts at a demonstration before another teacher tries, or less is required."""
DONE, REFUSED, UNLEARNED, TRIALS = "done.json", "refused.json", "unlearned.json", "trials"


class Level(NamedTuple):
    """Error of the socket's believed place.

    Attributes:
        name: shift, tilt and friction.
        shift: largest shift along x and y [m].
        tilt: largest turn about x, y and z [rad].
        friction: Coulomb coefficient.
    """

    name: str
    shift: float
    tilt: float
    friction: float

    def most(self) -> dict[str, float]:
        """Largest errors of the socket by quantity [m, rad]."""
        shifts = {f"fixture.offset_{axis}": self.shift for axis in "xy"}
        return shifts | {f"fixture.tilt_{axis}": self.tilt for axis in "xyz"}


FRICTION = "world.friction"
LEVELS = tuple(
    Level(f"{1e3 * shift:g}mm-{degrees:g}deg-{friction:g}", shift, math.radians(degrees), friction)
    for shift, degrees in ((0.001, 2.0), (0.002, 5.0))
    for friction in (0.2, 0.5)
)
"""Published accuracy of the seen socket: 2 mm and 5 degrees, at friction 0.5."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is done with every assembly.

    Attributes:
        robot: name of a shipped robot, or a robot.toml.
        trials: per level, the same samples for every method.
        seed: of demonstrations; draws: of the samples, None: the same.
        methods: names of `METHODS` and `WITHOUT_DEMONSTRATION`.
        levels: names of `LEVELS`.
        duration_s: longest duration of a trial; a second hole takes 12 to 16 s in the median.
    """

    robot: str = "panda"
    trials: int = 20
    seed: int = 1
    draws: int | None = None
    methods: tuple[str, ...] = (*METHODS, *WITHOUT_DEMONSTRATION)
    levels: tuple[str, ...] = tuple(level.name for level in LEVELS)
    duration_s: float = 25.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AssemblyJob:
    """A worker's job: an assembly, its folder and the plan."""

    pair: Pair
    folder: Path
    plan: Plan

    @property
    def size(self) -> int:
        """Number of results."""
        return 1


class Refused(Exception):
    """An assembly that cannot be run, with the refusing step and reason."""

    def __init__(self, step: str, why: str) -> None:
        super().__init__(why)
        self.step, self.why = step, why


def run(job: AssemblyJob, tell: Callable[[str], None]) -> None:
    """Do what is missing of one assembly.

    refused.json has the refusing step; unlearned.json has methods that learn nothing, and the others run.
    """
    job.folder.mkdir(parents=True, exist_ok=True)
    cost = _Cost(job.folder / "cost.json")
    try:
        _run(job, cost, tell)
    except Refused as error:
        _keep(job.folder / REFUSED, {"step": error.step, "why": error.why})
        tell(f"{job.pair.name}: refused at {error.step}: {error.why}")
    _keep(job.folder / DONE, asdict(job.plan))


def _run(job: AssemblyJob, cost: _Cost, tell: Callable[[str], None]) -> None:
    folder, plan = job.folder, job.plan
    with cost.of("parts"), _refusing(job, "parts"):
        fixture = _world(job.pair, folder)
    skills, unlearned = _taught(job, fixture, cost)
    _keep(folder / UNLEARNED, unlearned)
    for name, why in unlearned.items():
        tell(f"{job.pair.name}: {name} learned nothing and counts as failed: {why}")
    if not skills:
        return
    with cost.of("trials"):
        found = _campaign(fixture, skills, folder / TRIALS, plan)
    for name, each in found.items():
        tell(f"{job.pair.name}, {name}: " + ", ".join(f"{k} {v} of {plan.trials}" for k, v in each.items()))


def _taught(job: AssemblyJob, fixture: Path, cost: _Cost) -> tuple[dict[str, Path], dict[str, str]]:
    """Skills by method, and why others were not learned."""
    skills, unlearned = dict[str, Path](), dict[str, str]()
    for source, given in ((_shown, METHODS), (_removed, WITHOUT_DEMONSTRATION)):
        methods = [name for name in job.plan.methods if name in given]
        if not methods:
            continue
        try:
            with cost.of("demonstrations"), _refusing(job, "demonstrations"):
                shown = source(fixture, job.folder, job.plan)
        except Refused as error:
            unlearned |= dict.fromkeys(methods, error.why)
            continue
        for name in methods:
            try:
                with cost.of("learning"), _refusing(job, name):
                    skills[name] = _learned(given[name], shown, job.folder / f"{name}.skill.json")
            except Refused as error:
                unlearned[name] = error.why
    return skills, unlearned


@contextmanager
def _refusing(job: AssemblyJob, step: str) -> Any:
    """Refuse the step with the sentence of an error in it, files relative to the assembly."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SkillframeWarning)  # of the recordings: the page counts failures
            yield
    except SkillframeError as error:
        raise Refused(step, str(error).replace(str(job.folder), job.pair.name)) from None


def _world(pair: Pair, folder: Path) -> Path:
    """The fixture file beside copies of both meshes, and parts.json with their measures."""
    fixture = folder / "fixture.toml"
    for mesh in (pair.plug, pair.socket):
        if not (folder / mesh.name).exists():
            write_whole(folder / mesh.name, mesh.read_bytes())
    if not fixture.exists():
        write_whole(fixture, fitting(pair, folder).encode())
    if not (folder / "parts.png").exists():
        scene = make_scene(registry().world(str(fixture)), {})
        registry().output("scene").write(scene, folder / "parts.png", no_progress)
    if not (folder / "parts.json").exists():
        _keep(folder / "parts.json", values(load(fixture)) | {"way_out_m": pair.way_out})
    return fixture


def _shown(fixture: Path, folder: Path, plan: Plan) -> list[Demonstration]:
    files = [folder / f"demonstration{i}.npz" for i in (1, 2)]
    if not all(file.exists() for file in files):
        _recorded(fixture, plan).save(folder / "demonstration.npz")
    return demonstrations_of(files)


def _recorded(fixture: Path, plan: Plan) -> Recording:
    """Demonstrations that end upright and in place, by repetition.

    The teacher pushes, and looks where that fails five times. Where both fail because parts lean, in place suffices;
    where they slide, seated; last by looking. A teacher who looks carries the part, which may show no push.
    """
    # Accuracy of a teacher's view of the hole entrance, where pushing alone fails [m]
    pushing, looking = TeacherSettings(), TeacherSettings(vision_error=5e-4)
    for teacher, ends, attempts in (
        (pushing, IN_PLACE | UPRIGHT, FEW), (looking, IN_PLACE | UPRIGHT, sessions.MOST_ATTEMPTS),
        (pushing, IN_PLACE, 1), (pushing, {}, sessions.MOST_ATTEMPTS), (looking, IN_PLACE, FEW),
    ):  # fmt: skip
        scene, draws = scene_of(str(fixture), ends, depth=1)
        try:
            return sessions.record(
                robot_of(plan.robot), scene, teacher, count=2, seed=plan.seed, draws=draws, attempts=attempts,
                at_once=FEW,
            )  # fmt: skip
        except SkillframeError:
            continue
    return record(fixture, plan.robot, teacher=looking, count=2, seed=plan.seed)


def _removed(fixture: Path, folder: Path, plan: Plan) -> list[Demonstration]:
    file = folder / "removal.npz"
    if not file.exists():
        record(fixture, plan.robot, teacher="disassembly", seed=plan.seed).save(file)
    return demonstrations_of(file)


def _learned(method: Method, shown: list[Demonstration], path: Path) -> Path:
    if not path.exists():
        method(shown).save(path)
    return path


def _campaign(fixture: Path, skills: dict[str, Path], out: Path, plan: Plan) -> dict[str, dict[str, int]]:
    """Run what is missing of the campaign, and return successes by level and method."""
    levels = levels_of(plan.levels)
    if out.exists() and not _whole(out):
        shutil.rmtree(out)
    if not out.exists():
        seed = plan.seed if plan.draws is None else plan.draws
        Campaign(
            world=str(fixture), robot=plan.robot, skills=[str(path) for path in skills.values()],
            trials=plan.trials * len(levels), seed=seed, coc="tip", duration_s=plan.duration_s,
            vary=drawn(levels, plan.trials, seed), scores=list(SCORES), name=f"AutoMate {fixture.parent.name}",
        ).prepare(out)  # fmt: skip
    # Trials simulated side by side, limited because a tick takes 0.8 ms for one or many
    run_campaign(out, evaluate.evaluate, Options(traces=0, chunk=400))
    rows = by_level(out, plan.levels, plan.trials)
    return {
        level: {
            name: sum(row["success"] and row["skill"] == path.name for row in each) for name, path in skills.items()
        }
        for level, each in rows.items()
    }


def levels_of(names: Sequence[str]) -> list[Level]:
    """Levels in the order of their trials."""
    return [level for level in LEVELS if level.name in names]


def by_level(campaign: Path, names: Sequence[str], trials: int) -> dict[str, list[dict[str, Any]]]:
    """Results of an assembly's campaign by level."""
    levels = levels_of(names)
    found: dict[str, list[dict[str, Any]]] = {level.name: [] for level in levels}
    for row in CampaignResults(campaign).rows:
        found[levels[row["trial"] // trials].name].append(row)
    return found


def drawn(levels: Sequence[Level], trials: int, seed: int) -> dict[str, Any]:
    """`[vary]` of a campaign of consecutive levels, `trials` each.

    All levels use the same directions and shares of their largest error, so that they are comparable, and run side by
    side.
    """
    shares = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(LEVELS[0].most()), trials))
    vary = {
        name: {"values": [float(level.most()[name] * each) for level in levels for each in share]}
        for name, share in zip(LEVELS[0].most(), shares, strict=True)
    }
    return vary | {FRICTION: {"values": [level.friction for level in levels for _ in range(trials)]}}


def _whole(folder: Path) -> bool:
    try:
        load_campaign(folder)
    except SkillframeError:
        return False
    return True


def _keep(path: Path, value: Any) -> None:
    write_whole(path, (json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode())


class _Cost:
    """Processor time of each step [s], summed in a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._spent: dict[str, float] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}

    @contextmanager
    def of(self, step: str) -> Any:
        """Context whose time is the step's."""
        began = time.process_time()
        try:
            yield
        finally:
            self._spent[step] = self._spent.get(step, 0.0) + time.process_time() - began
            _keep(self._path, self._spent)
