"""One series of joints and wrenches, seen by `skillframe drive run` and by an exported program."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from skillframe_drive.cell import Cell
from skillframe_drive.link import RobotState
from skillframe_drive.runs import load_task, run_once
from skillframe_lmc.phase import speed
from skillframe_ur.urscript import Program

from skillframe import LearnedSkill
from skillframe.frames import Float, rotation_vector
from skillframe.robot.kinematics import RobotState as Kinematics
from skillframe.robot.model import load_model
from skillframe.robot.spec import load_robot

H = 0.002
RESTS = 100  # cycles in which the force sensor is zeroed
MODEL = load_model(load_robot("ur5e"))


class Replayed(NamedTuple):
    """Joint positions (T, 6) that were sent, and whether and why it ended."""

    sent: Float
    success: bool
    reason: str


class ReplayLink:
    """A link to a robot that does not care: its states are those of a series, joints and wrench (T, 12)."""

    takes, period, fault, missed, longest = "position", H, "", 0, 0.0

    def __init__(self, series: Float) -> None:
        self.series, self.sent, self._reads = series, [], 0

    def read(self) -> RobotState:
        k = max(0, self._reads - 2)  # two states are read before those of the tare
        row = self.series[min(k, len(self.series) - 1)]
        self._reads += 1
        return RobotState(H * self._reads, row[:6].copy(), np.zeros(6), row[6:].copy())

    def send(self, command: Float) -> None:
        self.sent.append(command.copy())

    def tare(self) -> None: ...

    def arm(self) -> None: ...

    def halt(self) -> None: ...

    def close(self) -> None: ...


def by_drive(skill: LearnedSkill, series: Float, robot: str = "ur5e") -> Replayed:
    """What `skillframe drive run` sends."""
    link = ReplayLink(series)
    cell = Cell(robot=robot, link="ur", host="", world="valley", force_n=80.0)
    duration_s = (len(series) - RESTS) * H / MODEL.spec.control.pace(speed(skill.document))
    done = run_once(
        skill, load_task(cell), link, coc=None, slow=1.0, dry=False, duration_s=duration_s, rate_hz=100.0,
        done=lambda: True,
    )  # fmt: skip
    return Replayed(np.array(link.sent), done.trace.meta["status"] == "SUCCESS", done.reason)


def by_program(text: str, series: Float) -> Replayed:
    """What the program sends, on the same series."""
    sent: list[Float] = []
    said: list[str] = []
    at = [0]

    def row() -> Float:
        return series[min(at[0], len(series) - 1)]

    def pose() -> tuple[float, ...]:
        found = Kinematics(MODEL.model, row()[:6], np.zeros(6)).pose(MODEL.tool_frames[0])
        return (*found.position.tolist(), *rotation_vector(found.rotation).tolist())

    def servoj(q: Float, *others: float) -> None:
        assert others == (0, 0, H, 0.03, 300)
        sent.append(q.copy())

    robot = {
        "get_actual_joint_positions": lambda: row()[:6].copy(), "get_tcp_force": lambda: tuple(row()[6:].tolist()),
        "get_actual_tcp_pose": pose, "get_tcp_offset": lambda: (0.0,) * 6, "zero_ftsensor": lambda: None,
        "sync": lambda: None, "servoj": servoj, "stopj": lambda a: None,
        "textmsg": lambda a, b="": said.append(f"{a}{b}"), "popup": lambda *words, **more: None,
    }  # fmt: skip
    for cycle, _ in enumerate(Program(text, robot, {"sync", "servoj", "stopj"}).run()):
        at[0] = cycle  # the first cycle passes after the zero, and the first sample is seen once more
        if cycle >= len(series):
            return Replayed(np.array(sent[: len(series) - RESTS]), False, "under way")
    return Replayed(np.array(sent), said[0].startswith("skillframe: success"), said[0])
