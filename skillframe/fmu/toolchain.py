"""The C compiler: which one, and one way of calling it."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from skillframe.errors import MissingDependency, SkillframeError

# Contraction of a*b+c into one rounding depends on the machine; without it results repeat between machines.
FLAGS = ("-O2", "-std=c11", "-fPIC", "-shared", "-fvisibility=hidden", "-fno-math-errno", "-ffp-contract=off")


class CompilerFailed(SkillframeError):
    """The compiler refused the sources. The text has the first lines of what it said."""


def find_compiler() -> list[str] | None:
    """The command of a C compiler: $CC, then cc, gcc, clang on the path, then `ziglang` if it is installed."""
    chosen = os.environ.get("CC")
    if chosen:
        command = shlex.split(chosen)
        return command if shutil.which(command[0]) else None
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def require_compiler(purpose: str) -> list[str]:
    """As `find_compiler`.

    Raises:
        MissingDependency: there is none.
    """
    command = find_compiler()
    if command is None:
        raise MissingDependency("a C compiler (cc, gcc, clang or $CC)", purpose, "pip install ziglang")
    return command


def compile_library(sources: Sequence[str], out: str, folder: Path, extra: Sequence[str] = ()) -> None:
    """Compile C files (relative to `folder`, so that no path enters the binary) into a shared library.

    Raises:
        CompilerFailed: with the compiler's first lines.
        MissingDependency: no compiler.
    """
    command = [*require_compiler("building an FMU"), *FLAGS, *extra, "-I.", *sources, "-o", out, "-lm"]
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    if result.returncode:
        said = " | ".join(line.strip() for line in result.stderr.splitlines() if "error" in line)[:600]
        raise CompilerFailed(f"the C compiler refused {', '.join(sources)}: {said or result.stderr[:600]}")
