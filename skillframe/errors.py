"""Exceptions: one base class, and leaves that carry facts and format one sentence a person can act on.

`SkillframeError` is everything a user can fix (exit code 2); `RunStopped` and its kind are answers, not errors, and
live with the executor. An error's text says what is wrong, where, and what to do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec

MOST_NAMES = 30
"""Names that an error lists; more are no sentence any more."""
LEAST_LIKENESS = 0.5
"""Share of letters in common (Ratcliff and Obershelp) from which on a name is suggested."""
EXTRAS: Mapping[str, str] = {
    "sim": "simulating robots and worlds",
    "cluster": "a campaign with worker processes",
    "video": "writing a video",
    "ros": "reading a ROS bag, or writing one",
    "hdf5": "reading an HDF5 file",
    "parquet": "reading a parquet file or a LeRobot data set",
    "fmu": "an FMU",
    "crane": "a hydraulic machine",
    "parts": "a world of mesh files",
    "step": "a part drawn as STEP",
}
"""What each extra of the distribution is for; pyproject.toml says what it installs."""
LIBRARIES: Mapping[str, tuple[str, str]] = {
    "mujoco": ("mujoco", "sim"),
    "pinocchio": ("pin", "sim"),
    "distributed": ("distributed", "cluster"),
    "dask": ("distributed", "cluster"),
    "cryptography": ("cryptography", "cluster"),
    "av": ("av", "video"),
    "PIL": ("pillow", "video"),
    "rosbags": ("rosbags", "ros"),
    "mcap": ("mcap", "ros"),
    "h5py": ("h5py", "hdf5"),
    "pyarrow": ("pyarrow", "parquet"),
    "fmpy": ("fmpy", "fmu"),
    "lxml": ("lxml", "fmu"),
    "casadi": ("casadi", "crane"),
    "trimesh": ("trimesh", "parts"),
    "manifold3d": ("manifold3d", "parts"),
    "cascadio": ("cascadio", "step"),
}
"""By module: the distribution that it comes from, and the first extra that installs that."""


class SkillframeError(Exception):
    """Base class of every error that skillframe raises on purpose: bad usage or bad input."""


class InputError(SkillframeError):
    """A file, or something in it, cannot be used.

    Attributes:
        where: file, with row, channel or key if known.
        problem: what is wrong.
        fix: what to do about it.
    """

    def __init__(self, where: object, problem: str, fix: str = "") -> None:
        self.where, self.problem, self.fix = str(where), problem, fix
        super().__init__(f"{self.where}: {problem}" + (f"; {fix}" if fix else ""))


class UnknownName(SkillframeError):
    """Nothing is registered under a name. The text lists what there is and suggests the nearest.

    Attributes:
        kind: what was looked for ("world", "skill", "key" ...).
        name: the name that was asked for.
        known: the names that exist.
        note: why a name that a person has in mind may not be there.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], note: str = "", where: str = "") -> None:
        self.kind, self.name, self.known, self.note = kind, name, sorted(known), note
        near = suggest(name, self.known)
        text = f"{where}: " if where else ""
        text += f"unknown {kind} {name!r}"
        text += f"; did you mean {near!r}?" if near else ""
        some = self.known if len(self.known) <= MOST_NAMES else [*self.known[:MOST_NAMES], "..."]
        text += f" (there are: {', '.join(some) or 'none'})"
        super().__init__(text + (f"; {note}" if note else ""))


class MissingDependency(SkillframeError):
    """An optional library is needed for this. The text has the command that installs it."""

    def __init__(self, library: str, purpose: str, command: str) -> None:
        self.library, self.purpose, self.command = library, purpose, command
        super().__init__(f"{purpose} needs {library}, which is not installed; type: {command}")


def missing_extra(module: str) -> MissingDependency | None:
    """What is said where a module cannot be imported because an extra is not installed. None for any other module."""
    if module.partition(".")[0] not in LIBRARIES:
        return None
    library, extra = LIBRARIES[module.partition(".")[0]]
    return MissingDependency(library, EXTRAS[extra], f"pip install 'skillframe[{extra}]'")


def need(module: str) -> None:
    """Find out before any work is done for it whether a module of an extra is installed.

    Raises:
        MissingDependency: it is not.
    """
    missing = missing_extra(module)
    if missing is not None and find_spec(module) is None:
        raise missing


@contextmanager
def extras_named() -> Iterator[None]:
    """Within this, an extra that is not installed is a sentence that names the line to type.

    Raises:
        MissingDependency: in place of `ModuleNotFoundError` for a library of an extra.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        missing = missing_extra(error.name or "")
        if missing is None:
            raise
        raise missing from error


class SkillframeWarning(UserWarning):
    """Something that looks wrong and may be right: a biased recording, a bare number that reads like millimetres."""


def suggest(name: str, known: Iterable[str]) -> str | None:
    """Nearest of the known names, or None if none is near. A name can be near as a whole or by its beginning."""
    from difflib import SequenceMatcher

    def likeness(other: str) -> tuple[float, float, str]:
        texts = (other, other[: len(name)])
        whole, beginning = (SequenceMatcher(None, text.lower(), name.lower()).ratio() for text in texts)
        return max(whole, beginning), whole, other  # of equals the last, whatever the order of `known`

    near = max(known, key=likeness, default=None)
    return near if near is not None and likeness(near)[0] >= LEAST_LIKENESS else None
