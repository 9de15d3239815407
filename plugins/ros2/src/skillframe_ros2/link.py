"""The link to a robot that crisp_controllers' Cartesian controller moves in ROS 2: over DDS, without ROS 2 here."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from skillframe_drive.link import SILENT_S, RobotState, Spring

from skillframe.errors import MissingDependency, SkillframeError
from skillframe.frames import Float, matrix_from_quaternion, norm, pose_error, rotate_spatial
from skillframe_ros2 import law

WAIT_S = 3.0
"""Time to wait for the robot's nodes, and for their answers while nothing moves [s]."""
CALL_S = 0.1
"""Time to wait for an answer during a run [s]."""
APART = 1e-3, 0.01
"""Largest distance [m] and angle [rad] of the end-effector frame from the centre of compliance and the tool's axes."""
OTHERS = "another program publishes /target_pose, and the controller ignores targets of two: end it"


class Ros2Link:
    """A connected robot: a `skillframe_drive.link.ImpedanceLink`.

    It has the state 500 times a second, from joint_states at 500 Hz or more. Another process publishes the targets, and
    holds the arm when this one dies (`skillframe_ros2.publisher`); when the network or the computer fails, nothing
    does.
    """

    takes = "impedance"
    period = 2e-3

    def __init__(self, host: str) -> None:
        try:
            from skillframe_ros2 import dds, messages, topics
        except ModuleNotFoundError as error:
            if (error.name or "").split(".")[0] != "cyclonedds":
                raise
            raise MissingDependency("cyclonedds", "a link to ROS 2", "pip install cyclonedds") from None
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
        from cyclonedds.util import duration

        self._messages: Any = messages
        self._taken = dds.taken
        self.fault, self.missed, self.longest = "", 0, 0.0
        at = self._participant = dds.participant(host)
        self._joints = dds.reader(at, topics.JOINT_STATES, messages.JointState, messages.SENSOR)
        self._poses = dds.reader(at, topics.CURRENT_POSE, messages.PoseStamped, messages.SENSOR)
        self._wrenches = dds.reader(at, topics.WRENCH, messages.WrenchStamped, messages.SENSOR)
        self._targets = dds.reader(at, topics.TARGET_POSE, messages.PoseStamped, messages.NEWEST)  # whose it counts
        self._calls = {
            kind: (dds.writer(at, asked, request, messages.SERVICE), dds.reader(at, told, reply, messages.SERVICE))
            for kind, asked, told, request, reply in (
                ("set", topics.SET, topics.SET_REPLY, messages.SetParametersRequest, messages.SetParametersReply),
                ("get", topics.GET, topics.GET_REPLY, messages.GetParametersRequest, messages.GetParametersReply),
            )
        }  # fmt: skip
        self._waits, self._silent = WaitSet(at), duration(milliseconds=5)
        self._waits.attach(
            ReadCondition(self._joints, ViewState.Any | InstanceState.Any | SampleState.NotRead)
        )  # fmt: skip
        self._client, self._call = int.from_bytes(os.urandom(7), "little"), 0
        self._publisher: Any = None  # a process with a pipe
        self._reads = 0
        self._last: float | None = None
        self._set: tuple[bytes, bytes] | None = None
        self._stiffness, self._damping = np.zeros(6), np.zeros(6)
        where = f"{host} in domain {os.environ.get(dds.DOMAIN, '0')}"
        self._meet(where, topics)
        self._order, self._end_effector = self._ask_frames()
        nothing = np.zeros(len(self._order))
        self._seen = RobotState(0.0, nothing, nothing, np.zeros(6))
        self._pose = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        self._felt, self._base = np.zeros(6), ""
        self._came = {"pose": time.monotonic(), "wrench": time.monotonic()}
        self._host = host
        if self._targets.get_matched_publications():
            raise SkillframeError(OTHERS)

    def _meet(self, where: str, topics: Any) -> None:
        """Wait until each of the robot's topics and services is there."""
        found: list[tuple[str, Callable[[], Any]]] = [
            (topics.JOINT_STATES, self._joints.get_matched_publications),
            (topics.CURRENT_POSE, self._poses.get_matched_publications),
            (topics.WRENCH, self._wrenches.get_matched_publications),
        ]
        for kind, (asking, answers) in self._calls.items():
            name = f"{topics.CONTROLLER}/{kind}_parameters"
            found += [(name, asking.get_matched_subscriptions), (name, answers.get_matched_publications)]
        until = time.monotonic() + WAIT_S
        while lacking := [name for name, matched in found if not matched()]:
            if time.monotonic() > until:
                names = ", ".join(dict.fromkeys(f"/{each.removeprefix('rt/')}" for each in lacking))
                text = f"there is no crisp controller at {where}: nobody serves {names}"
                raise SkillframeError(f"{text}; start it with rmw_cyclonedds_cpp, and check ROS_DOMAIN_ID")
            time.sleep(0.01)
        for name, matched in found[1:]:
            if len(matched()) > 1:
                text = f"several nodes at {where} serve /{name.removeprefix('rt/')}, and each would follow the targets"
                raise SkillframeError(f"{text}: leave one, or give each a ROS_DOMAIN_ID of its own")

    def _ask_frames(self) -> tuple[list[str], str]:
        """Names of the joints from base to tool, and of the end-effector frame."""
        request = self._messages.GetParametersRequest(names=["joints", "end_effector_frame"])
        reply = self._asked("get", request, WAIT_S)
        if reply is None or len(reply.values) != 2 or not reply.values[0].string_array_value:
            raise SkillframeError(self.fault or "the controller does not say its joints: its node is not configured")
        joints, frame = reply.values
        return list(joints.string_array_value), frame.string_value

    def _asked(self, kind: str, request: Any, wait_s: float) -> Any:
        """The answer to a call of a service, or None after setting `fault`."""
        asking, answers = self._calls[kind]
        self._call += 1
        request.client, request.call = self._client, self._call
        begin, sent = time.monotonic(), 0
        while (waited := time.monotonic() - begin) < wait_s:
            if waited >= 0.5 * sent:  # [s]; a node may take calls before it sees who reads its answers
                asking.write(request)
                sent += 1
            for reply in self._taken(answers):
                if (reply.client, reply.call) == (self._client, self._call):
                    return reply
            time.sleep(2e-4)
        self.fault = self.fault or f"the controller does not answer {kind}_parameters within {1e3 * wait_s:.0f} ms"
        return None

    def read(self) -> RobotState:
        """Wait for the next state."""
        if self.fault:
            return self._seen
        until = time.monotonic() + SILENT_S
        message: Any = None
        while message is None or self._early(message):
            if new := self._taken(self._joints):
                message = new[-1]
            elif time.monotonic() > until:
                self.fault = f"no state from the robot for {1e3 * SILENT_S:.0f} ms"
                return self._seen
            else:
                self._waits.wait(self._silent)
        self._take(message)
        self._reads += 1
        # every 100 ms, for other publishers of targets
        if self._reads % 50 == 0 and len(self._targets.get_matched_publications()) > 1:
            self.fault = OTHERS
        return self._seen

    def _early(self, message: Any) -> bool:
        """Whether a state comes within the period, from a robot of a higher rate."""
        if self._last is None:
            return False
        after: float = self._messages.seconds(message.header.stamp) - self._last
        return 0.0 <= after < 0.75 * self.period

    def _take(self, joints: Any) -> None:
        now = self._messages.seconds(joints.header.stamp)
        if self._last is not None:
            self.missed += max(0, round((now - self._last) / self.period) - 1)
            self.longest = max(self.longest, now - self._last)
        self._last = now
        places = {name: i for i, name in enumerate(joints.name)}
        if lacking := [name for name in self._order if name not in places]:
            self.fault = f"/joint_states lacks the controller's joint {lacking[0]}"
            return
        if not len(joints.name) == len(joints.position) == len(joints.velocity):
            self.fault = "/joint_states has not as many positions and velocities as names"
            return
        rows = [places[name] for name in self._order]
        position, velocity = np.array(joints.position)[rows], np.array(joints.velocity)[rows]
        for pose in self._taken(self._poses)[-1:]:
            self._pose, self._base = self._messages.pose_values(pose), pose.header.frame_id
            self._came["pose"] = time.monotonic()
        for wrench in self._taken(self._wrenches)[-1:]:
            self._came["wrench"] = time.monotonic()
            self._felt = self._in_base(wrench)
        if old := [name for name, came in self._came.items() if time.monotonic() - came > SILENT_S]:
            self.fault = self.fault or f"no {old[0]} from the robot for {1e3 * SILENT_S:.0f} ms"
        joined = np.concatenate([position, velocity])
        for name, given in (("joint_states", joined), ("current_pose", self._pose), ("the wrench", self._felt)):
            if not np.isfinite(given).all():
                self.fault = self.fault or f"the robot sends values in {name} that are no numbers"
        if not self.fault:
            self._seen = RobotState(now, position, velocity, self._felt)

    def _in_base(self, message: Any) -> Float:
        """The measured wrench (6,) in base axes: it is given in those of the pose's frame, or in the tool's."""
        wrench: Float = self._messages.wrench_values(message)
        if message.header.frame_id == self._base:
            return wrench
        turned: Float = rotate_spatial(matrix_from_quaternion(self._pose[None, 3:]), wrench[None])[0]
        return turned

    def tare(self) -> None:
        """Nothing: ROS 2 has no common service for it, and the run's own tare suffices."""

    def refused(self, command: Spring) -> str:
        """Why the controller cannot take a command, in a sentence, or ""."""
        error = pose_error(self._messages.pose_of(self._pose), command.measured)
        if float(norm(error[:, :3])[0]) > APART[0] or float(norm(error[:, 3:])[0]) > APART[1]:
            return (
                f"the controller's frame {self._end_effector} is {1e3 * float(norm(error[:, :3])[0]):.1f} mm and "
                f"{float(norm(error[:, 3:])[0]):.3f} rad from the tool's axes in the centre of compliance: name that "
                "frame in end_effector_frame, or move the centre with --coc"
            )
        stiffness, damping = self._diagonals(command)
        for name, values in (("stiffness", stiffness), ("damping", damping)):
            least = 0.0 if name == "stiffness" else 1e-6  # the controller takes zero damping for critical
            if not (np.isfinite(values).all() and values.min() >= least and values.max() <= law.MOST):
                return (
                    f"the skill's {name} has {values.min():.6g} to {values.max():.6g} along the tool's axes, and the "
                    f"controller takes {least:g} to {law.MOST:.0f}"
                )
        return ""

    def _diagonals(self, command: Spring) -> tuple[Float, Float]:
        axes = command.measured.rotation[0]
        stiffness, damping = law.diagonal(command.stiffness, axes), law.diagonal(command.damping, axes)
        for values in (stiffness, damping):
            values[np.abs(values) < 1e-9 * np.abs(values).max()] = 0.0  # a free axis, as rounded
        return stiffness, damping

    def arm(self) -> None:
        """Start the process that publishes targets."""
        if self.fault:
            return
        line, pipe = [sys.executable, "-m", "skillframe_ros2.publisher", self._host, str(SILENT_S)], subprocess.PIPE
        self._publisher = subprocess.Popen(line, bufsize=0, start_new_session=True, stdin=pipe, stdout=pipe)
        if self._publisher.stdout.readline() != b"ready\n":
            self.fault = "the process that publishes targets ended at once: its error stands above"
        self.missed, self.longest, self._last = 0, 0.0, None

    def send(self, command: Spring) -> None:
        """Publish the target pose and the target wrench, after the parameters if stiffness or damping changed."""
        if self.fault:
            return
        pose, measured = self._messages.flat(command.desired), self._messages.flat(command.measured)
        matrices = command.stiffness.tobytes(), command.damping.tobytes()
        if matrices != self._set:
            if why := self.refused(command):
                self.fault = why
                return
            if self._set is None and not self._hold(measured):
                return
            self._stiffness, self._damping = self._diagonals(command)
            if not self._set_parameters():
                return
            if self._set is None:  # states are counted from the first target
                self.missed, self.longest, self._last = 0, 0.0, None
            self._set = matrices
        self._publish(True, pose, law.target_wrench(command, self._stiffness, self._damping), measured)

    def _hold(self, measured: Float) -> bool:
        """Whether the measured pose is the target: one that was left from before would pull at the new stiffness."""
        self._taken(self._targets)
        self._publish(False, measured, np.zeros(6), measured)
        until = time.monotonic() + WAIT_S  # the publisher has just started, and the arm holds where it was
        while not self.fault and time.monotonic() < until:
            for target in self._taken(self._targets):
                if np.array_equal(self._messages.pose_values(target), measured):
                    return True
            time.sleep(2e-4)
        self.fault = self.fault or f"the first target was not published within {WAIT_S:g} s"
        return False

    def _set_parameters(self) -> bool:
        values = law.parameters(self._stiffness, self._damping)
        listed = [self._messages.Parameter(name, self._messages.value_of(value)) for name, value in values.items()]
        reply = self._asked("set", self._messages.SetParametersRequest(parameters=listed), CALL_S)
        if reply is None:
            return False
        for name, result in zip(values, reply.results, strict=False):
            if not result.successful:
                self.fault = f"the controller refuses {name} = {values[name]} ({result.reason or 'without a reason'})"
        if len(reply.results) != len(values):
            self.fault = self.fault or "the controller answers for other parameters than were sent"
        return not self.fault

    def _publish(self, watched: bool, pose: Float, wrench: Float, measured: Float) -> None:
        from skillframe_ros2.publisher import Targets

        if not (np.isfinite(pose).all() and np.isfinite(wrench).all()):
            self.fault = "the target is no number, and was not sent"
            return
        try:
            self._publisher.stdin.write(Targets(watched, pose, wrench, measured).packed())
        except OSError:
            self.fault = f"no target for {1e3 * SILENT_S:.0f} ms: the arm was commanded to hold"

    def halt(self) -> None:
        """Hold at the measured pose."""
        if not self.fault and self._publisher is not None:
            self._publish(False, self._pose, np.zeros(6), self._pose)

    def close(self) -> None:
        """End the process that publishes targets, which holds the arm if a run was under way, and leave the network."""
        if self._publisher is not None:
            self._publisher.stdin.close()
            try:
                self._publisher.wait(2.0)
            except subprocess.TimeoutExpired:
                self._publisher.kill()
                self._publisher.wait()
            self._publisher.stdout.close()
            self._publisher = None
        for name in ("_joints", "_poses", "_wrenches", "_targets", "_calls", "_waits", "_participant"):
            self.__dict__.pop(name, None)
        gc.collect()  # the client library's entities refer to each other, and leave the network when they go
