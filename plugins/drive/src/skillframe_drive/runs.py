"""One run of a skill on a real robot: checks, confirmation, the run, and who says that it succeeded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from skillframe import LearnedSkill, SingleRun
from skillframe.campaign import combined_hash
from skillframe.errors import InputError, SkillframeError
from skillframe.execution import (
    SIMULATED,
    PacedSkill,
    force_source,
    load_robot_model,
    load_world,
    prepare,
    simulate,
    split_settings,
)
from skillframe.extend import registry
from skillframe.frames import Float, norm
from skillframe.robot import RobotModel
from skillframe.skill import Command, Observation, Skill
from skillframe.world import Scene, start_configurations
from skillframe_drive.cell import Cell
from skillframe_drive.link import INTERFACES, Link, RobotState
from skillframe_drive.real import drive_type


@dataclass(frozen=True, slots=True)
class Line:
    """A check's result: what was measured, and why the robot may not move ("" if it may)."""

    text: str
    problem: str = ""


@dataclass(frozen=True, slots=True)
class Task:
    """A cell, loaded: the robot's model, the scene, and where its fixture is believed to be."""

    cell: Cell
    robot: RobotModel
    scene: Scene
    believed: dict[str, Float]

    @property
    def start(self) -> Float:
        """(n,) joint positions of the start [rad]."""
        result: Float = start_configurations(self.robot, self.scene, {}, 1)[0]
        return result


def load_task(cell: Cell) -> Task:
    """Load what a cell names.

    Raises:
        SkillframeError: unknown robot, world, link or quantity, or a robot whose interface is not the link's.
    """
    takes, robot = registry().record("link", cell.link).takes, load_robot_model(cell.robot)
    if (interface := robot.spec.control.interface) != INTERFACES[takes]:
        text = f"takes a joint {INTERFACES[takes]}, and {cell.robot} is declared with the interface {interface!r}"
        raise InputError(f"link {cell.link}", text, f'name a robot with interface = "{INTERFACES[takes]}"')
    params, believed = split_settings(cell.world, cell.believed)
    if other := sorted(key for key in believed if not key.startswith("fixture.")):
        raise InputError(f"believed.{other[0]}", "is no place of the fixture", "give fixture.offset_x ... alone")
    return Task(cell, robot, load_world(cell.world, params), {k: np.array([v]) for k, v in believed.items()})


def open_link(cell: Cell) -> Link:
    """Connect to the robot. Raises `SkillframeError`, and `UnknownName` for a link that is not installed."""
    link: Link = registry().record("link", cell.link).open(cell.host)
    return link


def check(task: Task, link: Link, *, anywhere: bool = False) -> list[Line]:
    """Measure a robot at rest, without moving it: clock, rest, start, and noise of the force sensor.

    Args:
        task: the cell.
        link: to the robot.
        anywhere: the robot need not be at its start.
    """
    states: list[RobotState] = [link.read()]
    while not link.fault and states[-1].time - states[0].time < 0.4:
        states.append(link.read())
    if link.fault:
        return [Line("the robot is connected", link.fault)]
    rate = (len(states) - 1 + link.missed) / (states[-1].time - states[0].time)
    lines = [Line(f"{rate:.0f} states a second")]
    if abs(rate * link.period - 1.0) > 0.02:  # of the link's rate
        lines[0] = Line(lines[0].text, f"the link expects {1.0 / link.period:.0f}")
    speed = float(np.abs([each.velocity for each in states]).max())
    lines.append(Line(f"at rest, joints below {speed:.3f} rad/s", "" if speed < 0.01 else "the robot moves"))
    away = np.abs(states[-1].position - task.start)
    there = anywhere or away.max() < 0.05
    far = f"joint {np.argmax(away) + 1} is {away.max():.3f} rad from the start of {task.cell.world}"
    lines.append(Line(far, "" if there else "move the robot to its start first: robot.toml's [home]"))
    wrenches = np.array([each.wrench for each in states])
    noise, force = wrenches.std(axis=0)[:3].max(), float(norm(wrenches.mean(axis=0)[None, :3])[0])
    lines.append(Line(f"force sensor reads {force:.1f} N, with a noise of {noise:.2f} N"))
    return lines


def run_once(
    skill: LearnedSkill, task: Task, link: Link, *, coc: str | None, slow: float, dry: bool, duration_s: float,
    rate_hz: float, done: Callable[[], bool] | None,
) -> SingleRun:  # fmt: skip
    """Run a skill on the robot.

    Args:
        skill: the skill.
        task: the cell.
        link: to the robot.
        coc: centre of compliance, as `skillframe.run`.
        slow: share of the skill's speed, 0 to 1.
        dry: read and compute, but send nothing.
        duration_s: longest run [s].
        rate_hz: of the trace.
        done: asks the person whether the task is done; None if the pose decides.

    Raises:
        SkillframeError: the skill cannot run on this robot.
    """
    runnable, setup = prepare(task.robot, task.scene, skill.document, coc)
    spec = setup.robot.spec
    lowest = min(each for each in (task.cell.force_n, spec.limits.force_n) if each is not None)
    robot = replace(setup.robot, spec=replace(spec, limits=replace(spec.limits, force_n=lowest)))
    setup = replace(setup, robot=robot, drive=drive_type(link, task.believed, dry=dry))
    slowed: Skill = runnable if slow == 1.0 else Slowed(runnable, 1, 1.0 / slow)
    result = simulate(slowed, setup, {}, [np.random.default_rng()], duration_s=duration_s / slow, trace_hz=rate_hz)
    assert result.traces is not None
    trace = result.traces[0]
    trace.meta.update({
        "skill": skill.name, "source": "real", "link": task.cell.link, "missed": link.missed, "dry": dry,
        "witness": task.cell.witness, "slow": slow, "skill_sha256": combined_hash(skill.document),
    })  # fmt: skip
    trace.meta["notes"] = [*trace.meta.get("notes", []), "a run on a robot: forces are its sensor's"]
    for key in ("failure", "reason"):
        trace.meta[key] = trace.meta[key].replace(SIMULATED, force_source(trace.meta))
    if done is not None and not dry:
        meta, said = trace.meta, done()  # the person decides, unless a limit was broken or the link failed
        broken = meta["ended_by"] not in ("skill", "time", "goal")
        meta["goal_reached"] = said
        meta["success"] = said and not broken and meta["status"] != "FAILURE"
        meta["failure"] = "" if meta["success"] else (meta["failure"] or "the person says that it is not done")
    return SingleRun(trace=trace, interrupted=result.interrupted)


class Slowed(PacedSkill):
    """A skill on a slower clock, whose commands hold for that clock."""

    def step(self, observation: Observation) -> Command:
        """The command, with its speed divided by the pace."""
        command = super().step(observation)
        return command._replace(twist=command.twist / self._pace)


def refuse_problems(lines: list[Line]) -> None:
    """Raise `SkillframeError` if a check has found a problem."""
    for line in lines:
        if line.problem:
            raise SkillframeError(f"the robot may not move: {line.text}: {line.problem}")
