"""`skillframe demonstration record`: demonstrations from the simulated teacher."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from skillframe.blind_teacher import BlindSettings
    from skillframe.demonstrate import Recording
    from skillframe.teacher import TeacherSettings
    from skillframe.world.scene import Scene


@click.command(name="record")
@click.option("--world", required=True, help="World to demonstrate (skillframe plugins list names them).")
@click.option("--robot", default="free_tool", show_default=True, help="Robot name, robot.toml or URDF.")
@click.option(
    "--teacher", type=click.Choice(["kinesthetic", "teleoperation", "blind"]), default="kinesthetic", show_default=True
)
@click.option("--out", required=True, type=click.Path(path_type=Path), help="File; with --count N: NAME1, NAME2, ...")
@click.option("--count", default=1, show_default=True, type=click.IntRange(1), help="Number of demonstrations.")
@click.option("--seed", default=0, show_default=True, help="Everything random follows from it.")
@click.option("--noise", default=8.0, show_default=True, help="Standard deviation of the person's aim [degrees].")
@click.option("--delay", type=float, help="One-way delay [s]; default 0, teleoperation 0.1.")
@click.option("--scale", type=float, help="Motion scale of teleoperation; default 1, teleoperation 2.")
@click.option("--belief", metavar="X,Y,TURN", help="Blind: deviation of goal minus start [mm, mm, degrees].")
@click.option("--centre", metavar="X,Y,TURN", help="Blind: mean of goal minus start [mm, mm, degrees]; default 0,0,0.")
@click.option("--rate", default=500.0, show_default=True, help="Sample rate [Hz].")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="world.*, start.*, fixture.* ...")
@click.option("--json", "as_json", is_flag=True, help="What was recorded as JSON on stdout.")
def command(
    world: str, robot: str, teacher: str, out: Path, count: int, seed: int, noise: float, delay: float | None,
    scale: float | None, belief: str | None, centre: str | None, rate: float, settings: tuple[str, ...], as_json: bool,
) -> int:  # fmt: skip
    """Record demonstrations of a world from a simulated person.

    Demonstrations that fail are redrawn and counted. The starts of the world's task are taken in turn, so that
    --count 2 shows the valley from both sides. A blind teacher searches from a start of its own each time, knowing no
    more than --belief; every search is kept, whether it found the goal or not.

    \b
    Example:
      skillframe demonstration record --world peg_in_hole --count 2 --seed 1 --out demo.npz
      skillframe demonstration record --world peg_in_hole --set world.fillet=0.0008 --teacher blind --count 5 \\
        --out s.npz
    """
    from skillframe.config import parse_setting
    from skillframe.prepare import load_robot_model, load_world, split_settings

    params, draws = split_settings(world, dict(parse_setting(text) for text in settings))
    machine, scene = load_robot_model(robot), load_world(world, params)
    common: dict[str, Any] = {"count": count, "seed": seed, "draws": draws, "rate_hz": rate, "progress": _progress}
    if teacher == "blind":
        from skillframe.demonstrate_blind import record_blind

        recording = record_blind(machine, scene, _blind(scene, belief, centre), **common)
    else:
        from skillframe.demonstrate import record

        recording = record(machine, scene, _seeing(teacher, noise, delay, scale), **common)
    files = _write(recording, out, count)
    if as_json:
        click.echo(json.dumps({"files": [str(f) for f in files], "rejected": recording.rejected}))
        return 0
    for path, demonstration in zip(files, recording.demonstrations, strict=True):
        click.echo(f"{path}: {demonstration.duration:.2f} s at {demonstration.rate:.0f} Hz")
    for text in recording.rejected:
        click.echo(f"redrawn: {text}")
    return 0


def _progress(text: str) -> None:
    click.echo(text, err=True)


def _write(recording: Recording, out: Path, count: int) -> list[Path]:
    from skillframe.demonstration.files import write_demonstration

    files = [out] if count == 1 else [out.with_name(f"{out.stem}{i + 1}{out.suffix}") for i in range(count)]
    for path, demonstration in zip(files, recording.demonstrations, strict=True):
        write_demonstration(demonstration, path)
    return files


def _seeing(teacher: str, noise: float, delay: float | None, scale: float | None) -> TeacherSettings:
    from math import radians

    from skillframe.teacher import TeacherSettings

    remote = teacher == "teleoperation"
    return TeacherSettings(
        kind=teacher, aim_noise=radians(noise), delay_s=(0.1 if remote else 0.0) if delay is None else delay,
        scale=(2.0 if remote else 1.0) if scale is None else scale,
    )  # fmt: skip


def _blind(scene: Scene, belief: str | None, centre: str | None) -> BlindSettings:
    from skillframe.blind_teacher import BlindSettings

    spread = scene.task.believed if belief is None else _place(belief, "--belief")
    middle = (0.0, 0.0, 0.0) if centre is None else _place(centre, "--centre")
    return BlindSettings(believed=spread, centre=middle)


def _place(text: str, option: str) -> tuple[float, float, float]:
    """A place on the surface in metres and radians from "mm,mm,degrees"."""
    from math import isfinite, radians

    from skillframe.errors import InputError

    try:
        x, y, turn = (float(part) for part in text.split(","))
    except ValueError:
        x = y = turn = float("nan")
    if not all(map(isfinite, (x, y, turn))):
        raise InputError(
            option, f"expected three numbers X,Y,TURN, got {text!r}", "give millimetres and degrees: 4,4,0"
        )
    return (1e-3 * x, 1e-3 * y, radians(turn))
