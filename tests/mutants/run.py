"""Single changes of the core mathematics, and whether the everyday test that is named beside each one notices it.

`mutants.toml` holds them: a file, a text that stands in it once, what takes its place, and the tests that must fail
then. Each is made in a copy of the tree, never in the tree itself, and its tests are run there: those that are not slow
and repeat no figures, in a fixed order, with hypothesis' random numbers fixed. Before, all named tests must pass in the
copy as it is. What was found is kept (`build/mutants.json`), so that a run that was cut short goes on; it is forgotten
as soon as any file of the tree changes.

    python -m tests.mutants.run [--only TEXT] [--jobs 2] [--again] [--json] [--results FILE]

The exit code is 0 if at least 95 % are caught, 1 if not, and 2 if the list is wrong or the tests fail as they are.
"""

from __future__ import annotations

import argparse
import ast
import csv
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from queue import SimpleQueue

ROOT = Path(__file__).resolve().parents[2]
LIST, KEPT = Path(__file__).with_name("mutants.toml"), ROOT / "build" / "mutants.json"
LEAST, LIMIT_S, LATE = 0.95, 600.0, -1000  # the share, the time for one change, and the code of one that took longer
CACHES = {".hypothesis", ".pytest_cache", ".mypy_cache", ".ruff_cache", "__pycache__"}
LEFT_OUT = CACHES | {".git", ".venv", "build", "dist"}
RESULTS = Path(__file__).with_name("caught.csv")  # of the last run: the page of the docs is made of it


class WrongList(Exception):
    """The list, or a test that it names, is not as it should be: a sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """One change.

    Attributes:
        what: is wrong then, in words.
        file: below the root of the tree.
        before, after: `before` stands once in the file.
        tests: files, or tests of a file, one of which must fail.
        survived: it once did, and a test was written.
    """

    what: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]
    survived: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of a mutant: whether it was caught, by which test, and the seconds that took."""

    what: str
    caught: bool
    by: str
    seconds: float


def mutants(path: Path = LIST) -> list[Mutant]:
    """The list."""
    rows = tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]
    return [Mutant(**{**row, "tests": tuple(row["tests"])}) for row in rows]


def problems(listed: Sequence[Mutant], root: Path = ROOT) -> Iterator[str]:
    """What is wrong with a list: sentences."""
    names = [m.what for m in listed]
    yield from (f"{name!r} stands twice" for name in sorted({n for n in names if names.count(n) > 1}))
    for m in listed:
        if (root / m.file).is_file():
            count = (root / m.file).read_text(encoding="utf-8").count(m.before)
            if count != 1:
                yield f"{m.what!r}: its text stands {count} times in {m.file}, not once: {m.before!r}"
        else:
            yield f"{m.what!r}: there is no {m.file}"
        if m.before == m.after:
            yield f"{m.what!r} changes nothing"
        yield from (f"{m.what!r}: there is no test {test}" for test in m.tests if not _there(root, test))


def _there(root: Path, test: str) -> bool:
    file, _, name = test.partition("::")
    return (root / file).is_file() and (not name or name in _functions(root / file))


@cache
def _functions(file: Path) -> set[str]:
    """Names of a file's functions."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def mutated(root: Path, mutant: Mutant) -> None:
    """Make a change in a copy of the tree, and forget what Python compiled of the file."""
    _write(root, mutant.file, (root / mutant.file).read_text(encoding="utf-8").replace(mutant.before, mutant.after))


def _write(root: Path, name: str, text: str) -> None:
    file = root / name
    file.write_text(text, encoding="utf-8")
    for old in (file.parent / "__pycache__").glob(f"{file.stem}.*.pyc"):
        old.unlink()


def copied(to: Path) -> Path:
    """A copy of the tree."""
    shutil.copytree(ROOT, to, ignore=lambda _, names: LEFT_OUT.intersection(names), symlinks=True)
    return to


def environment(root: Path) -> dict[str, str]:
    """That of a Python whose skillframe and plug-ins are those of a copy, with one thread each."""
    places = [root, *sorted((root / "plugins").glob("*/src"))]
    own = {"PYTHONPATH": os.pathsep.join(map(str, places)), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **own}


def ran(root: Path, tests: Sequence[str], limit: float = LIMIT_S) -> tuple[int, str]:
    """Pytest's exit code and what it printed, for the everyday ones of some tests within so many seconds."""
    options = ("-x", "-q", "-m", "not slow and not figures", "-p", "no:cacheprovider", "--hypothesis-seed=0")
    command = [sys.executable, "-m", "pytest", *options, *tests]
    try:
        done = subprocess.run(
            command, cwd=root, env=environment(root), capture_output=True, text=True, timeout=limit, check=False
        )
    except subprocess.TimeoutExpired:
        return LATE, f"not done within {limit:g} s"
    return done.returncode, done.stdout + done.stderr


def require_own_modules(root: Path, files: Sequence[str]) -> None:
    """Refuse to run where an import would find another tree's module than that of the copy."""
    names = sorted({".".join(Path(file.partition("/src/")[2] or file).with_suffix("").parts) for file in files})
    code = f"import importlib\nfor n in {names!r}: print(importlib.import_module(n).__file__)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env=environment(root), capture_output=True, text=True, check=False
    )
    elsewhere = [line for line in done.stdout.split() if not Path(line).is_relative_to(root)]
    if done.returncode or elsewhere:
        raise WrongList(f"the copy's own code cannot be imported: {' '.join(elsewhere) or done.stderr[-500:]}")


def judged(root: Path, mutant: Mutant) -> Outcome:
    """Make one change in a copy, run its tests, and take the change back."""
    kept, began = (root / mutant.file).read_text(encoding="utf-8"), time.monotonic()
    mutated(root, mutant)
    try:
        code, said = ran(root, mutant.tests)
    finally:
        _write(root, mutant.file, kept)
    if code == LATE:
        return Outcome(what=mutant.what, caught=False, by=said, seconds=time.monotonic() - began)
    if code not in (0, 1):
        raise WrongList(f"{mutant.what!r}: pytest ended with {code}, its tests were not run: {said[-500:]}")
    found = re.search(r"^FAILED ([^\s\[]+)", said, re.MULTILINE)
    by = found[1] if found else mutant.tests[0]
    return Outcome(what=mutant.what, caught=code == 1, by=by if code else "", seconds=time.monotonic() - began)


def all_judged(chosen: Sequence[Mutant], jobs: int, kept: dict[str, Outcome], state: str) -> list[Outcome]:
    """What comes of some mutants, each worker in a copy of its own."""
    left = [m for m in chosen if m.what not in kept]
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies: SimpleQueue[Path] = SimpleQueue()
        if left:
            first = copied(Path(folder) / "0")
            require_own_modules(first, [m.file for m in left])
            names = sorted({test for m in left for test in m.tests})
            code, said = ran(first, names, LIMIT_S * len(names))
            if code:
                raise WrongList(f"tests fail, or are missing, without any change:\n{said[-2000:]}")
            copies.put(first)
        for i in range(1, min(jobs, len(left))):
            copies.put(copied(Path(folder) / str(i)))

        def one(mutant: Mutant) -> Outcome:
            root = copies.get()
            try:
                return judged(root, mutant)
            finally:
                copies.put(root)

        with ThreadPoolExecutor(jobs) as pool:
            for outcome in pool.map(one, left):
                kept[outcome.what] = outcome
                print(_line(outcome), file=sys.stderr, flush=True)
                KEPT.parent.mkdir(exist_ok=True)
                KEPT.write_text(json.dumps({"state": state, "outcomes": [asdict(o) for o in kept.values()]}, indent=1))
    return [kept[m.what] for m in chosen]


def state_of_tree() -> str:
    """A hash of everything in the tree that a copy would hold."""
    digest = hashlib.sha256()
    for folder, inner, files in os.walk(ROOT):
        inner[:] = sorted(set(inner) - LEFT_OUT)
        for name in sorted(files):
            path = Path(folder) / name
            digest.update(f"{path.relative_to(ROOT)}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def kept_of(state: str) -> dict[str, Outcome]:
    """What an earlier run found out about the tree as it is now."""
    if not KEPT.is_file() or (read := json.loads(KEPT.read_text()))["state"] != state:
        return {}
    return {row["what"]: Outcome(**row) for row in read["outcomes"]}


def _line(outcome: Outcome) -> str:
    return f"{'caught  ' if outcome.caught else 'SURVIVED'} {outcome.seconds:5.1f} s  {outcome.what}  {outcome.by}"


def _sum(outcomes: Sequence[Outcome]) -> str:
    caught = sum(o.caught for o in outcomes)
    return f"{len(outcomes)} single changes: {caught} caught, {len(outcomes) - caught} survived"


def caught_by(path: Path = RESULTS) -> dict[str, str]:
    """The test that caught each change in the last run, "" for those that survived."""
    with path.open(newline="", encoding="utf-8") as file:
        return {row["change"]: row["caught_by"] for row in csv.DictReader(file)}


def record(path: Path, listed: Sequence[Mutant], outcomes: Sequence[Outcome]) -> None:
    """Write outcomes to a file of results. Results of other changes stay as long as these are listed."""
    known = (caught_by(path) if path.is_file() else {}) | {o.what: o.by if o.caught else "" for o in outcomes}
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(("change", "caught_by"))
        rows.writerows((m.what, known[m.what]) for m in listed if m.what in known)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command. Returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants.run", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", default="", help="those whose words or file hold this text")
    parser.add_argument("--jobs", type=int, default=1, help="how many at a time, each in a copy of its own")
    parser.add_argument("--again", action="store_true", help="forget what an earlier run found")
    parser.add_argument("--json", action="store_true", help="print what came of each as JSON")
    parser.add_argument("--results", type=Path, help="a CSV file that is updated with the results")
    given = parser.parse_args(arguments)
    listed = mutants()
    chosen = [m for m in listed if given.only in m.what or given.only in m.file]
    try:
        for problem in problems(listed):
            raise WrongList(problem)
        state = state_of_tree()
        outcomes = all_judged(chosen, max(given.jobs, 1), {} if given.again else kept_of(state), state)
        if given.results:
            record(given.results, listed, outcomes)
    except WrongList as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2
    caught = sum(o.caught for o in outcomes)
    if given.json:
        found = {"mutants": len(outcomes), "caught": caught, "outcomes": [asdict(o) for o in outcomes]}
        print(json.dumps(found, indent=1))
    else:
        print("\n".join([*(_line(o) for o in outcomes if not o.caught), _sum(outcomes)]))
    return 0 if caught >= LEAST * len(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
