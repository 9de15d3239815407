"""`campaign.toml` as a checked record.

`trials` is the number per skill. With grid axes, trial i takes cell i modulo the number of cells, and there must be at
least as many trials as cells. The first trials are then one end of the grid, so a campaign with grid or values axes
cannot stop early (`validity`). `[set]` fixes quantities, as `--set` does: `"world.clearance" = 0.0002`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from skillframe.campaign.sampling import KINDS, Axis, Value, cells_of, parse_axis
from skillframe.campaign.statistics import Plan, plan_of
from skillframe.config import build, in_si, read_toml
from skillframe.config.units import DURATION, Quantity, require_within
from skillframe.document.file import parse_source
from skillframe.errors import InputError
from skillframe.extend.drives import quantities, typed_value, unknown
from skillframe.files.documents import refuse_other

DURATION_S: float = DURATION.nominal
"""Simulated time after which a trial has failed, several times that of an insertion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """When to stop early.

    Attributes:
        interval_width: width of every skill's anytime-valid 95 % interval at which to stop.
    """

    interval_width: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RaceKeys:
    """Settings of a race, in which significantly worse skills stop (`race`).

    Attributes:
        every: trials between two comparisons; few make the batches slow.
        alpha: probability that a difference is found between equally good skills.
    """

    every: int = 32
    alpha: float = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Expect:
    """The threshold: exit code 1 when a skill's success rate is below it.

    Attributes:
        rate: lowest acceptable success rate.
        skill: label of the skill; None for the first.
        by: what has to reach it for exit code 0: the counted "rate", or the whole 95 % "interval" (`verdict`).
    """

    rate: float | None = None
    skill: str | None = None
    by: Literal["rate", "interval"] = "rate"


@dataclass(frozen=True, slots=True, kw_only=True)
class _File:
    """The keys of a campaign file.

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
        name: the file's name by default.
        seed: of every sample.
        trials: number per skill; in a race the maximum.
        robot: a robot's name or a path to a robot.toml or its folder, relative to `folder`.
        world: a world's name, or a path to a fixture.toml, relative to `folder`.
        skills: "FILE.skill.json" or "TYPE:DEMO,..." (see `document.file`), relative to `folder`.
        vary: axes by quantity.
        fixed: values by quantity, `[set]` in the file.
        coc: centre of compliance, "x,y,z" in the tool frame or a frame's name; None for the skill's own.
        duration_s: simulated time after which a trial has failed.
        race: settings of a race, or None.
        scores: names of scores, each a column of results.csv.
        folder: of the file.
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
        """Names of the skills in results: "peg.skill.json", "replay:demo1.npz"."""
        return tuple(parse_source(text, self.folder).label for text in self.skills)

    @property
    def robot_name(self) -> str:
        """The robot's name, also where `robot` is a path."""
        return name_of(self.robot)

    @property
    def world_name(self) -> str:
        """The world's name, also where `world` is a path."""
        if not self.world.endswith(".toml"):
            return self.world
        return name_of(self.world.removesuffix("/fixture.toml")).removesuffix(".toml")

    @property
    def world_place(self) -> str:
        """The world for the registry: a name, or the path of a fixture file."""
        return place_of(self.world, self.folder)

    @property
    def cells(self) -> int:
        """Number of cells of the grid. 1 without grid axes."""
        return cells_of(self.vary)

    @property
    def plan(self) -> Plan:
        """The design that is fixed before the first trial."""
        may_stop = self.stop.interval_width is not None or self.race is not None
        return plan_of(self.vary, trials=self.trials, skills=len(self.skills), may_stop=may_stop)

    def plain(self) -> dict[str, Any]:
        """The campaign as JSON values for `from_plain`, without its folder.

        Scores, `race` and `expect.by` are left out at their defaults, so that hashes of older campaigns stay the same.
        """
        values = {key: value for key, value in asdict(self).items() if key not in ("vary", "folder", "scores", "race")}
        values["skills"] = list(self.skills)
        values["expect"] = {k: v for k, v in values["expect"].items() if (k, v) != ("by", "rate")}
        values |= {"scores": list(self.scores)} if self.scores else {}
        values |= {"race": asdict(self.race)} if self.race else {}
        return {**values, "vary": {name: axis.plain() for name, axis in self.vary.items()}}

    @classmethod
    def from_plain(cls, values: Mapping[str, Any], folder: Path = Path()) -> CampaignSpec:
        """The inverse of `plain`, for checked values."""
        axes = {name: parse_axis(value, name) for name, value in values["vary"].items()}
        stop, expect = Stop(**values["stop"]), Expect(**values["expect"])
        race = RaceKeys(**values["race"]) if "race" in values else None
        rest = {k: v for k, v in values.items() if k not in ("vary", "stop", "race", "expect", "skills", "scores")}
        skills, scores = tuple(values["skills"]), tuple(values.get("scores", ()))
        return cls(**rest, skills=skills, scores=scores, vary=axes, stop=stop, race=race, expect=expect, folder=folder)

    @classmethod
    def from_toml(cls, path: Path, params: type | None = None) -> CampaignSpec:
        """Read and check a campaign file.

        Raises:
            InputError: what is wrong and where, as "file: section.key".
            UnknownName: there is no such world or score.
        """
        refuse_other(path, "campaign")
        return cls.from_table(read_toml(path), path, params)

    @classmethod
    def from_table(cls, table: Mapping[str, Any], path: Path, params: type | None = None) -> CampaignSpec:
        """Check the keys of a campaign file.

        Args:
            table: keys and values as in campaign.toml.
            path: their file, for errors; relative paths start in its folder.
            params: the world's parameter dataclass; None looks it up in the registry.

        Raises:
            InputError, UnknownName: as `from_toml`.
        """
        from skillframe.extend.registry import registry

        file = build(_File, table, f"{path}: campaign")
        known = quantities(params or registry().world(place_of(file.world, path.parent)).params)
        _check_numbers(file, path)
        if not file.skills:
            raise InputError(f"{path}: skills", "is empty", "name at least one skill file")
        entries = []
        for i, text in enumerate(file.skills):
            try:
                entries.append(parse_source(text, path.parent))
            except InputError as error:
                where = f"{path}: skills[{i}]"
                raise InputError(where, f"{error.where!r} {error.problem}", error.fix) from None
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
        for i, name in enumerate(file.scores):
            registry().score(name)
            if file.scores.index(name) != i:
                raise InputError(f"{path}: scores[{i}]", f"{name!r} is named twice", "name it once")
        given = flatten(file.vary, f"{path}: vary")
        vary = {name: _axis(name, value, known, file, path) for name, value in given.items()}
        fixed = {
            name: _fixed(name, value, known, given, path) for name, value in flatten(file.set, f"{path}: set").items()
        }
        values = {
            k: getattr(file, k) for k in ("seed", "trials", "robot", "world", "skills", "coc", "duration_s", "scores")
        }
        spec = cls(**values, name=file.name or path.stem, vary=vary, fixed=fixed, stop=file.stop, race=file.race,
                   expect=file.expect, folder=path.parent)  # fmt: skip
        _check_designs(spec, path)
        return spec


def name_of(robot: str) -> str:
    """A robot's name from a name, a folder, or the robot.toml in it."""
    return robot.removesuffix("/robot.toml").rsplit("/", 1)[-1]


def place_of(world: str, folder: Path) -> str:
    """A campaign file's world for the registry: a name, or a path."""
    return str(folder / world) if world.endswith(".toml") else world


def flatten(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Quantities of a table, whether written as "start.tilt_y", as start.tilt_y or under [vary.start].

    Raises:
        InputError: one is written twice.
    """
    flat: dict[str, Any] = {}
    for key, value in table.items():
        grouped = "." not in key and isinstance(value, Mapping) and not {*KINDS} & {*value}
        for name, content in {f"{key}.{inner}": v for inner, v in value.items()}.items() if grouped else [(key, value)]:
            if name in flat:
                raise InputError(f"{where}.{name}", "is written twice", "keep one of the two")
            flat[name] = content
    return flat


def _check_numbers(file: _File, path: Path) -> None:
    width, rate = file.stop.interval_width, file.expect.rate
    checks = [
        ("seed", file.seed, file.seed >= 0, "give zero or more"),
        ("trials", file.trials, 1 <= file.trials <= 10_000_000, "give 1 to 10000000"),  # more would exceed the memory
        ("stop.interval_width", width, width is None or 0.0 < width < 1.0, "give a number between 0 and 1"),
        ("expect.rate", rate, rate is None or 0.0 <= rate <= 1.0, "give a number from 0 to 1"),
    ]
    for key, value, good, fix in checks:
        if not good:
            raise InputError(f"{path}: {key}", f"is {value}", fix)
    if file.race is not None:
        if file.race.every < 1:
            raise InputError(
                f"{path}: race.every", f"is {file.race.every}", "give the trials between two tests, one or more"
            )
        if not 0.0 < file.race.alpha < 0.5:
            raise InputError(f"{path}: race.alpha", f"is {file.race.alpha}", "give a number between 0 and 0.5")
        if len(file.skills) < 2:
            raise InputError(
                f"{path}: race", "has one skill, which nothing can beat", "name a second one, or leave it out"
            )
        if file.stop.interval_width is not None:
            raise InputError(
                f"{path}: race",
                "and [stop] interval_width would both say when the campaign ends",
                "keep one of the two",
            )
    require_within(file.duration_s, file.duration_s, DURATION.unit, DURATION.range, f"{path}: duration_s")


def _known(name: str, known: Mapping[str, Quantity], where: str) -> Quantity:
    if name not in known:
        raise InputError(where, str(unknown(name, known)))
    return known[name]


def _axis(name: str, value: Any, known: Mapping[str, Quantity], file: _File, path: Path) -> Axis:
    where = f"{path}: vary.{name}"
    quantity = _known(name, known, where)
    axis = parse_axis(_numbers_in_si(quantity, value, where), where)
    if axis.kind == "values" and len(axis.numbers) != file.trials:
        raise InputError(where, f"{len(axis.numbers)} values for {file.trials} trials", "give one value per trial")
    typed = (typed_value(quantity, v, f"{where}.{axis.kind}[{i}]") for i, v in enumerate(axis.numbers))
    return Axis(kind=axis.kind, numbers=tuple(typed))


def _numbers_in_si(quantity: Quantity, content: Any, where: str) -> Any:
    """An axis as typed, with its texts that carry a unit ("8mm") as SI numbers."""
    if isinstance(content, Mapping):
        return {key: _numbers_in_si(quantity, value, f"{where}.{key}") for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_numbers_in_si(quantity, value, f"{where}[{i}]") for i, value in enumerate(content)]
    return in_si(content, quantity.kind, quantity.unit, where)


def _fixed(name: str, value: Any, known: Mapping[str, Quantity], varied: Mapping[str, Any], path: Path) -> Value:
    where = f"{path}: set.{name}"
    quantity = _known(name, known, where)
    if name in varied:
        raise InputError(where, "is both fixed and varied", "keep one of the two")
    fixed: Value = typed_value(quantity, value, where)
    return fixed


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
