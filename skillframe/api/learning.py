"""`learn` and `LearnedSkill`: from demonstrations to a skill that can be saved, read, drawn and run."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skillframe.api.inputs import Demonstrations, File, demonstrations_of
from skillframe.demonstration.record import Demonstration
from skillframe.document import file
from skillframe.errors import InputError, SkillframeWarning
from skillframe.extend.outputs import Explanation, Illustration, no_progress
from skillframe.extend.records import Document, LearnOptions, SkillType
from skillframe.extend.registry import registry
from skillframe.skill import Skill

if TYPE_CHECKING:  # learning needs no simulator
    from skillframe.api.inputs import Robot, Settings, World


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class LearnedSkill:
    """A skill as a document: what was learned, from what, in which frame.

    Attributes:
        document: the content of the skill file as JSON values; the page "Files" has its keys.
        name: in results: the file's name without its ending, or the kind of skill.
        source: on the command line: a file, or TYPE:DEMONSTRATION; None for a skill that was never saved.
    """

    document: Document
    name: str
    source: str | None = None

    @classmethod
    def load(cls, skill: File) -> LearnedSkill:
        """Read a skill file, or learn from a text "TYPE:DEMO[,DEMO...][,KEY=VALUE...]".

        Raises:
            InputError: the file or a demonstration cannot be used.
            UnknownName: no such kind of skill is installed.
        """
        text = os.fspath(skill)
        if isinstance(skill, str):
            name, document = file.load_skill(text)
        else:
            name, document = file.SkillSource("", (text,)).name, file.load(Path(text))
        return cls(document=document, name=name, source=text)

    @property
    def type(self) -> str:
        """The kind of skill: "lmc", "replay", "policy" ..."""
        return str(self.document["type"])

    @property
    def phases(self) -> list[dict[str, Any]]:
        """The phases. Their content depends on the kind of skill."""
        phases: list[dict[str, Any]] = self.document["phases"]
        return phases

    @property
    def words(self) -> list[str]:
        """What the skill does, a line each: "push along -z at 20 mm/s; free along x; turns freely about y"."""
        kind = self._kind()
        return kind.describe(self.document) if kind.describe is not None else [kind.summary]

    @property
    def summary(self) -> list[str]:
        """What it does, how certain that is ("sure: ..."), and what to do next ("next: ..."), or all of its words."""
        kind = self._kind()
        if kind.advice is None:
            return self.words
        sure, then = kind.advice(self.document)
        return [self.words[0], f"sure: {sure}", f"next: {then}"]

    @property
    def pictures(self) -> list[Illustration]:
        """Pictures that explain the skill, each with a title, a caption and SVG text."""
        kind = self._kind()
        return kind.explain(self.document) if kind.explain is not None else []

    def save(self, path: File) -> LearnedSkill:
        """Write the skill file as a whole. Returns the same skill under the file's name.

        Raises:
            InputError: the file cannot be written.
        """
        file.save(self.document, Path(path))
        return LearnedSkill(
            document=self.document, name=file.SkillSource("", (os.fspath(path),)).name, source=os.fspath(path)
        )

    def explain(self, out: File) -> int:
        """Write words and pictures as one HTML page (.html). Returns the number of pictures.

        Raises:
            InputError: the file cannot be written.
            UnknownName: skillframe-reports, which writes the page, is not installed.
        """
        output, pictures = registry().output("explanation"), self.pictures
        title = self.name if self.source is None else Path(self.source).name
        output.write(Explanation(title, self.document, self.words, pictures), Path(out), no_progress)
        return len(pictures)

    def build(
        self, world: World, robot: Robot = "panda", *, coc: str | None = None, set: Settings | None = None
    ) -> Skill:
        """The runnable skill for a world and a robot: a part of a sequence, or for loops of your own.

        Args:
            world: a name, a fixture file, or a scene of your own.
            robot: a name, a robot.toml or its folder, or a loaded robot.
            coc: centre of compliance, "x,y,z" [m] in the tool frame or a frame's name; None as learned.
            set: deviations from the nominal world.

        Raises:
            InputError: the skill's area lies outside the robot's workspace.
            UnknownName: no such world, robot, frame or setting.
        """
        from skillframe.api.inputs import robot_of, scene_of
        from skillframe.execution.prepare import prepare

        scene, _ = scene_of(world, set, depth=2)
        return prepare(robot_of(robot), scene, self.document, coc)[0]

    def _kind(self) -> SkillType:
        kind: SkillType = registry().behaviour(self.type)
        return kind

    def __repr__(self) -> str:
        count, made_of = len(self.phases), len(self.document["learned_from"])
        said = f"{count} phase{'s' * (count != 1)} from {made_of} demonstration{'s' * (made_of != 1)}"
        return f"LearnedSkill({self.name}: {self.type}, {said}; {self.words[0]})"

    def __str__(self) -> str:
        return "\n".join(self.words)


Skills = LearnedSkill | File | Mapping[str, Any]
"""A learned skill, its file or TYPE:DEMONSTRATION, or its document."""


def learn(
    demonstrations: Demonstrations, skill: str = "lmc", *, at: str | None = None, hand: str | None = None,
    axes: str = "base", **settings: Any,
) -> LearnedSkill:  # fmt: skip
    """Learn a skill from demonstrations of one phase. For a whole task see `segment`.

    Suspicious recordings (a biased wrench, gaps) cause a `SkillframeWarning`.

    Args:
        demonstrations: one or several, as objects or files.
        skill: kind of skill: "lmc", "seat", "search", "dual_arm", "replay", "dmp", "gmr", "seds", "acp" or a plug-in's.
        at: learning point: a frame's name or "x,y,z" [m] in the tool frame; None for the recorded tool point.
        hand: point that the teacher held, for the work of torques; None for the recording's own, or the learning point.
        axes: "base", or "phase_start": the tool's orientation at the start of the phase.
        **settings: of the learner; `skillframe plugins lmc` lists them [SI].

    Raises:
        InputError: a demonstration or a setting cannot be used, or demonstrations do not fit together.
        UnknownName: no such kind of skill, frame or setting.
    """
    return learn_with(demonstrations, skill, LearnOptions(at=at, hand=hand, axes=axes, settings=settings))


def learn_with(demonstrations: Demonstrations, skill: str, options: LearnOptions) -> LearnedSkill:
    """As `learn`, for settings of any name."""
    kind = registry().behaviour(skill)
    recordings = demonstrations_of(demonstrations)
    document = file.learned(kind, recordings, options)
    for text in suspicions(recordings):
        warnings.warn(text, SkillframeWarning, stacklevel=3)
    return LearnedSkill(document=document, name=skill)


def segment(
    demonstrations: Demonstrations, skill: str = "lmc", *, phases: int | None = None, segmenter: str = "wrench_hmm",
    set_boundary: Sequence[str] = (), at: str | None = None, hand: str | None = None, axes: str = "base",
    **settings: Any,
) -> LearnedSkill:  # fmt: skip
    """Cut demonstrations of a whole task into phases, learn each, and return the policy that runs them in sequence.

    Args:
        demonstrations: one or several, as objects or files; each from the free approach to the end of the task.
        skill: kind of skill of each phase.
        phases: number of phases; None finds it.
        segmenter: method: "wrench_hmm", "pose_hmm", "zvc" or a plug-in's.
        set_boundary: boundaries to move, "DEMO:NUMBER=SECONDS" each, both counted from 1.
        at: learning point of each phase, as for `learn`; so are `hand` and `axes`.
        hand: point that the teacher held.
        axes: "base" or "phase_start".
        **settings: of segmenter and learner [SI].

    Returns:
        a skill of type "policy"; `document["demonstrations"]` holds the `boundaries` [s] and `labels` of each.

    Raises:
        InputError: a demonstration or a setting cannot be used, or the demonstrations differ in task.
        UnknownName: no such segmenter, kind of skill, frame or setting.
    """
    own = {"segmenter": segmenter, "skill": skill, "phases": phases, "set_boundary": list(set_boundary)}
    options = LearnOptions(at=at, hand=hand, axes=axes, settings={**settings, **own})
    return segment_with(demonstrations, options)


def segment_with(demonstrations: Demonstrations, options: LearnOptions) -> LearnedSkill:
    """As `segment`, for settings of any name. `options.settings` names the `segmenter`."""
    registry().segmenter(options.settings["segmenter"])
    kind = registry().skill("policy")
    document = file.learned(kind, demonstrations_of(demonstrations), options)
    return LearnedSkill(document=document, name=kind.name)


def suspicions(demonstrations: Sequence[Demonstration]) -> list[str]:
    """Sentences on suspicious recordings: a skill would learn the bias of a biased wrench."""
    return [text for audit in registry().records("audit") for text in audit.warnings(demonstrations)]


def skill_of(given: Skills) -> LearnedSkill:
    """A learned skill from an object, a document or a file.

    Raises:
        InputError: it cannot be used. UnknownName: no such kind of skill.
    """
    if isinstance(given, LearnedSkill):
        return given
    if isinstance(given, Mapping):
        document = file.checked(dict(given), "skill document")
        return LearnedSkill(document=document, name=str(document["type"]))
    if isinstance(given, str | os.PathLike):
        return LearnedSkill.load(given)
    raise InputError(f"{given!r:.60}", "is no skill", "give what learn returned, or a skill file")
