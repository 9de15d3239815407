"""`skillframe demonstration record`: demonstrations from the simulated teacher."""

from __future__ import annotations

import json
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli.names import robot_option, world_option
from skillframe.cli.numbers import COUNT, NOT_NEGATIVE, POSITIVE, SEED, WithUnit
from skillframe.cli.output import note, progress, quiet_option, warned
from skillframe.config.ranges import Range

if TYPE_CHECKING:
    from skillframe.api.recording import Person
    from skillframe.robot.model import RobotModel
    from skillframe.teaching.teleoperation import OperatorSettings
    from skillframe.world.scene import Scene

_AIM = Range(0.0, pi / 2.0, "as a person who is further off aims at nothing")
_TURN = Range(-pi, pi, "half a turn to either side")
_DELAY = Range(0.0, 1.0, "as buses and valves take milliseconds")
_SIGHT = Range(0.0, 0.1, "as a person sees better than to a hand's width")
_STIFF = Range(0.0, 1e8, "stiffer than steel structures of this size")
_RATE = Range(0.01, 1e5, "as no controller here is faster")
QUIET_S = 5.0  # a recording that is over by then needs no progress


@click.command(name="record")
@world_option("World to demonstrate")
@robot_option
@click.option(
    "--teacher", type=click.Choice(["kinesthetic", "teleoperation", "blind"]),
    help="Who shows it [kinesthetic; of machines teleoperation].",
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
    "--noise",
    type=WithUnit("deg", _AIM),
    help="Standard deviation of the person's aim [degrees]; default 8, machines 6.",
)
@click.option(
    "--delay",
    type=WithUnit("s", _DELAY),
    help="One-way delay [s]; default 0, teleoperation 0.1, of machines 0.05.",
)
@click.option(
    "--scale", type=POSITIVE, help="Motion scale of teleoperation; default 1, teleoperation 2, of machines 4."
)
@click.option(
    "--looks",
    type=WithUnit("m", _SIGHT),
    help="Kinesthetic: how exactly the person sees the mouth [m].",
)
@click.option(
    "--force-scale", type=POSITIVE, help="Machines: force of the machine over force at the hand; default 1000."
)
@click.option(
    "--hand-stiffness",
    type=WithUnit("N/m", _STIFF, above=True),
    help="Machines: how stiffly the hand holds the master [N/m]; default 1200.",
)
@click.option(
    "--stiffness", type=WithUnit("N/m", _STIFF), help="Machines: stiffness while they are taught [N/m]; default 1e5."
)
@click.option("--damping", type=NOT_NEGATIVE, help="Machines: damping while they are taught [N s/m]; default 1e5.")
@click.option(
    "--feed-velocity", is_flag=True, help="Machines: feed the master's velocity as well (mind the loop gain)."
)
@click.option(
    "--packet-rate", type=WithUnit("Hz", _RATE), help="Machines: packets a second, held between them; default 100."
)
@click.option(
    "--angle",
    type=WithUnit("deg", _TURN),
    help="Machines: push at this angle in their plane, -90 straight down [degrees].",
)
@click.option("--belief", metavar="X,Y,TURN", help="Blind: deviation of goal minus start [mm, mm, degrees].")
@click.option("--centre", metavar="X,Y,TURN", help="Blind: mean of goal minus start [mm, mm, degrees]; default 0,0,0.")
@click.option("--rate", type=WithUnit("Hz", _RATE), help="Sample rate [Hz]; default 500, machines 100.")
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="What differs from the nominal: start.tilt_y=5deg ... (skillframe settings lists all).",
)
@click.option("--json", "as_json", is_flag=True, help="What was recorded as JSON on stdout.")
@quiet_option
def command(
    world: str, robot: str, teacher: str | None, out: Path, count: int, seed: int, noise: float | None,
    delay: float | None, scale: float | None, looks: float | None, belief: str | None, centre: str | None,
    rate: float | None, settings: tuple[str, ...], as_json: bool, **operated: Any,
) -> int:  # fmt: skip
    """Record demonstrations of a world from a simulated person.

    Demonstrations that fail are redrawn and counted. The starts of the world's task are taken in turn, so that
    --count 2 shows the valley from both sides. A blind teacher searches from a start of its own each time, knowing no
    more than --belief; every search is kept, whether it found the goal or not.

    A hydraulic machine is taught by teleoperation, from a scaled master that reflects its force. First it
    swings in the air to identify friction and payload; what it then records as wrench it estimates from its pressures.
    A set-up whose loop gain |K + j w D [with --feed-velocity]| scale / (force scale x hand stiffness) is not below 1 is
    refused.

    \b
    Examples:
      skillframe demonstration record --world peg_in_hole --count 2 --seed 1 --out demo.npz
      skillframe demonstration record --world peg_in_hole --set world.fillet=0.0008 --teacher blind --count 5 \\
        --out s.npz
      skillframe demonstration record --world pallets --robot hiab_xs031 --teacher teleoperation --delay 0.15 \\
        --angle -40 --count 2 --out push.npz
      skillframe demonstration record --world peg_in_hole --count 1000 --rate 50 --out pegs
    """
    from skillframe.api.recording import record
    from skillframe.api.tasks import robot_of, scene_of
    from skillframe.config import parse_setting
    from skillframe.extend.reading import check_writable

    check_writable(out)
    with warned():
        scene, draws = scene_of(world, dict(parse_setting(text) for text in settings), depth=1)
    machine = robot_of(robot)
    teacher = teacher or ("teleoperation" if machine.spec.hydraulic else "kinesthetic")
    _refuse_idle(teacher, {"noise": noise, "delay": delay, "scale": scale, "looks": looks}, (belief, centre))
    person: Person
    if machine.spec.hydraulic or any(map(_given, operated.values())):
        _refuse_looks(looks, teacher)
        scene, person = _operated(machine, scene, teacher, {**operated, "noise": noise, "delay": delay, "scale": scale})
    else:
        person = _person(scene, teacher, (noise, delay, scale, looks), (belief, centre))
    with progress("s simulated", QUIET_S) as show:
        recording = record(
            scene, machine, teacher=person, count=count, seed=seed, set=draws, rate_hz=rate, progress=note,
            watch=lambda now, longest: show(round(now, 1), longest),
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


def _refuse_idle(teacher: str, person: dict[str, float | None], places: tuple[str | None, str | None]) -> None:
    """Refuse options that the chosen teacher would ignore."""
    from skillframe.errors import InputError

    blind = teacher == "blind"
    idle: dict[str, float | str | None] = {**person} if blind else {"belief": places[0], "centre": places[1]}
    for name, value in idle.items():
        if value is not None:
            whose = "teachers who see" if blind else "--teacher blind"
            raise InputError(f"--{name}", f"is for {whose}, not for --teacher {teacher}", "leave it out")


def _refuse_looks(looks: float | None, teacher: str) -> None:
    from skillframe.errors import InputError

    if looks is not None:
        raise InputError("--looks", f"is for a hand on an arm, not for --teacher {teacher}", "leave it out")


def _operated(
    machine: RobotModel, scene: Scene, teacher: str, given: dict[str, Any]
) -> tuple[Scene, OperatorSettings]:  # fmt: skip
    """A hydraulic machine and its operator."""
    from math import radians

    from skillframe.errors import InputError

    name = machine.spec.name
    if not machine.spec.hydraulic:
        option = next(key for key, value in given.items() if _given(value)).replace("_", "-")
        raise InputError(f"--{option}", f"is for hydraulic machines, which {name} is not", "leave it out")
    if teacher != "teleoperation":
        raise InputError(
            f"--teacher {teacher}", f"nobody leads {name} by hand, it is a hydraulic machine", "use teleoperation"
        )
    from skillframe.teaching.machine_sessions import aimed
    from skillframe.teaching.teleoperation import OperatorSettings

    angle, noise = given.pop("angle"), given.pop("noise")
    names = {"delay": "delay_s", "packet_rate": "packet_hz"}
    values = {names.get(key, key): value for key, value in given.items() if value is not None}
    if noise is not None:
        values["aim_noise"] = radians(noise)
    where = scene if angle is None else aimed(machine, scene, radians(angle))
    return where, OperatorSettings(**values)


def _given(value: object) -> bool:
    """Was an option on the command line?"""
    return value is not None and value is not False


def _person(
    scene: Scene, teacher: str, person: tuple[float | None, float | None, float | None, float | None],
    places: tuple[str | None, str | None],
) -> Person:  # fmt: skip
    """Somebody who sees, or is blindfolded. What is not given is as by default."""
    from dataclasses import replace
    from math import radians

    from skillframe.api.recording import seeing

    noise, delay, scale, looks = person
    given: dict[str, Any] = {"aim_noise": None if noise is None else radians(noise), "delay_s": delay, "scale": scale}
    given["looks"] = looks
    belief, centre = places
    given |= {"believed": None if belief is None else _place(belief, "--belief")}
    given |= {"centre": None if centre is None else _place(centre, "--centre")}
    return replace(seeing(teacher, scene), **{key: value for key, value in given.items() if value is not None})


def _place(text: str, option: str) -> tuple[float, float, float]:
    """A place on the surface in metres and radians from "mm,mm,degrees"."""
    from math import radians

    from skillframe.config import parse_numbers
    from skillframe.errors import InputError

    numbers = parse_numbers(text)
    if len(numbers) != 3:
        raise InputError(
            option, f"expected three numbers X,Y,TURN, got {text!r}", "give millimetres and degrees: 4,4,0"
        )
    x, y, turn = numbers
    return (1e-3 * x, 1e-3 * y, radians(turn))
