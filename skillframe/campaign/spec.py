"""`campaign.toml` as a checked record: what runs, how often, and what varies.

`trials` is the total number per skill. Trial i of a campaign with grid axes takes cell i modulo the number of cells;
fewer trials than cells are refused. The first trials are then one end of the grid and no sample of it, so a campaign
with grid or values axes cannot stop early (`validity`). `[set]` fixes quantities (those of `--set`:
`"world.clearance" = 0.0002`) that `[vary]` does not name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from skillframe.campaign.axes import Axis, Value, cells_of, parse_axis
from skillframe.campaign.quantities import GROUPS, check_axis, check_name, check_value, in_si
from skillframe.campaign.validity import Plan, plan_of
from skillframe.config import build, read_toml
from skillframe.config.of_runs import DURATION
from skillframe.config.ranges import require_within
from skillframe.document.source import SkillSource, parse_source
from skillframe.errors import InputError

DURATION_S = DURATION.default
MOST_TRIALS = 10_000_000  # more are a typing mistake, and would fill the memory before the first one runs
"""Simulated time after which a trial has failed; our choice, several times what an insertion takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """When to stop early.

    Attributes:
        interval_width: stop once every skill's anytime-valid 95 % interval is this narrow.
    """

    interval_width: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RaceKeys:
    """That a skill which is decidedly worse runs no more (`race`).

    Attributes:
        every: trials between two looks; our choice, because fewer would make the batches of trials slow.
        alpha: chance that any two skills are told apart that are equally good.
    """

    every: int = 32
    alpha: float = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Expect:
    """The threshold: exit code 1 when a skill's success rate is below it.

    Attributes:
        rate: lowest acceptable success rate.
        skill: label of the skill it is asked of; None asks it of the first one.
        by: what has to reach it for exit code 0: the "rate" that was counted, or its whole 95 % "interval", as for the
            verdict (`verdict`).
    """

    rate: float | None = None
    skill: str | None = None
    by: Literal["rate", "interval"] = "rate"


@dataclass(frozen=True, slots=True, kw_only=True)
class _File:
    """The keys of a campaign file, in the types TOML has.

    Attributes:
        duration_s: simulated time after which a trial has failed [s].
    """

    seed: int
    trials: int
    robot: str
    world: str
    skills: tuple[str, ...]
    name: str = ""
    coc: str | None = None
    duration_s: float = DURATION_S
    vary: dict[str, Any] = field(default_factory=dict)
    set: dict[str, Any] = field(default_factory=dict)
    stop: Stop = field(default_factory=Stop)
    race: RaceKeys | None = None
    expect: Expect = field(default_factory=Expect)
    scores: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignSpec:
    """A campaign.

    Attributes:
        name: for people; the file's name if it has none.
        seed: of every draw; trial i of a seed is the same whatever else runs.
        trials: total number per skill; in a race the most that a skill runs.
        robot: a robot's name or a path to a robot.toml or its folder, relative to `folder`.
        world: a world's name, or a path to a fixture.toml, relative to `folder`.
        skills: "FILE.skill.json" or "TYPE:DEMO,..." (see `document.source`), relative to `folder`.
        vary: what varies, by quantity.
        fixed: quantities at one other value than the default, `[set]` in the file.
        coc: centre of compliance, "x,y,z" in the tool frame or a frame's name; None for the skill's own.
        duration_s: simulated time after which a trial has failed.
        race: how skills that are decidedly worse are left out; None runs all of them to the end.
        scores: names of scores to compute of every trial; each is a column of results.csv.
        folder: where the file lies; relative paths start there.
    """

    name: str
    seed: int
    trials: int
    robot: str
    world: str
    skills: tuple[str, ...]
    vary: dict[str, Axis] = field(default_factory=dict)
    fixed: dict[str, Value] = field(default_factory=dict)
    coc: str | None = None
    duration_s: float = DURATION_S
    stop: Stop = field(default_factory=Stop)
    race: RaceKeys | None = None
    expect: Expect = field(default_factory=Expect)
    scores: tuple[str, ...] = ()
    folder: Path = Path()

    @property
    def labels(self) -> tuple[str, ...]:
        """What the skills are called in results: "peg.skill.json", "replay:demo1.npz"."""
        return tuple(parse_source(text, self.folder).label for text in self.skills)

    @property
    def robot_name(self) -> str:
        """The robot's name, also where `robot` is the path of its files."""
        return name_of(self.robot)

    @property
    def world_name(self) -> str:
        """The world's name, also where `world` is the path of a fixture file."""
        if not self.world.endswith(".toml"):
            return self.world
        return name_of(self.world.removesuffix("/fixture.toml")).removesuffix(".toml")

    @property
    def world_place(self) -> str:
        """The world as the registry knows it: a name, or the path of a fixture file from here."""
        return place_of(self.world, self.folder)

    @property
    def cells(self) -> int:
        """Number of cells of the grid, or 1 without grid axes."""
        return cells_of(self.vary)

    @property
    def plan(self) -> Plan:
        """What is fixed before the first trial."""
        may_stop = self.stop.interval_width is not None or self.race is not None
        return plan_of(self.vary, trials=self.trials, skills=len(self.skills), may_stop=may_stop)

    def plain(self) -> dict[str, Any]:
        """The campaign as plain JSON values, as `from_plain` reads them, without its folder.

        Scores and `race` are in it where there are some, and `expect.by` where it is not "rate", so that the hashes of
        campaigns without them stay as they were.
        """
        values = {key: value for key, value in asdict(self).items() if key not in ("vary", "folder", "scores", "race")}
        values["skills"] = list(self.skills)
        values["expect"] = {k: v for k, v in values["expect"].items() if (k, v) != ("by", "rate")}
        values |= {"scores": list(self.scores)} if self.scores else {}
        values |= {"race": asdict(self.race)} if self.race else {}
        return {**values, "vary": {name: axis.plain() for name, axis in self.vary.items()}}

    @classmethod
    def from_plain(cls, values: Mapping[str, Any], folder: Path = Path()) -> CampaignSpec:
        """The inverse of `plain`, for values that were checked before."""
        axes = {name: parse_axis(value, name) for name, value in values["vary"].items()}
        stop, expect = Stop(**values["stop"]), Expect(**values["expect"])
        race = RaceKeys(**values["race"]) if "race" in values else None
        rest = {k: v for k, v in values.items() if k not in ("vary", "stop", "race", "expect", "skills", "scores")}
        skills, scores = tuple(values["skills"]), tuple(values.get("scores", ()))
        return cls(**rest, skills=skills, scores=scores, vary=axes, stop=stop, race=race, expect=expect, folder=folder)

    @classmethod
    def from_toml(cls, path: Path, params: type | None = None) -> CampaignSpec:
        """A checked campaign from its file.

        Args:
            path: the TOML file.
            params: the world's parameter dataclass; None looks it up in the registry.

        Raises:
            InputError: what is wrong and where, as "file: section.key".
            UnknownName: there is no such world, or no such score.
        """
        return cls.from_table(read_toml(path), path, params)

    @classmethod
    def from_table(cls, table: Mapping[str, Any], path: Path, params: type | None = None) -> CampaignSpec:
        """A checked campaign from the keys of a campaign file.

        Args:
            table: keys and values as in campaign.toml.
            path: the file that they stand in, or would stand in: errors name it, relative paths start in its folder.
            params: the world's parameter dataclass; None looks it up in the registry.

        Raises:
            InputError, UnknownName: as `from_toml`.
        """
        file = build(_File, table, f"{path}: campaign")
        params = params or _world_params(place_of(file.world, path.parent))
        _check_numbers(file, path)
        _check_skills(file, path)
        _check_scores(file, path)
        given = flatten(file.vary, f"{path}: vary")
        vary = {name: _axis(name, value, params, file, path) for name, value in given.items()}
        fixed = {
            name: _fixed(name, value, params, given, path) for name, value in flatten(file.set, f"{path}: set").items()
        }
        values = {
            k: getattr(file, k) for k in ("seed", "trials", "robot", "world", "skills", "coc", "duration_s", "scores")
        }
        spec = cls(**values, name=file.name or path.stem, vary=vary, fixed=fixed, stop=file.stop, race=file.race,
                   expect=file.expect, folder=path.parent)  # fmt: skip
        _check_designs(spec, path)
        return spec


def name_of(robot: str) -> str:
    """A robot's name from what a campaign file calls it: a name, a folder, or the robot.toml in it."""
    return robot.removesuffix("/robot.toml").rsplit("/", 1)[-1]


def place_of(world: str, folder: Path) -> str:
    """What a campaign file in a folder calls a world, as the registry knows it."""
    return str(folder / world) if world.endswith(".toml") else world


def flatten(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Quantities of a table, whether written as "start.tilt_y", as start.tilt_y or under [vary.start].

    Raises:
        InputError: one is written in two ways.
    """
    flat: dict[str, Any] = {}
    for key, value in table.items():
        grouped = key in GROUPS and isinstance(value, Mapping)
        for name, content in {f"{key}.{inner}": v for inner, v in value.items()}.items() if grouped else [(key, value)]:
            if name in flat:
                raise InputError(f"{where}.{name}", "is written twice", "keep one of the two")
            flat[name] = content
    return flat


def _world_params(name: str) -> type:
    from skillframe.extend.registry import registry

    return registry().world(name).params


def _check_numbers(file: _File, path: Path) -> None:
    width, rate = file.stop.interval_width, file.expect.rate
    checks = [
        ("seed", file.seed, file.seed >= 0, "give zero or more"),
        ("trials", file.trials, 1 <= file.trials <= MOST_TRIALS, f"give 1 to {MOST_TRIALS}"),
        ("stop.interval_width", width, width is None or 0.0 < width < 1.0, "give a number between 0 and 1"),
        ("expect.rate", rate, rate is None or 0.0 <= rate <= 1.0, "give a number from 0 to 1"),
    ]
    for key, value, good, fix in checks:
        if not good:
            raise InputError(f"{path}: {key}", f"is {value}", fix)
    if file.race is not None:
        _check_race(file, file.race, path)
    require_within(file.duration_s, file.duration_s, DURATION.unit, DURATION.range, f"{path}: duration_s")


def _check_race(file: _File, race: RaceKeys, path: Path) -> None:
    if race.every < 1:
        raise InputError(f"{path}: race.every", f"is {race.every}", "give the trials between two looks, one or more")
    if not 0.0 < race.alpha < 0.5:
        raise InputError(f"{path}: race.alpha", f"is {race.alpha}", "give a number between 0 and 0.5")
    if len(file.skills) < 2:
        raise InputError(f"{path}: race", "has one skill, which nothing can beat", "name a second one, or leave it out")
    if file.stop.interval_width is not None:
        raise InputError(
            f"{path}: race", "and [stop] interval_width would both say when the campaign ends", "keep one of the two"
        )


def _check_skills(file: _File, path: Path) -> None:
    if not file.skills:
        raise InputError(f"{path}: skills", "is empty", "name at least one skill file")
    entries = [_source(text, path, i) for i, text in enumerate(file.skills)]
    labels = [entry.label for entry in entries]
    for i, entry in enumerate(entries):
        where = f"{path}: skills[{i}]"
        if labels.index(entry.label) != i:
            raise InputError(where, f"a second skill is called {entry.label!r}", "rename one of the files")
        missing = [name for name in entry.files if not (path.parent / name).is_file()]
        if missing:
            raise InputError(where, f"no such file: {missing[0]}", "paths are relative to the campaign file")
    if file.expect.skill is not None and file.expect.skill not in labels:
        raise InputError(f"{path}: expect.skill", f"no skill is called {file.expect.skill!r}; there are {labels}")


def _source(text: str, path: Path, index: int) -> SkillSource:
    try:
        return parse_source(text, path.parent)
    except InputError as error:
        raise InputError(f"{path}: skills[{index}]", f"{error.where!r} {error.problem}", error.fix) from None


def _check_scores(file: _File, path: Path) -> None:
    if not file.scores:
        return
    from skillframe.extend.registry import registry

    for i, name in enumerate(file.scores):
        registry().score(name)
        if file.scores.index(name) != i:
            raise InputError(f"{path}: scores[{i}]", f"{name!r} is named twice", "name it once")


def _axis(name: str, value: Any, params: type, file: _File, path: Path) -> Axis:
    where = f"{path}: vary.{name}"
    check_name(name, params, where)
    axis = check_axis(name, parse_axis(in_si(name, value, params, where), where), params, where)
    if axis.kind == "values" and len(axis.numbers) != file.trials:
        raise InputError(where, f"{len(axis.numbers)} values for {file.trials} trials", "give one value per trial")
    return axis


def _fixed(name: str, value: Any, params: type, varied: Mapping[str, Any], path: Path) -> Value:
    where = f"{path}: set.{name}"
    check_name(name, params, where)
    if name in varied:
        raise InputError(where, "is both fixed and varied", "keep one of the two")
    return check_value(name, value, params, where)


def _check_designs(spec: CampaignSpec, path: Path) -> None:
    if spec.trials < spec.cells:
        raise InputError(
            f"{path}: trials", f"{spec.trials} trials leave some of the grid's {spec.cells} cells empty",
            f"give a multiple of {spec.cells}",
        )  # fmt: skip
    if spec.plan.in_order and spec.plan.may_stop:
        names = [name for name, axis in spec.vary.items() if axis.kind in ("grid", "values")]
        key = "stop.interval_width" if spec.race is None else "race"
        raise InputError(
            f"{path}: {key}",
            f"cannot stop early over {', '.join(names)}: grid and values axes run in order, so the first trials are "
            "one end of them and no interval from these trials holds for all",
            f"make these axes uniform or sobol, or leave out [{key.split('.')[0]}]",
        )
