"""For plug-in authors: conformance suites to inherit, and small skills to test with.

Inherit and name what is to be checked::

    from skillframe.testing import SkillConformance

    class TestMySkill(SkillConformance):
        skill_type = "my_skill"

Run under pytest, the class finds the skill through the registry, as a user would, and checks the laws of the loop's
contract. The same checks, as functions, are in `skillframe.conformance`; `skillframe plugins check` runs them too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any, ClassVar

import numpy as np

from skillframe.conformance import beginning, running, skills, stalls
from skillframe.conformance.drives import check_drive
from skillframe.conformance.examples import example_demonstrations, random_observations
from skillframe.conformance.exporters import check_exporter
from skillframe.conformance.material import example_campaign, example_phase, example_trace
from skillframe.conformance.play import play
from skillframe.conformance.plugins import CHECKS
from skillframe.conformance.readers import check_reader, differences
from skillframe.conformance.robots import check_robot
from skillframe.conformance.scores import check_score
from skillframe.conformance.sections import check_section
from skillframe.conformance.segmenters import check_segmenter
from skillframe.conformance.skills import check_skill, example_document
from skillframe.conformance.worlds import check_world
from skillframe.demonstration.record import Demonstration
from skillframe.execution.trace import Trace
from skillframe.extend.records import Document, SkillType
from skillframe.extend.registry import registry
from skillframe.frames import Float, Pose
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons

__all__ = [
    "CoordinatorConformance", "DriveConformance", "ExporterConformance", "HoldSkill", "ReaderConformance",
    "RobotConformance", "ScoreConformance", "ScriptedSkill", "SectionConformance", "SegmenterConformance",
    "SkillConformance", "WorldConformance", "check_drive", "check_exporter", "check_reader", "check_robot",
    "check_score", "check_section", "check_segmenter", "check_skill", "check_world", "differences", "example_campaign",
    "example_demonstrations", "example_phase", "example_trace", "play", "random_observations",
]  # fmt: skip


def _demand(problems: Sequence[str]) -> None:
    if problems:
        raise AssertionError("\n".join(problems))


class SkillConformance:
    """Inherit, set `skill_type`, and pytest checks the skill.

    Attributes:
        skill_type: the name it is registered under.
        document: a skill document to try it with, or None.
        demonstrations: demonstrations to learn the document from, or None: the type's own `example`, or else the
            example demonstrations.
    """

    kind: ClassVar[str] = "skill"
    skill_type: ClassVar[str] = ""
    document: ClassVar[Document | None] = None
    demonstrations: ClassVar[Sequence[Demonstration] | None] = None
    _made: ClassVar[dict[tuple[str, str], tuple[SkillType, Document]]] = {}

    def _type(self) -> SkillType:
        record: SkillType = getattr(registry(), self.kind)(self.skill_type)
        return record

    def _document(self) -> Document:
        from skillframe.document.source import learned

        if self.document is not None:
            return self.document
        if self.demonstrations is not None:
            return learned(self._type(), self.demonstrations)
        record, key = self._type(), (self.kind, self.skill_type)
        if key not in self._made or self._made[key][0] is not record:  # once for all tests, as in `check_skill`
            self._made[key] = record, example_document(record)
        return deepcopy(self._made[key][1])

    def _check(self, check: Callable[[SkillType, Document], object]) -> None:
        _demand(list(check(self._type(), self._document())))  # type: ignore[call-overload]

    def test_is_discovered(self) -> None:
        """The registry knows the skill, from a plug-in that loaded without error."""
        assert registry().provider(self.kind, self.skill_type).error is None
        assert self._type().summary

    def test_builds(self) -> None:
        """Building gives a skill and leaves the document alone."""
        self._check(skills.builds)

    def test_answers_in_shape(self) -> None:
        """Commands have the contract's shapes, finite values, rotations and symmetric gains."""
        self._check(skills.answers_in_shape)

    def test_starts_without_a_bump(self) -> None:
        """The first command asks for the pose where the tool is, and for next to no force."""
        self._check(skills.starts_without_a_bump)

    def test_batched_rows_equal_single_trials(self) -> None:
        """Each row of a batch is commanded as the same trial would be alone."""
        self._check(skills.rows_equal_single_trials)

    def test_rows_are_independent(self) -> None:
        """What happens in other trials does not reach a trial."""
        self._check(skills.rows_are_independent)

    def test_repeats_with_its_seed(self) -> None:
        """The same seeds give exactly the same commands."""
        self._check(skills.repeats_with_its_seed)

    def test_ends_with_a_reason(self) -> None:
        """Status is one of three, and what has ended says why."""
        self._check(skills.ends_with_a_reason)

    def test_survives_json(self) -> None:
        """The document is plain JSON, and what is read back does the same."""
        self._check(skills.survives_json)

    def test_says_what_it_does(self) -> None:
        """The skill can be told in words, and its pictures are pictures."""
        self._check(skills.says_what_it_does)

    def test_answers_in_time(self) -> None:
        """A step is back before the loop needs it."""
        self._check(running.answers_in_time)

    def test_runs_for_two_seconds(self) -> None:
        """Nothing raises over 2000 ticks, and speeds and feed-forward stay within bounds."""
        self._check(running.runs_for_two_seconds)

    def test_leaves_nothing_behind(self) -> None:
        """It prints nothing, writes no file and runs no program."""
        self._check(running.leaves_nothing_behind)

    def test_remembers_little(self) -> None:
        """Memory does not grow with every tick."""
        self._check(running.remembers_little)

    def test_goes_by_time(self) -> None:
        """What it does goes by the observation's time, not by the count of ticks."""
        self._check(beginning.goes_by_time)

    def test_starts_again(self) -> None:
        """A second start gives the same run as the first."""
        self._check(beginning.starts_again)

    def test_restarts_some_trials(self) -> None:
        """Trials that restart do as after a start, and the others go on undisturbed."""
        self._check(beginning.restarts_some_trials)

    def test_tells_its_journal(self) -> None:
        """The journal gives times and words for every trial."""
        self._check(beginning.tells_its_journal)

    def test_finds_the_way_on(self) -> None:
        """Where it offers a search for where another skill stalls, that search is a document that runs."""
        self._check(stalls.finds_the_way_on)


class CoordinatorConformance(SkillConformance):
    """Inherit, set `skill_type` to the coordinator's name, and pytest checks it as a skill of several arms."""

    kind: ClassVar[str] = "coordinator"


class RecordConformance:
    """What the suites below share: the record's name stands in the attribute that is called as its kind."""

    kind: ClassVar[str] = ""

    def _record(self) -> Any:
        return getattr(registry(), self.kind)(getattr(self, self.kind))

    def _problems(self) -> list[str]:
        return CHECKS[self.kind](self._record())

    def test_is_discovered(self) -> None:
        """The registry knows it, from a plug-in that loaded without error."""
        assert registry().provider(self.kind, getattr(self, self.kind)).error is None
        assert self._record().summary

    def test_conforms(self) -> None:
        """It obeys the contract. What it does not obey is named."""
        _demand(self._problems())


class WorldConformance(RecordConformance):
    """Inherit, set `world`, and pytest checks its parameters, scene, tool and goal."""

    kind: ClassVar[str] = "world"
    world: ClassVar[str] = ""


class ReaderConformance(RecordConformance):
    """Inherit, set `reader`: what is written comes back, and what cannot be read is refused in words."""

    kind: ClassVar[str] = "reader"
    reader: ClassVar[str] = ""


class SegmenterConformance(RecordConformance):
    """Inherit, set `segmenter` (and `demonstrations`, if the examples do not suit): boundaries and labels fit them."""

    kind: ClassVar[str] = "segmenter"
    segmenter: ClassVar[str] = ""
    demonstrations: ClassVar[Sequence[Demonstration] | None] = None
    phases: ClassVar[int] = 2

    def _problems(self) -> list[str]:
        return check_segmenter(self._record(), self.demonstrations, self.phases)


class ExporterConformance(RecordConformance):
    """Inherit, set `exporter`: it writes finite numbers that follow from the phase, and refuses in words."""

    kind: ClassVar[str] = "exporter"
    exporter: ClassVar[str] = ""


class ScoreConformance(RecordConformance):
    """Inherit, set `score` (and `traces` of your own): a number for any trace, the same each time."""

    kind: ClassVar[str] = "score"
    score: ClassVar[str] = ""
    traces: ClassVar[Sequence[Trace] | None] = None

    def _problems(self) -> list[str]:
        return check_score(self._record(), self.traces)


class RobotConformance(RecordConformance):
    """Inherit, set `robot`: it loads, its dynamics are sound, and it stands still when told to."""

    kind: ClassVar[str] = "robot"
    robot: ClassVar[str] = ""


class DriveConformance(RecordConformance):
    """Inherit, set `drive`: what makes it is there."""

    kind: ClassVar[str] = "drive"
    drive: ClassVar[str] = ""


class SectionConformance(RecordConformance):
    """Inherit, set `section`: plain parts from the chapter's files alone, the same each time."""

    kind: ClassVar[str] = "section"
    section: ClassVar[str] = ""


class HoldSkill(Skill):
    """Holds the pose it started in, for a while or for ever. A coordinator holds the poses of all arms.

    Args:
        stiffness: of translation [N/m] and of rotation [Nm/rad].
        duration: seconds until it ends with SUCCESS; None for never.
    """

    def __init__(self, stiffness: tuple[float, float] = (1000.0, 50.0), duration: float | None = None) -> None:
        self._impedance = Impedance(np.diag(np.repeat(stiffness, 3)).astype(float))
        self._duration = np.inf if duration is None else duration

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Remember where the tool is."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())

    def step(self, observation: Observation) -> Command:
        """Ask for the pose of the start."""
        shape = observation.time.shape
        ended = observation.time.reshape(shape[0], -1)[:, 0] >= self._duration
        status = np.where(ended, Status.SUCCESS, Status.RUNNING).astype(np.int64)
        reason = no_reasons(shape[0])
        reason[ended] = f"held for {self._duration:g} s"
        return Command(self._home, np.zeros((*shape, 6)), self._impedance, np.zeros((*shape, 6)), status, reason)


class ScriptedSkill(HoldSkill):
    """Moves as a script says, relative to where it started.

    Args:
        offset: seconds since the start (N,) -> displacement (N, 3) in base [m].
    """

    def __init__(
        self,
        offset: Callable[[Float], Float],
        stiffness: tuple[float, float] = (1000.0, 50.0),
        duration: float | None = None,
    ) -> None:
        super().__init__(stiffness, duration)
        self._offset = offset

    def step(self, observation: Observation) -> Command:
        """Ask for the start's pose displaced by the script."""
        command = super().step(observation)
        pose = Pose(self._home.position + self._offset(observation.time), self._home.rotation)
        return command._replace(pose=pose)
