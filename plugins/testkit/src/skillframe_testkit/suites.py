"""Conformance suites for plug-in authors to inherit, and small skills for tests.

Inherit and name the record::

    from skillframe_testkit.suites import SkillConformance

    class TestMySkill(SkillConformance):
        skill_type = "my_skill"

Under pytest the class finds the skill through the registry and checks the loop's contract. `skillframe_testkit.checks`
has the same checks as functions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any, ClassVar

import numpy as np

from skillframe.demonstration import Demonstration
from skillframe.execution import Trace
from skillframe.extend import Document, SkillType, registry
from skillframe.frames import Float, Pose
from skillframe.skill import Command, Impedance, Observation, Skill, Status, no_reasons
from skillframe_testkit.checks import running, skills
from skillframe_testkit.checks import start_checks as beginning
from skillframe_testkit.checks.drives import check_drive
from skillframe_testkit.checks.examples import example_demonstrations, random_observations
from skillframe_testkit.checks.exporters import check_exporter
from skillframe_testkit.checks.material import example_campaign, example_phase, example_trace
from skillframe_testkit.checks.playback import play
from skillframe_testkit.checks.plugins import CHECKS
from skillframe_testkit.checks.readers import check_reader, differences
from skillframe_testkit.checks.robots import check_robot
from skillframe_testkit.checks.scores import check_score
from skillframe_testkit.checks.sections import check_section
from skillframe_testkit.checks.segmenters import check_segmenter
from skillframe_testkit.checks.skills import check_skill, example_document
from skillframe_testkit.checks.worlds import check_world

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
    """Checks of a skill, named by `skill_type`.

    Attributes:
        skill_type: its registered name.
        document: a skill document, or None.
        demonstrations: to learn the document from; None for the type's own `example`, else the example demonstrations.
    """

    kind: ClassVar[str] = "skill"
    skill_type: ClassVar[str] = ""
    document: ClassVar[Document | None] = None
    demonstrations: ClassVar[Sequence[Demonstration] | None] = None
    _made: ClassVar[dict[tuple[str, str], tuple[SkillType, Document]]] = {}

    def _type(self) -> SkillType:
        record: SkillType = registry().record(self.kind, self.skill_type)
        return record

    def _document(self) -> Document:
        from skillframe.document import learned

        if self.document is not None:
            return self.document
        if self.demonstrations is not None:
            return learned(self._type(), self.demonstrations)
        record, key = self._type(), (self.kind, self.skill_type)
        if key not in self._made or self._made[key][0] is not record:  # once for all tests
            self._made[key] = record, example_document(record)
        return deepcopy(self._made[key][1])

    def _check(self, check: Callable[[SkillType, Document], object]) -> None:
        _demand(list(check(self._type(), self._document())))  # type: ignore[call-overload]

    def test_is_discovered(self) -> None:
        """Registered by a plug-in that loaded without error."""
        assert registry().provider(self.kind, self.skill_type).error is None
        assert self._type().summary

    def test_builds(self) -> None:
        """`skills.builds`."""
        self._check(skills.builds)

    def test_answers_in_shape(self) -> None:
        """`skills.answers_in_shape`."""
        self._check(skills.answers_in_shape)

    def test_starts_without_a_bump(self) -> None:
        """`skills.starts_without_a_bump`."""
        self._check(skills.starts_without_a_bump)

    def test_batched_rows_equal_single_trials(self) -> None:
        """`skills.rows_equal_single_trials`."""
        self._check(skills.rows_equal_single_trials)

    def test_rows_are_independent(self) -> None:
        """`skills.rows_are_independent`."""
        self._check(skills.rows_are_independent)

    def test_repeats_with_its_seed(self) -> None:
        """`skills.repeats_with_its_seed`."""
        self._check(skills.repeats_with_its_seed)

    def test_ends_with_a_reason(self) -> None:
        """`skills.ends_with_a_reason`."""
        self._check(skills.ends_with_a_reason)

    def test_survives_json(self) -> None:
        """`skills.survives_json`."""
        self._check(skills.survives_json)

    def test_says_what_it_does(self) -> None:
        """`skills.says_what_it_does`."""
        self._check(skills.says_what_it_does)

    def test_answers_in_time(self) -> None:
        """`running.answers_in_time`."""
        self._check(running.answers_in_time)

    def test_runs_for_two_seconds(self) -> None:
        """`running.runs_for_two_seconds`."""
        self._check(running.runs_for_two_seconds)

    def test_leaves_nothing_behind(self) -> None:
        """`running.leaves_nothing_behind`."""
        self._check(running.leaves_nothing_behind)

    def test_remembers_little(self) -> None:
        """`running.remembers_little`."""
        self._check(running.remembers_little)

    def test_goes_by_time(self) -> None:
        """`beginning.goes_by_time`."""
        self._check(beginning.goes_by_time)

    def test_starts_again(self) -> None:
        """`beginning.starts_again`."""
        self._check(beginning.starts_again)

    def test_restarts_some_trials(self) -> None:
        """`beginning.restarts_some_trials`."""
        self._check(beginning.restarts_some_trials)

    def test_writes_its_journal(self) -> None:
        """`beginning.writes_its_journal`."""
        self._check(beginning.writes_its_journal)

    def test_finds_the_way_on(self) -> None:
        """`skills.finds_the_way_on`."""
        self._check(skills.finds_the_way_on)


class CoordinatorConformance(SkillConformance):
    """Checks of a coordinator as a skill of several arms."""

    kind: ClassVar[str] = "coordinator"


class RecordConformance:
    """Base of the suites below. The record's name is in the attribute of its kind."""

    kind: ClassVar[str] = ""

    def _record(self) -> Any:
        return registry().record(self.kind, getattr(self, self.kind))

    def _problems(self) -> list[str]:
        return CHECKS[self.kind](self._record())

    def test_is_discovered(self) -> None:
        """Registered by a plug-in that loaded without error."""
        assert registry().provider(self.kind, getattr(self, self.kind)).error is None
        assert self._record().summary

    def test_conforms(self) -> None:
        """Conforms to the contract."""
        _demand(self._problems())


class WorldConformance(RecordConformance):
    """Checks of a world's parameters, scene, tool and goal."""

    kind: ClassVar[str] = "world"
    world: ClassVar[str] = ""


class ReaderConformance(RecordConformance):
    """Checks of a format's round trip and errors."""

    kind: ClassVar[str] = "reader"
    reader: ClassVar[str] = ""


class SegmenterConformance(RecordConformance):
    """Checks of boundaries and labels. Set `demonstrations` if the examples do not suit."""

    kind: ClassVar[str] = "segmenter"
    segmenter: ClassVar[str] = ""
    demonstrations: ClassVar[Sequence[Demonstration] | None] = None
    phases: ClassVar[int] = 2

    def _problems(self) -> list[str]:
        return check_segmenter(self._record(), self.demonstrations, self.phases)


class ExporterConformance(RecordConformance):
    """Checks of an exporter's numbers and refusals."""

    kind: ClassVar[str] = "exporter"
    exporter: ClassVar[str] = ""


class ScoreConformance(RecordConformance):
    """Checks of a score's numbers, for example traces and optional own ones."""

    kind: ClassVar[str] = "score"
    score: ClassVar[str] = ""
    traces: ClassVar[Sequence[Trace] | None] = None

    def _problems(self) -> list[str]:
        return check_score(self._record(), self.traces)


class RobotConformance(RecordConformance):
    """Checks of a robot's loading, dynamics and standing."""

    kind: ClassVar[str] = "robot"
    robot: ClassVar[str] = ""


class DriveConformance(RecordConformance):
    """Checks of a drive."""

    kind: ClassVar[str] = "drive"
    drive: ClassVar[str] = ""


class SectionConformance(RecordConformance):
    """Checks of a section's parts."""

    kind: ClassVar[str] = "section"
    section: ClassVar[str] = ""


class HoldSkill(Skill):
    """Holds the start pose, of all arms for a coordinator.

    Args:
        stiffness: of translation [N/m] and of rotation [Nm/rad].
        duration: seconds until it ends with SUCCESS; None for never.
    """

    def __init__(self, stiffness: tuple[float, float] = (1000.0, 50.0), duration: float | None = None) -> None:
        self._impedance = Impedance(np.diag(np.repeat(stiffness, 3)).astype(float))
        self._duration = np.inf if duration is None else duration

    def start(self, observation: Observation, rngs: Sequence[np.random.Generator]) -> None:
        """Store the tool's pose."""
        self._home = Pose(observation.pose.position.copy(), observation.pose.rotation.copy())

    def step(self, observation: Observation) -> Command:
        """Command the start pose."""
        shape = observation.time.shape
        ended = observation.time.reshape(shape[0], -1)[:, 0] >= self._duration
        status = np.where(ended, Status.SUCCESS, Status.RUNNING).astype(np.int64)
        reason = no_reasons(shape[0])
        reason[ended] = f"held for {self._duration:g} s"
        return Command(self._home, np.zeros((*shape, 6)), self._impedance, np.zeros((*shape, 6)), status, reason)


class ScriptedSkill(HoldSkill):
    """Moves by a script relative to its start.

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
        """Command the start pose displaced by the script."""
        command = super().step(observation)
        pose = Pose(self._home.position + self._offset(observation.time), self._home.rotation)
        return command._replace(pose=pose)
