"""Unknown is not failed: what a chunk that raises says about its skill, and what it says about the machine only.

A row is a result of the skill. It is never written for trouble of the environment, which is, by a closed list of ours,

    MemoryError, OSError, ImportError                       wherever raised, in a plug-in's step too
    UnknownName, MissingDependency, plug-in load errors,    wherever raised: a name that was there when the campaign
    CompilerFailed                                          was prepared is missing in this process
    InputError of files                                     raised while an FMU is found, unpacked or built
    ScoreFailed                                             a score is no part of the skill
    anything                                                raised while the robot, the skill or the world is loaded
                                                            (`needed`): none of it depends on a draw, and all of it
                                                            was loaded once before the campaign began

Everything else is the trial's own doing and becomes its row, once the trial has been found: a ValueError in a skill's
step, a start out of the robot's reach, a draw that the world refuses, an FMU that crashes, `sys.exit` in a skill.

A worker that dies is judged by the driver. One that goes over its memory limit, or is killed, while it is alone with
one trial, twice, becomes that trial's row ("worker died (memory)"). The limit is on the worker's own memory, in which
there was nothing but that trial and what earlier ones left, so the trial is the likely cause; it is not known, and
`campaign status` says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import NamedTuple

from skillframe.campaign.rows import ChunkJob, Row
from skillframe.campaign.work import WorkT
from skillframe.errors import InputError, MissingDependency, SkillframeError, UnknownName, missing_extra
from skillframe.execution.scores import ScoreFailed
from skillframe.extend.registry import BadPlugin, PluginConflict

Evaluate = Callable[[ChunkJob], list[Row]]
FILES = frozenset(f"skillframe.fmu.{name}" for name in ("allow", "build", "extract", "foreign", "library"))
"""Modules that turn an FMU's file into something that runs; no draw reaches them."""
OLD_SIGNS = (
    "no such file", "cannot be read", "MemoryError", "ImportError", "ModuleNotFoundError", "OSError", "PermissionError",
    "FileNotFoundError", "unknown skill", "unknown world", "unknown coordinator", "is not installed",
)  # fmt: skip
"""What the rows of campaigns before this rule say about trouble of the environment."""


class CampaignError(SkillframeError):
    """A campaign that cannot go on: nothing works, or the environment does not let it."""


class Unusable(SkillframeError):
    """Something that every trial needs could not be loaded in this process."""


class Raised(NamedTuple):
    """The job raised.

    Attributes:
        text: what, in words; without "error: ".
        trouble: of the environment, so that nothing is known about the skill.
        memory: for want of memory; fewer trials at once may work.
    """

    text: str
    trouble: bool = False
    memory: bool = False


@contextmanager
def needed(what: str) -> Iterator[None]:
    """Within this, whatever is raised is trouble of the environment.

    Raises:
        Unusable: in place of what was raised.
    """
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:  # files and plug-ins are foreign: whatever they raise
        raise Unusable(f"{what} cannot be loaded: {said(error)}") from error


def attempt(evaluate: Callable[[WorkT], list[Row]], job: WorkT) -> list[Row] | Raised:
    """Run a job. What it raises is judged, `sys.exit` included, and only Ctrl-C goes through."""
    try:
        return evaluate(job)
    except KeyboardInterrupt:
        raise
    except SystemExit as error:
        return Raised(f"SystemExit: the skill or the world called sys.exit({error.code!r})")
    except BaseException as error:  # whatever a skill or world raises
        return Raised(said(error), is_trouble(error), isinstance(error, MemoryError))


def said(error: BaseException) -> str:
    """An error in words: its own sentence if it is one of ours, else with its kind. Never empty."""
    if isinstance(error, ModuleNotFoundError) and (missing := missing_extra(error.name or "")):
        error = missing
    text = str(error)
    return text if isinstance(error, SkillframeError) and text else f"{type(error).__name__}: {text}".removesuffix(": ")


def is_trouble(error: BaseException) -> bool:
    """Whether an error is one of the environment (see the module)."""
    from skillframe.fmu.toolchain import CompilerFailed

    always = (MemoryError, OSError, ImportError, UnknownName, MissingDependency, BadPlugin, PluginConflict, Unusable)
    if isinstance(error, (*always, ScoreFailed, CompilerFailed)):
        return True
    return isinstance(error, InputError) and not FILES.isdisjoint(_modules(error.__traceback__))


def _modules(traceback: TracebackType | None) -> Iterator[str]:
    """Names of the modules that an error passed through."""
    while traceback is not None:
        yield str(traceback.tb_frame.f_globals.get("__name__"))
        traceback = traceback.tb_next


def looks_like_trouble(failure: str) -> bool:
    """Whether the row of an old campaign may be trouble of the environment, judged by its text."""
    return failure.startswith("error: ") and any(sign in failure for sign in OLD_SIGNS)
