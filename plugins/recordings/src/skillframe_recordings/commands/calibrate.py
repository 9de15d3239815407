"""`skillframe calibrate`: bias, tool weight and mounting of a force sensor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli import layout_option

if TYPE_CHECKING:
    from skillframe_recordings.conditioning.calibrate import Calibrated


@click.command(name="calibrate")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), help="File to write, for --set calibration (.json)."
)
@layout_option
def command(files: tuple[Path, ...], out: Path, layout: Path | None) -> int:
    """Calibrate a wrist's force sensor from FILES without contact.

    FILES hold the tool's orientation and the sensor's readings: some ten poses at rest (the layout says rate = 1 if
    they have no clock) or a slow motion in free air. The result is the bias, the tool's weight and centre of mass, the
    sensor's mounting and the direction of gravity, with standard deviations, or a note on what the orientations do not
    determine. Nothing is written if there was contact. `from` and `to` of a layout choose a stretch.

    \b
    Examples:
      skillframe check poses.csv --layout auto --write-layout poses.toml
      skillframe calibrate poses.csv --layout poses.toml --out tool.json
      skillframe convert demo.csv --set calibration=tool.json --out demo.npz
    """
    import numpy as np

    from skillframe.demonstration import read_layout, write_calibration
    from skillframe.errors import InputError
    from skillframe.extend import read_demonstration
    from skillframe.frames import rotate_spatial
    from skillframe_recordings.conditioning.calibrate import calibrate, plain

    given = {} if layout is None else read_layout(layout)
    if given.get("calibration") is not None:
        raise InputError(str(layout), "names a calibration, which is what this command makes", "leave it out")
    sensor = {"wrench_frame": "tool", "wrench_point": "tool", "wrench_includes_tool_weight": True}
    read = [read_demonstration(path, **{**given, **sensor}) for path in files]
    rotation = np.concatenate([d.pose.rotation for d in read])
    raw = [rotate_spatial(np.swapaxes(d.pose.rotation, -1, -2), d.wrench) for d in read]
    found = calibrate(np.concatenate(raw), rotation, " and ".join(map(str, files)))
    more = {**plain(found), "files": [path.name for path in files]}
    write_calibration(found.calibration, out, more)
    _show(found, out)
    return 0


def _show(found: Calibrated, out: Path) -> None:
    import numpy as np

    c, spread = found.calibration, found.calibration.spread
    bias, com = spread["bias"], spread["com_m"]
    centre = ", ".join(
        f"{1e3 * v:.1f}" + (" (undetermined)" if s is None else f" +- {1e3 * s:.2g}")
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
            f"{out}; use it with: skillframe convert RECORDING --set calibration={out} --out DEMO.npz",
        ),
    ]
    for name, text in lines:
        click.echo(f"{name:<12}{text}")
