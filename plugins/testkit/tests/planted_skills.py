"""Skills with one defect each, as an author could write them by mistake. Every one holds or glides otherwise."""

import contextlib
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from skillframe_testkit.suites import HoldSkill

from skillframe.extend import SkillType
from skillframe.frames import Pose, rotation_matrix
from skillframe.skill import Impedance, Skill


class Glide(HoldSkill):
    """Glides down at 30 mm/s for a second, holds, and ends after five."""

    speed = 0.03

    def __init__(self):
        super().__init__(duration=5.0)

    def start(self, observation, rngs):
        super().start(observation, rngs)
        self.rngs, self.tick = rngs, 0
        self.began = observation.time.copy()

    def moved(self, command, seconds):
        down = np.array([0.0, 0.0, -self.speed])
        by = np.minimum(seconds, 1.0)[:, None] * down
        return command._replace(pose=Pose(command.pose.position + by, command.pose.rotation))

    def step(self, observation):
        self.tick += 1
        return self.moved(super().step(observation), observation.time - self.began)


class Slow(Glide):
    def step(self, observation):
        time.sleep(0.02)
        return super().step(observation)


class Busy(Glide):
    def step(self, observation):
        until = time.process_time() + 0.02
        while time.process_time() < until:
            pass
        return super().step(observation)


class Prints(Glide):
    def step(self, observation):
        print("tick", self.tick)
        return super().step(observation)


class Complains(Glide):
    def start(self, observation, rngs):
        super().start(observation, rngs)
        sys.stderr.write("no calibration found\n")


class TooFast(Glide):
    speed = 30.0


class TurnsTooFast(Glide):
    def step(self, observation):
        twist = np.zeros((len(observation.time), 6))
        twist[:, 5] = 100.0 * (observation.time > 0.2)
        return super().step(observation)._replace(twist=twist)


class NeverEnds(Glide):
    def __init__(self):
        super().__init__()
        self._duration = np.inf


class WritesFiles(Glide):
    def step(self, observation):
        if self.tick % 500 == 0:
            Path("ticks.log").write_text(str(self.tick))
        return super().step(observation)


class RunsAProgram(Glide):
    def start(self, observation, rngs):
        super().start(observation, rngs)
        subprocess.run([sys.executable, "-c", ""], check=True)


class Connects(Glide):
    def start(self, observation, rngs):
        super().start(observation, rngs)
        with socket.socket() as line, contextlib.suppress(OSError):
            line.connect(("127.0.0.1", 9))


class Removes(Glide):
    def start(self, observation, rngs):
        super().start(observation, rngs)
        Path("old.log").unlink(missing_ok=True)


class Twists(Glide):
    def step(self, observation):
        push = np.zeros((len(observation.time), 6))
        push[:, 5] = 80.0 * np.minimum(observation.time - self.began, 1.0)
        return super().step(observation)._replace(feedforward=push)


class Spins(Glide):
    def step(self, observation):
        command = super().step(observation)
        turn = rotation_matrix((observation.time - self.began)[:, None] * [0.0, 0.0, 30.0])
        return command._replace(pose=Pose(command.pose.position, turn @ command.pose.rotation))


class RaisesLate(Glide):
    def step(self, observation):
        if self.tick == 600:
            raise IndexError("list index out of range")
        return super().step(observation)


class NotFiniteLate(Glide):
    def step(self, observation):
        command = super().step(observation)
        return self.moved(command, np.full(len(observation.time), np.nan)) if self.tick == 900 else command


class WritesLate(Glide):
    def step(self, observation):
        if self.tick == 700:
            observation.wrench[:] = 0.0
        return super().step(observation)


class Restarting(Glide):
    """Restarts as it should."""

    def restart(self, rows, observation, rngs):
        self._home.position[rows] = observation.pose.position[rows]
        self._home.rotation[rows] = observation.pose.rotation[rows]
        self.began[rows] = observation.time[rows]


class RestartsAll(Restarting):
    def restart(self, rows, observation, rngs):
        self.start(observation, self.rngs)


class RestartsNone(Restarting):
    def restart(self, rows, observation, rngs):
        pass


class JournalRaises(Glide):
    def journal(self, trial):
        return {}["events"]


class JournalOfWords(Glide):
    def journal(self, trial):
        return ["began", "ended"]


class CountsTicks(Glide):
    def step(self, observation):
        command = HoldSkill.step(self, observation)
        self.tick += 1
        return self.moved(command, np.full(len(observation.time), 0.001 * self.tick))


class EndsByTicks(Glide):
    def step(self, observation):
        command = super().step(observation)
        status, reason = command.status.copy(), command.reason.copy()
        if self.tick >= 100:
            status[:], reason[:] = 1, "100 ticks are over"
        return command._replace(status=status, reason=reason)


class Leaks(Glide):
    def __init__(self):
        super().__init__()
        self.seen = []

    def step(self, observation):
        self.seen.append(observation)
        return super().step(observation)


class IgnoresSecondStart(Glide):
    begun = False

    def start(self, observation, rngs):
        if not self.begun:
            super().start(observation, rngs)
            self.begun = True


class Pushes(Glide):
    def step(self, observation):
        push = np.zeros((len(observation.time), 6))
        push[:, 2] = -500.0 * np.minimum(observation.time - self.began, 1.0)
        return super().step(observation)._replace(feedforward=push)


class Jumps(Glide):
    def step(self, observation):
        return self.moved(super().step(observation), np.full(len(observation.time), 0.5))


class PushesAtOnce(Glide):
    def step(self, observation):
        return super().step(observation)._replace(feedforward=np.full((len(observation.time), 6), 20.0))


class ForgetsRotation(Glide):
    def step(self, observation):
        command = super().step(observation)
        return command._replace(twist=command.twist[:, :3])


class Stretches(Glide):
    def step(self, observation):
        command = super().step(observation)
        return command._replace(pose=Pose(command.pose.position, 1.01 * command.pose.rotation))


class PushesAway(Glide):
    def step(self, observation):
        return super().step(observation)._replace(impedance=Impedance(-50.0 * np.eye(6)))


class FeedsEnergy(Glide):
    def step(self, observation):
        return super().step(observation)._replace(impedance=Impedance(np.eye(6), -np.eye(6)))


class MeetsInTheMean(Glide):
    def step(self, observation):
        command = super().step(observation)
        by = 1e-3 * observation.wrench[:, :3].mean(0) * observation.time[:, None]
        return command._replace(pose=Pose(command.pose.position + by, command.pose.rotation))


class OwnChance(Glide):
    def step(self, observation):
        command = super().step(observation)
        by = 1e-6 * np.random.default_rng().normal(size=(len(observation.time), 3))
        return command._replace(pose=Pose(command.pose.position + by, command.pose.rotation))


class GlobalChance(Glide):
    def start(self, observation, rngs):
        super().start(observation, rngs)
        np.random.random()  # noqa: NPY002 - the mistake to be caught


class EndsInSilence(Glide):
    def step(self, observation):
        command = super().step(observation)
        reason = command.reason.copy()
        reason[:] = ""
        return command._replace(reason=reason)


class UnknownStatus(Glide):
    def step(self, observation):
        command = super().step(observation)
        return command._replace(status=command.status + 7)


class AnswersNothing(Glide):
    def step(self, observation):
        super().step(observation)


class Quits(Glide):
    def step(self, observation):
        raise SystemExit(3)


class TellsTime(Glide):
    """By the wall clock."""

    def step(self, observation):
        now = time.perf_counter()
        self.first = getattr(self, "first", now)
        return self.moved(HoldSkill.step(self, observation), np.full(len(observation.time), now - self.first))


class ChangesItsFolder(Glide):
    def start(self, observation, rngs):
        super().start(observation, rngs)
        os.makedirs("cache", exist_ok=True)


PLANTED = {
    Slow: "answers in time: a step takes",
    Busy: "answers in time: a step takes",
    Prints: "leaves nothing behind: prints 'tick 0'",
    Complains: "leaves nothing behind: prints 'no calibration found'",
    TooFast: "runs for two seconds: the desired pose moves at",
    TurnsTooFast: "runs for two seconds: the desired twist is 100 rad/s in tick 201",
    WritesFiles: "leaves nothing behind: opens the file 'ticks.log' for writing",
    RunsAProgram: "leaves nothing behind: runs the program",
    ChangesItsFolder: "leaves nothing behind: makes the folder 'cache'",
    Connects: "leaves nothing behind: connects to ('127.0.0.1', 9)",
    Removes: "leaves nothing behind: removes 'old.log'",
    Twists: "runs for two seconds: the feed-forward is 50.1 Nm",
    Spins: "runs for two seconds: the desired pose moves at",
    RaisesLate: "runs for two seconds: step raised IndexError in tick 600, at 0.600 s: list index out of range",
    NotFiniteLate: "runs for two seconds: the command is not finite in tick 899",
    WritesLate: "writes into its observation, which is not its own; copy what it changes",
    RestartsAll: "restarts some trials: a trial that goes on while others restart: position differs",
    RestartsNone: "restarts some trials: a restarted trial against one that starts: position differs",
    JournalRaises: "writes its journal: journal(0) raised KeyError: 'events'",
    JournalOfWords: "writes its journal: journal(0) gave ['began', 'ended']",
    CountsTicks: "goes by time: position goes by the count of ticks",
    EndsByTicks: "goes by time: status goes by the count of ticks",
    Leaks: "remembers little: keeps",
    IgnoresSecondStart: "starts again: a second start against a first: position differs",
    Pushes: "runs for two seconds: the feed-forward is 200 N",
    Jumps: "starts without a bump",
    PushesAtOnce: "starts without a bump",
    ForgetsRotation: "twist has shape (8, 3), expected (8, 6)",
    Stretches: "pose.rotation is not orthonormal",
    PushesAway: "stiffness is not positive semi-definite",
    FeedsEnergy: "damping is not positive semi-definite",
    MeetsInTheMean: "rows are independent",
    OwnChance: "repeats with its seed",
    GlobalChance: "draws from numpy's global generator",
    EndsInSilence: "give one exactly at the end",
    UnknownStatus: "expected the integers of Status",
    AnswersNothing: "answers in shape: raised",
    Quits: "raised SystemExit: 3",
    TellsTime: "repeats with its seed",
}
"""The defect, and what must be among what the kit says of it."""


def kind(make: type[Skill], **changes):
    values = {
        "name": make.__name__.lower(), "summary": "holds", "build": lambda document: make(),
        "describe": lambda document: ["glides down"], "example": lambda: {"phases": [{"k": 0.1}]},
    }  # fmt: skip
    return SkillType(**{**values, **changes})
