"""Records of what is made of skills and runs: exporters, scores, files, report sections, plots, published results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from skillframe.errors import UnknownName

if TYPE_CHECKING:
    from pathlib import Path

    from skillframe.demonstration.record import Demonstration
    from skillframe.frames import Float

Axes = Literal["base", "tool"]  #: in which a direction is fixed
STROKES = ("c1", "c2", "c3", "s4")


class Illustration(NamedTuple):
    """One picture: a title, a caption, and the drawing as SVG text with its `xmlns`, without which no page shows it."""

    title: str
    caption: str
    svg: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingImpedance:
    """One phase of a skill as a moving impedance, in the axes of an exporter.

    Attributes:
        axes: axes of the arrays below.
        center: (3,) centre of compliance in the tool frame [m].
        twist: (6,) velocity of the desired pose, linear first [m/s, rad/s].
        stiffness, damping: (6, 6), linear first [N/m, Nm/rad; Ns/m, Nms/rad].
        lead_force, lead_torque: largest push, which limits the lead of the desired pose [N, Nm].
        stop: when the phase ends, as in the skill file.
    """

    axes: Axes
    center: Float
    twist: Float
    stiffness: Float
    damping: Float
    lead_force: float
    lead_torque: float
    stop: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExporterType:
    """A format of another controller, written by `skillframe export`: settings for a phase, or a program for a skill.

    Attributes:
        name: as written after `--to`.
        summary: one line for listings.
        contract: see `skillframe.extend.records.SkillType`.
        axes: axes of the phase's arrays: the robot's base, or the tool at the start of the phase; None for a program.
        checked: the controller's version, or repository and commit, that names and types were checked against.
        notes: lines to read before using the settings; printed, and written into the file.
        write: `write(phase, lines)` returns the text of the file. `lines` describe the skill, its centre, `checked` and
            `notes`, and become comments if the file can hold any. Raises `InputError` if the controller cannot run the
            phase. For a program, `write(document, robot, lines)` gets the whole skill, a checked document, and a
            `skillframe.robot.spec.RobotSpec`.
    """

    name: str
    summary: str
    contract: str = ""
    axes: Axes | None
    checked: str
    notes: tuple[str, ...] = ()
    write: Callable[..., str]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreType:
    """A figure of a run, such as its settling time.

    Attributes:
        name: letters, digits and underscores; the column of results.csv is `score.NAME`.
        summary: one line for listings and reports.
        contract: see `skillframe.extend.records.SkillType`.
        unit: of the figure, SI: "s", "N", "1".
        compute: the figure from a trial's `skillframe.execution.trace.Trace`, sampled at 100 Hz in a campaign and at
            `--rate` in `skillframe run`. A number, or NaN for a trial without such a figure. It must depend on the
            trace alone.
    """

    name: str
    summary: str
    contract: str = ""
    unit: str
    compute: Callable[[Any], float]


class Grid(NamedTuple):
    """A table on a page: headings, rows of cells, and a caption."""

    head: Sequence[object]
    rows: Sequence[Sequence[object]]
    caption: str = ""


def part_problem(part: object) -> str:
    """What is wrong with a part of a section, or "" for text, a `Grid` or an `Illustration`."""
    if isinstance(part, Grid):
        odd = [len(row) for row in part.rows if len(row) != len(part.head)]
        return f"a row of its table has {odd[0]} cells, and its head {len(part.head)}" if odd else ""
    if isinstance(part, str | Illustration):
        return ""
    return f"it gave {type(part).__name__}, not text, Grid or Illustration"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFiles:
    """The files of a report's chapter.

    Attributes:
        title: of the chapter.
        files: path of each by its name in the folder: "results.csv", "traces/00003_v.skill.json.npz"; of a
            run, "run.npz".
        used: names of files that were used, so that the page can list them.
    """

    title: str
    files: Mapping[str, Path]
    used: list[str] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        """Sorted names of the files."""
        return sorted(self.files)

    def path(self, name: str) -> Path:
        """Path of a file, which is marked as used.

        Raises:
            UnknownName: the chapter has no such file.
        """
        if name not in self.files:
            raise UnknownName("file of the report", name, self.files)
        if name not in self.used:
            self.used.append(name)
        return self.files[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionType:
    """A section of a report, by `make` or by `draw`.

    Attributes:
        name: for listings, and in the section's address on the page.
        summary: one line for listings.
        contract: see `skillframe.extend.records.SkillType`.
        title: the heading.
        order: position on the page, ascending; equal ones by name.
        make: the parts of the section from the chapter's files alone; an empty list leaves it out. A part is a
            paragraph of plain text, a `Grid`, or an `Illustration`.
        draw: the section as HTML, from its page of skillframe-reports; "" leaves it out. The HTML is not checked, and
            an error ends the report.
    """

    name: str
    summary: str
    contract: str = ""
    title: str
    order: int = 50
    make: Callable[[ReportFiles], Sequence[str | Grid | Illustration]] | None = None
    draw: Callable[[Any], str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderType:
    """A kind of results folder whose report has a first page of its own, and a campaign inside as its chapter.

    Attributes:
        name: of the kind.
        summary: one line for listings.
        contract: see `skillframe.extend.records.SkillType`.
        title: of the first page, one word; in lower case it is the address on the page.
        holds: `holds(folder)` returns whether a folder is of this kind.
        live: `live(folder)` returns the campaign's folder that receives trials while it is being made.
        read: `read(folder)` returns an object with `folder`, its name; `evidence`, the name of the campaign's folder
            inside it that makes the chapter; `hashes`, (file, sha256) of what the first page was made from; and
            `wrong`, sentences on contradictions between its files.
        page: `page(chapter)` returns the first page as HTML. The object that was read is `chapter.content`.
    """

    name: str
    summary: str
    contract: str = ""
    title: str
    holds: Callable[[Path], bool]
    live: Callable[[Path], Path]
    read: Callable[[Path], Any]
    page: Callable[[Any], str]


class Moment(NamedTuple):
    """A run at a time: its trace, the time [s] or None for its end, and whether the whole scene is shown."""

    trace: Any
    time: float | None
    far: bool


class Explanation(NamedTuple):
    """A skill explained: a title, its document, the document in words, and pictures."""

    title: str
    document: dict[str, Any]
    words: Sequence[str]
    pictures: Sequence[Illustration]


class Segmentation(NamedTuple):
    """Demonstrations cut into phases: the policy's document, its words, and the command line that made it."""

    document: dict[str, Any]
    words: Sequence[str]
    demonstrations: Sequence[Demonstration]
    command: str


def no_progress(done: float, total: float) -> None:
    """Ignore progress."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputType:
    """A kind of file that is written of a result: a page, a video, a picture.

    Attributes:
        name: of the kind; for a run, also the option of `skillframe run`.
        summary: one line for listings, and the help of the option.
        contract: see `skillframe.extend.records.SkillType`.
        of: its input and user: "run", a `skillframe.execution.trace.Trace`, for `skillframe run --NAME FILE` and
            `SingleRun.write`; "moment", a `Moment`, for `SingleRun.picture`; "results", paths of campaign folders and
            traces, for `skillframe.report`; "skill", an `Explanation`, for `skillframe show --page`; "segmentation",
            a `Segmentation`, for `skillframe segment --page`; "scene", a `skillframe.world.scene.Scene`, for
            `skillframe worlds --pictures`.
        endings: of the file's name, the usual one first; () if `check` decides.
        check: `check(path)` refuses a file that could not be written, before the work for it.
        write: `write(result, path, progress)` writes the file as a whole, and returns a note to print, or "". It calls
            `progress(done, total)`.
    """

    name: str
    summary: str
    contract: str = ""
    of: Literal["run", "moment", "results", "skill", "segmentation", "scene"]
    endings: tuple[str, ...] = ()
    check: Callable[[Path], None] | None = None
    write: Callable[[Any, Path, Callable[[float, float], None]], str]


@dataclass(frozen=True, slots=True, kw_only=True)
class RequirementType:
    """Something outside Python that a plug-in needs, such as a program or a driver: a line of `skillframe doctor`.

    Attributes:
        name: of it.
        summary: what does not work without it.
        contract: see `skillframe.extend.records.SkillType`.
        find: its place or version; "" if it is missing.
        fix: the command that installs it.
    """

    name: str
    summary: str
    contract: str = ""
    find: Callable[[], str]
    fix: Callable[[], str]


class Curve(NamedTuple):
    """One curve: its name for the legend (or ""), its values (T,), the class of its stroke."""

    name: str
    values: Float
    stroke: str


class TimePlot(NamedTuple):
    """A plot over the time of a trace.

    Attributes:
        title: above it.
        unit: of its values.
        curves: each with a value at every sample of the trace.
        caption: below it.
        events: whether the run's events are marked.
    """

    title: str
    unit: str
    curves: Sequence[Curve]
    caption: str = ""
    events: bool = True


def actuator_curves(names: Sequence[str], values: Float, style: str) -> list[Curve]:
    """A curve for each actuator's column of values (T, k). `style` begins with "line". Names may be fewer."""
    return [
        Curve(name=names[i] if i < len(names) else "", values=values[:, i],
              stroke=style.replace("line", f"line {STROKES[i % len(STROKES)]}", 1))
        for i in range(values.shape[1])
    ]  # fmt: skip


Verdict = Literal["pass", "fail", "reported"]  #: of a row
Setting = float | int | str | bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RowRun:
    """How to compute a published result.

    Attributes:
        settings: the row's own, as changed by `--set`.
        seed: of everything random.
        quick: fewer trials, for a first look and for automatic checks.
        tell: receives messages on the progress.
    """

    settings: Mapping[str, Any]
    seed: int = 0
    quick: bool = False
    tell: Callable[[str], None] = print

    def count(self, full: int, quick: int) -> int:
        """A number: `quick` for a first look, otherwise `full`."""
        return quick if self.quick else full


@dataclass(frozen=True, slots=True, kw_only=True)
class RowResult:
    """The computed counterpart of a published result.

    Attributes:
        ours: the computed figure, in the words of the published one.
        verdict: by the row's threshold; "reported" without one, or if it was not computed.
        difference: how and why it differs from the paper, or why it was not computed; "" if it does not.
        computed: False if there is no computed figure, for the reason in `difference`.
        values: figures by name, for scripts.
        head, rows: the table behind the figure.
        pictures: the paper's figures, drawn from the computed data.
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
    """A published result and its computation: a row of `skillframe reproduce`.

    Attributes:
        name: the row's number, "13".
        summary: the claim, one line.
        published: the published figure.
        source: where it was published.
        bar: the threshold of "pass"; "" if the result is only reported.
        frozen: whether all constants of the method were fixed before this row's world or figure was seen, so that the
            result is a prediction; False: method and worlds were developed together, with fresh seeds for the figure.
        calibrated: what was chosen knowing the published figure; "" if nothing was.
        weak: why reaching the threshold would show nothing; such a row can fail, otherwise it is "reported".
        settings: what `--set` can change, with its default [SI units, unless the name says otherwise].
        group: rows of one group run one after another in one process, so that they can share costly work.
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
