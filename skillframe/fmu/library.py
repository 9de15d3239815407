"""FMUs by name: the source folders under `fmus/`, and what has been built from them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from skillframe.errors import InputError, SkillframeError, UnknownName
from skillframe.fmu.build import VERSIONS, build_fmu, cached_path
from skillframe.paths import data_dirs


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltFmu:
    """A built file: the FMU's name, the version of the standard ("2.0" or "3.0") and its absolute path."""

    name: str
    fmi_version: str
    path: Path


def fmu_folders() -> dict[str, Path]:
    """Source folder of every FMU that can be named, the user's own before the shipped ones."""
    names: dict[str, Path] = {}
    for kind in data_dirs("fmus"):
        for folder in sorted(p.parent for p in kind.glob("*/fmu.toml")):
            names.setdefault(folder.name, folder.resolve())
    return names


def built() -> list[BuiltFmu]:
    """Every FMU whose present sources have been built. Folders that cannot be read are left out."""
    rows = []
    for name, folder in fmu_folders().items():
        for version in VERSIONS:
            try:
                path = cached_path(folder, version)
            except SkillframeError:
                continue
            if path.is_file():
                rows.append(BuiltFmu(name=name, fmi_version=f"{version}.0", path=path))
    return rows


def build_named(name: str) -> list[BuiltFmu]:
    """Build both versions of a named FMU.

    Raises:
        UnknownName: no folder of that name; and as `build_fmu`.
    """
    folders = fmu_folders()
    if name not in folders:
        raise UnknownName("fmu", name, folders)
    return [BuiltFmu(name=name, fmi_version=f"{v}.0", path=build_fmu(folders[name], v)) for v in VERSIONS]


def find_fmu(name_or_path: str | Path, base: Path | None = None, version: int = 2) -> Path:
    """The file of an FMU: a name in `fmus/` (built now if needed), or a path, relative to `base`.

    Raises:
        InputError: no such file, or a folder.
        UnknownName: neither a name nor a file; and as `build_fmu`.
    """
    text = str(name_or_path)
    folders = fmu_folders()
    if text in folders:
        return build_fmu(folders[text], version)
    path = (base or Path()) / text
    if path.is_file():
        return path.resolve()
    if path.is_dir():
        raise InputError(path, "is a folder", "give an .fmu file or a name from `skillframe fmu list`")
    if path.suffix == ".fmu" or len(path.parts) > 1:
        raise InputError(path, "no such file", "give an .fmu file or a name from `skillframe fmu list`")
    raise UnknownName("fmu", text, folders)
