"""Sign and frame of the measured wrench, found by three presses of an operator's hand on the tool's tip.

A force f on the tip has the torque r x f at the tool frame's origin, r from there to the tip. The forces are pressed
along base -z, x and y: two of them would leave a turned base and a wrong sign in the tool's axes alike. A reading that
fits them neither as it is nor in one of the frames below is refused as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from skillframe.frames import Float
from skillframe.robot import tool_pose
from skillframe_drive.link import Link, RobotState
from skillframe_drive.runs import Line, Task

PRESSES = {
    "Press the tool's tip straight down, with about 20 N, and hold": np.array([0.0, 0.0, -1.0]),
    "Let go. Then press the tip along the base's x axis, towards larger x, and hold": np.array([1.0, 0.0, 0.0]),
    "Let go. Then press the tip along the base's y axis, towards larger y, and hold": np.array([0.0, 1.0, 0.0]),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What counts as a press.

    Attributes:
        least_n: force of a press [N], twice the error that makers state for wrist sensors.
        let_go_n: largest force of a tool that is let go [N].
        held_s: time for which a press has to last, and over which it is averaged [s].
        wait_s: longest time to wait for a press [s].
        within_rad: largest angle between a press and its axis [rad], below 45 degrees, so that no press fits two axes.
        lever_m: largest distance of the torque's origin from where it should be [m], a hand's width.
    """

    least_n: float = 8.0
    let_go_n: float = 4.0
    held_s: float = 0.3
    wait_s: float = 30.0
    within_rad: float = 0.61
    lever_m: float = 0.05


BOUNDS = Bounds()


def check_wrench(task: Task, link: Link, say: Callable[[str], None]) -> Line:
    """Ask for three presses, and compare what the sensor reads with them. Nothing is sent to the robot.

    Args:
        task: the cell.
        link: to the robot, at rest in free air.
        say: prints what the operator has to do.
    """
    rest = _held(link, np.zeros(6), lambda force: True)
    if rest is None:
        return Line("the wrench, at rest", link.fault or "no state")
    read: list[Float] = []
    for text in PRESSES:
        say(text)
        pressed = _held(link, rest, lambda force: force > BOUNDS.least_n)
        if pressed is None:
            return Line(
                "the wrench, pressed by hand",
                link.fault or f"no press above {BOUNDS.least_n:g} N in {BOUNDS.wait_s:g} s",
            )
        read.append(pressed)
        if _held(link, rest, lambda force: force < BOUNDS.let_go_n) is None:
            return Line("the wrench, let go", link.fault or f"still above {BOUNDS.let_go_n:g} N: let the tool go")
    state = link.read()
    rotation = tool_pose(task.robot.model, state.position, task.robot.tool_frames[0]).rotation.reshape(3, 3)
    lever = rotation @ np.array(task.scene.tool.frames["tip"])
    return Line("the wrench, pressed by hand", judged(np.array(read), rotation, lever))


def judged(read: Float, rotation: Float, lever: Float) -> str:
    """What is wrong with the wrenches (3, 6) that were read during the presses, or "".

    Args:
        read: force [N] and torque [N m], in base axes if all is right.
        rotation: (3, 3) of the tool in base.
        lever: (3,) from the tool frame's origin to the tip, base axes [m].
    """
    turned = np.diag([-1.0, -1.0, 1.0])
    frames = {
        "": np.eye(3),
        "its sign is wrong: it is the tool's wrench on the environment": -np.eye(3),
        "it is given in the tool's axes and not in the base's": rotation,
        "it is given in the tool's axes, with the wrong sign": -rotation,
        "its base is turned by 180 degrees about z (ROS's base_link and UR's base differ so)": turned,
    }
    wanted = np.array(list(PRESSES.values()))
    for name, matrix in frames.items():
        force = read[:, :3] @ matrix.T
        cosine = np.sum(force * wanted, axis=1) / np.linalg.norm(force, axis=1)
        if (cosine > np.cos(BOUNDS.within_rad)).all():
            return name or _origin(read[1], lever)
    directions = " and ".join(str(np.round(each[:3] / np.linalg.norm(each[:3]), 2).tolist()) for each in read)
    return f"forces along base -z, x and y were read along {directions}: press along the axes, or set the frame right"


def _origin(wrench: Float, lever: Float) -> str:
    """What is wrong with the origin of the torque, by the press across the tool's axis."""
    force, torque = wrench[:3], wrench[3:]
    most = BOUNDS.lever_m * float(np.linalg.norm(force))
    off = float(np.linalg.norm(torque - np.cross(lever, force)))
    if off <= most:
        return ""
    if float(np.linalg.norm(torque)) <= most:
        return "its torque is taken at the tool's tip: set the robot's tool centre point to the flange"
    if float(np.linalg.norm(torque + np.cross(lever, force))) <= most:
        return "the sign of its torque is wrong"
    return f"its torque is {off:.2f} N m from that of a force at the tip: press the tip itself, or set the frame right"


def _held(link: Link, rest: Float, wanted: Callable[[float], bool]) -> Float | None:
    """Mean wrench (6,) less `rest` over the first `held_s` in which the force was as wanted, or None."""
    states: list[RobotState] = []
    first = link.read()
    while not link.fault and (state := link.read()).time - first.time < BOUNDS.wait_s:
        states.append(state)
        if not wanted(float(np.linalg.norm((state.wrench - rest)[:3]))):
            states.clear()
        elif state.time - states[0].time >= BOUNDS.held_s:
            mean: Float = np.mean([each.wrench for each in states], axis=0) - rest
            return mean
    return None
