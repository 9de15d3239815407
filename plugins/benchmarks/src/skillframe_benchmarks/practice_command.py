"""`skillframe practise`: from two meshes to a tried skill, without a demonstration."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from skillframe.cli import COUNT, SEED, WithUnit, campaign_progress, emit_json, note, terminable
from skillframe.config.units import Range
from skillframe.errors import InputError

if TYPE_CHECKING:
    from skillframe import CampaignResults
    from skillframe_benchmarks.practice import Practice

_MESH = click.Path(path_type=Path, exists=True, dir_okay=False)


@click.command()
@click.argument("plug", type=_MESH)
@click.argument("socket", type=_MESH)
@click.option("--units", help='Of both files, as "mm"; needed for all but GLB and STEP.')
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder for everything that is made."
)
@click.option("--shift", type=WithUnit("mm", Range(0.0, 0.05, "50 mm")), default="2mm", show_default=True,
              help="Largest error of the socket's place, along each axis.")  # fmt: skip
@click.option("--tilt", type=WithUnit("deg", Range(0.0, 0.6, "34 deg")), default="5deg", show_default=True,
              help="Largest error of its orientation, about each axis.")  # fmt: skip
@click.option("--robot", default="panda", show_default=True, help="A robot's name, or its robot.toml.")
@click.option("--trials", default=20, show_default=True, type=COUNT, help="Trials of the skill.")
@click.option("--seed", default=0, show_default=True, type=SEED, help="Everything random follows from it.")
@click.option("--json", "as_json", is_flag=True, help="All results as JSON alone on stdout.")
def command(
    plug: Path, socket: Path, units: str | None, out: Path, shift: float, tilt: float, robot: str, trials: int,
    seed: int, as_json: bool,
) -> int:  # fmt: skip
    """Teach a skill from two meshes alone: PLUG (held) and SOCKET (standing), assembled as they were exported.

    Takes the part out of its assembled pose, makes a skill of kind seat from that, and practises it with the socket
    anywhere within --shift and --tilt. The same command goes on where it was ended. A fixture.toml that is in the
    folder before is taken as it is (skillframe worlds new): friction and the like stand there.

    Exit code 0, also if trials fail; 2 where the parts cannot be used, or do not come apart.

    \b
    Example:
      skillframe practise plug.stl socket.stl --units mm --out practised
    """
    from skillframe_parts.found import lines, needs_units, values

    from skillframe_benchmarks import practice as steps
    from skillframe_benchmarks.command import agree

    if plug.name == socket.name:
        raise InputError(plug, f"is named as {socket}, and both are copied into one folder", "rename one")
    if units is None and needs_units(plug.name, socket.name):
        raise InputError("--units", "is missing", "give for example --units mm")
    placed = str(Path(robot).absolute()) if Path(robot).exists() else robot
    shown: list[str] = []

    def say(*texts: str) -> None:
        shown.extend(texts)
        if not as_json:
            for text in texts:
                click.echo(text)

    with terminable() as code:
        try:
            parts = steps.world_of(plug, socket, units, out, note)
            asked = steps.Practice(
                files=steps.files_of(parts), robot=placed, shift=1e-3 * shift, tilt=math.radians(tilt), trials=trials,
                seed=seed,
            )  # fmt: skip
            agree(out, asked)
            say(*lines(parts))
            taken = steps.removed(out, asked)
            say(f"taken out in {taken.duration:.1f} s: {out / steps.REMOVAL}")
            skill = steps.learned(out, asked, taken)
            say(f"learned {out / steps.SKILL}: {skill.words[0]}")
            with campaign_progress() as notify:
                results = steps.tried(out, asked, notify)
        except KeyboardInterrupt:
            click.echo(f"ended; what is done is kept in {out}, the same command goes on from there", err=True)
            return int(code())
    say(*_verdict(out, asked, results))
    if as_json:
        (rate,) = results.skills.values()
        emit_json({
            "parts": values(parts), "skill": skill.source, "shift_m": asked.shift, "tilt_rad": asked.tilt,
            "lines": shown, **rate._asdict(),
        })  # fmt: skip
    return 0


def _verdict(out: Path, asked: Practice, results: CampaignResults) -> list[str]:
    from skillframe_benchmarks.practice import CERTIFY, TRIALS

    (rate,) = results.skills.values()
    box = f"the socket anywhere within {1e3 * asked.shift:g} mm and {math.degrees(asked.tilt):g} degrees"
    if rate.rate is None:
        return [f"no trial: each of {rate.refused} starts is inside the socket; raise task.start.above_mouth"]
    text = f"{rate.successes} of {rate.trials} trials are seated, {box}"
    if rate.interval_95 is not None:
        low, high = rate.interval_95
        text += f" (95 % interval {100 * low:.0f} to {100 * high:.0f} %)"
    if rate.refused:
        text += f"; {rate.refused} starts inside the socket are left out"
    found = [text]
    failed = [row for row in results.rows if not row["success"] and row["ended_by"] != "start"]
    if failed:
        first = failed[0]["trial"]
        found += [f"why one failed: skillframe campaign replay {out / TRIALS} {first} --out trial{first}.npz"]
    return [*found, f"next, where 90 % succeed: skillframe certify run {out / CERTIFY} --rate 0.9 --out certified"]
