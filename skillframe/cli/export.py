"""`skillframe export`: a learned phase as settings or a message of a controller that others wrote."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli import names
from skillframe.cli.numbers import WHOLE

if TYPE_CHECKING:
    from skillframe.extend.records import ExporterType
    from skillframe.frames import Float


@click.command()
@click.argument("skill", required=False, type=click.Path(path_type=Path))
@click.option(
    "--to", "form", metavar="FORMAT", shell_complete=names.formats, help="Format to write; --list names them."
)
@click.option("--out", type=click.Path(path_type=Path), help="File to write (.yaml).")
@click.option("--phase", type=WHOLE, help="Phase of a policy, counted from 1.")
@click.option("--coc", help='Centre of compliance: "x,y,z" in the tool frame, or a frame (tip) [as learned].')
@click.option("--attitude", metavar="QX,QY,QZ,QW", help="The tool's attitude in base at the start of the phase.")
@click.option("--list", "listing", is_flag=True, help="List formats, write nothing.")
@click.option("--json", "as_json", is_flag=True, help="JSON on stdout: the formats, or what was written.")
def command(
    skill: Path | None, form: str | None, out: Path | None, phase: int | None, coc: str | None,
    attitude: str | None, listing: bool, as_json: bool,
) -> None:  # fmt: skip
    """Write a phase of SKILL as settings of another controller.

    What the controller cannot hold is written as comments; what it cannot do at all is refused.

    \b
    Examples:
      skillframe export --list
      skillframe export peg.skill.json --to crisp --coc tip --out peg.yaml
      skillframe export peg.skill.json --to cartesian_controllers --attitude 1,0,0,0 --out peg.yaml
    """
    if listing:
        _list(as_json)
        return
    for name, value in (("SKILL", skill), ("--to", form), ("--out", out)):
        if value is None:
            raise click.UsageError(f"Missing '{name}'; for example: export peg.skill.json --to crisp --out peg.yaml")
    assert skill is not None
    assert form is not None
    assert out is not None
    chosen = _write(skill, form, out, phase, coc, attitude)
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
    rows = [(f.name, f.axes, f.summary, f.checked) for f, _ in exporters]
    table(("format", "axes", "what it is", "checked against"), rows, LIST_WIDTH)


def _write(skill: Path, form: str, out: Path, phase: int | None, coc: str | None, attitude: str | None) -> ExporterType:
    from skillframe.demonstration.record import resolve_point
    from skillframe.document.export import exported
    from skillframe.document.file import load
    from skillframe.document.frame import read_frame, with_center
    from skillframe.document.impedance import moving_impedance
    from skillframe.extend.registry import registry
    from skillframe.files import write_whole

    exporter = registry().exporter(form)
    document = load(skill)
    kind = registry().behaviour(document["type"])
    words = kind.describe(document)[:1] if kind.describe is not None else []
    if coc is not None:
        document = with_center(document, resolve_point(coc, read_frame(document).points).tolist())
    turned = None if attitude is None else _attitude(attitude)
    moving = moving_impedance(document, phase, exporter.axes, turned, str(skill))
    write_whole(out, exported(exporter, moving, [f"{skill.name}: {line}" for line in words]).encode())
    return exporter


def _attitude(text: str) -> Float:
    import numpy as np

    from skillframe.config import parse_numbers
    from skillframe.errors import InputError
    from skillframe.frames import matrix_from_quaternion

    q = np.array(parse_numbers(text))
    if q.shape != (4,) or not abs(np.sqrt(q @ q) - 1.0) < 0.01:
        raise InputError("--attitude", f"{text!r} is not a unit quaternion", "give qx,qy,qz,qw, w last")
    rotation: Float = matrix_from_quaternion(q / np.sqrt(q @ q))
    return rotation
