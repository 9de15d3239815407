"""The link to a Universal Robot through ur_rtde: its state at 500 Hz, and joint positions by servoJ."""

from __future__ import annotations

import time
from ctypes import py_object, pythonapi

import numpy as np
from skillframe_drive.link import SILENT_S, RobotState

from skillframe.errors import MissingDependency, SkillframeError
from skillframe.frames import Float

RATE_HZ = 500.0
LOOKAHEAD_S, GAIN = 0.03, 300.0
"""servoJ's smoothing: part of the delay that robot.toml declares, so that a certificate holds for these values only."""
STOPPED_BITS = ~0b11
"""Bits of `safety_status_bits` besides normal and reduced mode: protective, emergency and safeguard stops, faults."""
STOP_RAD_S2 = 10.0
FIELDS = ["timestamp", "actual_q", "actual_qd", "actual_TCP_force", "safety_status_bits"]


class UrLink:
    """A connected robot: a `skillframe_drive.link.Link`.

    The robot's TCP is left where it is set; `actual_TCP_force` is taken at the flange, so the TCP has to be zero.
    After a lost connection ur_rtde connects again in a thread of its own and blocks its callers, so that nothing of it
    is called after a fault.
    """

    takes = "position"
    period = 1.0 / RATE_HZ

    def __init__(self, host: str) -> None:
        try:
            from rtde_control import RTDEControlInterface
            from rtde_receive import RTDEReceiveInterface
        except ImportError:
            raise MissingDependency("ur_rtde", "a link to a Universal Robot", "pip install ur_rtde") from None
        try:
            self._state = RTDEReceiveInterface(host, RATE_HZ, FIELDS)
            self._control = RTDEControlInterface(host, RATE_HZ)
        except (RuntimeError, OSError) as error:
            text = f"there is no Universal Robot at {host} ({str(error).strip().splitlines()[0]})"
            raise SkillframeError(f"{text}; check the address, power, and remote control") from None
        self.fault, self.missed, self.longest = "", 0, 0.0
        self._last = -1.0
        self._seen = RobotState(0.0, np.zeros(6), np.zeros(6), np.zeros(6))

    def read(self) -> RobotState:
        """Wait for the next state."""
        if self.fault:
            return self._seen
        until = time.perf_counter() + SILENT_S
        while (now := self._state.getTimestamp()) == self._last:
            if time.perf_counter() > until:
                self.fault = f"no state from the robot for {1e3 * SILENT_S:.0f} ms"
                return self._seen
            time.sleep(5e-5)
        if self._last >= 0.0:
            self.missed += max(0, round((now - self._last) / self.period) - 1)
            self.longest = max(self.longest, now - self._last)
        self._last = now
        if (status := self._state.getSafetyStatusBits()) & STOPPED_BITS:
            self.fault = f"the robot is in a protective or emergency stop (safety status {status:#x})"
        state = self._state
        self._seen = RobotState(
            now, np.array(state.getActualQ()), np.array(state.getActualQd()), np.array(state.getActualTCPForce())
        )
        return self._seen

    def tare(self) -> None:
        """Zero the force sensor."""
        if not self.fault and not self._control.zeroFtSensor():
            self.fault = "the robot does not zero its force sensor"

    def arm(self) -> None:
        """Start the controller's watchdog."""
        if not self.fault:
            self._control.setWatchdog(20.0)  # Hz: the controller ends its program when it hears nothing for 50 ms
        self.missed, self.longest = 0, 0.0

    def send(self, command: Float) -> None:
        """Joint positions (6,) for the next 2 ms."""
        if not self.fault and not self._control.servoJ(command.tolist(), 0.0, 0.0, self.period, LOOKAHEAD_S, GAIN):
            self.fault = "the robot does not take commands, because its program has stopped"

    def halt(self) -> None:
        """Stop and hold."""
        if not self.fault:
            self._control.servoStop(STOP_RAD_S2)

    def close(self) -> None:
        """End the robot's program and the connection. After a fault the process has to end instead."""
        if not self.fault:
            self._control.stopScript()
            self._control.disconnect()
            self._state.disconnect()
        for client in (self._control, self._state):  # never destroyed: that waits a second more, or to connect again
            pythonapi.Py_IncRef(py_object(client))
