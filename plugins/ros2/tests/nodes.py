"""What ROS 2 nodes of a robot would publish and answer, held still: for the link's own tests."""

from __future__ import annotations

import gc
import threading
import time

import numpy as np
from skillframe_ros2 import dds, messages
from skillframe_ros2.fake import Network

JOINTS = [f"joint{i + 1}" for i in range(7)]
HOST = "127.0.0.1"


class Nodes:
    """Publishes the same state every `period` seconds, and answers parameter calls.

    Attributes:
        published: whether states are published; answers: whether calls are answered.
        names, position, pose, wrench, frame: what is published; refuse: a parameter that is refused.
        values: parameters that were set; lost: number of the next calls whose answers are lost.
    """

    def __init__(self, period: float = 0.002, lost: int = 0) -> None:
        self.lost = lost
        self.period, self.published, self.answers, self.refuse = period, True, True, ""
        self.names = ["finger", *reversed(JOINTS)]
        self.position = [9.0, *np.arange(7.0, 0.0, -1.0)]
        self.pose, self.wrench, self.frame = np.array([0.5, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0]), np.arange(6.0), "base"
        self.values: dict[str, float] = {}
        self._net = Network(HOST)
        self.targets, self.pushes = self._net.poses, self._net.wrenches
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        begin, count = time.monotonic(), 0
        while not self._ends.is_set():
            count += 1
            for call in dds.taken(self._net.getting) if self.answers else ():
                if self.lost:
                    self.lost -= 1
                    continue
                known = {
                    "joints": messages.ParameterValue(type=messages.STRINGS, string_array_value=JOINTS),
                    "end_effector_frame": messages.value_of("tip"),
                }
                self._net.got.write(messages.GetParametersReply(call.client, call.call, [known[n] for n in call.names]))
            for call in dds.taken(self._net.setting) if self.answers else ():
                results = [
                    messages.SetParametersResult(each.name != self.refuse, "too large") for each in call.parameters
                ]
                self.values.update({each.name: each.value.double_value for each in call.parameters})
                self._net.set.write(messages.SetParametersReply(call.client, call.call, results))
            if self.published:
                header = messages.Header(messages.stamp_of(count * self.period), self.frame)
                self._net.wrench.write(messages.wrench_message(header, self.wrench))
                self._net.pose.write(messages.pose_message(messages.Header(frame_id="base"), self.pose))
                speed = [0.0] * len(self.position)
                self._net.joints.write(messages.JointState(header, self.names, list(self.position), speed, []))
            time.sleep(max(0.0, begin + count * self.period - time.monotonic()))

    def close(self) -> None:
        self._ends.set()
        self._thread.join()
        self.__dict__.clear()
        gc.collect()
