"""Exceptions: one base class, and subclasses that carry facts and format one sentence.

`SkillframeError` is everything that a user can fix (exit code 2); `RunStopped` and its kind are outcomes, not errors,
and live with the executor. An error's text says what is wrong, where, and what to do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec

MOST_NAMES = 30
"""Most names that an error lists."""
EXTRAS: Mapping[str, str] = {
    "sim": "simulating robots and worlds",
    "cluster": "a campaign with worker processes",
    "skillframe-recordings[ros]": "reading a ROS bag, or writing one",
    "skillframe-recordings[hdf5]": "reading an HDF5 file",
    "skillframe-recordings[parquet]": "reading a parquet file or a LeRobot data set",
    "fmu": "an FMU",
    "crane": "a robot with closed chains",
    "parts": "a world of mesh files",
    "step": "a part drawn as STEP",
    "collada": "a robot's meshes in COLLADA (.dae)",
    "skillframe-reports[video]": "writing a video",
}
"""Purpose of each extra of the core, and of extras of other distributions that the core names in full."""
LIBRARIES: Mapping[str, tuple[str, str]] = {
    "mujoco": ("mujoco", "sim"),
    "pinocchio": ("pin", "sim"),
    "distributed": ("distributed", "cluster"),
    "dask": ("distributed", "cluster"),
    "cryptography": ("cryptography", "cluster"),
    "av": ("av", "skillframe-reports[video]"),
    "PIL": ("pillow", "skillframe-reports[video]"),
    "rosbags": ("rosbags", "skillframe-recordings[ros]"),
    "mcap": ("mcap", "skillframe-recordings[ros]"),
    "h5py": ("h5py", "skillframe-recordings[hdf5]"),
    "pyarrow": ("pyarrow", "skillframe-recordings[parquet]"),
    "fmpy": ("fmpy", "fmu"),
    "lxml": ("lxml", "fmu"),
    "casadi": ("casadi", "crane"),
    "trimesh": ("trimesh", "parts"),
    "manifold3d": ("manifold3d", "parts"),
    "cascadio": ("cascadio", "step"),
    "collada": ("pycollada", "collada"),
}
"""By module: its distribution, and the first extra that installs it."""


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
    """Nothing is registered under a name. The text lists the known names and suggests the nearest.

    Attributes:
        kind: what was looked for ("world", "skill", "key" ...).
        name: the unknown name.
        known: the names that exist.
        note: why an expected name may be absent.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], note: str = "", where: str = "") -> None:
        self.kind, self.name, self.known, self.note = kind, name, sorted(known), note
        near = suggest(name, self.known)
        text = f"{where}: " if where else ""
        text += f"unknown {kind} {name!r}"
        text += f"; did you mean {near!r}?" if near else ""
        some = self.known
        if len(some) > MOST_NAMES:
            groups = sorted({f"{group}.*" if dot else each for each in some for group, dot, _ in [each.partition(".")]})
            some = groups if 2 * len(groups) <= len(some) else [*some[:MOST_NAMES], "..."]
        text += f" (there are: {', '.join(some) or 'none'})"
        super().__init__(text + (f"; {note}" if note else ""))


class MissingDependency(SkillframeError):
    """An optional library is missing. The text has the command that installs it."""

    def __init__(self, library: str, purpose: str, command: str) -> None:
        self.library, self.purpose, self.command = library, purpose, command
        super().__init__(f"{purpose} needs {library}, which is not installed; type: {command}")


def missing_extra(module: str) -> MissingDependency | None:
    """The error for a module of an extra that is not installed. None for any other module."""
    if module.partition(".")[0] not in LIBRARIES:
        return None
    library, extra = LIBRARIES[module.partition(".")[0]]
    requirement = extra if "[" in extra else f"skillframe[{extra}]"
    return MissingDependency(library, EXTRAS[extra], f"pip install '{requirement}'")


def need(module: str) -> None:
    """Check, before the work, that a module of an extra is installed.

    Raises:
        MissingDependency: it is not.
    """
    missing = missing_extra(module)
    if missing is not None and find_spec(module) is None:
        raise missing


@contextmanager
def extras_named() -> Iterator[None]:
    """While open, an extra that is not installed is reported with the command that installs it.

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
    """Something suspicious that may be right: a biased recording, a bare number that looks like millimetres."""


def suggest(name: str, known: Iterable[str]) -> str | None:
    """Nearest of the known names, by the whole name or its beginning, or None."""
    from difflib import SequenceMatcher

    def likeness(other: str) -> tuple[float, float, str]:
        texts = (other, other[: len(name)])
        whole, beginning = (SequenceMatcher(None, text.lower(), name.lower()).ratio() for text in texts)
        return max(whole, beginning), whole, other  # of equals the last in the alphabet

    near = max(known, key=likeness, default=None)
    return near if near is not None and likeness(near)[0] >= 0.5 else None
