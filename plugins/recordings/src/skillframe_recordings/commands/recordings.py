"""`skillframe check` and `convert` for recordings of any layout."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import emit_json, note
from skillframe_recordings.commands.proposing import proposed

if TYPE_CHECKING:
    from skillframe_recordings.audit import DemonstrationAudit

_OPTIONS = [
    click.option(
        "--layout", metavar="FILE",
        help="Layout file: reading settings of a logger. \"auto\" reads nothing and proposes them, with reasons.",
    ),
    click.option(
        "--set", "settings", multiple=True, metavar="KEY=VALUE",
        help="A reading setting, as columns=t,px,py,pz,... or wrench-frame=tool, over that of the layout.",
    ),
    click.option(
        "--write-layout", type=click.Path(path_type=Path), metavar="FILE",
        help="Write these settings, or what --layout auto proposes, to a layout file (.toml).",
    ),
]  # fmt: skip


def reading_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--layout`, `--set` and `--write-layout`, for the settings of `demonstration.options.ReadOptions`."""
    for option in reversed(_OPTIONS):
        function = option(function)
    return function


def reading_settings(layout: str | None, settings: Sequence[str]) -> dict[str, Any]:
    """Return the typed settings over those of a layout. Raises `InputError` for an unknown one or a wrong value."""
    from skillframe.demonstration import read_layout, typed_settings
    from skillframe.extend import AUTO

    return {**({} if layout in (None, AUTO) else read_layout(Path(layout))), **typed_settings(settings)}


def _keep_layout(files: Sequence[Path], settings: dict[str, Any], layout: Path | None) -> None:
    """Write the settings that read the files as a layout, if --write-layout is given."""
    from skillframe_recordings.proposal.layouts import OF_ONE, key_of, write_layout

    if layout is None:
        return
    write_layout(
        layout, settings, (), f"made by: {click.get_current_context().command_path} {shlex.join(map(str, files))}"
    )
    left = ", ".join(key_of(name) for name in OF_ONE if name in settings)
    note(f"{layout}: written" + (f" without {left}, as of one recording" if left else ""))


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--out", required=True,
    help="File: .npz (native), .csv, .hdf5 (robomimic) or .mcap (ROS 2); without an ending a LeRobot data set. A "
    "folder (FOLDER/, or one that is there) takes an .npz for each file.",
)  # fmt: skip
@reading_options
@click.option("--json", "as_json", is_flag=True, help="The audit of what was written as JSON on stdout.")
def convert(
    files: tuple[Path, ...], out: str, layout: str | None, settings: tuple[str, ...], write_layout: Path | None,
    as_json: bool,
) -> int:  # fmt: skip
    """Read recordings of any layout and write demonstrations.

    Pose and wrench from two files are joined over their common time. Metadata is read from NAME.meta.toml beside a text
    file. Nothing is written if any file has an error.

    \b
    Examples:
      skillframe convert demo.csv --out demo.npz
      skillframe convert log1.csv log2.csv --layout layout.toml --out demos/
      skillframe convert R_CartPos.dat --set columns=t,px,py,pz,roll,pitch,yaw --set euler=xyz \\
          --set wrench=worldforce.dat --set wrench-columns=t,fx,fy,fz,tx,ty,tz --set to=7.07 --out approach.npz
      skillframe convert demo.mcap --set pose-topic=/tool_pose --set wrench-topic=/ft --out demo.npz
      skillframe convert demo.bag --set robot=panda --set wrench-topic=/ft --set wrench-frame=tool --out demo.npz
    """
    from skillframe.extend import AUTO, is_data_set, read_demonstration, write_data_set, write_demonstration
    from skillframe_recordings.audit import audit

    given = reading_settings(layout, settings)
    if layout == AUTO:
        return proposed(files, given, write_layout, as_json, "convert", "--out", out) or 1  # nothing was written
    targets = _targets(files, out)
    if given.get("wrench") is not None and len(files) > 1:
        raise click.UsageError("--set wrench is the file of one recording; convert those that have one by one")
    demonstrations = [read_demonstration(path, **given) for path in files]
    audits = [audit(demonstration) for demonstration in demonstrations]
    _keep_layout(files, given, write_layout)
    if targets == [Path(out)] and is_data_set(Path(out)):
        write_data_set(demonstrations, Path(out))
    else:
        Path(out).mkdir(parents=True, exist_ok=True) if targets != [Path(out)] else None
        for demonstration, target in zip(demonstrations, targets, strict=True):
            write_demonstration(demonstration, target)
    for found in audits:
        for text in found.notes:
            note(text if len(files) == 1 else f"{found.file}: {text}")
        for text in found.warnings:
            click.echo(f"warning: {text}" if len(files) == 1 else f"warning: {found.file}: {text}", err=True)
    written = [found.as_json() | {"written": str(to)} for found, to in zip(audits, targets * len(audits), strict=False)]
    if as_json:
        emit_json(written[0] if len(files) == 1 else written)
        return 0
    for found, to in zip(audits, targets * len(audits), strict=False):
        click.echo(f"{to}: {found.samples} samples, {found.duration_s:.2f} s at {found.rate_hz:.4g} Hz")
    return 0


def _targets(files: Sequence[Path], out: str) -> list[Path]:
    """The output path, or one path in a folder for each recording.

    Raises:
        UsageError: one file for several recordings.
        InputError: two recordings would have the same file.
    """
    place = Path(out)
    if not (out.endswith(("/", "\\")) or (place.is_dir() and not (place / "meta").is_dir())):
        if len(files) > 1 and place.suffix:
            raise click.UsageError(
                f"--out {out} is one file, and {len(files)} recordings are given; give a folder: --out {place.stem}/"
            )
        return [place]
    stems = [path.name.split(".")[0] for path in files]
    names = [s if stems.count(s) == 1 else f"{p.resolve().parent.name}_{s}" for s, p in zip(stems, files, strict=True)]
    for i, name in enumerate(names):
        if name in names[:i]:
            from skillframe.errors import InputError

            raise InputError(files[i], f"would be written to {name}.npz as {files[names.index(name)]} is", "rename one")
    return [place / f"{name}.npz" for name in names]


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@reading_options
@click.option("--json", "as_json", is_flag=True, help="A list with one audit per file as JSON on stdout.")
def check(
    files: tuple[Path, ...], layout: str | None, settings: tuple[str, ...], write_layout: Path | None, as_json: bool
) -> int:
    """Audit recordings: rate, gaps, frames, bias, noise, contact intervals and faults.

    Warnings include their evidence and leave the exit code at 0. It is 1 if a recording holds no motion to learn from,
    2 if a file cannot be read.

    \b
    Examples:
      skillframe check demo1.npz demo2.npz
      skillframe check rim0.csv --set columns=t,px,py,pz,qx,qy,qz,qw,fx,fy,fz,tx,ty,tz --json
      skillframe check log.csv --layout auto --write-layout layout.toml
      skillframe check log.csv --layout layout.toml --set wrench-sign=teacher --set from=1.5
      skillframe check log1.csv log2.csv --layout layout.toml
    """
    from skillframe.errors import SkillframeError
    from skillframe.extend import AUTO, read_demonstration
    from skillframe_recordings.audit import audit, compared

    given, demonstrations = reading_settings(layout, settings), []
    if layout == AUTO:
        return proposed(files, given, write_layout, as_json, "check")
    for path in files:
        try:
            demonstrations.append(read_demonstration(path, **given))
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
    _keep_layout(files, given, write_layout)
    return 0 if all(found.usable for found in audits) else 1


def _show(found: DemonstrationAudit) -> None:
    degrees = math.degrees(found.turned_rad)
    words = [say(found.wrench[key]) for key, say in WRENCH_WORDS.items() if key in found.wrench]
    words += [f"{key} {value}" for key, value in found.wrench.items() if key not in WRENCH_WORDS]
    frames = f"; points {', '.join(found.frames)}" if found.frames else ""
    late = dict.fromkeys(found.onsets_unseen, ", onset not seen")
    contacts = [f"{c[0]:.2f}-{c[1]:.2f} s (peak {c[2]:.1f} N{late.get(c[0], '')})" for c in found.contacts]
    stalls = [f"{s['what']} {s['start']:.2f}-{s['stop']:.2f} s" for s in found.stalls]
    faults = [f"{f['kind']} of {f['what']} {f['start']:.2f}-{f['stop']:.2f} s" for f in found.faults]
    click.echo(found.file)
    lines = [
        ("samples", f"{found.samples}, {found.duration_s:.3f} s at {found.rate_hz:.5g} Hz, jitter {found.jitter:.1%}"),
        ("gaps", ", ".join(f"{g[1]:.3g} s at {g[0]:.3f} s" for g in found.gaps[:5]) or "none"),
        ("motion", f"{found.path_m * 1e3:.1f} mm, {degrees:.1f} degrees"),
        ("wrench", (", ".join(words) or "not declared, taken as environment on tool, base axes") + frames),
        ("bias", six(found.bias)),
        ("noise", f"{six(found.noise)} at rest; {six(found.noise_typical)} typically"),
        ("drift", six(found.drift) if found.drift else "not seen (it does not end in free air)"),
        ("peak", f"{found.peak_force_n:.2f} N, {counted(found.spikes, 'spike')}"),
        ("contact", f"above {found.contact_threshold_n:.2f} N: " + (_first(contacts) or "none")),
        *([("stalls", ", ".join(stalls))] if stalls else []),
        *([("faults", _first(faults))] if faults else []),
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


def six(values: list[float]) -> str:
    """Format force and torque with units."""
    return f"({', '.join(f'{v:.3f}' for v in values[:3])}) N, ({', '.join(f'{v:.4f}' for v in values[3:])}) Nm"


def _first(texts: list[str]) -> str:
    """The first eight texts and the number of the others."""
    return ", ".join(texts[:8]) + (f" and {len(texts) - 8} more" if len(texts) > 8 else "")


def counted(count: int, what: str) -> str:
    """Format a count with its noun."""
    return f"{count} {what}{'s' * (count != 1)}"
