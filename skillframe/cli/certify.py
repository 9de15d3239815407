"""`skillframe certify TASK.toml`: from a teacher or demonstrations to a certificate, as the commands one would type.

Each step is a command of this program, echoed before it runs, and leaves a file by which it is known to be done. The
same command goes on where it was interrupted.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from skillframe.cli.numbers import COUNT
from skillframe.cli.output import bold, is_quiet, quiet_option

if TYPE_CHECKING:
    from skillframe.campaign.claims.task import TaskFile

_PATH = click.Path(path_type=Path)
NOT_CERTIFIED = 1
"""Exit code of a step that ran and whose answer is no."""


class Step(NamedTuple):
    """A command, and how it is known to be done.

    Attributes:
        command: what is typed after `skillframe`.
        done: whether its outcome is there.
        may_say_no: exit code 1 is an answer, and the steps after it still run.
    """

    command: list[str]
    done: Callable[[], bool]
    may_say_no: bool = False


@click.command(name="certify")
@click.argument("task", type=_PATH)
@click.option("--out", type=_PATH, required=True, help="Folder for everything; absent, empty, or this task's.")
@click.option("--workers", type=COUNT, help="Worker processes of the campaigns [in-process].")
@quiet_option
def command(task: Path, out: Path, workers: int | None) -> int:
    """Go from demonstrations, or a simulated teacher, to a certificate. TASK is one TOML file.

    Records or takes demonstrations, learns a skill, finds the border of success, the smallest disturbance that breaks
    it and the quantity that matters, certifies a box, and writes a report. The same command goes on after an
    interruption.

    Exit code 0 if a box was certified, 1 if not.

    \b
    Example:
      skillframe certify valley.task.toml --out valley --workers 2
    """
    from skillframe.campaign.claims.task import TaskFile
    from skillframe.cli.main import run

    given = TaskFile.from_toml(task)
    given.settle(out)
    steps = steps_of(given, out, workers)
    for number, step in enumerate(steps, start=1):
        said = f"[{number} of {len(steps)}] $ skillframe {shlex.join(step.command)}"
        if step.done():
            click.echo(bold(f"\n{said}  (done)"))
            continue
        click.echo(bold(f"\n{said}"))
        given.bring_demonstrations(out)
        code = run([*step.command, "--quiet"] if is_quiet() and step.command[0] != "learn" else step.command)
        if code and not (step.may_say_no and code == NOT_CERTIFIED):
            return code
    return _conclude(out)


def steps_of(task: TaskFile, out: Path, workers: int | None) -> list[Step]:
    """The commands, in order."""
    proof, skill = out / "proof", out / "skill.skill.json"
    crew = [] if workers is None else ["--workers", str(workers)]
    demonstrations = [str(path) for path in task.demonstrations_in(out)]
    recorded = Step(
        ["demonstration", "record", "--world", task.world_from_here, "--robot", task.robot_from_here, "--count",
         str(task.teacher), "--seed", str(task.seed), "--out", str(out / "demonstrations" / "demo.npz")],
        lambda: all(Path(path).is_file() for path in demonstrations),
    )  # fmt: skip
    told = [
        text for name, value in (("--at", task.at), ("--exception", task.exception)) if value for text in (name, value)
    ]
    told += [text for name, value in task.learn.items() for text in ("--set", f"{name}={value}")]
    begun = [str(out / "campaign.toml"), "--out", str(proof)]

    def asked() -> list[str]:
        return [str(proof)] if (proof / "question.json").is_file() else begun

    def there(name: str) -> Callable[[], bool]:
        return lambda: (proof / name).is_file()

    numbers = ["--rate", f"{task.rate:g}", "--confidence", f"{task.confidence:g}"]
    return [
        *([recorded] if task.teacher else []),
        Step(["learn", *demonstrations, "--skill", task.learner, *told, "--out", str(skill)], skill.is_file),
        Step(["campaign", "map", *asked(), *crew], there("border.json")),
        Step(["campaign", "break", str(proof), *crew], there("breaking.json"), may_say_no=True),
        Step(["campaign", "matter", str(proof), *crew], there("matter.json")),
        Step(["campaign", "certify", str(proof), *numbers, *crew], there("certificate.json"), may_say_no=True),
        Step(["report", str(proof), "--out", str(out / "report.html")], (out / "report.html").is_file),
    ]


def _conclude(out: Path) -> int:
    from skillframe.campaign.claims.certificate import CERTIFICATE
    from skillframe.files.documents import read_json

    said = read_json(out / "proof" / CERTIFICATE, "remove it and type the command again")["predicate"]
    word = "Certified" if said["certified"] else "Not certified"
    click.echo(f"\n{word}. Open {out / 'report.html'} in a browser, its first page is the certificate;")
    click.echo(f"to check it: skillframe campaign check {out / 'proof'}")
    return 0 if said["certified"] else NOT_CERTIFIED
