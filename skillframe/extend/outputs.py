"""Records of what is made of skills and runs: exporters, scores, sections of a report, and what they are given."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from skillframe.errors import UnknownName

if TYPE_CHECKING:
    from pathlib import Path

    from skillframe.extend.records import Illustration
    from skillframe.frames import Float

Axes = Literal["base", "tool"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MovingImpedance:
    """One phase of a skill as a moving impedance, in the axes that an exporter asked for.

    Attributes:
        axes: what the arrays below are expressed in.
        center: (3,) centre of compliance in the tool frame [m].
        twist: (6,) velocity of the desired pose, linear first [m/s, rad/s].
        stiffness, damping: (6, 6), linear first [N/m, Nm/rad; Ns/m, Nms/rad].
        lead_force, lead_torque: how much the desired pose may lead: largest push [N, Nm].
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
    """A format of another controller's settings, written by `skillframe export`.

    Attributes:
        name: as written after `--to`.
        summary: one line for listings.
        contract: see `records.SkillType`.
        axes: what the arrays of the phase are to be expressed in: the robot's base, or the tool as it stands at the
            start of the phase.
        checked: the controller's version, or repository and commit, that names and types were checked against.
        notes: what must be known before the settings are used, a line each; printed, and among the lines of the file.
        write: `write(phase, lines)` gives the whole text of the file. `lines` say what the skill does, where its centre
            is, what `checked` and `notes` say; they go into the file as comments, if it can hold any. Raises
            `InputError` if the controller cannot do what the phase asks for.
    """

    name: str
    summary: str
    contract: str = ""
    axes: Axes
    checked: str
    notes: tuple[str, ...] = ()
    write: Callable[[MovingImpedance, Sequence[str]], str]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreType:
    """A figure of a run, such as its settling time.

    Attributes:
        name: letters, digits and underscores; the column of results.csv is `score.NAME`.
        summary: one line for listings and reports.
        contract: see `records.SkillType`.
        unit: of the figure, SI: "s", "N", "1".
        compute: the figure from a trial's `skillframe.execution.trace.Trace`, sampled at 100 Hz in a campaign and at
            `--rate` in `skillframe run`. A number, or NaN for a trial that has no such figure. The same trace gives the
            same figure, whatever was computed before.
    """

    name: str
    summary: str
    contract: str = ""
    unit: str
    compute: Callable[[Any], float]


class Grid(NamedTuple):
    """A table on a page: headings, rows of cells, and a caption in plain words."""

    head: Sequence[object]
    rows: Sequence[Sequence[object]]
    caption: str = ""


def part_problem(part: object) -> str:
    """What is wrong with a part of a section, in words. "" if it is text, a `Grid` or an `Illustration`."""
    from skillframe.extend.records import Illustration

    if isinstance(part, Grid):
        odd = [len(row) for row in part.rows if len(row) != len(part.head)]
        return f"a row of its table has {odd[0]} cells, and its head {len(part.head)}" if odd else ""
    if isinstance(part, str | Illustration):
        return ""
    return f"it gave {type(part).__name__}, not text, Grid or Illustration"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFiles:
    """The files that a chapter of a report is made from.

    Attributes:
        title: of the chapter.
        files: where each lies, by its name in the folder: "results.csv", "summary.json", "traces/000003.npz".
        used: names that were asked for, so that the page can say what it was made from.
    """

    title: str
    files: Mapping[str, Path]
    used: list[str] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        """Sorted names of what there is."""
        return sorted(self.files)

    def path(self, name: str) -> Path:
        """Where a file lies. It is noted as used.

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
    """A section of a report.

    Attributes:
        name: for listings, and in the section's address on the page.
        summary: one line for listings.
        contract: see `records.SkillType`.
        title: the heading.
        make: the parts of the section from the chapter's files and nothing else; an empty list leaves it out. A part is
            a paragraph of plain text, a `Grid`, or an `Illustration`.
    """

    name: str
    summary: str
    contract: str = ""
    title: str
    make: Callable[[ReportFiles], Sequence[str | Grid | Illustration]]
