"""`skillframe demo`: all steps in a few minutes, as the commands that a user would type.

Each step is a command of this program, echoed before it runs: two demonstrations of each task, learning, one run, a
campaign over errors of the fixture's pose beside plain replay, a certificate of the first task's skill, and one report.
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

from skillframe.cli.options import COUNT, SEED, robot_option
from skillframe.cli.output import bold, emit_json, is_quiet
from skillframe.errors import InputError, need
from skillframe.files import write_whole

MARKER = ".skillframe-demo"
VALLEY = """\
# Where does the learned slide work, when the valley is shifted and tilted unknown to the robot?
name = "Valley: shifted and tilted"
seed = 11
trials = {trials}
robot = "{robot}"
world = "valley"
skills = ["valley.skill.json", "replay:demonstrations/valley1.npz"]
duration_s = 6.0
[expect]
rate = {rate:g}                   # the report says whether this is shown
[set]
"start.offset_z" = 0.05      # above the steeper flank of the most tilted valley: a start inside it is no trial
"world.friction" = 0.5       # it was taught at 0.2
[vary]
"fixture.offset_x" = {{ uniform = [-0.015, 0.015] }}
"fixture.tilt_y" = {{ uniform = [-0.45, 0.45] }}
"""
PEG = """\
# Where does the learned insertion work, when the hole is shifted and tilted unknown to the robot?
name = "Peg in hole: the hole shifted and tilted"
seed = 12
trials = {trials}
robot = "{robot}"
world = "peg_in_hole"
coc = "tip"
skills = ["peg.skill.json", "replay:demonstrations/peg1.npz"]
duration_s = 8.0
[expect]
rate = {rate:g}
[set]
"start.offset_z" = 0.002     # above the rim of the most tilted hole
[vary]
"fixture.offset_x" = {{ uniform = [-0.008, 0.008] }}
"fixture.tilt_y" = {{ uniform = [-0.12, 0.12] }}
"""
STEPS = 10
PROOF, CERTIFIED = "proof", "valley"
"""Folder of the certificate, and the task with the fastest trials, whose skill it covers."""
CERTIFY = ["certify", "run"]
TASKS = (("valley", "valley", VALLEY, None), ("peg", "peg_in_hole", PEG, "tip"))


@click.command(name="demo")
@click.option("--out", default="demo", show_default=True, type=click.Path(path_type=Path), help="Folder to make.")
@robot_option
@click.option("--trials", default=96, show_default=True, type=COUNT, help="Trials per skill and campaign.")
@click.option("--rate", default=0.9, show_default=True, type=click.FloatRange(0.5, 1.0, max_open=True),
              help="Success rate to certify.")  # fmt: skip
@click.option("--workers", default=2, show_default=True, type=COUNT, help="Worker processes of the campaigns.")
@click.option("--seed", default=1, show_default=True, type=SEED, help="Seed of the demonstrations.")
@click.option("--json", "as_json", is_flag=True, help="The outcome as JSON alone on stdout; the log goes to stderr.")
def command(out: Path, robot: str, trials: int, rate: float, workers: int, seed: int, as_json: bool) -> int:
    """Demonstrate, learn, run and prove two skills, certify one, and write a report.

    A simulated teacher shows a robot twice how to slide into a valley, and how to put a peg into a hole with 0.25 mm of
    play.

    \b
    Example:
      skillframe demo --out demo
    """
    from skillframe.cli.main import require_command, run

    require_command("report")
    for library in ("mujoco", "pinocchio", "distributed", "cryptography"):
        need(library)
    if out.exists() and (not out.is_dir() or (any(out.iterdir()) and not (out / MARKER).exists())):
        raise InputError(out, "is there already and was not made by demo", "choose another --out")
    if out.exists():
        shutil.rmtree(out)
    (out / "demonstrations").mkdir(parents=True)
    write_whole(out / MARKER, b"made by skillframe demo, which clears this folder\n")
    began = time.perf_counter()
    for name, _, template, _ in TASKS:
        text = template.format(trials=trials, robot=robot, rate=rate)
        write_whole(out / f"{name}.campaign.toml", text.encode())
    steps, quiet, certified = list[list[str]](), is_quiet(), False
    with redirect_stdout(sys.stderr) if as_json else nullcontext():
        for step in _steps(out, robot, trials, rate, workers, seed):  # one at a time, as it copies files in between
            steps.append(step)
            click.echo(bold(f"\n[{len(steps)} of {STEPS}] $ skillframe {shlex.join(step)}"))
            code = run([*step, "--quiet"] if quiet else step)
            certified = certified or (step[: len(CERTIFY)] == CERTIFY and code == 0)
            if code and not (code == 1 and step[0] in ("campaign", "certify")):  # 1: a rate or claim is not met
                return code
    spent = time.perf_counter() - began
    if as_json:
        emit_json(_outcome(out, robot, steps, spent, certified))
        return 0
    report = out / "report.html"
    first = "The certificate" if certified else "Why nothing was certified"
    click.echo(f"\nDone in {spent:.0f} s. {first}: {report}#certificate")
    click.echo(f"Below it, {report} shows what was learned, the runs in 3-D, and where the skills work beside a plain")
    click.echo(f"replay of the demonstrations. To check the certificate: skillframe certify check {out / PROOF}")
    return 0


def _outcome(out: Path, robot: str, steps: list[list[str]], wall_s: float, certified: bool) -> dict[str, Any]:
    from skillframe.campaign.summary import read_summary

    found = {name: read_summary(out / name)["skills"] for name, *_ in TASKS}
    campaigns = [{"robot": robot, "world": world, "skills": found[name]} for name, world, *_ in TASKS]
    typed = [shlex.join(["skillframe", *step]) for step in steps]
    return {
        "report": str(out / "report.html"), "campaigns": campaigns, "certified": certified,
        "certificate": str(out / PROOF / "certificate.json"), "commands": typed, "wall_s": wall_s,
    }  # fmt: skip


def _steps(out: Path, robot: str, trials: int, rate: float, workers: int, seed: int) -> Iterator[list[str]]:
    """The commands, in order."""
    for name, world, _, coc in TASKS:
        demos = [str(out / "demonstrations" / f"{name}{i}.npz") for i in (1, 2)]
        skill = str(out / f"{name}.skill.json")
        yield [
            "record", "--world", world, "--robot", robot, "--count", "2", "--seed", str(seed),
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
