"""`skillframe export`: a learned phase as settings or a message of another controller."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import options
from skillframe.cli.options import WHOLE

if TYPE_CHECKING:
    from skillframe.extend.outputs import ExporterType
    from skillframe.frames import Float


@click.command()
@click.argument("skill", required=False, type=click.Path(path_type=Path))
@click.option("--to", "form", metavar="FORMAT", shell_complete=options.formats, help="Format to write.")
@click.option("--out", type=click.Path(path_type=Path), help="File to write.")
@click.option("--phase", type=WHOLE, help="Phase of a policy, counted from 1.")
@click.option("--coc", help='Centre of compliance: "x,y,z" in the tool frame, or a frame (tip) [as learned].')
@click.option("--orientation", metavar="QX,QY,QZ,QW", help="The tool's orientation in base at the start of the phase.")
@click.option("--robot", shell_complete=options.robots, help="Robot of a program: its name, robot.toml or folder.")
@click.option("--json", "as_json", is_flag=True, help="JSON on stdout: the formats, or what was written.")
def command(
    skill: Path | None, form: str | None, out: Path | None, phase: int | None, coc: str | None,
    orientation: str | None, robot: str | None, as_json: bool,
) -> None:  # fmt: skip
    """List the formats of other controllers, or write SKILL for one: a phase as settings, or all of it as a program.

    What the controller cannot hold is written as comments; what it cannot do at all is refused.

    \b
    Examples:
      skillframe export
      skillframe export peg.skill.json --to crisp --coc tip --out peg.yaml
      skillframe export peg.skill.json --to cartesian_controllers --orientation 1,0,0,0 --out peg.yaml
      skillframe export peg.skill.json --to urscript --robot ur5e --coc tip --out peg.script
    """
    given = {"SKILL": skill, "--to": form, "--out": out}
    extra = {"--phase": phase, "--coc": coc, "--orientation": orientation, "--robot": robot}
    if all(value is None for value in [*given.values(), *extra.values()]):
        _list(as_json)
        return
    if skill is None or form is None or out is None:
        name = next(name for name in ("SKILL", "--to", "--out") if given[name] is None)
        raise click.UsageError(f"Missing '{name}'; for example: export peg.skill.json --to crisp --out peg.yaml")
    chosen = _write(skill, form, out, extra)
    if as_json:
        from skillframe.cli.output import emit_json

        emit_json({"file": str(out), "format": form, "checked_against": chosen.checked, "notes": list(chosen.notes)})
        return
    click.echo(f"{out}: {form}")
    click.echo(f"checked against {chosen.checked}")
    for text in chosen.notes:
        click.echo(f"note: {text}")


def _list(as_json: bool) -> None:
    from skillframe.cli.output import LIST_WIDTH, emit_json, table
    from skillframe.extend.registry import registry

    exporters = [(each, registry().provider("exporter", each.name)) for each in registry().records("exporter")]
    if as_json:
        emit_json(
            [
                {
                    "name": f.name, "summary": f.summary, "axes": f.axes, "checked_against": f.checked,
                    "distribution": plugin.distribution,
                }
                for f, plugin in exporters
            ]
        )  # fmt: skip
        return
    rows = [(f.name, f.axes or "program", f.summary, f.checked) for f, _ in exporters]
    table(("format", "axes", "what it is", "checked against"), rows, LIST_WIDTH)


def _write(skill: Path, form: str, out: Path, extra: dict[str, Any]) -> ExporterType:
    from skillframe.demonstration.record import resolve_point
    from skillframe.document.export import exported, moving_impedance, written
    from skillframe.document.file import load
    from skillframe.document.frame import read_frame, with_center
    from skillframe.errors import InputError
    from skillframe.extend.registry import registry
    from skillframe.files import write_whole
    from skillframe.robot.spec import load_robot

    exporter = registry().exporter(form)
    used = ("--coc", "--robot") if exporter.axes is None else ("--phase", "--coc", "--orientation")
    for name, value in extra.items():
        if value is not None and name not in used:
            raise InputError(name, f"is not used by {form}", "leave it out")
    if exporter.axes is None and extra["--robot"] is None:
        raise InputError("--robot", f"is missing: {form} is a program for one robot", "name the robot")
    document = load(skill)
    kind = registry().behaviour(document["type"])
    words = kind.describe(document)[:1] if kind.describe is not None else []
    about = [f"{skill.name}: {line}" for line in words]
    if (coc := extra["--coc"]) is not None:
        document = with_center(document, resolve_point(coc, read_frame(document).points).tolist())
    if exporter.axes is None:
        text = written(exporter, document, load_robot(extra["--robot"]), about=about)
    else:
        turned = None if extra["--orientation"] is None else _orientation(extra["--orientation"])
        moving = moving_impedance(document, extra["--phase"], exporter.axes, turned, str(skill))
        text = exported(exporter, moving, about)
    write_whole(out, text.encode())
    return exporter


def _orientation(text: str) -> Float:
    import numpy as np

    from skillframe.config import parse_numbers
    from skillframe.errors import InputError
    from skillframe.frames import matrix_from_quaternion

    q = np.array(parse_numbers(text))
    if q.shape != (4,) or not abs(np.sqrt(q @ q) - 1.0) < 0.01:
        raise InputError("--orientation", f"{text!r} is not a unit quaternion", "give qx,qy,qz,qw, w last")
    rotation: Float = matrix_from_quaternion(q / np.sqrt(q @ q))
    return rotation
