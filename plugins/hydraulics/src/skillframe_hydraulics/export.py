"""`skillframe fmu export`: a hydraulic machine as a system of FMUs."""

from __future__ import annotations

from pathlib import Path

import click

from skillframe.errors import InputError


@click.command()
@click.argument("robot", metavar="ROBOT")
@click.option("--out", required=True, type=click.Path(path_type=Path), metavar="FILE.ssp", help="The file to write.")
def command(robot: str, out: Path) -> None:
    """Write a machine's cylinders and motors, with their parameters, as a system of FMUs for other tools (SSP 1.0).

    \b
    Example:
      skillframe fmu export hiab_xs031 --out crane.ssp
    """
    from skillframe.execution import load_robot_model
    from skillframe.fmu import write_ssp
    from skillframe_hydraulics.system import components

    model = load_robot_model(robot)
    spec = model.spec
    if not spec.own_law or (spec.drive is not None and spec.drive.kind != "hydraulic"):
        raise InputError(f"robot {spec.name}", "is no hydraulic machine", "name one such as hiab_xs031")
    found, step = components(model), 1.0 / spec.control.rate_hz
    write_ssp(out, spec.name, found, step, spec.folder)
    click.echo(f"{out}: {len(found)} components, communication step {1e3 * step:g} ms")
