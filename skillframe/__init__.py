"""skillframe: teach robots compliant assembly from human demonstration, and prove the skill.

    from skillframe import Campaign, learn, record, report, run

    demonstrations = record("peg_in_hole", "panda", count=2, seed=1)
    skill = learn(demonstrations).save("peg.skill.json")
    print(skill)
    print(run(skill, "peg_in_hole", "panda", coc="tip", set={"fixture.tilt_y": "4deg"}))
    tilted = {"fixture.tilt_y": {"uniform": [-0.1, 0.1]}}
    campaign = Campaign(world="peg_in_hole", skills=skill, coc="tip", vary=tilted)
    results = campaign.run(workers=2)
    print(results)
    report(results, "peg.html")

The method in seven files: `skillframe.demonstration.record`, the segmenter's emission, the LMC plug-in's learner and
runtime, `skillframe.skill`, `skillframe.control.controller`, `skillframe.execution.executor`.
Importing the package loads none of the scientific libraries.
"""

from typing import TYPE_CHECKING, Any

from skillframe import files

__version__ = "0.2.0"

_PUBLIC = {
    "Campaign": "skillframe.api.campaigns",
    "CampaignResults": "skillframe.api.campaigns",
    "Command": "skillframe.skill",
    "Demonstration": "skillframe.demonstration.record",
    "Impedance": "skillframe.skill",
    "LearnedSkill": "skillframe.api.learning",
    "Observation": "skillframe.skill",
    "Pose": "skillframe.frames",
    "Recording": "skillframe.extend.reading",
    "SingleRun": "skillframe.api.running",
    "Skill": "skillframe.skill",
    "SkillframeError": "skillframe.errors",
    "SkillframeWarning": "skillframe.errors",
    "Status": "skillframe.skill",
    "hookimpl": "skillframe.extend.hookspecs",
    "learn": "skillframe.api.learning",
    "per_trial": "skillframe.skill",
    "record": "skillframe.api.recording",
    "report": "skillframe.api.reporting",
    "run": "skillframe.api.running",
    "segment": "skillframe.api.learning",
}
__all__ = ["__version__", *sorted(_PUBLIC)]

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from skillframe.api.campaigns import Campaign as Campaign
    from skillframe.api.campaigns import CampaignResults as CampaignResults
    from skillframe.api.learning import LearnedSkill as LearnedSkill
    from skillframe.api.learning import learn as learn
    from skillframe.api.learning import segment as segment
    from skillframe.api.recording import record as record
    from skillframe.api.reporting import report as report
    from skillframe.api.running import SingleRun as SingleRun
    from skillframe.api.running import run as run
    from skillframe.demonstration.record import Demonstration as Demonstration
    from skillframe.errors import SkillframeError as SkillframeError
    from skillframe.errors import SkillframeWarning as SkillframeWarning
    from skillframe.extend.hookspecs import hookimpl as hookimpl
    from skillframe.extend.reading import Recording as Recording
    from skillframe.frames import Pose as Pose
    from skillframe.skill import Command as Command
    from skillframe.skill import Impedance as Impedance
    from skillframe.skill import Observation as Observation
    from skillframe.skill import Skill as Skill
    from skillframe.skill import Status as Status
    from skillframe.skill import per_trial as per_trial


def __getattr__(name: str) -> Any:
    """Load a public name on first use, so that `import skillframe` stays fast."""
    if name not in _PUBLIC:
        raise AttributeError(f"module 'skillframe' has no attribute {name!r}")
    from importlib import import_module

    from skillframe.errors import extras_named

    with extras_named():
        return getattr(import_module(_PUBLIC[name]), name)


def _robots_of_plugins(name: str | None = None) -> "Mapping[str, Path]":
    from skillframe.extend.registry import robot_folders

    return robot_folders(name)


def _tables_of_plugins(values: "dict[str, Any]", path: "Path") -> "dict[str, Any]":
    from skillframe.extend.drives import written_out

    return written_out(values, path)


def __dir__() -> list[str]:
    """The public names, for completion."""
    return sorted({*globals(), *_PUBLIC})


files.OFFERS["robots"] = _robots_of_plugins
files.WRITES_OUT.append(_tables_of_plugins)
