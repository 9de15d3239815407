"""`skillframe benchmark`: AutoMate's assemblies, and insertions of 100 points."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from skillframe.cli import COUNT, SEED, note, terminable
from skillframe.errors import InputError, UnknownName

if TYPE_CHECKING:
    from skillframe_benchmarks.assembly import Plan
    from skillframe_benchmarks.counts import Found
    from skillframe_benchmarks.practice import Practice


@click.group(name="benchmark")
def command() -> None:
    """Run public benchmarks of assembly on parts that you fetched. Nothing of them is shipped.

    \b
    Example:
      skillframe benchmark automate IsaacGymEnvs --out automate
    """


@command.command()
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.argument("assemblies", nargs=-1, metavar="[ASSEMBLY]...")
@click.option("--out", type=click.Path(path_type=Path), default=Path("automate"), show_default=True,
              help="Folder for everything that is made, automate.json and automate.html.")  # fmt: skip
@click.option("--robot", default="panda", show_default=True, help="A robot's name, or its robot.toml.")
@click.option("--trials", default=20, show_default=True, type=COUNT, help="A level, the same samples for every method.")
@click.option("--level", "levels", multiple=True, help="As 1mm-2deg-0.2: shift, tilt, friction [all four].")
@click.option("--method", "methods", multiple=True, help="As lmc [all].")
@click.option("--seed", default=1, show_default=True, type=SEED, help="Of demonstrations and samples.")
@click.option(
    "--trial-seed", "draws", type=SEED, help="Seed of the samples, for others with the same demonstrations [--seed]."
)
@click.option("--workers", type=COUNT, help="Assemblies at a time [number of cores].")
@click.option("--list", "only_list", is_flag=True, help="List the assemblies, run nothing.")
@click.option("--json", "as_json", is_flag=True, help="The table as JSON on stdout.")
def automate(
    folder: Path, assemblies: tuple[str, ...], out: Path, robot: str, trials: int, levels: tuple[str, ...],
    methods: tuple[str, ...], seed: int, draws: int | None, workers: int | None, only_list: bool, as_json: bool,
) -> int:  # fmt: skip
    """AutoMate's plugs and sockets: each becomes a world, is shown twice, learned, and run beside a plain push.

    FOLDER is a checkout of IsaacGymEnvs (branch automate) or its assets/automate. Of each ASSEMBLY, or of all 100:
    rates of *seated* (within 1 mm of the assembled height, 2 mm sideways) and of the published check. The same command
    goes on where it was ended. Exit code 0 when all of it ran, 130 after Ctrl-C.

    \b
    Example:
      skillframe benchmark automate IsaacGymEnvs --list
      skillframe benchmark automate IsaacGymEnvs 00004 00007 --trials 20 --out automate
    """
    from skillframe_benchmarks.assembly import LEVELS, AssemblyJob, Plan
    from skillframe_benchmarks.assets import pairs

    found = pairs(folder, assemblies)
    if only_list:
        return _list(found, as_json)
    known = [level.name for level in LEVELS]
    plan = Plan(
        robot=robot, trials=trials, seed=seed, draws=seed if draws is None else draws,
        methods=_chosen("method", methods, list(Plan().methods)), levels=_chosen("level", levels, known),
    )  # fmt: skip
    agree(out, plan)
    jobs = [AssemblyJob(pair=pair, folder=(out / pair.name).resolve(), plan=plan) for pair in found]
    with terminable() as code:
        return _run(jobs, out, workers or os.cpu_count() or 1, as_json, code)


@command.command()
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("--out", type=click.Path(path_type=Path), default=Path("insertion"), show_default=True,
              help="Folder for a world each.")  # fmt: skip
def insertion(folder: Path, out: Path) -> int:
    """Worlds of the AI for Industry Challenge: its plugs and ports of boxes, for --score insertion_points.

    FOLDER is a checkout of intrinsic-dev/aic, or its aic_assets/models. Says what is found in each pair, or why it is
    refused. Exit code 2 where all are.

    \b
    Example:
      skillframe benchmark insertion aic --out insertion
      skillframe run sc.skill.json --world insertion/sc/fixture.toml --coc tip --score insertion_points
    """
    from skillframe_parts.found import lines
    from skillframe_parts.load import load

    from skillframe.errors import SkillframeError
    from skillframe_benchmarks.boxes import INSERTIONS, write

    refused = []
    for name in INSERTIONS:
        try:
            path, height = write(folder, name, out)
            said = lines(load(path))
        except SkillframeError as error:
            refused.append(f"{name} is refused: {error}")
            continue
        where = f"{1000.0 * abs(height):.2g} mm {'below' if height < 0.0 else 'above'} its published place"
        click.echo("\n".join([f"{path} written, the plug at rest {where}", *said]))
    for sentence in refused:
        click.echo(sentence, err=True)
    return 2 if len(refused) == len(INSERTIONS) else 0


def _chosen(what: str, given: Sequence[str], known: Sequence[str]) -> tuple[str, ...]:
    for name in given:
        if name not in known:
            raise UnknownName(what, name, known)
    return tuple(name for name in known if name in given or not given)


def agree(out: Path, plan: Plan | Practice) -> None:
    """Keep the plan, or refuse a folder that was begun with another."""
    from skillframe.files import write_whole

    # Version of a benchmark's folder
    path, mine = out / "plan.json", {**json.loads(json.dumps(asdict(plan))), "layout": 3}
    if path.exists():
        theirs = json.loads(path.read_text(encoding="utf-8"))
        if theirs.get("draws") is None and "seed" in theirs:
            theirs["draws"] = theirs["seed"]  # a folder without `draws`
        other = [f"{key} = {theirs.get(key)!r}" for key in mine if theirs.get(key) != mine[key]]
        if other:
            raise InputError(out, f"was begun with {', '.join(other)}", "type the same, or choose another --out")
        return
    out.mkdir(parents=True, exist_ok=True)
    write_whole(path, (json.dumps(mine, indent=1, sort_keys=True) + "\n").encode())


def _list(found: Sequence[Any], as_json: bool) -> int:
    from skillframe.cli import LIST_WIDTH, emit_json, table
    from skillframe_benchmarks.assets import DEVELOPED

    rows = [(pair.name, pair.way_out, pair.name in DEVELOPED) for pair in found]
    if as_json:
        emit_json([{"assembly": name, "way_out_m": out, "developed_on": used} for name, out, used in rows])
    else:
        lines = [(name, "" if out is None else f"{1e3 * out:.0f}", "yes" if used else "") for name, out, used in rows]
        table(("assembly", "way out [mm]", "developed on"), lines, LIST_WIDTH)
    return 0


def _run(jobs: Sequence[Any], out: Path, workers: int, as_json: bool, code: Any) -> int:
    from skillframe_benchmarks import runner

    broken, interrupted = [], False
    try:
        broken = runner.run(jobs, out, workers, note)
    except KeyboardInterrupt:
        interrupted = True
    _show(jobs, out, as_json)
    if interrupted:
        click.echo(f"ended; what is done is kept in {out}, the same command goes on from there", err=True)
        return int(code())
    if broken:
        raise RuntimeError("; ".join(broken))
    return 0


def _show(jobs: Sequence[Any], out: Path, as_json: bool) -> None:
    from skillframe.cli import PAGE_WIDTH, emit_json, table
    from skillframe.files import write_whole
    from skillframe_benchmarks import page
    from skillframe_benchmarks.assembly import LEVELS
    from skillframe_benchmarks.counts import read

    levels = [level for level in LEVELS if level.name in jobs[0].plan.levels]
    found: list[Found] = [each for job in jobs if (each := read(job.folder, levels)) is not None]
    totals = page.totals(found, levels, jobs[0].plan.methods)
    write_whole(
        out / "automate.json", (json.dumps(page.plain(found, totals), indent=1, sort_keys=True) + "\n").encode()
    )
    write_whole(out / "automate.html", page.render(found, totals, jobs[0].plan, len(jobs)).encode())
    if as_json:
        emit_json(page.plain(found, totals))
    else:
        table(page.HEAD, page.lines(totals), PAGE_WIDTH)
    refused = sum(bool(each.refused) for each in found)
    note(f"{len(found)} of {len(jobs)} assemblies done, {refused} of them refused; page: {out / 'automate.html'}")
