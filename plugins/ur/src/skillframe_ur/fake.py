"""A fake controller of a Universal Robot: RTDE (30004), dashboard (29999), scripts (30001 to 30003), a simulated arm.

One thread. Each 2 ms of its clock it reads the input registers that clients wrote, does one cycle of the program that
was sent to it, advances the arm by two steps of 1 ms, and sends a state to every client. A program is interpreted
(`skillframe_ur.urscript`), but for the one that ur_rtde uploads: its loop reads a command's number in
`input_int_register_0` and arguments in `input_double_register_0` ..., and answers in `output_int_register_0`: 1 ready
for a command, 2 done. Seen with ur_rtde 1.6.5.
"""

from __future__ import annotations

import select
import socket
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from skillframe_drive.fake import FakeArm, FakeController

from skillframe.frames import Float, rotation_vector
from skillframe_ur import rtde
from skillframe_ur.urscript import Program, ScriptError

PERIOD_S = 0.002
RTDE, DASHBOARD, SCRIPTS = 30004, 29999, (30001, 30002, 30003)
"""TCP ports of every controller of this maker."""
OF_RTDE = b"def rtde_control("
"""How the program begins that ur_rtde uploads."""
WAITS = {"sync", "servoj", "stopj"}
"""Functions that take a cycle of a program."""
VERSION = (5, 12, 0, 0)
PATIENCE_S = 3.0
"""In lockstep: longest real time to wait for a command."""
SERVO, MOVE_J, ZERO_FT, SERVO_STOP, WATCHDOG, PROTECTIVE, STOP = 11, 1, 8, 16, 35, 31, 255
REALTIME = {24, SERVO, 9, 10, 6, 25, 26, 27, 38}
"""Commands that are done in every round while they stand in the register."""
ACCEPTED = {17, 29}
"""Commands that change nothing here: payload and tool centre point."""
HOLD = {15, 33, 34}
"""Commands that hold the present position."""


class _Client:
    """A connection to the RTDE port."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setblocking(False)
        self.socket, self.received = connection, bytearray()
        self.inputs: dict[int, tuple[list[str], struct.Struct]] = {}
        self.outputs: list[str] = []
        self.shape, self.every = rtde.layout([]), 1
        self.started = self.wrote = False


class FakeUr(FakeController):
    """The controller. It listens at the maker's ports of a loopback address, `host`."""

    def __init__(
        self, arm: FakeArm, host: str, *, lockstep: bool = False, faults: Mapping[str, float] | None = None,
        say: Callable[[str], None] = print,
    ) -> None:  # fmt: skip
        super().__init__(arm, PERIOD_S, lockstep=lockstep, faults=faults, say=say)
        self._ints, self._doubles = np.zeros(48, dtype=np.int64), np.zeros(48)
        self._answer = 0
        self._program = self._busy = self._servoing = self.protective = False
        self._last_write = 0
        self._watchdog_hz = 0.0
        self._move: tuple[Float, Float, int, float] | None = None
        self._zero = np.zeros(6)
        self._clients: list[_Client] = []
        self._texts: dict[socket.socket, int] = {}
        self._script = b""
        self._cycles: Iterator[None] | None = None
        self._listening = {port: _listen(host, port) for port in (RTDE, DASHBOARD, *SCRIPTS)}

    @property
    def moving(self) -> bool:
        """Whether the client servoes."""
        return self._servoing

    def had_clients(self) -> bool:
        """Whether a client is connected, or a program runs by itself."""
        return bool(self._clients) or self._cycles is not None

    def close(self) -> None:
        """Close all ports."""
        for each in (*self._listening.values(), *(c.socket for c in self._clients), *self._texts):
            each.close()

    def cut(self) -> None:
        """Close all connections and listen no more."""
        self.close()
        self._clients.clear()
        self._texts.clear()
        self._listening.clear()

    def serve(self) -> None:
        """Answer all ports. While servoing count a period without a command, in lockstep wait for it."""
        self._accept()
        self._serve_texts()
        self._serve()
        if self.moving and self._cycles is None:
            self._await_command()
        for client in self._clients:
            client.wrote = False

    def _accept(self) -> None:
        for port, listening in self._listening.items():
            try:
                connection, _ = listening.accept()
            except OSError:
                continue
            if port == RTDE:
                self._clients.append(_Client(connection))
                continue
            if port == DASHBOARD:
                connection.sendall(b"Connected: Universal Robots Dashboard Server\n")
            connection.setblocking(False)
            self._texts[connection] = port

    def _serve_texts(self) -> None:
        for connection, port in list(self._texts.items()):
            data = _received(connection)
            if data == b"":
                del self._texts[connection]
                if self._script and port in SCRIPTS:
                    self.say(f"a text of {len(self._script)} bytes has no end of a program, and is dropped")
                    self._script = b""
            elif data is not None and port == DASHBOARD:
                answers = [self._dashboard(line) for line in data.decode().strip().splitlines()]
                connection.sendall("".join(f"{each}\n" for each in answers).encode())
            elif data is not None:
                self._script += data
                if self._script.rstrip().endswith(b"\nend"):
                    script, self._script = self._script, b""
                    self.load(script)

    def load(self, script: bytes) -> None:
        """Start a program, in place of the one that runs."""
        if self._program:
            self._halt("another program comes")
        self._cycles = None
        if not script.lstrip().startswith(OF_RTDE):
            robot: dict[str, Callable[..., Any]] = {
                "get_actual_joint_positions": lambda: self.arm.position.copy(),
                "get_actual_tcp_pose": lambda: tuple(map(float, self._pose())), "get_tcp_offset": lambda: (0.0,) * 6,
                "get_tcp_force": lambda: tuple(self.felt(self._zero).tolist()), "zero_ftsensor": self._zero_sensor,
                "sync": lambda: None, "servoj": self._servoj, "stopj": lambda a: self._stop_servo(),
                "textmsg": lambda first, second="": self.say(f"{first}{second}"), "popup": self._popup,
            }  # fmt: skip
            try:
                self._cycles = Program(script.decode(errors="replace"), robot, WAITS).run()
            except ScriptError as error:
                self.say(f"the program is refused, {error}")
                return
        self.say(f"a program of {len(script)} bytes starts")
        self._program, self._busy, self._answer = True, False, 1

    def _dashboard(self, line: str) -> str:
        if line.lower() == "stop":
            self._halt("the dashboard stops the program")
        if line.lower() == "unlock protective stop":
            self.protective = False
        state = "PLAYING" if self._program else "STOPPED"
        return {
            "polyscopeversion": "URSoftware 5.12.0.1101319 (Dec 10 2021)", "is in remote control": "true",
            "robotmode": "Robotmode: RUNNING", "get serial number": "20225500001", "get robot model": "UR5e",
            "version": "5.12.0", "programstate": f"{state} program",
            "safetystatus": f"Safetystatus: {'PROTECTIVE_STOP' if self.protective else 'NORMAL'}",
            "stop": "Stopped", "unlock protective stop": "Protective stop releasing",
        }.get(line.lower(), "ok")  # fmt: skip

    def _serve(self) -> None:
        for client in list(self._clients):
            data = _received(client.socket)
            if data == b"":
                self._clients.remove(client)
            elif data is not None:
                client.received += data
                for what, body in rtde.packets(client.received):
                    self._take(client, what, body)

    def _take(self, client: _Client, what: str, body: bytes) -> None:
        if what == "V":
            self._send(client, "V", b"\x01")
        elif what == "v":
            self._send(client, "v", struct.pack(">4I", *VERSION))
        elif what == "O":
            (rate,), client.outputs = struct.unpack(">d", body[:8]), _names(body[8:])
            client.every, client.shape = max(1, round(1.0 / (PERIOD_S * rate))), rtde.layout(client.outputs)
            self._send(client, "O", b"\x01" + ",".join(map(rtde.kind, client.outputs)).encode())
        elif what == "I":
            names, recipe = _names(body), len(client.inputs) + 1
            client.inputs[recipe] = names, rtde.layout(names)
            self._send(client, "I", bytes([recipe]) + ",".join(map(rtde.kind, names)).encode())
        elif what in "SP":
            client.started = what == "S"
            self._send(client, what, b"\x01")
        elif what == "U":
            names, shape = client.inputs[body[0]]
            for name, value in zip(names, shape.unpack(body[1:]), strict=True):
                if "int_register" in name:
                    self._ints[int(name.rpartition("_")[2])] = value
                elif "double_register" in name:
                    self._doubles[int(name.rpartition("_")[2])] = value
            client.wrote = client.wrote or bool(self._ints[0])  # ur_rtde also writes 0, which is no command
            self._last_write = self._cycle

    def _send(self, client: _Client, what: str, body: bytes) -> None:
        try:
            client.socket.sendall(rtde.packet(what, body))
        except OSError:
            if client in self._clients:
                self._clients.remove(client)

    def _await_command(self) -> None:
        """Count a period without a command. In lockstep wait for the command first."""
        until = time.perf_counter() + (PATIENCE_S if self.lockstep else 0.0)
        writers = [client for client in self._clients if client.inputs]
        while writers and not any(client.wrote for client in writers) and time.perf_counter() < until:
            select.select([client.socket for client in writers], [], [], 0.02)
            self._serve()
            writers = [client for client in self._clients if client.inputs]
        self.missing += not any(client.wrote for client in writers)

    def step(self) -> None:
        """Do a round of the program, and advance the arm."""
        if self._program and self._cycles is not None:
            try:
                next(self._cycles)
            except StopIteration:
                self._halt("the program has ended")
            except ScriptError as error:
                self._halt(f"the program fails, {error}")
        elif self._program:
            self._round()
        for _ in range(round(PERIOD_S / self.arm.dt)):
            self.arm.step()
        if not self.protective and self.arm.contact_n > 150.0:  # the robot's own limit
            self.protect(f"{self.arm.contact_n:.0f} N at the tool")

    def _popup(self, text: str, title: str = "Popup", **kind: bool) -> None:
        self.say(f"a window, {title}: {text}")

    def _round(self) -> None:
        """One round of the program's loop."""
        silent = (self._cycle - self._last_write) * PERIOD_S
        if self._watchdog_hz > 0.0 and silent > 1.0 / self._watchdog_hz:
            self._halt(f"the watchdog ends the program after {1e3 * silent:.0f} ms without a command")
            return
        command = int(self._ints[0])
        if command in REALTIME:
            self._do(command)
            self._answer = 1
        elif command == 0:
            self._busy, self._answer = False, 1
        elif command == STOP:
            self._halt("the client ends the program")
        elif not self._busy and self._do(command):
            self._busy, self._answer = True, 2

    def _do(self, command: int) -> bool:
        """Do a command. False if it goes on in the next period."""
        values = self._doubles
        if command == SERVO:
            self._servoj(values[:6])
        elif command == MOVE_J:
            return self._moved(values[:6].copy(), float(values[6]), float(values[7]))
        elif command == ZERO_FT:
            self._zero_sensor()
        elif command in HOLD or command == SERVO_STOP:
            self._stop_servo()
        elif command == WATCHDOG:
            self._watchdog_hz = float(values[0])
        elif command == PROTECTIVE:
            self.protect("the client asks for it")
        elif command not in ACCEPTED:
            self.say(f"command {command} is not emulated")
        return True

    def _servoj(self, joints: Float, *_: float) -> None:
        """Take joint positions (6,) for this period. Acceleration, speed, time, lookahead and gain change nothing."""
        target = joints[None].copy()
        fast = np.abs(target - self.arm.target).max() / PERIOD_S
        if fast > 3.2:
            self.protect(f"a joint is sent {fast:.1f} rad/s")
            return
        self.taken()
        self.arm.target, self._servoing = target, True

    def _zero_sensor(self) -> None:
        self._zero = self.loaded()

    def _stop_servo(self) -> None:
        self._servoing = False
        self.arm.hold()

    def _pose(self) -> list[float]:
        """Pose (6,) of the flange: position and rotation vector."""
        pose = self.arm.pose
        return [*pose.position[0], *rotation_vector(pose.rotation)[0]]

    def _moved(self, goal: Float, speed: float, acceleration: float) -> bool:
        """Whether a blocking joint motion to `goal` (6,) with a cubic time law is over."""
        if self._move is None:
            way = float(np.abs(goal - self.arm.target[0]).max())
            lasts = max(1.5 * way / speed, (6.0 * way / acceleration) ** 0.5, PERIOD_S)
            self._move = self.arm.target[0].copy(), goal, self._cycle, lasts
        start, goal, begun, lasts = self._move
        share = min(1.0, (self._cycle - begun) * PERIOD_S / lasts)
        self.arm.target = (start + share * share * (3.0 - 2.0 * share) * (goal - start))[None]
        if share < 1.0:
            return False
        self._move = None
        return True

    def _halt(self, why: str) -> None:
        self.say(why)
        self._program = self._servoing = False
        self._cycles = None
        self._watchdog_hz, self._move, self._answer = 0.0, None, 0
        self.arm.hold()

    def protect(self, why: str) -> None:
        """Go into a protective stop."""
        self.protective = True
        self._halt(f"protective stop: {why}")

    def publish(self) -> None:
        """Send the state to every client."""
        values = self._values()
        for client in list(self._clients):
            if client.started and self._cycle % client.every == 0:
                self._send(client, "U", b"\x01" + rtde.packed(client.outputs, client.shape, values))

    def _values(self) -> dict[str, Any]:
        arm = self.arm
        return {
            "timestamp": self.time, "actual_q": arm.position, "actual_qd": arm.velocity, "target_q": arm.target[0],
            "actual_TCP_force": self.felt(self._zero), "ft_raw_wrench": arm.wrench, "actual_TCP_speed": arm.twist,
            "actual_TCP_pose": self._pose(),
            "robot_mode": 7, "safety_mode": 3 if self.protective else 1, "runtime_state": 2 if self._program else 1,
            "robot_status_bits": 1 | (2 if self._program else 0), "joint_mode": [253] * 6,
            "safety_status_bits": 4 | 1024 if self.protective else 1,
            "speed_scaling": 1.0, "target_speed_fraction": 1.0, "output_int_register_0": self._answer,
        }  # fmt: skip


def _listen(host: str, port: int) -> socket.socket:
    listening = socket.socket()
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listening.bind((host, port))
    listening.listen(8)
    listening.setblocking(False)
    return listening


def _received(connection: socket.socket) -> bytes | None:
    """What a connection sent: None for nothing yet, b"" at its end."""
    try:
        return connection.recv(1 << 20)
    except BlockingIOError:
        return None
    except OSError:
        return b""


def _names(body: bytes) -> list[str]:
    return [name for name in body.decode().split(",") if name]
