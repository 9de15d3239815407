"""Cached, bit-reproducible builds of FMUs from source folders, and FMUs by name.

C functions over arrays (`library`, `Record`) repeat the NumPy code beside them bit for bit; without a compiler that
runs. Matrix products stay in NumPy, whose rounding depends on its library.

A name is that of a source folder under `fmus/`.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skillframe.errors import InputError, MissingDependency, SkillframeError, UnknownName
from skillframe.files import cache_dir, data_dirs
from skillframe.fmu.table import VariableTable, build_description, model_description, read_table, variables_header

# Contracting a*b+c into one rounding would make results depend on the machine.
FLAGS = ("-O2", "-std=c11", "-fPIC", "-shared", "-fvisibility=hidden", "-fno-math-errno", "-ffp-contract=off")


class CompilerFailed(SkillframeError):
    """The compiler refused the sources."""


def find_compiler() -> list[str] | None:
    """Command of a C compiler: $CC, then cc, gcc, clang, then `ziglang`, or None."""
    chosen = os.environ.get("CC")
    if chosen:
        command = shlex.split(chosen)
        return command if shutil.which(command[0]) else None
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def require_compiler(purpose: str) -> list[str]:
    """`find_compiler`, required.

    Raises:
        MissingDependency: there is none.
    """
    command = find_compiler()
    if command is None:
        raise MissingDependency("a C compiler (cc, gcc, clang or $CC)", purpose, "pip install ziglang")
    return command


def compile_library(sources: Sequence[str], out: str, folder: Path, extra: Sequence[str] = ()) -> None:
    """Compile C files, relative to `folder`, into a shared library.

    Raises:
        CompilerFailed, MissingDependency: with the compiler's messages, or without a compiler.
    """
    command = [*require_compiler("building an FMU"), *FLAGS, *extra, "-I.", *sources, "-o", out, "-lm"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    if result.returncode:
        said = " | ".join(line.strip() for line in result.stderr.splitlines() if "error" in line)[:600]
        raise CompilerFailed(f"the C compiler refused {', '.join(sources)}: {said or result.stderr[:600]}")


VERSIONS = (2, 3)
_LAYOUT = "1"  # raise with changes of the packing


def build_fmu(folder: Path, version: int, out: Path | None = None) -> Path:
    """FMU of a source folder for version 2 or 3, from the cache or built into `out`.

    Raises:
        MissingDependency: no C compiler.
        CompilerFailed, InputError: sources that cannot be built.
    """
    table = read_table(folder)
    common = common_folder()
    token = _token(folder, table, common)
    path = out or cached_path(folder, version)
    if out is not None or not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as work:
            made = _make(table, folder, common, token, version, Path(work))
            os.replace(made, path)
    return path


def cached_path(folder: Path, version: int) -> Path:
    """Cache path for the folder's present sources."""
    table = read_table(folder)
    key = _digest(_token(folder, table, common_folder()), " ".join(find_compiler() or ["none"]), *FLAGS, _LAYOUT)
    return cache_dir("fmus") / key[:24] / f"fmi{version}" / f"{table.name}.fmu"


def build_source(source: Path) -> Path | None:
    """Shared library of one C file, from the cache if possible, or None."""
    return build_library(source.stem, source.read_text(encoding="utf-8"))


def build_library(
    name: str, text: str, include: Path | None = None, flags: tuple[str, ...] = ()
) -> Path | None:  # fmt: skip
    """Shared library of C text, from the cache if possible, or None.

    The cache key lacks the headers of `include`, whose version the text must contain.
    """
    compiler = find_compiler()
    if compiler is None:
        return None
    extra = [*flags, *([] if include is None else ["-I", str(include)])]
    library = cache_dir(name) / _digest(text, " ".join([*compiler, *FLAGS, *flags]))[:24] / f"{name}.so"
    if not library.is_file():
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as work:
            (Path(work) / f"{name}.c").write_text(text, encoding="utf-8")
            try:
                compile_library([f"{name}.c"], f"{name}.so", Path(work), extra)
            except CompilerFailed:
                return None
            os.replace(Path(work) / f"{name}.so", library)
    return library


def common_folder() -> Path:
    """Folder with the FMI interface code shared by source FMUs."""
    return next(folder / "common" for folder in data_dirs("fmus") if (folder / "common" / "model.h").is_file())


def _digest(*parts: str | bytes) -> str:
    whole = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        whole.update(len(data).to_bytes(8, "little") + data)
    return whole.hexdigest()


def _headers(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.h"))


def _token(folder: Path, table: VariableTable, common: Path) -> str:
    files = [
        folder / "fmu.toml",
        *(folder / s for s in table.sources),
        *_headers(folder),
        *sorted(common.glob("*.[ch]")),
    ]
    parts = [part for file in files for part in (file.name, file.read_bytes())]
    return "{" + _digest(*parts)[:32] + "}"


def _make(table: VariableTable, folder: Path, common: Path, token: str, version: int, work: Path) -> Path:
    from fmpy import platform, platform_tuple, sharedLibraryExtension

    tree = work / "tree"
    sources = tree / "sources"
    sources.mkdir(parents=True)
    names = [f"face{version}.c", *table.sources]
    shared = [common / n for n in ("model.h", "instance.h", f"abi{version}.h", f"face{version}.c")]
    shared += [common / "unused3.h"] if version == 3 else []
    for file in [*shared, *(folder / s for s in table.sources), *_headers(folder)]:
        shutil.copyfile(file, sources / file.name)
    (sources / "variables.h").write_text(variables_header(table, token), encoding="utf-8")
    where = tree / "binaries" / (platform if version == 2 else platform_tuple)
    where.mkdir(parents=True)
    library = table.name + sharedLibraryExtension
    compile_library(names, library, sources)
    os.replace(sources / library, where / library)
    (tree / "modelDescription.xml").write_text(model_description(table, token, version), encoding="utf-8")
    if version == 3:
        (sources / "buildDescription.xml").write_text(build_description(table, names), encoding="utf-8")
    readme = folder / "README.md"
    if readme.is_file():
        (tree / "documentation").mkdir()
        shutil.copyfile(readme, tree / "documentation" / "README.md")
    return pack(tree, work / f"{table.name}.fmu")


def pack(tree: Path, out: Path) -> Path:
    """Zip a folder reproducibly: sorted names, fixed date and permission."""
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(p for p in tree.rglob("*") if p.is_file()):
            entry = zipfile.ZipInfo(file.relative_to(tree).as_posix(), (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, file.read_bytes())
    return out


@cache
def library(source: Path) -> ctypes.CDLL | None:
    """Built library, or None."""
    try:
        path = build_source(source)
        return None if path is None else ctypes.CDLL(str(path))
    except OSError:
        return None


class Record:
    """A C struct of array addresses (8-byte numbers), integers and doubles."""

    def __init__(self, fields: Mapping[str, NDArray[Any] | int | float]) -> None:
        names: list[tuple[str, type]] = []
        for name, value in fields.items():
            number = ctypes.c_int64 if isinstance(value, int) else ctypes.c_double
            names.append((name, ctypes.c_void_p if isinstance(value, np.ndarray) else number))
        told = type("Told", (ctypes.Structure,), {"_fields_": names})
        self._told = told(*(x.ctypes.data if isinstance(x, np.ndarray) else x for x in fields.values()))
        self._told.kept = dict(fields)

    def bound(self, built: ctypes.CDLL, name: str, *more: type) -> Callable[..., int]:
        """C function of this record and `more` numbers, which returns an integer."""
        found = built[name]
        found.argtypes, found.restype = [ctypes.c_void_p, *more], ctypes.c_int64
        return partial(found, ctypes.byref(self._told))


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltFmu:
    """A built FMU: name, version of the standard ("2.0" or "3.0") and absolute path."""

    name: str
    fmi_version: str
    path: Path


def fmu_folders() -> dict[str, Path]:
    """Source folder of every named FMU, the user's own first."""
    names: dict[str, Path] = {}
    for kind in data_dirs("fmus"):
        for folder in sorted(p.parent for p in kind.glob("*/fmu.toml")):
            names.setdefault(folder.name, folder.resolve())
    return names


def built() -> list[BuiltFmu]:
    """FMUs whose present sources are built."""
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
        UnknownName: no such folder; and as `build_fmu`.
    """
    folders = fmu_folders()
    if name not in folders:
        raise UnknownName("fmu", name, folders)
    return [BuiltFmu(name=name, fmi_version=f"{v}.0", path=build_fmu(folders[name], v)) for v in VERSIONS]


def copied(row: BuiltFmu, folder: Path) -> BuiltFmu:
    """Copy a built FMU into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{row.path.stem}_fmi{row.fmi_version[0]}.fmu"
    shutil.copyfile(row.path, path)
    return replace(row, path=path.resolve())


def find_fmu(name_or_path: str | Path, base: Path | None = None, version: int = 2) -> Path:
    """File of an FMU: a name in `fmus/` (built if needed), or a path relative to `base`.

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
        raise InputError(path, "is a folder", "give an .fmu file or a name from `skillframe fmu`")
    if path.suffix == ".fmu" or len(path.parts) > 1:
        raise InputError(path, "no such file", "give an .fmu file or a name from `skillframe fmu`")
    raise UnknownName("fmu", text, folders)
