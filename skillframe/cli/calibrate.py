"""`skillframe calibrate`: a force sensor's bias, tool weight and mounting from readings without contact."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.demonstration import reading_options, reading_settings
from skillframe.cli.output import emit_json

if TYPE_CHECKING:
    from skillframe.conditioning.calibrate import Calibrated


@click.command(name="calibrate")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="File to write, for --calibration (.json).")
@reading_options
@click.option("--json", "as_json", is_flag=True, help="What was found as JSON on stdout.")
def command(files: tuple[Path, ...], out: Path, as_json: bool, **options: Any) -> None:
    """Calibrate a wrist's force sensor from FILES without contact.

    FILES hold the tool's attitude and what the sensor read: some ten poses at rest (--rate 1 where they have no clock)
    or a slow motion in free air. Found are bias, the tool's weight and centre of mass, how the sensor is mounted, and
    where down is, each with its standard deviation. What the attitudes do not tell is said. Nothing is written if
    there was contact. --from and --to choose a stretch.

    \b
    Examples:
      skillframe calibrate poses.csv --rate 1 --position 0,0,0 --out tool.json
      skillframe demonstration convert demo.csv --calibration tool.json --out demo.npz
    """
    import numpy as np

    from skillframe.conditioning.calibrate import calibrate, plain
    from skillframe.demonstration.calibration import write_calibration
    from skillframe.extend.reading import read_demonstration
    from skillframe.frames import rotate_spatial

    if options["calibration"] is not None:
        raise click.UsageError("--calibration is what this command makes")
    sensor = {"wrench_frame": "tool", "wrench_point": "tool", "wrench_includes_tool_weight": True}
    settings = {**reading_settings(options), **sensor}
    read = [read_demonstration(path, **settings) for path in files]
    rotation = np.concatenate([d.pose.rotation for d in read])
    raw = [rotate_spatial(np.swapaxes(d.pose.rotation, -1, -2), d.wrench) for d in read]
    found = calibrate(np.concatenate(raw), rotation, " and ".join(map(str, files)))
    more = {**plain(found), "files": [path.name for path in files]}
    write_calibration(found.calibration, out, more)
    if as_json:
        from skillframe.files.documents import read_json

        emit_json({**read_json(out, ""), "written": str(out)})
        return
    _show(found, out)


def _show(found: Calibrated, out: Path) -> None:
    import numpy as np

    c, spread = found.calibration, found.calibration.spread
    bias, com = spread["bias"], spread["com_m"]
    centre = ", ".join(
        f"{1e3 * v:.1f}" + (" (not told)" if s is None else f" +- {1e3 * s:.2g}")
        for v, s in zip(c.com, com, strict=True)
    )
    turned = np.rad2deg(found.turned)
    lines = [
        (
            "samples",
            f"{found.samples}, of which {found.independent:.0f} count; gravity turned by up to {turned:.0f} deg",
        ),
        ("bias", f"({', '.join(f'{v:.3f}' for v in c.bias[:3])}) N, +- {max(bias[:3]):.2g} N"),
        ("", f"({', '.join(f'{v:.4f}' for v in c.bias[3:])}) Nm, +- {max(bias[3:]):.2g} Nm"),
        ("tool", f"{c.mass:.3f} +- {spread['mass_kg']:.2g} kg, centre of mass ({centre}) mm from the sensor"),
        ("mounting", found.mounting),
        ("gravity", found.level),
        ("left over", f"{spread['residual_force']:.3f} N, {spread['residual_torque']:.4f} Nm rms"),
        *([("note", found.advice)] if found.advice else []),
        (
            "written",
            f"{out}; use it with: skillframe demonstration convert RECORDING --calibration {out} --out DEMO.npz",
        ),
    ]
    for name, text in lines:
        click.echo(f"{name:<12}{text}")
