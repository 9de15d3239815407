"""`skillframe record`: demonstrations by a simulated teacher."""

from __future__ import annotations

import json
from collections.abc import Callable
from math import pi, radians
from pathlib import Path

import click

from skillframe.cli.options import COUNT, SEED, WithUnit, robot_option, teachers, world_option
from skillframe.cli.output import note, progress, warned
from skillframe.config.units import Range


@click.command(name="record")
@world_option("World to demonstrate")
@robot_option
@click.option(
    "--teacher", shell_complete=teachers,
    help="The teacher: kinesthetic, teleoperation, blind or disassembly [kinesthetic; of machines teleoperation].",
)  # fmt: skip
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path),
    help="File; with --count N: NAME1, NAME2, ... Without an ending: a LeRobot data set.",
)
@click.option("--count", default=1, show_default=True, type=COUNT, help="Number of demonstrations.")
@click.option("--seed", default=0, show_default=True, type=SEED, help="Everything random follows from it.")
@click.option(
    "--angle",
    type=WithUnit("deg", Range(-pi, pi, "half a turn to either side")),
    help="Machines: push at this angle in their plane, -90 straight down [degrees].",
)
@click.option(
    "--rate",
    type=WithUnit("Hz", Range(0.01, 1e5, "as no controller here is faster")),
    help="Sample rate [Hz]; default 500, machines 100.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="What differs from the nominal: start.tilt_y=5deg (worlds --settings lists all), teacher.aim_noise=2deg ...",
)
@click.option("--json", "as_json", is_flag=True, help="What was recorded as JSON on stdout.")
def command(
    world: str, robot: str, teacher: str | None, out: Path, count: int, seed: int, angle: float | None,
    rate: float | None, settings: tuple[str, ...], as_json: bool,
) -> int:  # fmt: skip
    """Record demonstrations of a world by a simulated teacher.

    Demonstrations that fail are sampled again and counted. The starts of the world's task are taken in turn, so that
    --count 2 shows the valley from both sides. A blind teacher searches from a start of its own each time, knowing no
    more than teacher.believed; every search is kept, whether it found the goal or not.

    A machine with actuators is taught by teleoperation, from a scaled master that reflects its force. First it
    swings in the air to identify friction and payload; what it then records as wrench it estimates.
    A set-up whose loop gain |K + j w D [with feed_velocity]| scale / (force_scale hand_stiffness) is not below 1 is
    refused.

    Settings of the teacher: aim_noise, speed, force_max, tremor_force, tremor_torque, and delay_s and scale of
    teleoperation, looks (how exactly the hole entrance is seen) of kinesthetic teaching; believed and centre of a
    blind one (spread and mean of goal minus start [m, m, rad]); of machines also force_scale, hand_stiffness,
    stiffness, damping, feed_velocity and packet_hz.

    \b
    Examples:
      skillframe record --world peg_in_hole --count 2 --seed 1 --out demo.npz
      skillframe record --world peg_in_hole --set world.fillet=0.0008 --teacher blind --count 5 --out s.npz
      skillframe record --world pallets --robot hiab_xs031 --set teacher.delay_s=150ms --angle -40 --count 2 \\
        --out push.npz
      skillframe record --world peg_in_hole --count 1000 --rate 50 --out pegs
    """
    from skillframe.api.inputs import robot_of
    from skillframe.api.recording import record
    from skillframe.config import parse_setting
    from skillframe.extend.reading import check_writable

    check_writable(out)
    machine = robot_of(robot)
    with progress("s simulated", after_s=5.0) as show, warned():
        recording = record(
            world, machine, teacher=teacher, count=count, seed=seed, set=dict(parse_setting(text) for text in settings),
            angle=None if angle is None else radians(angle), rate_hz=rate, progress=note,
            watch=_onwards(lambda now, longest: show(round(now, 1), round(longest, 1))),
        )  # fmt: skip
    files = recording.save(out)
    if as_json:
        where = {"robot": machine.spec.name, "world": world}
        click.echo(json.dumps({**where, "files": [str(f) for f in files], "rejected": recording.rejected}))
        return 0
    if len(files) < len(recording):
        click.echo(f"{files[0]}: {len(recording)} episodes, {sum(map(len, recording))} frames, LeRobot v3.0")
        files = []
    for path, demonstration in zip(files, recording.demonstrations, strict=False):
        click.echo(f"{path}: {demonstration.duration:.2f} s at {demonstration.rate:.0f} Hz")
    for text in recording.rejected:
        click.echo(f"redrawn: {text}")
    return 0


def _onwards(watch: Callable[[float, float], None]) -> Callable[[float, float], None]:
    before = last = 0.0

    def told(now: float, longest: float) -> None:
        nonlocal before, last
        before += last if now < last else 0.0
        last = now
        watch(before + now, before + longest)

    return told
