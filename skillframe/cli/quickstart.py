"""`skillframe quickstart`: the whole way in a few minutes, as the commands a person would type.

Each step is a command of this program, echoed before it runs, so that the log doubles as a tutorial: two demonstrations
of each task, learning, one run, a campaign over errors of the fixture's pose beside plain replay, a certificate of the
first task's skill, and one report.
"""

from __future__ import annotations

import shlex
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import Any

import click

from skillframe.cli.certify import NOT_CERTIFIED
from skillframe.cli.names import robot_option
from skillframe.cli.numbers import COUNT, SEED
from skillframe.cli.output import bold, emit_json, is_quiet, quiet_option
from skillframe.errors import need
from skillframe.files import write_whole

MARKER = ".skillframe-quickstart"
VALLEY = """\
# Where does the learned slide work, when the valley is shifted and tilted and nobody tells the robot?
name = "Valley: shifted and tilted"
seed = 11
trials = {trials}
robot = "{robot}"
world = "valley"
skills = ["valley.skill.json", "replay:demonstrations/valley1.npz"]
duration_s = 6.0
[set]
"start.offset_z" = 0.035     # above the steeper flank of the most tilted valley
"world.friction" = 0.5       # it was taught at 0.2
[vary]
"fixture.offset_x" = {{ sobol = [-0.015, 0.015] }}
"fixture.tilt_y" = {{ sobol = [-0.45, 0.45] }}
"""
PEG = """\
# Where does the learned insertion work, when the hole is shifted and tilted and nobody tells the robot?
name = "Peg in hole: the hole shifted and tilted"
seed = 12
trials = {trials}
robot = "{robot}"
world = "peg_in_hole"
coc = "tip"
skills = ["peg.skill.json", "replay:demonstrations/peg1.npz"]
duration_s = 8.0
[vary]
"fixture.offset_x" = {{ sobol = [-0.008, 0.008] }}
"fixture.tilt_y" = {{ sobol = [-0.12, 0.12] }}
"""
STEPS = 10
PROOF, CERTIFIED = "proof", "valley"
"""Folder of the certificate, and the task whose skill it is of: its trials are the quickest."""
CERTIFY = ["campaign", "certify"]
TASKS = (("valley", "valley", VALLEY, None), ("peg", "peg_in_hole", PEG, "tip"))


@click.command(name="quickstart")
@click.option("--out", default="demo", show_default=True, type=click.Path(path_type=Path), help="Folder to make.")
@robot_option
@click.option("--trials", default=96, show_default=True, type=COUNT, help="Trials per skill and campaign.")
@click.option("--rate", default=0.9, show_default=True, type=click.FloatRange(0.5, 1.0, max_open=True),
              help="Success rate to certify.")  # fmt: skip
@click.option("--workers", default=2, show_default=True, type=COUNT, help="Worker processes of the campaigns.")
@click.option("--seed", default=1, show_default=True, type=SEED, help="Seed of the demonstrations.")
@click.option("--json", "as_json", is_flag=True, help="The outcome as JSON alone on stdout; the log goes to stderr.")
@quiet_option
def command(out: Path, robot: str, trials: int, rate: float, workers: int, seed: int, as_json: bool) -> int:
    """Demonstrate, learn, run and prove two skills, certify one, and write a report.

    A simulated person shows a robot twice how to slide into a valley, and how to put a peg into a hole with 0.25 mm of
    play.

    \b
    Example:
      skillframe quickstart --out demo
    """
    for library in ("mujoco", "pinocchio", "distributed", "cryptography"):
        need(library)
    _make_room(out)
    began = time.perf_counter()
    for name, _, template, _ in TASKS:
        text = template.format(trials=trials, robot=robot)
        write_whole(out / f"{name}.campaign.toml", text.encode())
    steps, quiet = list[list[str]](), is_quiet()
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        for step in _steps(out, robot, trials, rate, workers, seed):  # it copies files between, so one at a time
            steps.append(step)
            code = _type(step, len(steps), quiet)
            if code and not (code == NOT_CERTIFIED and step[:2] == CERTIFY):
                return code
    spent = time.perf_counter() - began
    if as_json:
        emit_json(_outcome(out, robot, steps, spent))
        return 0
    click.echo(f"\nDone in {spent:.0f} s. Open {out / 'report.html'} in a browser: what was learned,")
    click.echo("the runs in 3-D, where the skills work, beside a plain replay of the demonstrations, and")
    click.echo(f"{_verdict(out)} on a page to print. To check it: skillframe campaign check {out / PROOF}")
    return 0


def _outcome(out: Path, robot: str, steps: list[list[str]], wall_s: float) -> dict[str, Any]:
    """What a script wants to know: where the report is, and how each campaign ended."""
    from skillframe.campaign.claims.certificate import CERTIFICATE
    from skillframe.campaign.summary import read_summary

    found = {name: read_summary(out / name)["skills"] for name, *_ in TASKS}
    campaigns = [{"robot": robot, "world": world, "skills": found[name]} for name, world, *_ in TASKS]
    typed = [shlex.join(["skillframe", *step]) for step in steps]
    return {
        "report": str(out / "report.html"), "campaigns": campaigns, "certified": _certified(out)["certified"],
        "certificate": str(out / PROOF / CERTIFICATE), "commands": typed, "wall_s": wall_s,
    }  # fmt: skip


def _certified(out: Path) -> dict[str, Any]:
    from skillframe.campaign.claims.certificate import CERTIFICATE
    from skillframe.files.documents import read_json

    predicate: dict[str, Any] = read_json(out / PROOF / CERTIFICATE, "type the command again")["predicate"]
    return predicate


def _verdict(out: Path) -> str:
    return "a certificate" if _certified(out)["certified"] else "why nothing was certified"


def _make_room(out: Path) -> None:
    """An empty folder. An earlier quickstart's is cleared, anything else is left alone.

    Raises:
        InputError: the folder holds something that no quickstart made.
    """
    from skillframe.errors import InputError

    if out.exists() and (not out.is_dir() or (any(out.iterdir()) and not (out / MARKER).exists())):
        raise InputError(out, "is there already and was not made by quickstart", "choose another --out")
    if out.exists():
        shutil.rmtree(out)
    (out / "demonstrations").mkdir(parents=True)
    write_whole(out / MARKER, b"made by skillframe quickstart, which clears this folder\n")


def _steps(out: Path, robot: str, trials: int, rate: float, workers: int, seed: int) -> Iterator[list[str]]:
    """The commands, in order."""
    for name, world, _, coc in TASKS:
        demos = [str(out / "demonstrations" / f"{name}{i}.npz") for i in (1, 2)]
        skill = str(out / f"{name}.skill.json")
        yield [
            "demonstration", "record", "--world", world, "--robot", robot, "--count", "2", "--seed", str(seed),
            "--out", str(out / "demonstrations" / f"{name}.npz"),
        ]  # fmt: skip
        yield ["learn", *demos, "--out", skill]
        where = [] if coc is None else ["--coc", coc]
        start = "start.offset_x=0.02" if name == "valley" else "fixture.tilt_y=0.08"
        trace, plan = str(out / f"{name}.npz"), str(out / f"{name}.campaign.toml")
        yield ["run", skill, "--world", world, "--robot", robot, *where, "--set", start, "--out", trace]
        yield ["campaign", "run", plan, "--out", str(out / name), "--workers", str(workers)]
        _copy(demos, out / name / "demonstrations")
        _copy([trace], out / name / "traces")
    yield [
        *CERTIFY, str(out / f"{CERTIFIED}.campaign.toml"), "--rate", f"{rate:g}", "--look", str(trials),
        "--out", str(out / PROOF), "--workers", str(workers),
    ]  # fmt: skip
    for fresh in sorted((out / PROOF).glob("claim*/fresh")):
        _copy([str(out / "demonstrations" / f"{CERTIFIED}{i}.npz") for i in (1, 2)], fresh / "demonstrations")
    shown = [str(out / name) for name in (*(name for name, *_ in TASKS), PROOF)]
    yield ["report", *shown, "--out", str(out / "report.html")]


def _copy(files: list[str], folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for file in files:
        shutil.copy(file, folder)


def _type(step: list[str], number: int, quiet: bool) -> int:
    """Echo a command and run it. `learn` has warnings only, and so nothing to leave out."""
    from skillframe.cli.main import run

    click.echo(bold(f"\n[{number} of {STEPS}] $ skillframe {shlex.join(step)}"))
    return run([*step, "--quiet"] if quiet and step[0] != "learn" else step)
