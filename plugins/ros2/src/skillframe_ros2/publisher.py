"""The process that publishes a run's targets, and holds the arm when the run ends, dies or hangs.

crisp_controllers has no watchdog: its arm follows the last target and exerts the last wrench for ever. So the runner
hands its targets over a pipe, and this process publishes them. Without one for SILENT_S, or when the pipe closes, it
publishes the pose that was measured last, and no wrench.

    python -m skillframe_ros2.publisher HOST SILENT_S
"""

from __future__ import annotations

import os
import select
import struct
import sys
import time
from typing import NamedTuple

import numpy as np

from skillframe.frames import Float
from skillframe_ros2.dds import participant, writer
from skillframe_ros2.messages import NEWEST, Header, PoseStamped, WrenchStamped, pose_message, wrench_message
from skillframe_ros2.topics import TARGET_POSE, TARGET_WRENCH

LAYOUT = struct.Struct("<?20d")


class Targets(NamedTuple):
    """What is handed over.

    Attributes:
        watched: whether the next is due within SILENT_S.
        pose: (7,) target, position and quaternion.
        wrench: (6,) target, in the tool's axes.
        measured: (7,) pose, to hold at if no more targets come.
    """

    watched: bool
    pose: Float
    wrench: Float
    measured: Float

    def packed(self) -> bytes:
        """As bytes."""
        return LAYOUT.pack(self.watched, *self.pose, *self.wrench, *self.measured)

    @classmethod
    def unpacked(cls, data: bytes) -> Targets:
        """From bytes."""
        watched, *values = LAYOUT.unpack(data)
        return cls(watched, *np.split(np.array(values), [7, 13]))


def main(host: str, silent_s: float) -> int:
    """Publish until the pipe closes, or no target comes for `silent_s` [s]. Returns 1 if the arm had to be held."""
    at = participant(host)
    pose, wrench = writer(at, TARGET_POSE, PoseStamped, NEWEST), writer(at, TARGET_WRENCH, WrenchStamped, NEWEST)
    until = time.monotonic() + 3.0
    while len(pose.get_matched_subscriptions()) < 2 or not wrench.get_matched_subscriptions():  # run and controller
        if time.monotonic() > until:
            sys.stderr.write("the controller does not read /target_pose and /target_wrench\n")
            return 1
        time.sleep(0.01)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    held = Targets(False, np.zeros(7), np.zeros(6), np.zeros(7))
    while select.select([0], [], [], silent_s if held.watched else None)[0] and (data := _newest()):
        held = Targets.unpacked(data)
        wrench.write(wrench_message(Header(), held.wrench))
        pose.write(pose_message(Header(), held.pose))
    os.close(0)  # so that a run that hung learns of it
    if held.watched:
        wrench.write(wrench_message(Header(), np.zeros(6)))
        pose.write(pose_message(Header(), held.measured))
    time.sleep(0.3)  # so that reliable messages arrive before the process ends
    return int(held.watched)


def _newest() -> bytes:
    """The newest whole message in the pipe, none if it is closed."""
    data = os.read(0, 64 * LAYOUT.size)
    while data and len(data) % LAYOUT.size:
        more = os.read(0, LAYOUT.size - len(data) % LAYOUT.size)
        if not more:
            return b""
        data += more
    return data[-LAYOUT.size :]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], float(sys.argv[2])))
