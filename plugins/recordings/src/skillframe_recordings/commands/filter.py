"""`skillframe filter`: filter a wrench and remove bias and tool weight."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import NUMBER, emit_json, layout_option
from skillframe.config import parse_numbers
from skillframe_recordings.commands.recordings import six

if TYPE_CHECKING:
    from skillframe.demonstration import Demonstration
    from skillframe.signals import WrenchModel
    from skillframe_recordings.conditioning.offline import Removed


@click.command(name="filter")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="File to write: .npz or .csv.")
@click.option(
    "--method",
    type=click.Choice(["smoother", "filter", "none"]),
    default="smoother",
    show_default=True,
    help="Kalman smoother (no lag, for learning), the loop's causal filter, or neither.",
)
@click.option("--bias/--no-bias", default=True, show_default=True, help="Remove the bias of a free-air stretch.")
@click.option(
    "--weight/--no-weight",
    default=None,
    help="Identify and remove the tool's weight [default: if the metadata say that it is in the wrench].",
)
@click.option("--free-air", metavar="FROM,TO", help="Stretch without contact [s] [default: start to first contact].")
@click.option("--noise", metavar="N,NM", help="Sensor noise per sample [N, Nm] [default: from the recording].")
@click.option(
    "--corner", type=NUMBER, help="Corner frequency [Hz] [default: chosen so that no plain 10 Hz filter is better]."
)
@layout_option
@click.option("--json", "as_json", is_flag=True, help="What was identified as JSON on stdout.")
def command(
    file: Path, out: Path, method: str, bias: bool, weight: bool | None, free_air: str | None, noise: str | None,
    corner: float | None, layout: Path | None, as_json: bool,
) -> int:  # fmt: skip
    """Filter a demonstration's wrench. Remove bias and tool weight.

    Noise figures come from the recording unless given. Weight and bias can be separated only if the tool turns in free
    air; otherwise the bias alone is removed, with advice on the axis to turn about.

    \b
    Examples:
      skillframe filter demo.npz --out clean.npz
      skillframe filter free_motion.npz --weight --free-air 0,6 --method none --out identified.npz
    """
    from skillframe.demonstration import faults, stalls
    from skillframe.extend import read_demonstration, write_demonstration
    from skillframe_recordings.conditioning.offline import doubtful_bias, filter_wrench, remove_bias, smooth

    demonstration = read_demonstration(file, layout)
    held = stalls(demonstration)
    for stall in held:
        click.echo(f"warning: {stall.words()}: what happened then is not known, whatever is written", err=True)
    for fault in faults(demonstration, held):
        click.echo(f"warning: {fault.warning()}", err=True)
    removed = None
    if bias or weight:
        removed = remove_bias(demonstration, _pair("--free-air", free_air), weight)
        if free_air is None and (force := doubtful_bias(demonstration, removed)) is not None:
            first, last = removed.stretch
            click.echo(
                f"warning: {force:.2f} N from {first:.2f} to {last:.2f} s were taken for bias; if the recording starts "
                "in contact, name a stretch without (--free-air FROM,TO), or leave the bias (--no-bias)",
                err=True,
            )
        demonstration = removed.demonstration
    if method != "none":
        run = smooth if method == "smoother" else filter_wrench
        demonstration = run(demonstration, _model(demonstration, _pair("--noise", noise), corner))
    write_demonstration(demonstration, out)
    said = demonstration.meta.get("conditioning", {})
    if as_json:
        payload = said.get("payload", {})  # infinite condition numbers become null
        payload = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in payload.items()}
        emit_json({**said, **({"payload": payload} if payload else {}), "written": str(out)})
    else:
        _show(out, removed, said)
    return 0


def _pair(name: str, text: str | None) -> tuple[float, float] | None:
    """Two numbers from "A,B"."""
    if text is None:
        return None
    numbers = parse_numbers(text)
    if len(numbers) != 2:
        raise click.UsageError(f"{name} {text!r} is not two finite numbers; write for example {name} 0,2.5")
    return numbers[0], numbers[1]


def _model(demonstration: Demonstration, noise: tuple[float, float] | None, corner: float | None) -> WrenchModel | None:
    """The recording's wrench model with the given values, or None without any."""
    if noise is None and corner is None:
        return None
    import numpy as np

    from skillframe.signals import WrenchModel
    from skillframe_recordings.conditioning.wrench_model import model_of

    model, dt = model_of(demonstration), 1.0 / demonstration.rate
    corners = model.corner(dt) if corner is None else np.full(6, corner)
    if not np.all(corners > 0.0) or (noise is not None and min(noise) <= 0.0):
        raise click.UsageError("--noise and --corner must be above 0")
    return WrenchModel.from_corner(model.noise if noise is None else np.repeat(noise, 3), corners, dt)


def _show(out: Path, removed: Removed | None, said: dict[str, Any]) -> None:
    if removed is not None:
        payload = removed.payload
        click.echo(f"free air    {removed.stretch[0]:.3f} to {removed.stretch[1]:.3f} s")
        click.echo(f"bias        {six(payload.bias.tolist())} in tool axes")
        if payload.mass:
            com = ", ".join(f"{v * 1e3:.1f}" for v in payload.com)
            click.echo(
                f"tool        {payload.mass:.3f} kg, centre of mass ({com}) mm, condition {payload.condition:.1f}"
            )
        click.echo(f"left over   {payload.residual_force:.3f} N, {payload.residual_torque:.4f} Nm rms")
        if payload.advice:
            click.echo(f"note        {payload.advice}")
    if "method" in said:
        corner = said["corner_hz"]
        click.echo(f"noise       {six(said['noise'])}")
        click.echo(f"{said['method']:<12}corner {corner[0]:.1f} Hz (force), {corner[3]:.1f} Hz (torque)")
        for i, name, unit in ((0, "force", "N"), (1, "torque", "Nm")) if "because" in said else ():
            passes = [v for v in said["passes"][3 * i : 3 * i + 3] if v is not None]
            open_at = f"its own for changes above {max(passes):.2g} {unit}" if passes else "never its own"
            share = f" ({100.0 * said['opened'][i]:.0f} % of the samples)" if passes else ""
            quiet = f"{said['quiet_corner_hz'][3 * i]:.1f} Hz where nothing happens"
            click.echo(f"{name:<12}{quiet}, {open_at}{share}: {said['because'][i]}")
    click.echo(f"written     {out}")
