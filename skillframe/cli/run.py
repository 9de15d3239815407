"""`skillframe run`: one run of a skill in a world, with its trace."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import click

from skillframe.cli import names
from skillframe.cli.endings import PAGE, TRACE
from skillframe.cli.names import robot_option, world_option
from skillframe.cli.numbers import SEED, WithUnit
from skillframe.cli.output import note, quiet_option
from skillframe.config.of_runs import DURATION, TRACE_RATE

FORCES = ("peak_force_filtered_n", "peak_force_10ms_n", "ended_by", "goal_reached", "ended_itself")
APART = "distance_to_collision_m"
QUIET_S = 5.0  # a run that is over by then needs no progress


@click.command(name="run")
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
    help="What differs from the nominal: start.offset_x=8mm ... (skillframe settings lists all).",
)
@click.option("--out", type=TRACE, help="Trace file (.npz).")
@click.option("--replay", type=PAGE, help="Page with a 3-D replay and plots of the run (.html).")
@click.option("--video", type=click.Path(path_type=Path), help="Film of the run (.mp4).")
@click.option("--seed", default=0, show_default=True, type=SEED, help="Seed of the sensor noise.")
@click.option(
    "--duration",
    default=DURATION.default,
    show_default=True,
    type=WithUnit("s", DURATION.range),
    help="Longest run in simulated seconds.",
)
@click.option(
    "--rate",
    default=TRACE_RATE.default,
    show_default=True,
    type=WithUnit("Hz", TRACE_RATE.range),
    help="Rate of the trace [Hz].",
)
@click.option(
    "--score",
    "scores",
    multiple=True,
    metavar="NAME",
    shell_complete=names.scores,
    help="A figure that a plug-in computes from the trace; repeat for several (skillframe plugins list names them).",
)
@click.option("--json", "as_json", is_flag=True, help="The outcome as JSON on stdout.")
@quiet_option
def command(
    skill: str, world: str, robot: str, coc: str | None, places: Path | None, settings: tuple[str, ...],
    out: Path | None, replay: Path | None, video: Path | None, seed: int, duration: float, rate: float,
    scores: tuple[str, ...],
    as_json: bool,
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

    if video is not None:
        from skillframe.reports.video import check_film, write_film

        check_film(video)
    with progress("s simulated", QUIET_S) as show, warned():
        done = once(
            skill, world, robot, coc=coc, set=dict(parse_setting(text) for text in settings), seed=seed,
            duration_s=duration, rate_hz=rate, scores=scores,
            progress=lambda now, longest: show(round(now, 2), longest), places=places,
        )  # fmt: skip
    if out is not None:
        done.save(out)
    if replay is not None:
        done.replay(replay)
    if video is not None:
        with progress("frames") as show:
            film = write_film(done.trace, video, show)
        note(f"note: the video was drawn by {film.renderer}")
    if done.unscored is not None:  # the run is kept
        raise done.unscored
    _tell(done.trace.meta, {"trace": out, "replay": replay, "video": video}, as_json)
    if done.interrupted:
        raise KeyboardInterrupt
    return 0 if done.success else 1


def _known(value: Any) -> Any:
    """Of a run that diverged, what is not a number is not known. JSON has no word for it but null."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _hundredths(value: float) -> str:
    """A figure of which thousandths mean nothing, and never none."""
    return f"{value:.2f}" if value >= 0.01 else "less than 0.01"


def _scene(meta: dict[str, Any]) -> str:
    """Who did it where, and how far it got, where the world can say that."""
    takes, way = meta["interface"]["takes"], meta["progress"]
    where = f"{meta['robot']}{'' if takes == 'torque' else f', told a {takes},'} in {meta['world']}"
    if way is None:
        return where
    reached = "an unknown part" if way["reached_m"] is None else f"{way['reached_m'] * 1000:.0f}"
    return f"{where}, {way['word']} {reached} of {way['of_m'] * 1000:.0f} mm"


def _tell(meta: dict[str, Any], files: dict[str, Path | None], as_json: bool) -> None:
    from skillframe.execution.tracemeta import SHARE_JOINTS, SHARES
    from skillframe.reports.motors import said_of_motors
    from skillframe.reports.peaks import said
    from skillframe.reports.second import told_of_second

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
        forces = ", ".join(said(meta, "{:.1f}".format))
        ended += f"; {forces}; {missed} mm and {turned} degrees from the goal"
    click.echo(ended)
    if meta.get("second"):
        click.echo(f"  second parts: {', '.join(told_of_second(meta['second']))}")
    if motors := said_of_motors(meta):
        click.echo(f"  motors: {', '.join(motors)}")
    for name, score in (meta.get("scores") or {}).items():
        figure = "none" if score["value"] is None else f"{score['value']:.4g} {score['unit']}"
        click.echo(f"  score {name}: {figure}")
    for what, path in files.items():
        if path is not None:
            click.echo(f"  {what}: {path}")
