"""The link to a Franka Research 3 through pylibfranka: its state at 1 kHz, and joint torques."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from skillframe_drive.link import SILENT_S, RobotState

from skillframe.errors import MissingDependency, SkillframeError
from skillframe.frames import Float

JOINTS = 7


class FrankaLink:
    """A connected robot: a `skillframe_drive.link.Link`.

    The robot compensates gravity and friction itself, and ends the motion after 20 missing commands. It has no sensor
    at the wrist: its wrench is estimated from joint torques, and its value at rest turns with the pose.
    """

    takes = "torque"
    period = 1e-3

    def __init__(self, host: str) -> None:
        try:
            import pylibfranka
        except ImportError:
            raise MissingDependency("pylibfranka", "a link to a Franka robot", "pip install pylibfranka") from None
        self._library: Any = pylibfranka
        try:
            self._robot = pylibfranka.Robot(host, pylibfranka.RealtimeConfig.kIgnore)
        except Exception as error:
            text = f"there is no Franka robot at {host} ({str(error).strip().splitlines()[0]})"
            raise SkillframeError(f"{text}; check the address, and that FCI is active") from None
        self._motion: Any = None
        self.fault, self.missed, self.longest = "", 0, 0.0
        self._last: float | None = None
        self._seen = RobotState(0.0, np.zeros(JOINTS), np.zeros(JOINTS), np.zeros(6))

    def read(self) -> RobotState:
        """Wait for the next state."""
        if self.fault:
            return self._seen
        asked = time.perf_counter()
        try:
            state = self._robot.read_once() if self._motion is None else self._motion.readOnce()[0]
        except Exception as error:
            self._fail(error)
            return self._seen
        if self._motion is not None and time.perf_counter() - asked > SILENT_S:
            self.fault = f"no state from the robot for {1e3 * SILENT_S:.0f} ms"
            return self._seen
        modes = self._library.RobotMode
        if self._motion is None and state.robot_mode in (modes.Reflex, modes.UserStopped):  # else readOnce fails
            self.fault = f"the robot is in the mode {state.robot_mode.name}: release its stops and errors in Desk"
            return self._seen
        now = state.time.to_sec()
        if self._last is not None:
            self.missed += max(0, round((now - self._last) / self.period) - 1)
            self.longest = max(self.longest, now - self._last)
        self._last = now
        self._seen = RobotState(now, np.array(state.q), np.array(state.dq), np.array(state.O_F_ext_hat_K))
        return self._seen

    def tare(self) -> None:
        """Nothing: the estimate of the wrench cannot be zeroed in the robot."""

    def arm(self) -> None:
        """Begin torque control."""
        if self.fault:
            return
        try:
            self._motion = self._robot.start_torque_control()
        except Exception as error:
            self._fail(error)
        self.missed, self.longest, self._last = 0, 0.0, None

    def send(self, command: Float) -> None:
        """Joint torques (7,) above gravity and Coriolis torques [N m]."""
        self._write(command, finished=False)

    def halt(self) -> None:
        """End torque control: the robot holds its position."""
        self._write(np.zeros(JOINTS), finished=True)
        self._motion = None

    def close(self) -> None:
        """End torque control if it still runs."""
        if self._motion is not None:
            self.halt()

    def _write(self, torque: Float, *, finished: bool) -> None:
        if self.fault or self._motion is None:
            return
        command = self._library.Torques(torque.tolist())
        command.motion_finished = finished
        try:
            self._motion.writeOnce(command)
        except Exception as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self.fault = self.fault or f"the robot: {str(error).strip().splitlines()[0]}"
