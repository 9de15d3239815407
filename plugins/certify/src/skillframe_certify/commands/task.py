"""`skillframe certify run TASK.toml`: from demonstrations to a certificate, as a list of commands.

Each step is a command of this program, printed before it runs. The file that it leaves marks it as done, so the same
command continues after an interruption.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from skillframe.cli import bold, is_quiet

if TYPE_CHECKING:
    from skillframe_certify.task import TaskFile

NOT_CERTIFIED = 1
"""Exit code of a step whose answer is no."""


SKILL = "skill.skill.json"


class Step(NamedTuple):
    """A command of the task.

    Attributes:
        command: arguments after `skillframe`.
        done: returns whether its result exists.
        may_say_no: exit code 1 is an answer, and later steps still run.
    """

    command: list[str]
    done: Callable[[], bool]
    may_say_no: bool = False


def certify_task(task: Path, out: Path, workers: int | None) -> int:
    """Run all steps from a task file to a certificate and a report, and return the exit code.

    Raises:
        InputError: the task is unusable, the folder belongs to something else, or its skill is not that of the proof.
    """
    from skillframe.campaign import file_hash
    from skillframe.cli.main import run
    from skillframe.errors import InputError
    from skillframe_certify.certificate import examine
    from skillframe_certify.question import LOOK
    from skillframe_certify.task import TaskFile

    given = TaskFile.from_toml(task)
    given.settle(out)
    skill, proved = out / SKILL, out / "proof" / LOOK / "skills" / SKILL
    if skill.is_file() and proved.is_file() and file_hash(skill) != file_hash(proved):
        raise InputError(
            skill, f"is not the skill that {out / 'proof'} is about", "put it back, or certify it with another --out"
        )
    steps = steps_of(given, out, workers)
    for number, step in enumerate(steps, start=1):
        said = f"[{number} of {len(steps)}] $ skillframe {shlex.join(step.command)}"
        if step.done():
            click.echo(bold(f"\n{said}  (done)"))
            continue
        click.echo(bold(f"\n{said}"))
        given.bring_demonstrations(out)
        code = run([*step.command, "--quiet"] if is_quiet() else step.command)
        if code and not (step.may_say_no and code == NOT_CERTIFIED):
            return code
    content, wrong = examine(out / "proof")
    if wrong or content is None:
        click.echo(f"\nNot certified: the certificate does not follow from its trials: {'; '.join(wrong)}", err=True)
        return NOT_CERTIFIED
    word = "Certified" if content["certified"] else "Not certified"
    click.echo(f"\n{word}. Open {out / 'report.html'} in a browser, its first page is the certificate;")
    click.echo(f"to check it: skillframe certify check {out / 'proof'}")
    return 0 if content["certified"] else NOT_CERTIFIED


def steps_of(task: TaskFile, out: Path, workers: int | None) -> list[Step]:
    """Return the commands in order."""
    proof, skill = out / "proof", out / SKILL
    crew = [] if workers is None else ["--workers", str(workers)]
    demonstrations = [str(path) for path in task.demonstrations_in(out)]
    recorded = Step(
        ["record", "--world", task.world_from_here, "--robot", task.robot_from_here, "--count",
         str(task.teacher), "--seed", str(task.seed), "--out", str(out / "demonstrations" / "demo.npz")],
        lambda: all(Path(path).is_file() for path in demonstrations),
    )  # fmt: skip
    told = [] if task.at is None else ["--at", task.at]
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
        Step(["certify", "map", *asked(), *crew], there("border.json")),
        Step(["certify", "find-failure", str(proof), *crew], there("breaking.json"), may_say_no=True),
        Step(["certify", "sensitivity", str(proof), *crew], there("matter.json")),
        Step(["certify", "run", str(proof), *numbers, *crew], there("certificate.json"), may_say_no=True),
        Step(["report", str(proof), "--out", str(out / "report.html")], (out / "report.html").is_file),
    ]
