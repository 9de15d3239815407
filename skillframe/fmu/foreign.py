"""Compile the C sources that a foreign FMU carries, for this machine, against the standard headers fmpy ships."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from skillframe.errors import InputError
from skillframe.fmu.build import pack
from skillframe.fmu.extract import content_hash, unpack
from skillframe.fmu.inspection import inspect_fmu
from skillframe.fmu.library import BuiltFmu
from skillframe.fmu.toolchain import compile_library
from skillframe.paths import cache_dir


def build_from_sources(path: Path) -> BuiltFmu:
    """An FMU like the given one, with a binary for this machine added. It is cached, and not allowed in-process.

    Raises:
        InputError: no C sources, or none that its description lists.
        CompilerFailed, MissingDependency: as `compile_library`.
    """
    import fmpy

    facts = inspect_fmu(path)
    if not facts.has_sources:
        raise InputError(path, "carries no C sources", f"ask its maker for {fmpy.platform} or for sources")
    out = cache_dir("fmus-compiled") / content_hash(path)[:24] / path.name
    if "co_simulation" not in facts.kinds:
        raise InputError(path, f"holds {' and '.join(facts.kinds)} only", "export it as co-simulation")
    files, defines = list(facts.source_files), list(facts.definitions)
    if not files:
        raise InputError(path, "does not list its source files", "ask its maker for a binary")
    for name in files:
        if name.startswith("-") or not (unpack(path) / "sources" / name).is_file() or ".." in Path(name).parts:
            raise InputError(path, f"lists the source {name!r}, which is not in its folder sources", "export it again")
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent) as work:
        tree = Path(work) / "tree"
        shutil.copytree(unpack(path), tree)
        library = facts.identifier + fmpy.sharedLibraryExtension
        headers = Path(fmpy.__file__).parent / "c-code"
        extra = ["-fvisibility=default", f"-I{headers}", "-std=gnu11", *defines]
        compile_library(files, library, tree / "sources", extra)
        where = tree / "binaries" / (fmpy.platform if facts.fmi_version.startswith("2") else fmpy.platform_tuple)
        where.mkdir(parents=True, exist_ok=True)
        os.replace(tree / "sources" / library, where / library)
        os.replace(pack(tree, Path(work) / "made.fmu"), out)
    return BuiltFmu(name=facts.name, fmi_version=facts.fmi_version, path=out)
