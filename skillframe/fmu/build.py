"""Build an FMU from a folder of sources, once, into a cache keyed by everything that could change the result.

Two builds from the same inputs are the same file to the bit: the zip is sorted and carries one fixed date, the token is
a hash of the sources, and the compiler is called with relative paths.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import zipfile
from pathlib import Path

from skillframe.fmu.describe import build_description, model_description, variables_header
from skillframe.fmu.table import VariableTable, read_table
from skillframe.fmu.toolchain import FLAGS, CompilerFailed, compile_library, find_compiler
from skillframe.paths import cache_dir, data_dirs

VERSIONS = (2, 3)
_DATE = (1980, 1, 1, 0, 0, 0)
_LAYOUT = "1"  # raise when the way of packing changes


def build_fmu(folder: Path, version: int, out: Path | None = None) -> Path:
    """The FMU of a source folder, from the cache if it is there.

    Args:
        folder: holds fmu.toml and the C files it names.
        version: 2 or 3, of the standard.
        out: build into this file instead of the cache.

    Raises:
        MissingDependency: no C compiler and nothing in the cache.
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
    """Where the build of this folder's present sources lies, or would lie."""
    table = read_table(folder)
    key = _digest(_token(folder, table, common_folder()), " ".join(find_compiler() or ["none"]), *FLAGS, _LAYOUT)
    return cache_dir("fmus") / key[:24] / f"fmi{version}" / f"{table.name}.fmu"


def build_source(source: Path) -> Path | None:
    """The shared library of one C file, from the cache if it is there, or None where it cannot be built."""
    return build_library(source.stem, source.read_text(encoding="utf-8"))


def build_library(
    name: str, text: str, include: Path | None = None, flags: tuple[str, ...] = ()
) -> Path | None:  # fmt: skip
    """The shared library of C text, from the cache if it is there, or None where it cannot be built.

    `include` is a folder with headers of others; what they are is not part of the key, so the text has to say it.
    `flags` go to the compiler after its own.
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
    """The folder with the FMI faces that every source FMU shares."""
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
    """Zip a folder reproducibly: sorted names, one date, one permission."""
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(p for p in tree.rglob("*") if p.is_file()):
            entry = zipfile.ZipInfo(file.relative_to(tree).as_posix(), _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, file.read_bytes())
    return out
