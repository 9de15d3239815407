"""Runs one function over many damaged inputs in forked processes: a limit on memory, an alarm, and what came of each.

A process that dies is replaced and its input is written down. `sound` is forked with all that was imported and warmed
up, so an input costs what the function costs. Nothing from skillframe is used.
"""

import contextlib
import io
import json
import os
import random
import resource
import select
import shutil
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tests.oracle.mutations import mutated, numbers_typed

MEMORY = 500_000_000  # bytes beyond those of the process before its first input
SECONDS = 30.0  # for one input, of processor time and of wall time: other work may share the machine
LIMIT_ON_WALL = 10  # wall seconds allowed for each second of SECONDS
INTERRUPTED = 130


@dataclass(frozen=True)
class Case:
    """One kind of input.

    Attributes:
        kind: its name.
        files: name and content of everything that lies in the folder.
        target: the file that is damaged; "" where a number is typed instead.
        commands: command lines in which {} is the folder and # a typed number; one is drawn.
        share: how often it is drawn, relative to the others.
        refused: whether even the sound file is refused.
    """

    kind: str
    files: dict
    target: str
    commands: list
    share: float = 1.0
    refused: bool = False


@dataclass
class Found:
    """Counts by kind and outcome, and the bad ones: (index, kind, outcome, command, what was said)."""

    counts: Counter = field(default_factory=Counter)
    bad: list = field(default_factory=list)
    spent: Counter = field(default_factory=Counter)
    seconds: float = 0.0
    most_bytes: int = 0


class Hang(BaseException):
    """The alarm: no `except Exception` takes it."""


def fuzz(cases, run, count, seed, folder, tell=lambda done: None):
    """Give `count` damaged inputs to `run(arguments) -> exit code`. Returns what came of them."""
    warm_up(cases, run, folder)
    found, began, index = Found(), time.perf_counter(), 0
    while index < count:
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reader)
            work(cases, run, range(index, count), seed, folder, writer)
        os.close(writer)
        index = collect(reader, child, found, index, cases, seed, tell)
    found.seconds = time.perf_counter() - began
    return found


def warm_up(cases, run, folder):
    """Every command once on a sound input, so that every process is forked with all that they import."""
    for case in cases:
        for command in case.commands:
            words = ["1" if word == "#" else word for word in command]
            outcome, said = one(case, case.files.get(case.target, b""), words, run, Path(folder) / "warm")
            fine = (
                ("0", "1", str(INTERRUPTED)) if case.target and not case.refused else ("0", "1", "2", str(INTERRUPTED))
            )
            assert outcome in fine, (case.kind, words, outcome, said)


def collect(reader, child, found, index, cases, seed, tell):
    """Results of one process until it ends, and the index after the last input that it got."""
    rest = b""
    while True:
        ready, _, _ = select.select([reader], [], [], SECONDS * LIMIT_ON_WALL + 30.0)
        block = os.read(reader, 65536) if ready else b""
        if not block:
            break
        *lines, rest = (rest + block).split(b"\n")
        for line in lines:
            index, kind, outcome, command, said, size, spent = json.loads(line)
            found.spent[kind] += spent
            found.counts[kind, outcome] += 1
            found.most_bytes = max(found.most_bytes, size)
            if outcome not in ("0", "1", "2", str(INTERRUPTED)):
                found.bad.append((index, kind, outcome, command, said))
            index += 1
            tell(index)
    os.close(reader)
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL if not ready else 0)
    _, status = os.waitpid(child, 0)
    if status or not ready:
        case, *_ = drawn(cases, index, seed)
        outcome = "hang" if not ready else f"died of {status}"
        found.counts[case.kind, outcome] += 1
        found.bad.append((index, case.kind, outcome, "", ""))
        index += 1
    return index


def drawn(cases, index, seed):
    """Input number `index`: case, damaged content and command. The same for one seed, whatever ran before."""
    rng = random.Random(f"{seed}/{index}")
    case = rng.choices(cases, [case.share for case in cases])[0]
    content = mutated(case.target, case.files[case.target], rng) if case.target else b""
    command = [numbers_typed(rng) if word == "#" else word for word in rng.choice(case.commands)]
    return case, content, command


def work(cases, run, indices, seed, folder, writer):
    """In the child: limits, then inputs one after another, a line of JSON for each."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGALRM, alarm)
    signal.signal(signal.SIGPROF, alarm)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    place = Path(folder) / f"work{os.getpid()}"
    try:
        for index in indices:
            case, content, command = drawn(cases, index, seed)
            began = time.process_time()
            outcome, said = one(case, content, command, run, place)
            spent = time.process_time() - began
            more = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
            os.write(
                writer, json.dumps([index, case.kind, outcome, command, said[-1500:], more, spent]).encode() + b"\n"
            )
    finally:
        shutil.rmtree(place, ignore_errors=True)
        os._exit(0)


def alarm(number, frame):
    raise Hang


def one(case, content, command, run, place):
    """Outcome of one input, and what was said."""
    shutil.rmtree(place, ignore_errors=True)
    for name, sound in case.files.items():
        file = place / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content if name == case.target else sound)
    (place / "out").mkdir()
    arguments = [word.replace("{}", str(place)) for word in command]
    said, err, code = io.TextIOWrapper(io.BytesIO(), encoding="utf-8"), io.StringIO(), None
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.setitimer(signal.ITIMER_REAL, SECONDS * LIMIT_ON_WALL)
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(err), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            code = run(arguments)
    except Hang:
        return "hang", ""
    except BaseException:
        return "traceback", traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
    return judged(code, err.getvalue(), place / "out", case.kind), err.getvalue()


def judged(code, said, out, kind):
    """The exit code where all promises are kept, else the promise that was broken."""
    if code not in (0, 1, 2, INTERRUPTED):
        return f"exit {code}"
    if "Traceback (most recent" in said:
        return "traceback"
    if "memory ran out" in said:
        return "memory"
    left = [path.name for path in out.rglob("*") if path.is_file()]
    if code == 2 and left:
        return "output left behind"
    if any(name.startswith(".") or name.endswith((".tmp", ".part")) for name in left):
        return "temporary file left behind"
    if code == 2 and not said.strip():
        return "exit 2 without a word"
    return str(code)


def table(found):
    """Lines of counts: kind, then outcomes."""
    kinds = sorted({kind for kind, _ in found.counts})
    outcomes = sorted({outcome for _, outcome in found.counts})
    yield f"{'kind':28}" + "".join(f"{outcome:>12}" for outcome in outcomes)
    for kind in kinds:
        cells = "".join(f"{found.counts[kind, outcome]:12}" for outcome in outcomes)
        runs = sum(found.counts[kind, outcome] for outcome in outcomes)
        yield f"{kind:28}{cells}{1e3 * found.spent[kind] / runs:10.0f} ms"
    total = [sum(n for (_, o), n in found.counts.items() if o == outcome) for outcome in outcomes]
    yield f"{'all ' + str(sum(total)):28}" + "".join(f"{n:12}" for n in total)
    yield f"{found.seconds:.0f} s; memory beyond the start at most {found.most_bytes / 1e6:.0f} MB"


if sys.platform != "linux":
    raise ImportError("forks and /proc are needed")
