"""`skillframe demonstration record`: demonstrations from the simulated teacher."""

from __future__ import annotations

import json
from pathlib import Path

import click


@click.command(name="record")
@click.option("--world", required=True, help="World to demonstrate (skillframe plugins list names them).")
@click.option("--robot", default="free_tool", show_default=True, help="Robot name, robot.toml or URDF.")
@click.option(
    "--teacher", type=click.Choice(["kinesthetic", "teleoperation"]), default="kinesthetic", show_default=True
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="File; with --count N: NAME1, NAME2, ...")
@click.option("--count", default=1, show_default=True, type=click.IntRange(1), help="Number of demonstrations.")
@click.option("--seed", default=0, show_default=True, help="Everything random follows from it.")
@click.option("--noise", default=8.0, show_default=True, help="Standard deviation of the person's aim [degrees].")
@click.option("--delay", type=float, help="One-way delay [s]; default 0, teleoperation 0.1.")
@click.option("--scale", type=float, help="Motion scale of teleoperation; default 1, teleoperation 2.")
@click.option("--rate", default=500.0, show_default=True, help="Sample rate [Hz].")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="world.*, start.*, fixture.* ...")
@click.option("--json", "as_json", is_flag=True, help="What was recorded as JSON on stdout.")
def command(
    world: str, robot: str, teacher: str, out: Path, count: int, seed: int, noise: float, delay: float | None,
    scale: float | None, rate: float, settings: tuple[str, ...], as_json: bool,
) -> int:  # fmt: skip
    """Record demonstrations of a world from a simulated person.

    Demonstrations that fail are redrawn and counted. The starts of the world's task are taken in turn, so that
    --count 2 shows the valley from both sides.

    \b
    Example:
      skillframe demonstration record --world peg_in_hole --count 2 --seed 1 --out demo.npz
    """
    from math import radians

    from skillframe.config import parse_setting
    from skillframe.demonstrate import record
    from skillframe.demonstration.files import write_demonstration
    from skillframe.prepare import load_robot_model, load_world, split_settings
    from skillframe.teacher import TeacherSettings

    params, draws = split_settings(world, dict(parse_setting(text) for text in settings))
    remote = teacher == "teleoperation"
    person = TeacherSettings(
        kind=teacher, aim_noise=radians(noise), delay_s=(0.1 if remote else 0.0) if delay is None else delay,
        scale=(2.0 if remote else 1.0) if scale is None else scale,
    )  # fmt: skip
    recording = record(
        load_robot_model(robot), load_world(world, params), person, count=count, seed=seed, draws=draws, rate_hz=rate,
        progress=lambda text: click.echo(text, err=True),
    )  # fmt: skip
    files = [out] if count == 1 else [out.with_name(f"{out.stem}{i + 1}{out.suffix}") for i in range(count)]
    for path, demonstration in zip(files, recording.demonstrations, strict=True):
        write_demonstration(demonstration, path)
    if as_json:
        click.echo(json.dumps({"files": [str(f) for f in files], "rejected": recording.rejected}))
        return 0
    for path, demonstration in zip(files, recording.demonstrations, strict=True):
        click.echo(f"{path}: {demonstration.duration:.2f} s at {demonstration.rate:.0f} Hz")
    for text in recording.rejected:
        click.echo(f"redrawn: {text}")
    return 0
