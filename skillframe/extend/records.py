"""Records that plug-ins yield: frozen, with a name, a summary and factories, so that entry modules stay light."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from skillframe.extend.outputs import Illustration

if TYPE_CHECKING:
    from pathlib import Path

    from skillframe.demonstration.record import Demonstration
    from skillframe.demonstration.table import Table
    from skillframe.frames import Float
    from skillframe.skill import Skill
    from skillframe.world.scene import Scene

Document = dict[str, Any]
"""A skill file's content as JSON values; `skillframe.document.file` lists its keys."""


@dataclass(frozen=True, slots=True)
class Lazy:
    """A factory whose module is imported when it is called.

    Attributes:
        place: "module:function", as in entry points.
    """

    place: str

    def load(self) -> Any:
        """Import the object at `place`. Raises `ImportError` or `AttributeError` if there is none."""
        module, _, name = self.place.partition(":")
        return getattr(import_module(module), name)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the object at `place`."""
        return self.load()(*args, **kwargs)


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnOptions:
    """Points and axes of learning, set by the command line. See the contract's "four points".

    Attributes:
        at: learning point: "x,y,z" in the tool frame, a frame's name, or None for the recorded tool point.
        hand: point at which torque work is taken; None for the demonstration's own `hand`, or the learning point.
        axes: "base", or "phase_start": the tool's orientation at the start of the phase.
        settings: the learner's own settings by name, checked by the learner.
        toward: (3,) known direction of the task, in `axes`: a learner that finds no direction to push in may use it,
            and reports that.
        straight: whether the part is known to go straight there. A demonstrated rotation then only aligned the part, so
            a learner makes it compliant and does not push it.
    """

    at: str | None = None
    hand: str | None = None
    axes: str = "base"
    settings: Mapping[str, Any] = field(default_factory=dict)
    toward: tuple[float, float, float] | None = None
    straight: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Stalled:
    """Where a skill stalls, and what is known of the way on.

    A kind of skill is an exception strategy, which finds the way on, if its record has `exception`. Its skill runs as
    any other, with three agreements:

    - it starts pressed against something, or just above it, and the first pose that it observes is the one to search
      about: the nominal axis at the height of the stall, in the nominal orientation, wherever the tool has slid to;
    - SUCCESS means that the way on is found: the stalled skill continues from there;
    - FAILURE means that it is not, with the reason in words.

    Attributes:
        way: (3,) unit vector along which the other skill continues, in base axes.
        radius: largest distance of the way on from the nominal axis [m].
        near: its likely distance [m]; None: all distances are equally likely.
        tilt: largest angle of the fixture's orientation [rad].
        friction: between tool and fixture, as stated.
        frame: the `frame` block of the document that will hold the body.
        options: points and axes of learning, and the remaining settings.
        blind: demonstrations of a search, if any.
    """

    way: tuple[float, float, float]
    radius: float
    tilt: float
    friction: float
    frame: Document
    options: LearnOptions
    blind: Sequence[Demonstration] = field(default_factory=tuple)
    near: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SkillType:
    """A kind of skill.

    Attributes:
        name: as written in skill files and on the command line.
        summary: one line for listings.
        contract: the version of the plug-in contract that the record was written for, "0.2"; "" for the entry module's
            `skillframe_contract` (`skillframe.extend.contract`). Every record has this field.
        version: of the type's part of the skill file; a newer file is refused.
        build: a runnable skill from a checked skill document.
        check: raises `InputError` naming the key if the kind's part of a document is invalid; None: only the common
            layout is checked when a file is read.
        learn: a skill document's body (`frame`, `phases`, ...) from demonstrations; None if it is not learned.
        settings: returns the dataclass whose fields `--set` changes when it is learned, for listings; None: unknown.
        describe: the document in words, a line each.
        advice: how certain the learned skill is, and what to do next, a sentence each; None: `learn` prints all words.
        explain: pictures for the report, drawn from the document alone; None if there are none.
        area: (2, 3) corners of the box that a run may reach, relative to its start and in the axes of the document's
            `frame` [m]; a box outside the robot's workspace is refused before the run. None: unknown.
        speed: largest speed of a document's skill in contact [m/s], which sets how much longer it takes on slow arms;
            None for one that does not move, or if unknown.
        example: a small valid document to try the type with, for a type that is not learned, or that the example
            demonstrations of `skillframe_testkit.suites` do not suit.
        exception: a document's body for finding the way on where another skill has stalled (`Stalled`); None:
            this kind is no exception strategy.
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
    """A method that cuts demonstrations into phases.

    Attributes:
        fit: `fit(demonstrations, phases or None, settings)` returns the phase model with boundaries and labels.
    """

    name: str
    summary: str
    contract: str = ""
    version: int = 1
    fit: Callable[[Sequence[Demonstration], int | None, Mapping[str, Any]], Document]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoordinatorType(SkillType):
    """A skill for several arms: its observations and commands have a dimension (N, arms, ...).

    Attributes:
        centers: (arms, 3) centres of compliance in each arm's tool frame [m] from a document; None: every arm has the
            document's one.
    """

    centers: Callable[[Document], Float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldType:
    """A world that skills run in.

    Attributes:
        params: a frozen dataclass type whose fields, in SI units with defaults, `--set world.KEY` can change.
        build: the scene (fixtures, tool, start, goal) from one value of `params`.
    """

    name: str
    summary: str
    contract: str = ""
    version: int = 1
    params: type
    build: Callable[[Any], Scene]


def make_scene(record: WorldType, params: Mapping[str, Any]) -> Scene:
    """The scene of a world with some parameters set, which are checked.

    Raises:
        InputError: an unknown parameter (with a suggestion) or one out of range.
    """
    from skillframe.config import build

    values: Any = build(record.params, params, f"world.{record.name}")
    scene = record.build(values)
    return replace(scene, params={**scene.params, **asdict(values)})


@dataclass(frozen=True, slots=True, kw_only=True)
class TeacherType:
    """A simulated teacher, who demonstrates the task of a world.

    Attributes:
        name: of the teacher, and the `kind` of its settings.
        summary: one line for listings.
        contract: see `SkillType`.
        usual: `usual(scene)` returns its default settings in a world, a dataclass.
        record: `record(model, scene, settings, *, count, seed, draws, progress, watch)` returns a
            `skillframe.Recording`. It also takes `rate_hz`, the sample rate, and has a default for it.
    """

    name: str
    summary: str
    contract: str = ""
    usual: Callable[[Scene], Any]
    record: Callable[..., Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReaderType:
    """A demonstration file format.

    Attributes:
        suffixes: file name endings that select it (".csv").
        read: `read(path, options)` returns the demonstration or raises `InputError`.
        write: the inverse, or None.
        table: `table(path, options)` returns the file as a table, for `--layout auto`; None: it has none.
        topics: whether it takes the settings of topics of a ROS bag, which are refused for other formats.
        claims: `claims(path)` returns whether a file or folder is of this format whatever its ending, or raises
            `InputError` for a part of a recording that cannot be read by itself; None: the ending decides.
        write_set: `write_set(demonstrations, folder)` writes several into one data set, for names without an ending;
            None: the format has no data sets.
        check_set: `check_set(folder)` raises `InputError` if `write_set` could not write there.
    """

    name: str
    summary: str
    contract: str = ""
    suffixes: tuple[str, ...]
    read: Callable[[Path, Mapping[str, Any]], Demonstration]
    write: Callable[[Demonstration, Path], None] | None = None
    table: Callable[[Path, Mapping[str, Any]], Table] | None = None
    topics: bool = False
    claims: Callable[[Path], bool] | None = None
    write_set: Callable[[Sequence[Demonstration], Path], None] | None = None
    check_set: Callable[[Path], None] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditType:
    """A check of demonstrations, which `learn` runs on its input.

    Attributes:
        warnings: `warnings(demonstrations)` returns a sentence for everything suspicious, with its file and the
            evidence. Invalid recordings are refused before, at reading.
    """

    name: str
    summary: str
    contract: str = ""
    warnings: Callable[[Sequence[Demonstration]], list[str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldFileType:
    """A kind of file that describes a world, selected by its path wherever a world is named.

    Attributes:
        name: of the kind.
        summary: one line for listings.
        contract: see `SkillType`.
        world: `world(path)` returns the world of a file whose name ends with `.toml`.
        files: `files(path)` returns the path of each other file that it names, by that name, for campaigns to copy.
        refuse: `refuse(name)` raises `InputError` for a name that is mistaken for a world, such as a part's file.
        found: `found(path, say)` returns what is found in a file, in sentences and as JSON values, for `skillframe
            worlds FILE`; `say` takes messages on progress.
    """

    name: str
    summary: str
    contract: str = ""
    world: Callable[[Path], WorldType]
    files: Callable[[Path], Mapping[str, Path]]
    refuse: Callable[[str], None] | None = None
    found: Callable[[Path, Callable[[str], None]], tuple[Sequence[str], Mapping[str, Any]]] | None = None
