"""`skillframe doctor`: what is installed, what is missing, and what to type."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib import metadata
from importlib.util import find_spec
from typing import NamedTuple

import click

from skillframe.cli.output import emit_json, table
from skillframe.errors import EXTRAS

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
COMPILERS = ("cc", "gcc", "clang")


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One thing that skillframe uses.

    Attributes:
        name: of it.
        found: version or place; empty if it is missing.
        needed_for: what does not work without it.
        required: whether the core needs it.
        fix: command that installs it; empty if it is there.
    """

    name: str
    found: str
    needed_for: str
    required: bool = False
    fix: str = ""


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(as_json: bool) -> int:
    """Show what is installed, what is missing and what to type. Exits 1 if something required is missing.

    \b
    Example:
      skillframe doctor
      skillframe doctor --json
    """
    findings = list(examine())
    if as_json:
        emit_json([asdict(finding) for finding in findings])
    else:
        table(
            ("what", "found", "needed for"),
            [[f.name, f.found or ("MISSING" if f.required else "not found"), f.needed_for] for f in findings],
        )
        for finding in findings:
            if finding.fix:
                click.echo(f"{finding.name}: {finding.fix}")
    return int(any(finding.required and finding.fix for finding in findings))


def examine() -> Iterator[Check]:
    """Everything that skillframe uses, the required first."""
    version = ".".join(map(str, sys.version_info[:3]))
    fix = "install Python 3.11 or newer, then: make install" if sys.version_info < (3, 11) else ""
    yield Check(name="python", found=version, needed_for="everything", required=True, fix=fix)
    for needed in _requirements("skillframe"):
        if not needed.extra:
            fix = "" if needed.met else f"{sys.executable} -m pip install '{needed}'"
            yield Check(name=needed.name, found=needed.found, needed_for="the core", required=True, fix=fix)
    yield from _extras("skillframe")
    yield _compiler()
    from skillframe.extend.registry import registry

    for each in registry().records("requirement"):
        found = each.find()
        yield Check(name=each.name, found=found, needed_for=each.summary, fix="" if found else each.fix())
    found = next((path for name in BROWSERS if (path := shutil.which(name))), "")
    fix = "" if found else "sudo apt install chromium (only the tests that open reports need it)"
    yield Check(name="browser", found=found, needed_for="tests that open reports", fix=fix)
    yield _recordings()
    yield from _plugins()


class _Requirement(NamedTuple):
    name: str
    lowest: str
    found: str
    extra: str

    @property
    def met(self) -> bool:
        return bool(self.found) and _numbers(self.found) >= _numbers(self.lowest)

    def __str__(self) -> str:
        return f"{self.name}>={self.lowest}"


def _requirements(distribution: str) -> Iterator[_Requirement]:
    for requirement in metadata.requires(distribution) or []:
        match = re.match(r"([\w.-]+)(?:\[[\w,-]+\])?\s*(?:[<>=!,.\d]*>=\s*([\d.]+))?", requirement)
        if match is None:
            continue
        try:
            found = metadata.version(match.group(1))
        except metadata.PackageNotFoundError:
            found = ""
        extra = re.search(r"extra == ['\"]([\w-]+)", requirement)
        yield _Requirement(match.group(1), match.group(2) or "0", found, extra.group(1) if extra else "")


def _extras(distribution: str) -> Iterator[Check]:
    requirements = list(_requirements(distribution))
    for extra in dict.fromkeys(each.extra for each in requirements if each.extra not in ("", "all")):
        needed = [each for each in requirements if each.extra == extra]
        name, lacking = f"{distribution}[{extra}]", [str(each) for each in needed if not each.met]
        fix = f"{sys.executable} -m pip install '{name}'  # lacks {', '.join(lacking)}" if lacking else ""
        yield Check(
            name=name,
            found=", ".join(f"{each.name} {each.found}" for each in needed if each.found),
            needed_for=EXTRAS[extra] if distribution == "skillframe" else EXTRAS.get(name, f"a part of {distribution}"),
            fix=fix,
        )


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:3])


def _compiler() -> Check:
    path = next((found for name in COMPILERS if (found := shutil.which(name))), "")
    if not path and find_spec("ziglang") is not None:
        path = "ziglang"
    fix = "" if path else "sudo apt install build-essential (or: pip install ziglang)"
    return Check(name="C compiler", found=path, needed_for="building FMUs", fix=fix)


def _recordings() -> Check:
    setting = os.environ.get("SKILLFRAME_RECORDINGS", "")
    found = setting if setting and os.path.isdir(setting) else ""
    problem = f"{setting} is no folder; " if setting and not found else ""
    fix = (
        "" if found else f"{problem}export SKILLFRAME_RECORDINGS=FOLDER (only tests on third-party recordings need it)"
    )
    return Check(name="recordings", found=found, needed_for="tests on real recordings", fix=fix)


def _plugins() -> Iterator[Check]:
    from skillframe.extend.registry import registry

    before = ""
    for plugin in registry().plugins:
        counts = Counter(each.split(":", 1)[0] for each in plugin.provides)
        provided = ", ".join(f"{count} {kind}{'s' * (count != 1)}" for kind, count in counts.items())
        fix = f"{plugin.error}; {sys.executable} -m pip install --upgrade {plugin.distribution}" if plugin.error else ""
        yield Check(
            name=f"plug-in {plugin.name}",
            found=f"{plugin.distribution} {plugin.version}",
            needed_for=provided or "nothing",
            fix=fix,
        )
        if plugin.distribution not in ("skillframe", before):
            yield from _extras(plugin.distribution)
        before = plugin.distribution
