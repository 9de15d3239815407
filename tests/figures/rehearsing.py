"""A fake robot in a process of its own, in lockstep, with a fault that is planted at a time: for `rehearsed`."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np
from skillframe_drive.fake import FakeArm

from skillframe.world.quantities import SensorSettings

FAKES = {"ur": ("skillframe_ur.fake", "FakeUr", "ur5e"), "franka": ("skillframe_franka.fake", "FakeFranka", "fr3"),
         "ros2": ("skillframe_ros2.fake", "FakeCrisp", "fr3")}  # fmt: skip
"""Module, class and robot of each link's fake."""
NOISE = SensorSettings()
FORK = multiprocessing.get_context("fork")
REST_RAD_S = 0.02
"""Speed of the joints that counts as rest."""
SENSOR: dict[str, tuple[float, float]] = {"drift": (1.0, 15.0), "payload": (0.1, 1.5), "sign": (-1.0, -1.0),
          "tool_axes": (1.0, 1.0), "at_tip": (1.0, 1.0), "noise": (1.0, 5.0), "press": (10.0, 60.0)}  # fmt: skip
"""Faults of the wrench and a hand at the tool, and the range of their values."""
SIGNALS = {"killed": signal.SIGKILL, "hung": signal.SIGSTOP, "interrupted": signal.SIGINT, "terminated": signal.SIGTERM}
LENGTHS = {"stall": (0.15, 0.4), "hung": (0.03, 0.5), "lost_states": (0.002, 0.12), "lost_commands": (0.002, 0.06)}
"""Range of how long a fault lasts [s]."""


class Plan:
    """A fault: none of the kind "" ; else its value, when it comes and how long it lasts [s].

    Attributes:
        early: the time counts from the client's coming, and not from the first command.
        pid: of the runner, once it has started.
    """

    def __init__(self, kind: str = "", value: float = 0.0, at: float = 0.0, lasts: float = 0.0, early: bool = False):
        self.kind, self.value, self.at, self.lasts, self.early = kind, value, at, lasts, early
        self.pid = FORK.Value("i", 0)

    def signal(self, number: int) -> None:
        """Send a signal to the runner, if it is still there."""
        if self.pid.value:
            with suppress(ProcessLookupError):
                os.kill(self.pid.value, number)


def planted(link: str, plan: Plan, seed: int) -> type:
    """The fake's class, with what its own faults lack: noise from a time on, and states or commands that are lost."""
    module, name, _ = FAKES[link]
    base, rng = getattr(import_module(module), name), np.random.default_rng(seed)

    class Planted(base):
        waits, noisy, dropping, deaf, unanswered = True, False, False, False, False

        def publish(self) -> None:
            self.unanswered = self.dropping
            if not self.dropping:
                super().publish()

        def serve(self) -> None:
            self.lockstep = self.waits and not self.unanswered and not self.deaf
            while self.deaf:
                try:
                    self._udp.recv(1024)
                except BlockingIOError:
                    break
            super().serve()

        def loaded(self) -> Any:
            return super().loaded() + self.noisy * plan.value * rng.normal(size=6) * ([1.0] * 3 + [1.0 / 15.0] * 3)

    return Planted


def serve(link: str, world: str, truth: Mapping[str, float], seed: int, pipe: Any, plan: Plan) -> None:
    """A fake robot with a planted fault, until the parent says that the runner has gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    arm, said = FakeArm(FAKES[link][2], world, truth, seed, NOISE), []
    server = planted(link, plan, seed)(arm, host_of(os.getppid()), lockstep=True, say=said.append,
                                        faults={"press": 20.0} if plan.early and plan.at == 0.0 else {})  # fmt: skip
    found: dict[str, Any] = {"fired": None, "moving_then": False, "halted_s": 0.0, "rest_s": 0.0}
    hand = np.random.default_rng(seed).normal(size=3)
    came = over = gone = None

    def until() -> bool:
        nonlocal came, over, gone
        now = server.time
        if came is None and server.had_clients():
            came = now
        begins = (came if plan.early else server.first) if came is not None else None
        if plan.kind and found["fired"] is None and begins is not None and now - begins >= plan.at:
            found.update(fired=now, early=not server.commands, moving_then=bool(server.moving))
            over = strike(server, plan, hand, now)
        if over is not None and now >= over:
            relent(server, plan)
            over = None
        if found["fired"] is not None:
            if server.moving:
                found["halted_s"] = now - found["fired"] + server.period
            if np.abs(arm.velocity).max() > REST_RAD_S:
                found["rest_s"] = now - found["fired"]
        if gone is None and pipe.poll():
            if pipe.recv() == "goal":
                pipe.send(arm.ground().goal)
            else:
                gone = now
        return gone is not None and (not plan.kind or now - gone > 0.3)

    pipe.send("ready")
    server.run(until)
    server.close()
    goal = arm.ground()
    pipe.send({**found, "goal": goal.goal, "commands": server.commands, "missing": server.missing, "said": said})


def host_of(pid: int) -> str:
    """`rehearsal.host` of another process."""
    return f"127.0.{pid // 250 % 250}.{pid % 250 + 1}"


def strike(server: Any, plan: Plan, hand: Any, now: float) -> float | None:
    """Let the fault happen. Until when it lasts, if it ends."""
    kind = plan.kind
    if kind in SENSOR and kind not in ("noise", "press"):
        server.faults[kind] = plan.value
    elif kind == "noise":
        server.noisy = True
    elif kind == "press":
        server.arm.pressed[:] = plan.value * hand / np.linalg.norm(hand)
        return now + 0.5
    elif kind == "lost_states":
        server.dropping = True
    elif kind == "lost_commands":
        server.deaf = True
    elif kind in SIGNALS:
        server.waits = kind == "interrupted"
        plan.signal(SIGNALS[kind])
    else:
        server.waits = False
        if kind == "stall":
            time.sleep(plan.lasts)
        else:
            (server.protect if kind == "protective_stop" else lambda why: server.cut())("planted")
    return now + plan.lasts if kind in LENGTHS else None


def relent(server: Any, plan: Plan) -> None:
    """End the fault."""
    server.dropping = server.deaf = False
    server.arm.pressed[:] = 0.0
    if plan.kind == "hung":
        server.waits = True
        plan.signal(signal.SIGCONT)


def ready(link: str, world: str, truth: Mapping[str, float], seed: int, plan: Plan) -> tuple[Any, Any]:
    """A fake robot in a process of its own, and the pipe to it."""
    here, there = FORK.Pipe()
    process = FORK.Process(target=serve, args=(link, world, truth, seed, there, plan))
    process.start()
    there.close()
    assert here.recv() == "ready"
    return process, here


def ended(process: Any, pipe: Any) -> dict[str, Any]:
    """Tell the fake that the runner has gone, and take what it found."""
    pipe.send("gone")
    found: dict[str, Any] = pipe.recv()
    process.join()
    return found
