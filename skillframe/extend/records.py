"""What plug-ins yield: frozen records with a name, a summary and factories, so that an entry module stays light."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from skillframe.extend.hardware import DriveType as DriveType
from skillframe.extend.hardware import RobotType as RobotType
from skillframe.extend.outputs import ExporterType as ExporterType
from skillframe.extend.outputs import Grid as Grid
from skillframe.extend.outputs import MovingImpedance as MovingImpedance
from skillframe.extend.outputs import ReportFiles as ReportFiles
from skillframe.extend.outputs import ScoreType as ScoreType
from skillframe.extend.outputs import SectionType as SectionType
from skillframe.extend.stalled import Stalled as Stalled

if TYPE_CHECKING:
    from pathlib import Path

    from skillframe.demonstration.record import Demonstration
    from skillframe.demonstration.table import Table
    from skillframe.frames import Float
    from skillframe.skill import Skill
    from skillframe.world.scene import Scene

Document = dict[str, Any]
"""A skill file's content as plain JSON values; its keys are in the contract and `skillframe.document.file`."""


@dataclass(frozen=True, slots=True)
class Lazy:
    """A factory whose module is imported when it is called, so that listing what exists loads no library.

    Attributes:
        place: "module:function", as entry points are written.
    """

    place: str

    def load(self) -> Any:
        """What stands at the place. Raises `ImportError` or `AttributeError` if nothing does."""
        module, _, name = self.place.partition(":")
        return getattr(import_module(module), name)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call what stands at the place."""
        return self.load()(*args, **kwargs)


class Illustration(NamedTuple):
    """One picture that explains a skill: a title, a caption in plain words, and the drawing as SVG text."""

    title: str
    caption: str
    svg: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnOptions:
    """The points and axes of learning that the command line sets. See the contract's "four points".

    Attributes:
        at: where it is learned: "x,y,z" in the tool frame, a frame's name, or None for the recorded tool point.
        hand: where torque work is taken; None for the demonstration's own `hand`, else the learning point.
        axes: "base", or "phase_start": the tool's attitude at the start of the phase.
        settings: the learner's own settings by name, checked by the learner.
        toward: (3,) where the part is to go, in `axes`, if that is known: a learner that finds no direction to push in
            may take it, and says so.
        straight: whether it is known that the part goes straight there. A turn that was shown then only aligned the
            part: a learner gives way to such turns, and does not push them.
    """

    at: str | None = None
    hand: str | None = None
    axes: str = "base"
    settings: Mapping[str, Any] = field(default_factory=dict)
    toward: tuple[float, float, float] | None = None
    straight: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SkillType:
    """A kind of skill.

    Attributes:
        name: as written in skill files and on the command line.
        summary: one line for listings.
        contract: the version of the plug-in contract that the record was written for, "0.2"; "" for what the entry
            module's `skillframe_contract` says (`skillframe.extend.contract`). Every record has this field.
        version: of the type's part of the skill file; a newer file is refused.
        build: a runnable skill from a checked skill document.
        check: raises `InputError` naming the key if the kind's part of a document is not as it should be; None: no more
            than the common layout is checked when a file is read.
        learn: a skill document's body (`frame`, `phases`, ...) from demonstrations; None if it is not learned.
        settings: gives the dataclass whose fields `--set` changes when it is learned, for listings; None: not known.
        describe: the document in words, a line each.
        advice: how sure what was learned is, and what to do next, a sentence each; None: `learn` tells all its words.
        explain: pictures for the report, drawn from the document alone; None if there are none.
        area: (2, 3) corners of the box that a run may reach, relative to its start and in the axes of the document's
            `frame` [m]; a box that leaves the robot's workspace is refused before the run. None: not known.
        speed: [m/s] at which a document's skill moves in contact at most, from which follows how many times longer it
            takes on arms that must move slowly; None for one that moves nothing, or if it is not known.
        example: a small valid document to try the type with, for a type that is not learned, or that the example
            demonstrations of `skillframe.testing` do not suit.
        exception: a document's body for finding the way on where another skill has stalled, as `extend.stalled` says;
            None: this kind is no exception strategy.
    """

    name: str
    summary: str
    contract: str = ""
    version: int = 1
    build: Callable[[Document], Skill]
    check: Callable[[Document], None] | None = None
    learn: Callable[[Sequence[Demonstration], LearnOptions], Document] | None = None
    settings: Callable[[], type] | None = None
    describe: Callable[[Document], list[str]] | None = None
    advice: Callable[[Document], tuple[str, str]] | None = None
    explain: Callable[[Document], list[Illustration]] | None = None
    area: Callable[[Document], Float] | None = None
    speed: Callable[[Document], float | None] | None = None
    example: Callable[[], Document] | None = None
    exception: Callable[[Stalled], Document] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmenterType:
    """A way of cutting demonstrations into phases.

    Attributes:
        fit: `fit(demonstrations, phases or None, settings)` gives the phase model with boundaries and labels.
    """

    name: str
    summary: str
    contract: str = ""
    version: int = 1
    fit: Callable[[Sequence[Demonstration], int | None, Mapping[str, Any]], Document]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoordinatorType(SkillType):
    """A skill for several arms: its observations and commands carry a dimension (N, arms, ...).

    Attributes:
        centers: (arms, 3) centres of compliance in each arm's tool frame [m] from a document; None: every arm has the
            document's one.
    """

    centers: Callable[[Document], Float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldType:
    """A world that skills run in.

    Attributes:
        params: a frozen dataclass type whose fields, in SI units with defaults, are what `--set world.KEY` can change.
        build: the scene (fixtures, tool, start, goal) from one value of `params`.
    """

    name: str
    summary: str
    contract: str = ""
    version: int = 1
    params: type
    build: Callable[[Any], Scene]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReaderType:
    """A demonstration file format.

    Attributes:
        suffixes: file name endings that select it (".csv").
        read: `read(path, options)` gives the demonstration or raises `InputError`.
        write: the inverse, or None.
        table: `table(path, options)` gives the file as a table, for what `--columns auto` proposes; None: it has none.
    """

    name: str
    summary: str
    contract: str = ""
    suffixes: tuple[str, ...]
    read: Callable[[Path, Mapping[str, Any]], Demonstration]
    write: Callable[[Demonstration, Path], None] | None = None
    table: Callable[[Path, Mapping[str, Any]], Table] | None = None


Verdict = Literal["pass", "fail", "reported"]
Setting = float | int | str | bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RowRun:
    """How a published result is to be computed now.

    Attributes:
        settings: the row's own, with what `--set` changed.
        seed: everything random follows from it.
        quick: fewer trials, for a first look and for automatic checks.
        tell: is told in words what happens.
    """

    settings: Mapping[str, Any]
    seed: int = 0
    quick: bool = False
    tell: Callable[[str], None] = print

    def count(self, full: int, quick: int) -> int:
        """How many of something: `quick` of them for a first look, else `full`."""
        return quick if self.quick else full


@dataclass(frozen=True, slots=True, kw_only=True)
class RowResult:
    """What computing a published result gave.

    Attributes:
        ours: our figure, in the words of the published one.
        verdict: of the row's threshold; "reported" where there is none, or where it could not be computed.
        difference: by how much it differs from the paper and why, or why it was not computed; "" if it does not.
        computed: False if there is no figure of ours, for the reason given in `difference`.
        values: figures by name, for scripts.
        head, rows: a table that stands behind the figure.
        pictures: the paper's figures, drawn from our data.
    """

    ours: str
    verdict: Verdict = "reported"
    difference: str = ""
    computed: bool = True
    values: Mapping[str, float] = field(default_factory=dict)
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    pictures: Sequence[Illustration] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RowType:
    """A published result, and how ours is computed: a row of `skillframe reproduce`.

    Attributes:
        name: the row's number, "13".
        summary: what is claimed, one line.
        published: the published figure.
        source: where it was published.
        bar: the threshold: what ours must be for "pass"; "" if it is reported only.
        frozen: every constant of the method was fixed before this row's world or figure was looked at, so ours is a
            prediction; False says that method and worlds were developed together, with fresh seeds for the figure.
        calibrated: what was chosen with the published figure in sight; "" if nothing was.
        weak: why reaching the threshold would show nothing, in words; such a row can fail, else it is "reported".
        settings: what `--set` can change, with its value as shipped [SI units, unless the name says otherwise].
        group: rows of one group are computed one after another in one process, so that they can share what is costly.
        topic: a word or two under which the page lists the row; "" takes the group.
        run: computes it; slow, and not in the process of the command.
    """

    name: str
    summary: str
    contract: str = ""
    published: str
    source: str
    bar: str = ""
    frozen: bool = False
    calibrated: str = ""
    weak: str = ""
    settings: Mapping[str, Setting] = field(default_factory=dict)
    group: str = ""
    topic: str = ""
    run: Callable[[RowRun], RowResult]
