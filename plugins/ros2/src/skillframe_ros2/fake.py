"""A stand-in for crisp_controllers in ROS 2: its topics, parameters and law, over a simulated arm, on loopback alone.

Each millisecond it answers its parameters' services, takes the newest targets, computes the torques of
`skillframe_ros2.law` and steps the arm; every second one it publishes the state. As version 1.0.0 does, it smooths
the target pose by a weighted mean of logarithms of poses, limits the torques' rate, damps the null space, ignores
targets of two publishers, and has no watchdog. Repulsion from joint limits is left out. The end effector is the tip.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from skillframe_drive.fake import FakeArm, FakeController

from skillframe.errors import MissingDependency
from skillframe.frames import Float, Pose, rotation_matrix, rotation_vector, skew
from skillframe_ros2 import law

PERIOD_S = 1e-3
EVERY = 2
"""Periods between two states."""
PATIENCE_S = 3.0
"""In lockstep: longest real time to wait for a target."""
BASE, TIP, FINGER = "base", "tip", "finger_joint"
STARTED: dict[str, bool | float | str] = {
    **{f"task.k_{axis}": 4000.0 if axis.startswith("pos") else 200.0 for axis in law.AXES},
    **{f"task.d_{axis}": 300.0 if axis.startswith("pos") else 10.0 for axis in law.AXES},
    **{f"task.error_clip.{axis}": float(most) for axis, most in zip(law.CLIPS, law.CLIP, strict=True)},
    "nullspace.stiffness": 1.0, "nullspace.damping": 2.0, "nullspace.projector_type": "kinematic",
    "use_local_jacobian": True, "use_operational_space": False, "limit_error": True,
    "filter.target_pose": 0.1, "max_delta_tau": 0.5, "nullspace.max_tau": 5.0,
}  # fmt: skip
"""Parameters with which the how-to page has the controller started, of those that the stand-in knows."""


class Network:
    """Readers and writers of a controller and its broadcasters. Raises `MissingDependency`."""

    def __init__(self, host: str) -> None:
        try:
            from skillframe_ros2 import dds, messages, topics
        except ModuleNotFoundError as error:
            if (error.name or "").split(".")[0] != "cyclonedds":
                raise
            raise MissingDependency("cyclonedds", "a stand-in for ROS 2", "pip install cyclonedds") from None
        self.messages, self.taken = messages, dds.taken
        at = dds.participant(host)
        self.poses = dds.reader(at, topics.TARGET_POSE, messages.PoseStamped, messages.NEWEST)
        self.wrenches = dds.reader(at, topics.TARGET_WRENCH, messages.WrenchStamped, messages.NEWEST)
        self.setting = dds.reader(at, topics.SET, messages.SetParametersRequest, messages.SERVICE)
        self.set = dds.writer(at, topics.SET_REPLY, messages.SetParametersReply, messages.SERVICE)
        self.getting = dds.reader(at, topics.GET, messages.GetParametersRequest, messages.SERVICE)
        self.got = dds.writer(at, topics.GET_REPLY, messages.GetParametersReply, messages.SERVICE)
        self.joints = dds.writer(at, topics.JOINT_STATES, messages.JointState, messages.NEWEST)
        self.pose = dds.writer(at, topics.CURRENT_POSE, messages.PoseStamped, messages.NEWEST)
        self.wrench = dds.writer(at, topics.WRENCH, messages.WrenchStamped, messages.NEWEST)


class FakeCrisp(FakeController):
    """The stand-in."""

    def __init__(
        self, arm: FakeArm, host: str, *, lockstep: bool = False, faults: Mapping[str, float] | None = None,
        say: Callable[[str], None] = print,
    ) -> None:  # fmt: skip
        super().__init__(arm, PERIOD_S, lockstep=lockstep, faults=faults, say=say)
        self._network: Network | None = Network(host)
        self._values: dict[str, bool | float | str] = {}
        self.change(STARTED)
        self._joints = [f"joint{i + 1}" for i in range(len(arm.position))]
        tip = self._tip()
        self._target = self._smooth = logarithm(tip)
        self._wrench = np.zeros(6)
        self._place, self._torque = arm.position.copy(), np.zeros(len(arm.position))
        self._moving = self._stopped = self._ignoring = False

    def _tip(self) -> Pose:
        at = self.arm.pose.at(self.arm.tip)
        return Pose(at.position.copy(), at.rotation.copy())

    @property
    def moving(self) -> bool:
        """Whether targets are expected."""
        return self._moving

    def had_clients(self) -> bool:
        """Whether somebody reads the joints."""
        return self._network is not None and bool(self._network.joints.get_matched_subscriptions())

    def _led(self) -> bool:
        """Whether somebody publishes targets."""
        return self._network is not None and bool(self._network.poses.get_matched_publications())

    def serve(self) -> None:
        """Answer calls, and take the newest targets. In lockstep wait for them while they come."""
        if self._network is None:
            return
        until = time.perf_counter() + (PATIENCE_S if self.lockstep and self._wanted() else 0.0)
        while not self._heard():
            if time.perf_counter() >= until or not self._led():
                if self._wanted():  # a state was not answered: the law goes on with the last targets
                    self.missing += 1
                    self._moving = not self.lockstep and self._led()
                return
            time.sleep(1e-4)

    def _wanted(self) -> bool:
        return self._moving and self._cycle % EVERY == 0

    def _heard(self) -> bool:
        """Answer calls, and take targets. Whether a new target pose came."""
        net = self._network
        assert net is not None
        for call in net.taken(net.setting):
            results = [self._change(each) for each in call.parameters]
            net.set.write(net.messages.SetParametersReply(call.client, call.call, results))
        for call in net.taken(net.getting):
            net.got.write(net.messages.GetParametersReply(call.client, call.call, [self._told(n) for n in call.names]))
        wrenches, poses = net.taken(net.wrenches), net.taken(net.poses)
        if wrenches and not self._ignoring:
            self._wrench = net.messages.wrench_values(wrenches[-1])
        if not poses:
            return False
        if len(net.poses.get_matched_publications()) > 1:
            if not self._ignoring:
                self.say("targets of two publishers are ignored")
            self._ignoring = True
            return True
        self._ignoring = False
        self._target = logarithm(net.messages.pose_of(net.messages.pose_values(poses[-1])))
        self._moving = True
        self.taken()
        return True

    def _change(self, parameter: Any) -> Any:
        """Set a parameter, and say whether it could be."""
        assert self._network is not None
        messages, value = self._network.messages, parameter.value
        name, known = parameter.name, self._values.get(parameter.name)
        kinds = {messages.BOOL: value.bool_value, messages.STRING: value.string_value}
        given = kinds.get(value.type, value.double_value)
        reason = ""
        if known is None:
            reason = "there is no such parameter"
        elif type(known) is not type(given):
            reason = f"it is a {type(known).__name__}"
        elif isinstance(given, float) and name.startswith("task.") and not -1.0 <= given <= law.MOST:
            reason = f"it is from -1 to {law.MOST:.0f}"
        else:
            self.change({name: given})
        return messages.SetParametersResult(not reason, reason)

    def change(self, values: Mapping[str, bool | float | str]) -> None:
        """Set parameters. Damping that is not given, 0 or less, is 2 sqrt(stiffness)."""
        self._values.update(values)
        stiffness, damping = (np.array([float(self._values[f"task.{k}_{axis}"]) for axis in law.AXES]) for k in "kd")
        self.gains = stiffness, np.where(damping > 0.0, damping, 2.0 * np.sqrt(stiffness))

    def _told(self, name: str) -> Any:
        """A parameter's value."""
        assert self._network is not None
        messages = self._network.messages
        if name == "joints":
            return messages.ParameterValue(type=messages.STRINGS, string_array_value=self._joints)
        return messages.value_of({"end_effector_frame": TIP, "base_frame": BASE}.get(name, self._values.get(name, "")))

    def step(self) -> None:
        """Advance the arm under the controller, or hold it by its brakes."""
        if self._stopped:
            self.arm.step(self.arm.holding(self._place, 1e4, 200.0))
            return
        asked = self._law()
        most = float(self._values["max_delta_tau"])
        self._torque = self._torque + np.clip(asked - self._torque, -most, most)
        self.arm.step(self._torque)

    def _law(self) -> Float:
        """Torques (n,) above gravity."""
        keep = float(self._values["filter.target_pose"])
        self._smooth = (1.0 - keep) * self._target + keep * self._smooth
        desired = exponential(self._smooth)
        if np.linalg.norm(self._smooth[3:]) > np.pi:
            self._smooth = logarithm(desired)
        tip, jacobian = self._tip(), self.arm.jacobian.copy()
        jacobian[:3] -= skew((self.arm.pose.rotation[0] @ self.arm.tip)[None])[0] @ jacobian[3:]
        back = tip.rotation[0].T
        local = np.concatenate([back @ jacobian[:3], back @ jacobian[3:]])
        twist = jacobian @ self.arm.velocity
        wrench = law.exerted(desired, tip, twist, *self.gains) + self._wrench
        result: Float = local.T @ wrench + self._null_space(local)
        return result

    def _null_space(self, jacobian: Float) -> Float:
        """Damping (n,) without effect on the tool, or by the kinematic projector with little."""
        pull = -float(self._values["nullspace.damping"]) * self.arm.velocity
        if self._values["nullspace.projector_type"] == "dynamic":
            mobility = np.linalg.solve(self.arm.mass_matrix(), jacobian.T)
            spread = jacobian.T @ np.linalg.solve(jacobian @ mobility, mobility.T)
        else:
            spread = np.linalg.pinv(jacobian) @ jacobian
        most = float(self._values["nullspace.max_tau"])
        return np.clip(pull - spread @ pull, -most, most)

    def publish(self) -> None:
        """Publish wrench, pose and joints, as broadcasters do: joints from tool to base, and others among them."""
        net = self._network
        if net is None or self._stopped or self._cycle % EVERY:
            return
        header = net.messages.Header(net.messages.stamp_of(self.time), BASE)
        net.wrench.write(net.messages.wrench_message(header, self.felt(np.zeros(6))))
        net.pose.write(net.messages.pose_message(header, net.messages.flat(self._tip())))
        names = [FINGER, *reversed(self._joints)]
        position, velocity = ([0.0, *each[::-1].tolist()] for each in (self.arm.position, self.arm.velocity))
        net.joints.write(net.messages.JointState(header, names, position, velocity, []))

    def protect(self, why: str) -> None:
        """Stop as ros2_control does after an error of the robot: controllers and broadcasters end, brakes hold."""
        self.say(f"the controllers are deactivated: {why}")
        self._stopped, self._moving, self._place = True, False, self.arm.position.copy()

    def cut(self) -> None:
        """Leave the network. The controller goes on with the last targets."""
        self.close()
        self.say("the network is cut, and the controller follows its last target")
        self._moving = False

    def close(self) -> None:
        """Leave the network."""
        self._network = None
        gc.collect()  # the client library's entities refer to each other


def logarithm(pose: Pose) -> Float:
    """Logarithm (6,) of a pose: translation, rotation."""
    turn = rotation_vector(pose.rotation)
    angle = float(np.linalg.norm(turn))
    w = skew(turn)[0]
    share = 1.0 / 12.0 if angle < 1e-4 else (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    moved = pose.position[0] - 0.5 * w @ pose.position[0] + share * w @ w @ pose.position[0]
    return np.concatenate([moved, turn[0]])


def exponential(vector: Float) -> Pose:
    """The pose (1,) of a logarithm (6,)."""
    turn, moved = vector[3:], vector[:3]
    angle = float(np.linalg.norm(turn))
    w = skew(turn[None])[0]
    first = 0.5 if angle < 1e-4 else (1.0 - np.cos(angle)) / angle**2
    second = 1.0 / 6.0 if angle < 1e-4 else (angle - np.sin(angle)) / angle**3
    return Pose((moved + first * w @ moved + second * w @ w @ moved)[None], rotation_matrix(turn[None]))
