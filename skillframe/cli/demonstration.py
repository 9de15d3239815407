"""`skillframe demonstration`: check and convert recordings, and record simulated ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import names
from skillframe.cli.numbers import NUMBER
from skillframe.cli.output import emit_json, note, quiet_option

if TYPE_CHECKING:
    from skillframe.conditioning.audit import DemonstrationAudit

_LAZY = {"record": "skillframe.cli.record"}


class _Group(click.Group):
    """Commands of this module, and those of their own module where it exists."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted([*super().list_commands(ctx), *(n for n, module in _LAZY.items() if find_spec(module))])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in _LAZY and find_spec(_LAZY[cmd_name]):
            command: click.Command = import_module(_LAZY[cmd_name]).command
            return command
        return super().get_command(ctx, cmd_name)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        if args and not args[0].startswith("-") and args[0] not in self.list_commands(ctx):
            from skillframe.errors import UnknownName

            raise UnknownName("command", args[0], self.list_commands(ctx))
        return super().resolve_command(ctx, args)


@click.group(cls=_Group)
def command() -> None:
    """Record, check and convert demonstrations.

    \b
    Example:
      skillframe demonstration check demo.npz
    """


_OPTIONS = [
    click.option(
        "--columns", multiple=True,
        help='Column names in order, "t,px,py,pz,qx,...", "_" to ignore one, or picks by header, "t=stamp,px=x,...". '
        "Given twice, the second names the --wrench file's; given once with names of both, each file takes its own. "
        '"auto" reads nothing and proposes the line to type, with reasons.',
    ),
    click.option("--units", help='Units that are not SI, in any order: "mm,deg,us,kN,Nmm".'),
    click.option("--euler", help='Order of roll, pitch, yaw: "xyz" about fixed axes, "ZYX" about moving ones.'),
    click.option("--rate", type=NUMBER, help="Sample rate [Hz] where there is no clock; replaces a clock."),
    click.option("--wrench", type=click.Path(path_type=Path), help="Separate file with the wrench, on its own clock."),
    click.option("--wrench-columns", help="Its columns (default: its header, or t,fx,fy,fz,tx,ty,tz)."),
    click.option("--wrench-units", help="Its units (default: those of --units)."),
    click.option("--wrench-rate", type=NUMBER, help="Its sample rate [Hz] (default: --rate)."),
    click.option("--wrench-shift", type=NUMBER, default=0.0, help="Seconds added to its clock."),
    click.option(
        "--clock", type=click.Choice(["auto", "pose", "wrench"]), default="auto", show_default=True,
        help="Whose samples are kept when two files are joined; auto takes the faster.",
    ),
    click.option("--from", "start", type=NUMBER, help="First time kept [s]."),
    click.option("--to", "stop", type=NUMBER, help="Last time kept [s]."),
    click.option("--zero-time", is_flag=True, help="Let the clock start at 0; --from and --to then count from there."),
    click.option("--position", help='Constant tool point "x,y,z" [m] for a file that holds orientation only.'),
    click.option("--arm", help="Arm to read from a file with columns ARM_px, ARM_fx, ..."),
    click.option("--wrench-frame", type=click.Choice(["base", "tool"]), help="Axes of the recorded wrench."),
    click.option("--wrench-point", help='Where it was taken: "tool", "x,y,z" in the tool frame, a frame\'s name.'),
    click.option(
        "--wrench-sign", type=click.Choice(["environment", "teacher"]),
        help="Whose force on the tool it is; the teacher's is turned round (holds while the tool's inertia is small).",
    ),
    click.option(
        "--wrench-includes-tool-weight/--wrench-without-tool-weight", default=None,
        help="Whether the tool's weight is still in it.",
    ),
    click.option(
        "--calibration", type=click.Path(path_type=Path),
        help="File of skillframe calibrate: its bias and weight are taken off.",
    ),
    click.option("--episode", help="Which of several recordings of a file: demo_0 in HDF5, 3 of a LeRobot data set."),
    click.option("--pose-topic", help="Topic of a ROS bag with the tool's pose, or with --robot its joint states."),
    click.option("--pose-frames", metavar="BASE,TOOL", help="Frames of a ROS bag's transforms (/tf, /tf_static)."),
    click.option("--wrench-topic", help="Topic of a ROS bag with the wrench (WrenchStamped)."),
    click.option(
        "--robot", shell_complete=names.robots,
        help="The robot whose joint states a ROS bag holds (name or path of its robot.toml).",
    ),
]  # fmt: skip


def reading_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """The settings of `demonstration.options.ReadOptions` as command-line options."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def reading_settings(options: dict[str, Any]) -> dict[str, Any]:
    """The options that were given. A second --columns is the wrench file's."""
    columns = options.pop("columns")
    if len(columns) > 2 or (len(columns) == 2 and options["wrench"] is None):
        raise click.UsageError("--columns can be given twice at most, the second for the --wrench file")
    if len(columns) == 2 and options["wrench_columns"]:
        raise click.UsageError("name the wrench file's columns once: by the second --columns or by --wrench-columns")
    settings = {**options, "columns": columns[0] if columns else None}
    if len(columns) == 2:
        settings["wrench_columns"] = columns[1]
    for name in ("start", "stop", "wrench_shift"):
        if settings[name] is not None and not math.isfinite(settings[name]):
            raise click.UsageError(f"{settings[name]} is not a time")
    unset = {"zero_time": False, "wrench_shift": 0.0, "clock": "auto"}
    return {k: v for k, v in settings.items() if v is not None and (k not in unset or v != unset[k])}


@command.command()
@click.argument("source", type=click.Path(path_type=Path))
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path),
    help="File: .npz (native), .csv, .hdf5 (robomimic) or .mcap (ROS 2); without an ending a LeRobot data set.",
)
@reading_options
@click.option("--json", "as_json", is_flag=True, help="The audit of what was written as JSON on stdout.")
@quiet_option
def convert(source: Path, out: Path, as_json: bool, **options: Any) -> int:
    """Read a recording of any layout and write a demonstration.

    Pose and wrench from two files are joined on time over the interval that both cover. Metadata is read from
    NAME.meta.toml beside a text file. Nothing is written if anything is wrong.

    \b
    Examples:
      skillframe demonstration convert demo.csv --out demo.npz
      skillframe demonstration convert R_CartPos.dat --columns t,px,py,pz,roll,pitch,yaw --euler xyz \\
          --wrench worldforce.dat --wrench-columns t,fx,fy,fz,tx,ty,tz --from 0 --to 7.07 --out approach.npz
      skillframe demonstration convert log.csv --columns t=stamp,px=x,py=y,pz=z,qx=qx,qy=qy,qz=qz,qw=qw,\\
          fx=fx,fy=fy,fz=fz,tx=mx,ty=my,tz=mz --units mm,ns --wrench-frame tool --out demo.npz
      skillframe demonstration convert demo.mcap --pose-topic /tool_pose --wrench-topic /ft --out demo.npz
      skillframe demonstration convert demo.bag --robot panda --wrench-topic /ft --wrench-frame tool --out demo.npz
    """
    from skillframe.conditioning.audit import audit
    from skillframe.extend.reading import AUTO, read_demonstration, write_demonstration

    settings = reading_settings(options)
    if settings.get("columns") == AUTO:
        return proposed([source], settings, as_json) or 1  # nothing was written
    demonstration = read_demonstration(source, **settings)
    found = audit(demonstration)
    write_demonstration(demonstration, out)
    for text in found.notes:
        note(text)
    for text in found.warnings:
        click.echo(f"warning: {text}", err=True)
    if as_json:
        emit_json({**found.as_json(), "written": str(out)})
    else:
        click.echo(f"{out}: {found.samples} samples, {found.duration_s:.2f} s at {found.rate_hz:.4g} Hz")
    return 0


@command.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@reading_options
@click.option("--json", "as_json", is_flag=True, help="A list with one audit per file as JSON on stdout.")
def check(files: tuple[Path, ...], as_json: bool, **options: Any) -> int:
    """Audit recordings: rate, gaps, frames, bias, noise, contact intervals, and what looks wrong.

    Warnings come with their evidence and leave the exit code at 0; it is 1 if a recording holds nothing to learn from
    (the tool does not move), 2 if a file cannot be read.

    \b
    Examples:
      skillframe demonstration check demo1.npz demo2.npz
      skillframe demonstration check rim0.csv --columns t,px,py,pz,qx,qy,qz,qw,fx,fy,fz,tx,ty,tz --json
      skillframe demonstration check log.csv --columns auto
    """
    from skillframe.conditioning.audit import audit, compared
    from skillframe.errors import SkillframeError
    from skillframe.extend.reading import AUTO, read_demonstration

    settings, demonstrations = reading_settings(options), []
    if settings.get("columns") == AUTO:
        return proposed(files, settings, as_json)
    for path in files:
        try:
            demonstrations.append(read_demonstration(path, **settings))
        except SkillframeError as error:
            if len(files) == 1:
                raise
            click.echo(f"error: {error}", err=True)
    audits = compared(demonstrations, [audit(d) for d in demonstrations])
    if as_json:
        emit_json([found.as_json() for found in audits])
    else:
        for found in audits:
            _show(found)
    if len(demonstrations) < len(files):
        return 2
    return 0 if all(found.usable for found in audits) else 1


def proposed(files: Sequence[Path], settings: dict[str, Any], as_json: bool) -> int:
    """Print the line that reads each foreign file. The exit code is 1 unless every line can be typed as it stands."""
    from skillframe.extend.reading import propose_reading

    found = [propose_reading(path, **settings) for path in files]
    if as_json:
        emit_json([proposal.as_json() for proposal in found])
        return 0 if all(proposal.whole for proposal in found) else 1
    for proposal in found:
        click.echo(f"{proposal.file}\n  type      {proposal.line}")
        for name in ("because", "undecided", "missing"):
            for text in getattr(proposal, name):
                click.echo(f"  {name:<10}{text}")
        if proposal.error:
            click.echo(f"  refused   {proposal.error}")
    return 0 if all(proposal.whole for proposal in found) else 1


def _show(found: DemonstrationAudit) -> None:
    """One audit for people: degrees and millimetres, with their units."""
    degrees = math.degrees(found.turned_rad)
    click.echo(found.file)
    lines = [
        ("samples", f"{found.samples}, {found.duration_s:.3f} s at {found.rate_hz:.5g} Hz, jitter {found.jitter:.1%}"),
        ("gaps", ", ".join(f"{g[1]:.3g} s at {g[0]:.3f} s" for g in found.gaps[:5]) or "none"),
        ("motion", f"{found.path_m * 1e3:.1f} mm, {degrees:.1f} degrees"),
        ("wrench", _declared(found)),
        ("bias", six(found.bias)),
        ("noise", f"{six(found.noise)} at rest; {six(found.noise_typical)} typically"),
        ("drift", six(found.drift) if found.drift else "not seen (it does not end in free air)"),
        ("peak", f"{found.peak_force_n:.2f} N, {counted(found.spikes, 'spike')}"),
        ("contact", _contacts(found)),
        *([("stalls", _stalls(found))] if found.stalls else []),
        *([("faults", _faults(found))] if found.faults else []),
    ]
    for name, text in lines:
        click.echo(f"  {name:<9}{text}")
    for text in found.notes:
        click.echo(f"  note     {text}")
    for text in found.warnings:
        click.echo(f"  warning  {text}")
    click.echo("  " + ("usable" if found.usable else "NOT usable") + f", {counted(len(found.warnings), 'warning')}")


WRENCH_WORDS: dict[str, Callable[[Any], str]] = {
    "sign": lambda sign: f"{sign} on tool", "point": lambda point: f"at the {point} point",
    "frame": lambda frame: f"{frame} axes",
    "includes_tool_weight": lambda it_does: f"{'with' if it_does else 'without'} the tool's weight",
}  # fmt: skip


def _declared(found: DemonstrationAudit) -> str:
    """What the metadata say about the wrench, as it is after reading."""
    frames = f"; points {', '.join(found.frames)}" if found.frames else ""
    words = [say(found.wrench[key]) for key, say in WRENCH_WORDS.items() if key in found.wrench]
    words += [f"{key} {value}" for key, value in found.wrench.items() if key not in WRENCH_WORDS]
    return (", ".join(words) or "not declared, taken as environment on tool, base axes") + frames


def six(values: list[float]) -> str:
    """Force and torque with their units."""
    return f"({', '.join(f'{v:.3f}' for v in values[:3])}) N, ({', '.join(f'{v:.4f}' for v in values[3:])}) Nm"


def counted(count: int, what: str) -> str:
    """How many of something, in words."""
    return f"{count} {what}{'s' * (count != 1)}"


def _stalls(found: DemonstrationAudit) -> str:
    return ", ".join(f"{s['what']} {s['start']:.2f}-{s['stop']:.2f} s" for s in found.stalls)


def _faults(found: DemonstrationAudit) -> str:
    more = f" and {len(found.faults) - 8} more" if len(found.faults) > 8 else ""
    return ", ".join(f"{f['kind']} of {f['what']} {f['start']:.2f}-{f['stop']:.2f} s" for f in found.faults[:8]) + more


def _contacts(found: DemonstrationAudit) -> str:
    late = dict.fromkeys(found.onsets_unseen, ", onset not seen")
    spans = [f"{c[0]:.2f}-{c[1]:.2f} s (peak {c[2]:.1f} N{late.get(c[0], '')})" for c in found.contacts[:8]]
    more = f" and {len(found.contacts) - 8} more" if len(found.contacts) > 8 else ""
    return f"above {found.contact_threshold_n:.2f} N: " + (", ".join(spans) or "none") + more
