"""`skillframe run`: one run of a skill in a world, with its trace."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import options
from skillframe.cli.options import SEED, TRACE, OutputFile, WithUnit, robot_option, world_option
from skillframe.cli.output import note
from skillframe.config.units import DURATION, TRACE_RATE

if TYPE_CHECKING:
    from skillframe.extend.outputs import OutputType

FORCES = ("peak_force_filtered_n", "peak_force_10ms_n", "ended_by", "goal_reached", "ended_itself")
APART = "distance_to_collision_m"


class RunCommand(click.Command):
    """A command with an option for every kind of file that plug-ins write of a run."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """The options of the core, with those of plug-ins behind `--out`."""
        params = super().get_params(ctx)
        behind = next(i for i, each in enumerate(params, start=1) if each.name == "out")
        files = []
        for record in _outputs():
            kind = OutputFile(*record.endings) if record.endings else click.Path(path_type=Path)
            files.append(click.Option([f"--{record.name}"], type=kind, help=f"{record.summary}."))
        return [*params[:behind], *files, *params[behind:]]

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does, but for an absent plug-in's option print what to install."""
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            from skillframe.extend.homes import homes
            from skillframe.extend.registry import registry

            name = error.option_name.lstrip("-")
            if f"output:{name}" in homes():
                registry().output(name)
            raise


def _outputs() -> list[OutputType]:
    from skillframe.extend.registry import registry

    return [record for record in registry().records("output") if record.of == "run"]


@click.command(name="run", cls=RunCommand)
@click.argument("skill")
@world_option("World to run in")
@robot_option
@click.option("--coc", help='Centre of compliance: "x,y,z" in the tool frame, or a frame (tip, wrist) [as learned].')
@click.option(
    "--places", type=click.Path(path_type=Path),
    help="TOML file: where the places are that the skill goes by [as the world says].",
)  # fmt: skip
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="KEY=VALUE",
    help="What differs from the nominal: start.offset_x=8mm ... (worlds --settings lists all).",
)
@click.option("--out", type=TRACE, help="Trace file (.npz).")
@click.option("--seed", default=0, show_default=True, type=SEED, help="Seed of the sensor noise.")
@click.option(
    "--duration",
    default=DURATION.nominal,
    show_default=True,
    type=WithUnit("s", DURATION.range),
    help="Longest run in simulated seconds.",
)
@click.option(
    "--rate",
    default=TRACE_RATE.nominal,
    show_default=True,
    type=WithUnit("Hz", TRACE_RATE.range),
    help="Rate of the trace [Hz].",
)
@click.option(
    "--score",
    "scores",
    multiple=True,
    metavar="NAME",
    shell_complete=options.scores,
    help="A figure that a plug-in computes from the trace; repeat for several (skillframe plugins names them).",
)
@click.option("--json", "as_json", is_flag=True, help="The outcome as JSON on stdout.")
def command(
    skill: str, world: str, robot: str, coc: str | None, places: Path | None, settings: tuple[str, ...],
    out: Path | None, seed: int, duration: float, rate: float, scores: tuple[str, ...], as_json: bool,
    **files: Path | None,
) -> int:  # fmt: skip
    """Run SKILL (a skill file, or TYPE:DEMONSTRATION) once in a simulated world.

    Exit code 0 if the goal was reached, 1 if not.

    \b
    Examples:
      skillframe run peg.skill.json --world peg_in_hole --robot panda --coc tip \\
        --set fixture.tilt_y=0.07 --set world.friction=0.3 --out run.npz --replay run.html
      skillframe run peg.skill.json --world peg_in_hole --video run.mp4
    """
    from skillframe.api.running import once
    from skillframe.cli.output import progress, warned
    from skillframe.config import parse_setting

    for record in _outputs():
        path = files[record.name]
        if path is not None and record.check is not None:
            record.check(path)
    with progress("s simulated", after_s=5.0) as show, warned():
        done = once(
            skill, world, robot, coc=coc, set=dict(parse_setting(text) for text in settings), seed=seed,
            duration_s=duration, rate_hz=rate, scores=scores,
            progress=lambda now, longest: show(round(now, 2), longest), places=places,
        )  # fmt: skip
    if out is not None:
        done.save(out)
    for name, path in files.items():
        if path is not None:
            with progress("frames") as show:
                said = done.write(name, path, show)
            if said:
                note(f"note: {said}")
    if done.unscored is not None:  # the run is kept
        raise done.unscored
    _tell(done.trace.meta, {"trace": out, **files}, as_json)
    if done.interrupted:
        raise KeyboardInterrupt
    return 0 if done.success else 1


def _known(value: Any) -> Any:
    """A value for JSON: None for NaN, as in a run that diverged."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _hundredths(value: float) -> str:
    return f"{value:.2f}" if value >= 0.01 else "less than 0.01"


def _scene(meta: dict[str, Any]) -> str:
    takes, way = meta["interface"]["takes"], meta["progress"]
    where = f"{meta['robot']}{'' if takes == 'torque' else f', with {takes} commands,'} in {meta['world']}"
    if way is None:
        return where
    reached = "an unknown part" if way["reached_m"] is None else f"{way['reached_m'] * 1000:.0f}"
    return f"{where}, {way['word']} {reached} of {way['of_m'] * 1000:.0f} mm"


def _tell(meta: dict[str, Any], files: dict[str, Path | None], as_json: bool) -> None:
    from skillframe.execution.result import joint_shares, peak_forces, second_parts
    from skillframe.execution.trace import SHARE_JOINTS, SHARES

    keys = ["success", "failure", "reason", "duration_s", "peak_force_n", "final_error_m", "final_error_rad"]
    outcome = {key: _known(meta[key]) for key in keys}
    judged = {key: _known(meta[key]) for key in (*FORCES, *SHARES, *SHARE_JOINTS, APART)}
    notes = list(meta.get("notes") or [])
    for text in notes:
        note(f"note: {text}")
    if meta["success"] and meta["ended_by"] == "time":
        note("note: the goal is reached, but the skill had not ended by itself when the time was up")
    if not any(files.values()):
        note("not saved; add --out run.npz")
    if as_json:
        named = {what: str(path) if path else None for what, path in files.items()}
        where = {name: meta[name] for name in ("robot", "interface", "world", "progress")}
        where |= {"scores": meta.get("scores") or {}, "touched": meta.get("touched"), "notes": notes}
        where |= {"second": meta["second"]} if meta.get("second") else {}
        click.echo(json.dumps({**outcome, **judged, **where, **named}, sort_keys=True))
        return
    click.echo(f"success: {_scene(meta)}" if meta["success"] else f"failure: {meta['failure']}\n  {_scene(meta)}")
    ended = f"  ended after {meta['duration_s']:.2f} s ({meta['reason']})"
    if None not in outcome.values():
        missed, turned = _hundredths(meta["final_error_m"] * 1000), _hundredths(math.degrees(meta["final_error_rad"]))
        forces = "".join(f"; {text}" for text in peak_forces(meta, "{:.1f}".format)[:1])
        ended += f"{forces}; {missed} mm and {turned} degrees from the goal"
    click.echo(ended)
    if meta.get("second"):
        click.echo(f"  second parts: {', '.join(second_parts(meta['second']))}")
    if motors := joint_shares(meta):
        click.echo(f"  motors: {', '.join(motors)}")
    for name, score in (meta.get("scores") or {}).items():
        figure = "none" if score["value"] is None else f"{score['value']:.4g} {score['unit']}"
        click.echo(f"  score {name}: {figure}")
    for what, path in files.items():
        if path is not None:
            click.echo(f"  {what}: {path}")
