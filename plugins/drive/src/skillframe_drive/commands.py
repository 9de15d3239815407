"""`skillframe drive`: check a robot, run a skill on it, and serve a fake robot."""

from __future__ import annotations

import json
import re
import shlex
import time
from functools import partial
from pathlib import Path
from typing import Any

import click

CONFIRMATION = "move"
CELL = click.Path(path_type=Path)


@click.group(name="drive")
def command() -> None:
    """Run a skill on a real robot, or on a fake one.

    The robot's own safety controller is the only safety function. The checks and limits here guard against mistakes,
    and no run has been made on a real robot yet.

    \b
    Example, in two terminals:
      skillframe drive fake ur --world valley --set fixture.offset_x=8mm
      skillframe drive run valley.skill.json --cell cell.toml --out run.npz
    """


@command.command()
@click.argument("cell", type=CELL)
@click.option("--press", is_flag=True, help="Check the wrench's sign and frame by three presses of your hand.")
@click.option("--json", "as_json", is_flag=True, help="The checks as JSON on stdout.")
def check(cell: Path, press: bool, as_json: bool) -> int:
    """Check the robot of CELL without moving it.

    Exit code 0 if a run may begin, 1 if not.

    \b
    Example:
      skillframe drive check cell.toml --press
    """
    from skillframe_drive.cell import load_cell
    from skillframe_drive.press import check_wrench
    from skillframe_drive.runs import check as measured
    from skillframe_drive.runs import load_task, open_link

    task = load_task(load_cell(cell))
    link = open_link(task.cell)
    try:
        lines = measured(task, link)
        if press and not link.fault:
            lines.append(check_wrench(task, link, partial(click.echo, err=True)))
    finally:
        link.close()
    if as_json:
        click.echo(json.dumps([{"text": line.text, "problem": line.problem} for line in lines]))
    else:
        _print(lines)
    return int(any(line.problem for line in lines))


def _print(lines: Any) -> None:
    for line in lines:
        click.echo(f"{'NO' if line.problem else 'ok':4}{line.text}" + (f": {line.problem}" if line.problem else ""))


@command.command()
@click.argument("skill")
@click.option("--cell", required=True, type=CELL, help="The robot and its surroundings: cell.toml.")
@click.option("--coc", help='Centre of compliance: "x,y,z" in the tool frame, or a frame (tip, wrist) [as learned].')
@click.option("--slow", default=1.0, show_default=True, type=click.FloatRange(0.05, 1.0), help="Share of the speed.")
@click.option("--press", is_flag=True, help="First check the wrench by three presses of your hand, as check does.")
@click.option("--dry", is_flag=True, help="Read and compute, but send nothing to the robot.")
@click.option("--duration", default=60.0, show_default=True, type=click.FloatRange(0.1), help="Longest run [s].")
@click.option("--out", type=click.Path(path_type=Path), help="Trace file (.npz), for report, replay and video.")
@click.option("--enter", type=CELL, metavar="TABLE", help="Enter the run as the next trial, as trials enter does.")
@click.option("--samples", multiple=True, metavar="NAME=VALUE", help="What was set for this trial, for --enter.")
@click.option("--json", "as_json", is_flag=True, help="The outcome as JSON on stdout.")
def run(
    skill: str, cell: Path, coc: str | None, slow: float, press: bool, dry: bool, duration: float,
    out: Path | None, enter: Path | None, samples: tuple[str, ...], as_json: bool,
) -> int:  # fmt: skip
    """Run SKILL once on the robot of a cell.

    Checks the robot, asks for a typed confirmation, zeroes the force sensor and runs. Exit code 0 if the task was done,
    1 if not.

    \b
    Example:
      skillframe drive run valley.skill.json --cell cell.toml --slow 0.5 --out run.npz
      skillframe drive run valley.skill.json --cell cell.toml --enter bench --samples fixture.offset_x=0.004
    """
    from skillframe import LearnedSkill
    from skillframe.cli.main import run as typed
    from skillframe_drive.cell import load_cell
    from skillframe_drive.press import check_wrench
    from skillframe_drive.runs import check as measured
    from skillframe_drive.runs import load_task, open_link, refuse_problems, run_once

    if samples and enter is None:
        raise click.UsageError("--samples is of a trial that is entered: give --enter TABLE")
    if enter is not None:
        _refuse_entering(dry, slow)
    learned, task = LearnedSkill.load(skill), load_task(load_cell(cell))
    link = open_link(task.cell)
    try:
        lines = measured(task, link)
        if press and not link.fault:
            lines.append(check_wrench(task, link, partial(click.echo, err=True)))
        if not as_json:
            _print(lines)
        refuse_problems(lines)
        if not dry:
            _confirm()
        done = run_once(
            learned, task, link, coc=coc, slow=slow, dry=dry, duration_s=duration, rate_hz=100.0,
            done=partial(click.confirm, "Is the task done?", err=True) if task.cell.witness == "person" else None,
        )  # fmt: skip
    finally:
        link.close()
    if out is not None:
        done.save(out)
    meta = done.trace.meta
    if as_json:
        keys = ("success", "failure", "reason", "duration_s", "peak_force_n", "ended_by", "goal_reached", "missed")
        click.echo(json.dumps({**{key: meta[key] for key in keys}, "out": None if out is None else str(out)}))
    else:
        click.echo("success" if done.success else f"failure: {done.failure}")
        click.echo(f"  ended after {done.duration_s:.2f} s ({done.reason}); peak force {done.peak_force_n:.1f} N")
        click.echo(f"  {meta['notes'][-2]}")
    entered = 0
    if enter is not None:
        outcome = ["--success"] if done.success else ["--failure", "--why", str(done.failure)]
        given = [word for each in samples for word in ("--samples", each)]
        name = Path(skill).name.removesuffix(".skill.json")
        words = ["trials", "enter", str(enter), "--skill", name, *outcome, *given]
        if entered := typed(words):
            click.echo(f"this run is not entered yet; put right and type: skillframe {shlex.join(words)}", err=True)
    if done.interrupted:
        raise KeyboardInterrupt
    return entered or (0 if done.success else 1)


def _refuse_entering(dry: bool, slow: float) -> None:
    """Refuse before the robot moves what cannot be entered."""
    from skillframe.errors import InputError

    if dry or slow != 1.0:
        raise click.UsageError("a dry or slowed run is no trial of the skill: leave out --dry and --slow, or --enter")
    root = click.get_current_context().find_root()
    if not isinstance(root.command, click.Group) or root.command.get_command(root, "trials") is None:
        raise InputError("--enter", "needs the command trials", "install skillframe-certify")


@command.command()
@click.argument("cell", type=CELL)
@click.option("--coc", help="Where a robot that takes impedances has its end-effector frame, as run takes it [tool].")
@click.option("--json", "as_json", is_flag=True, help="What was measured as JSON on stdout.")
def identify(cell: Path, coc: str | None, as_json: bool) -> int:
    """Measure the robot of CELL by small motions in free air: what robot.toml and campaign.toml should say.

    A robot that takes positions: delay and bandwidth, against robot.toml. One that takes torques: friction that is left
    in its joints. One that takes impedances: the stiffness that it renders, friction, and the delay of the
    feed-forward. All: noise and bias of the force sensor, and a weight that the robot's payload setting lacks. Move
    the robot to where the tool has 0.1 m of free air on all sides. Exit code 1 if something is wrong.

    \b
    Example:
      skillframe drive identify cell.toml
      skillframe drive identify cell.toml --coc tip
    """
    from skillframe.campaign import to_lines
    from skillframe.cli import emit_json
    from skillframe.demonstration import resolve_point
    from skillframe_drive.cell import load_cell
    from skillframe_drive.identify import identify as measured
    from skillframe_drive.identify import toml_lines
    from skillframe_drive.impedance import identify_impedance
    from skillframe_drive.runs import check, load_task, open_link, refuse_problems

    task = load_task(load_cell(cell))
    point = resolve_point(coc, task.scene.tool.frames, "--coc")
    link = open_link(task.cell)
    try:
        refuse_problems(check(task, link, anywhere=True))
        _confirm()
        say = partial(click.echo, err=True)
        impedance = link.takes == "impedance"
        found = identify_impedance(task, link, say, point) if impedance else measured(task, link, say)
    finally:
        link.close()
    tables = toml_lines(found)
    if as_json:
        emit_json({"lines": [{"text": line.text, "problem": line.problem} for line in found.lines], **tables})
    else:
        _print(found.lines)
        for file, table in (("robot.toml", "control"), ("campaign.toml", "vary")):
            if tables[table]:
                click.echo(f"\n# {file}\n[{table}]\n{to_lines(tables[table])}", nl=False)
    return int(any(line.problem for line in found.lines))


@command.command()
@click.argument("runs", nargs=-1, required=True, type=CELL, metavar="RUN...")
@click.option("--certificate", required=True, type=CELL, help="Folder of skillframe certify run.")
@click.option("--trials", default=119, show_default=True, type=click.IntRange(39, 10_000), help="Simulated, twice.")
@click.option("--workers", default=1, show_default=True, type=click.IntRange(1, 256), help="Processes.")
@click.option("--out", type=CELL, help="Folder for the result, for skillframe report; absent or empty.")
@click.option("--json", "as_json", is_flag=True, help="What was found as JSON on stdout.")
def hold(
    runs: tuple[Path, ...], certificate: Path, trials: int, workers: int, out: Path | None, as_json: bool
) -> int:  # fmt: skip
    """Compare real RUNs (.npz) with simulated ones: was that what was certified, and if not, what differs?

    Simulates the certificate's box anew, and a wider one. Exit code 0 if each run is like the simulated ones, 1 if one
    is outside what was certified.

    \b
    Example:
      skillframe drive hold run.npz --certificate certified --out held
      skillframe report held --out held.html
    """
    from skillframe.cli import emit_json, note
    from skillframe_drive.hold import (
        compare,
        covering,
        read_box,
        read_runs,
        refuse_other,
        refuse_used,
        said,
        simulate_box,
        wider,
        write_folder,
    )  # fmt: skip

    box = read_box(certificate)
    traces = read_runs(runs, box)
    if out is not None:
        refuse_used(out)
    first = simulate_box(box, box.low, box.high, trials, box.spec.seed + 1, workers, note)
    for name, trace in traces.items():
        refuse_other(trace, first.traces[0], name)
    wide = simulate_box(box, *wider(box), trials, box.spec.seed + 2, workers, note)
    found = {name: (trace, compare(trace, box, first, wide)) for name, trace in traces.items()}
    if out is not None:
        write_folder(out, found, box, first)
    if as_json:
        emit_json([
            {"run": name, "outside": each.outside, "p": each.verdict.p, **each.verdict._asdict(),
             "estimates": [one._asdict() for one in each.estimates], "vary": covering(each)}
            for name, (_, each) in found.items()
        ])  # fmt: skip
    else:
        for name, (_, each) in found.items():
            place, *rest = said(each)
            click.echo(f"{name}: {place}")
            click.echo("".join(f"  {line}\n" for line in rest), nl=False)
        if out is not None:
            click.echo(f"to see it: skillframe report {out} --out {out}.html")
    return int(any(each.outside for _, each in found.values()))


def _confirm() -> None:
    """Ask for the typed word. Raises `SkillframeError` if another is typed."""
    from skillframe.errors import SkillframeError

    if click.prompt(f"The robot will move. Type {CONFIRMATION}", err=True) != CONFIRMATION:
        raise SkillframeError("not confirmed: the robot was not moved")


@command.command()
@click.argument("link")
@click.option("--world", required=True, help="World around the robot (skillframe worlds names them).")
@click.option("--robot", help="Simulated robot behind the protocol [the link's own].")
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="The truth: fixture.offset_x=8mm ...")
@click.option("--host", default="127.0.0.1", show_default=True, help="Loopback address to listen at.")
@click.option("--lockstep", is_flag=True, help="Wait for each command, so that the machine's speed does not matter.")
@click.option("--fault", "faults", multiple=True, metavar="NAME=VALUE", help="A fault: cut=0.5, sign=-1 ...")
@click.option("--noise", default=0.3, show_default=True, type=click.FloatRange(0.0), help="Of the force sensor [N].")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0), help="Seed of the sensor noise.")
@click.option("--once", is_flag=True, help="End when the client has gone.")
def fake(
    link: str, world: str, robot: str | None, settings: tuple[str, ...], host: str, lockstep: bool,
    faults: tuple[str, ...], noise: float, seed: int, once: bool,
) -> int:  # fmt: skip
    """Serve a fake robot: the maker's protocol, with a simulated arm behind it.

    It is for rehearsals and tests, and shares skillframe's physics, so that success on it proves nothing about reality.
    Prints the address, then events, and at the end whether the task was done.

    \b
    Example:
      skillframe drive fake ur --world valley --set fixture.offset_x=4mm --lockstep
    """
    from skillframe.config import parse_setting
    from skillframe.errors import InputError, UnknownName
    from skillframe.extend import registry
    from skillframe.robot import load_robot
    from skillframe.world import SensorSettings
    from skillframe_drive.fake import FAULTS, FakeArm
    from skillframe_drive.link import INTERFACES

    if not re.fullmatch(r"127(\.\d{1,3}){3}", host):
        raise InputError("--host", f"is {host}", "give a loopback address, 127.0.0.1 to 127.255.255.254")
    record = registry().record("link", link)
    if record.fake is None:
        raise InputError(f"link {link}", "has no fake robot", "rehearse with another link")
    planted = {}
    for name, value in (parse_setting(text) for text in faults):
        if name not in FAULTS:
            raise UnknownName("fault", name, FAULTS)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"--fault {name}", f"is {value!r}", f"give a number: {FAULTS[name]}")
        planted[name] = float(value)
    sensors = SensorSettings(force_noise=noise, torque_noise=noise / 15.0)
    interface = load_robot(robot or record.robot).control.interface
    if interface != INTERFACES[record.takes]:
        text = f"takes a joint {interface}, and {link} robots take a joint {INTERFACES[record.takes]}"
        raise InputError(f"--robot {robot}", text, f"leave it out: {record.robot}")
    arm = FakeArm(robot or record.robot, world, dict(parse_setting(text) for text in settings), seed, sensors)
    try:
        server = record.fake(arm, host, lockstep=lockstep, faults=planted, say=click.echo)
    except OSError as error:
        raise InputError(f"--host {host}", f"cannot be listened at ({error.strerror})", "end the other fake") from None
    click.echo(f"ready: {link} at {host}, {robot or record.robot} in {world}; Ctrl-C ends it")
    try:
        server.run(_gone(server) if once else lambda: False)
    except KeyboardInterrupt:
        pass
    finally:
        server.close()
    goal = arm.ground()
    done = "done" if goal.goal else f"not done, {1e3 * goal.error_m:.1f} mm and {goal.error_rad:.3f} rad from the goal"
    click.echo(f"the task is {done}; {server.commands} commands, {server.missing} periods without one")
    return 0


def _gone(server: Any) -> Any:
    """Whether the client had come, and has gone for 0.2 s."""
    seen: list[float] = []

    def gone() -> bool:
        if server.had_clients():
            seen[:] = [time.monotonic()]
        return bool(seen) and time.monotonic() - seen[0] > 0.2

    return gone
