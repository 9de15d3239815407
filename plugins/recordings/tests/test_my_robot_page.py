"""Every line that docs/how-to/real-recording.md has for a maker's robot is typed, on synthetic files of its layout."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plugins.recordings.tests.bags_written import pose_fields, stamps, wrench_fields, write_bag
from plugins.recordings.tests.test_franka import write_states
from skillframe.cli.main import run
from skillframe.demonstration.columns import WRENCH
from skillframe.demonstration.record import Demonstration
from skillframe.extend.reading import read_demonstration
from skillframe.frames import rotate, rotation_vector

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "how-to" / "real-recording.md").read_text(encoding="utf-8")
MAKERS = PAGE.partition("\n## Lines for some makers\n")[2].partition("\n## ")[0]
LINES = [line for line in MAKERS.splitlines() if re.match(r"skillframe (convert|check \w+\.csv)", line)]


def table(path: Path, names: str, *columns: Any) -> None:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.17g")


def turned(d: Demonstration) -> np.ndarray:
    """The wrench in tool axes."""
    back = np.swapaxes(d.pose.rotation, -1, -2)
    return np.hstack([rotate(back, d.wrench[:, :3]), rotate(back, d.wrench[:, 3:])])


def write_all(folder: Path, d: Demonstration) -> None:
    """The page's files."""
    rotation, tool = d.pose.rotation, turned(d)
    matrix = np.tile(np.eye(4), (len(d), 1, 1))
    matrix[:, :3, :3], matrix[:, :3, 3] = rotation, d.position
    names = ",".join(["time", *(f"O_T_EE_{i}" for i in range(16)), *(f"O_F_ext_hat_K_{i}" for i in range(6))])
    table(folder / "franka.csv", names, d.time, np.swapaxes(matrix, 1, 2).reshape(-1, 16), -d.wrench)
    write_states(folder / "franka.bag", "upper", d)
    names = ",".join(["timestamp", *(f"actual_TCP_{k}_{i}" for k in ("pose", "force") for i in range(6))])
    table(folder / "ur.csv", names, d.time, d.position, rotation_vector(rotation), d.wrench)
    b = -np.arcsin(rotation[:, 2, 0])  # R = Rz(A) Ry(B) Rx(C), written out
    a, c = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]), np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    angles = np.rad2deg(np.column_stack([a, b, c]))
    table(folder / "kuka.csv", "time,X,Y,Z,A,B,C,Fx,Fy,Fz,Mx,My,Mz", d.time, 1e3 * d.position, angles, tool)
    names = "tm,x,y,z,u0,u1,u2,u3," + ",".join(WRENCH)
    table(folder / "abb.csv", names, 1e3 * d.time, 1e3 * d.position, d.quaternion[:, [3, 0, 1, 2]], tool)
    rows = zip(stamps(d.time), d.position, d.quaternion, tool, strict=True)
    written = [(t, pose_fields("PoseStamped", p, q), wrench_fields(w)) for t, p, q, w in rows]
    poses, wrenches = ([(t, part[k]) for t, *part in written] for k in (0, 1))
    topics = {
        "/tool": ("geometry_msgs/msg/PoseStamped", poses), "/wrench": ("geometry_msgs/msg/WrenchStamped", wrenches),
    }  # fmt: skip
    write_bag(folder / "bag.mcap", topics).rename(folder / "arm.mcap")


@pytest.mark.slow
def test_every_line_of_the_page_reads_what_was_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, demo: Demonstration
) -> None:
    monkeypatch.chdir(tmp_path)
    write_all(tmp_path, demo)
    assert len(LINES) == 8
    for line in LINES:
        words = shlex.split(line)[1:]
        assert run(words) == 0, line
        if words[-2:] == ["--layout", "auto"]:
            continue
        found = read_demonstration(tmp_path / words[-1])
        # rounding of millimetres, degrees and of rotations through their other forms
        np.testing.assert_allclose(found.position, demo.position, rtol=0, atol=1e-12, err_msg=line)
        np.testing.assert_allclose(found.pose.rotation, demo.pose.rotation, rtol=0, atol=1e-12, err_msg=line)
        np.testing.assert_allclose(found.wrench, demo.wrench, rtol=0, atol=1e-10, err_msg=line)


def test_the_page_has_a_robot_of_each_maker() -> None:
    heads = re.findall(r"^### (.*)$", MAKERS, re.MULTILINE)
    assert heads == ["Franka (Panda, FR3)", "Universal Robots", "KUKA", "ABB", "Any arm with ROS 2"]
