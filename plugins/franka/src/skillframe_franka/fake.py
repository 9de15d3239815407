"""A fake controller of a Franka Research 3: libfranka's protocol, version 10, over a simulated arm.

One thread. Each millisecond of its clock it answers requests (TCP 1337), takes the newest command (UDP), advances the
arm by a step, and sends the state (UDP). The layouts are those of libfranka-common d96c221, little-endian and packed.
"""

from __future__ import annotations

import re
import select
import socket
import struct
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from skillframe_drive.fake import FakeArm, FakeController

VERSION, JOINTS = 10, 7
PERIOD_S = 1e-3
MOST_MISSED = 20
"""Commands that may be missing in a row."""
PATIENCE_S = 3.0
"""In lockstep: longest real time to wait for a command."""
CONNECT, MOVE, STOP, MODEL = 0, 1, 2, 11
STARTED, DONE, PREEMPTED, REFLEX = 1, 0, 2, 8
"""Answers to `MOVE`: when it begins, and when it ends."""
IDLE_MODE, MOVE_MODE, REFLEX_MODE = 1, 2, 4
EXTERNAL, NO_CONTROLLER, TORQUE_MOTION, NO_MOTION = 2, 3, 5, 0
HOLD = 1e4, 200.0
"""Stiffness [1/s^2] and damping [1/s] per inertia that hold joints without a motion: a hand moves them by 1 mm."""
FLOATS = (
    ("O_T_EE", 16), ("O_T_EE_d", 16), ("F_T_EE", 16), ("EE_T_K", 16), ("F_T_NE", 16), ("NE_T_EE", 16), ("m_ee", 1),
    ("I_ee", 9), ("F_x_Cee", 3), ("m_load", 1), ("I_load", 9), ("F_x_Cload", 3), ("elbow", 2), ("elbow_d", 2),
    ("tau_J", 7), ("tau_J_d", 7), ("dtau_J", 7), ("q", 7), ("q_d", 7), ("dq", 7), ("dq_d", 7), ("ddq_d", 7),
    ("joint_contact", 7), ("cartesian_contact", 6), ("joint_collision", 7), ("cartesian_collision", 6),
    ("tau_ext_hat_filtered", 7), ("O_F_ext_hat_K", 6), ("K_F_ext_hat_K", 6), ("O_dP_EE_d", 6), ("O_ddP_O", 3),
    ("elbow_c", 2), ("delbow_c", 2), ("ddelbow_c", 2), ("O_T_EE_c", 16), ("O_dP_EE_c", 6), ("O_ddP_EE_c", 6),
    ("theta", 7), ("dtheta", 7), ("accelerometers", 36),
)  # fmt: skip
BRAKING = (6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0)
"""Deceleration limits of the joints [rad/s^2] that libfranka wants in the URDF; torque control does not use them."""
STATE = np.dtype([
    ("message_id", "<u8"), *((name, "<f4", (count,)) for name, count in FLOATS), ("motion", "u1"), ("controller", "u1"),
    ("errors", "u1", (41,)), ("reflex", "u1", (41,)), ("mode", "u1"), ("success_rate", "<f4"),
])  # fmt: skip
COMMAND = np.dtype([
    ("message_id", "<u8"), ("q_c", "<f8", (7,)), ("dq_c", "<f8", (7,)), ("O_T_EE_c", "<f8", (16,)),
    ("O_dP_EE_c", "<f8", (6,)), ("elbow_c", "<f8", (2,)), ("valid_elbow", "u1"), ("motion_finished", "u1"),
    ("torque", "<f8", (7,)), ("finished", "u1"),
])  # fmt: skip


class FakeFranka(FakeController):
    """The controller. It listens at the maker's port of a loopback address, `host`."""

    def __init__(
        self, arm: FakeArm, host: str, *, lockstep: bool = False, faults: Mapping[str, float] | None = None,
        say: Callable[[str], None] = print,
    ) -> None:  # fmt: skip
        super().__init__(arm, PERIOD_S, lockstep=lockstep, faults=faults, say=say)
        self._listening = socket.socket()
        self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._listening.bind((host, 1337))
        self._listening.listen(1)
        self._listening.setblocking(False)
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind((host, 0))
        self._udp.setblocking(False)
        self._client: socket.socket | None = None
        self._received, self._states_to = bytearray(), ("", 0)
        self._move: int | None = None  # number of the request of the motion that runs
        self._torque, self._hold = np.zeros(JOINTS), arm.position.copy()
        self._row = 0
        self._mode = IDLE_MODE

    @property
    def moving(self) -> bool:
        """Whether torque control runs."""
        return self._move is not None

    def had_clients(self) -> bool:
        """Whether a client is connected."""
        return self._client is not None

    def close(self) -> None:
        """Close all ports."""
        for each in (self._listening, self._udp, *([] if self._client is None else [self._client])):
            each.close()

    def cut(self) -> None:
        """Close all connections and listen no more."""
        self.close()
        self._client, self._states_to, self._move = None, ("", 0), None

    def protect(self, why: str) -> None:
        """End the motion by a reflex."""
        if self._move is not None:
            self._end(REFLEX, REFLEX_MODE, f"reflex: {why}")
        self._mode = REFLEX_MODE

    def serve(self) -> None:
        """Answer requests, and take a command while torque control runs."""
        self._serve()
        if self._move is not None:
            self._take_command()

    def _serve(self) -> None:
        if self._client is None:
            try:
                self._client, _ = self._listening.accept()
            except OSError:
                return
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client.setblocking(False)
            self._received.clear()
        try:
            data = self._client.recv(1 << 16)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            if self._move is not None:
                self.say("the connection is lost, and the motion ends")
            self._client, self._move, self._mode, self._states_to = None, None, IDLE_MODE, ("", 0)
            return
        self._received += data
        while len(self._received) >= 12:
            what, number, size = struct.unpack_from("<III", self._received)
            if len(self._received) < size:
                return
            body = bytes(self._received[12:size])
            del self._received[:size]
            self._answer(what, number, body)

    def _answer(self, what: int, number: int, body: bytes) -> None:
        if what == CONNECT:
            version, port = struct.unpack_from("<HH", body)
            assert self._client is not None
            self._states_to = (self._client.getpeername()[0], port)
            self._reply(what, number, struct.pack("<BH", int(version != VERSION), VERSION))
        elif what == MODEL:
            self._reply(what, number, b"\x00" + _described(self.arm.urdf).encode())
        elif what == MOVE:
            self._move, self._mode, self._row = number, MOVE_MODE, 0
            self.say("torque control begins")
            self._reply(what, number, bytes([STARTED]))
        elif what == STOP:
            if self._move is not None:
                self._end(PREEMPTED, IDLE_MODE, "the client stops the motion")
            self._reply(what, number, b"\x00")
        else:
            self._reply(what, number, b"\x00")

    def _reply(self, what: int, number: int, body: bytes) -> None:
        if self._client is not None:
            try:
                self._client.sendall(struct.pack("<III", what, number, 12 + len(body)) + body)
            except OSError:
                self._client = None

    def _take_command(self) -> None:
        """Take the newest command, in lockstep wait for it. Without one repeat the last, and give up after 20."""
        until = time.perf_counter() + (PATIENCE_S if self.lockstep and self.commands else 0.0)
        command: Any = None
        while command is None:
            try:
                command = np.frombuffer(self._udp.recv(1024), COMMAND)[0]
            except BlockingIOError:
                if time.perf_counter() >= until:
                    break
                select.select([self._udp], [], [], 0.02)
        if command is not None:
            self.taken()
            self._row, self._torque = 0, command["torque"].copy()
            if command["finished"]:
                self._end(DONE, IDLE_MODE, "the client ends torque control")
        elif self.commands:
            self.missing, self._row = self.missing + 1, self._row + 1
            if self._row > MOST_MISSED:
                self._end(REFLEX, REFLEX_MODE, f"reflex: {self._row} commands in a row are missing")

    def _end(self, answer: int, mode: int, why: str) -> None:
        self.say(why)
        assert self._move is not None
        self._reply(MOVE, self._move, bytes([answer]))
        self._move, self._mode = None, mode
        self._torque[:] = 0.0

    def step(self) -> None:
        """Advance the arm under the last torques, or hold it."""
        if self._move is None:
            self.arm.step(self.arm.holding(self._hold, *HOLD))
        else:
            self._hold = self.arm.position.copy()
            self.arm.step(self._torque)

    def publish(self) -> None:
        """Send the state to the client."""
        if not self._states_to[1]:
            return
        state = np.zeros((), STATE)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.arm.pose.rotation[0], self.arm.pose.position[0]
        moving = self._move is not None
        state["message_id"], state["O_T_EE"], state["m_ee"] = self._cycle, pose.T.ravel(), 0.73
        state["q"], state["dq"], state["tau_J_d"] = self.arm.position, self.arm.velocity, self._torque
        state["O_F_ext_hat_K"] = self.felt(np.zeros(6))
        state["mode"], state["success_rate"] = self._mode, 1.0
        state["motion"] = TORQUE_MOTION if moving else NO_MOTION
        state["controller"] = EXTERNAL if moving else NO_CONTROLLER
        try:
            self._udp.sendto(state.tobytes(), self._states_to)
        except OSError:
            self._states_to = ("", 0)


def _described(urdf: str) -> str:
    """The URDF with the element that libfranka requires in each joint."""
    for number, braking in enumerate(BRAKING, start=1):
        element = f'<position_based_velocity_limits velocity_offset="0" deceleration_limit="{braking}"/>'
        urdf = re.sub(rf'(<joint name="joint{number}"[^>]*>)', rf"\1{element}", urdf)
    return urdf
