"""skillframe: teach robots compliant assembly from human demonstration, and prove the skill.

The story in seven files: `skillframe.demonstration.record`, the LMC plug-in's learner and runtime, `skillframe.skill`,
`skillframe.control.controller`, `skillframe.world.scene` and `skillframe.run.executor`. Importing the package loads
none of the scientific libraries.
"""

from typing import TYPE_CHECKING, Any

from skillframe import doors, paths

__version__ = "0.2.0"

_PUBLIC = {
    "Command": "skillframe.skill",
    "Demonstration": "skillframe.demonstration.record",
    "Impedance": "skillframe.skill",
    "Observation": "skillframe.skill",
    "Pose": "skillframe.frames",
    "Skill": "skillframe.skill",
    "SkillframeError": "skillframe.errors",
    "Status": "skillframe.skill",
    "hookimpl": "skillframe.extend.hookspecs",
    "per_trial": "skillframe.skill",
}
__all__ = ["__version__", *sorted(_PUBLIC)]

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from skillframe.demonstration.record import Demonstration as Demonstration
    from skillframe.errors import SkillframeError as SkillframeError
    from skillframe.extend.hookspecs import hookimpl as hookimpl
    from skillframe.frames import Pose as Pose
    from skillframe.skill import Command as Command
    from skillframe.skill import Impedance as Impedance
    from skillframe.skill import Observation as Observation
    from skillframe.skill import Skill as Skill
    from skillframe.skill import Status as Status
    from skillframe.skill import per_trial as per_trial


def __getattr__(name: str) -> Any:
    """Load a public name on first use, so that `import skillframe` stays instant."""
    if name not in _PUBLIC:
        raise AttributeError(f"module 'skillframe' has no attribute {name!r}")
    from importlib import import_module

    from skillframe.errors import extras_named

    with extras_named():
        return getattr(import_module(_PUBLIC[name]), name)


def _robots_of_plugins(name: str | None = None) -> "Mapping[str, Path]":
    """Folders of registered robots; the registry is loaded when a robot is asked for that is not shipped."""
    from skillframe.extend.robots import folders

    return folders(name)


doors.install()
paths.OFFERS["robots"] = _robots_of_plugins
