"""Demonstrations made from closed forms: a tool that turns smoothly while it is pressed and let go."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from skillframe.demonstration.record import Demonstration
from skillframe.frames import quaternion_from_matrix, rotation_matrix

HEADER = "t,px,py,pz,qx,qy,qz,qw,fx,fy,fz,tx,ty,tz"


def make(count: int = 200, rate: float = 100.0, turn: float = 0.5, seed: int = 0) -> Demonstration:
    """A descent along -z with a turn about x + 2 y, free air for the first half, then 10 N along z with friction."""
    rng = np.random.default_rng(seed)
    time = np.arange(count) / rate
    s = np.linspace(0.0, 1.0, count)
    position = np.stack([0.4 + 0.05 * s, 0.1 - 0.02 * s, 0.3 - 0.1 * s], axis=-1)
    axis = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)
    quaternion = quaternion_from_matrix(rotation_matrix(turn * s[:, None] * axis))
    wrench = rng.normal(scale=np.repeat([0.05, 0.005], 3), size=(count, 6))
    wrench[count // 2 :, 2] += 10.0
    wrench[count // 2 :, 0] -= 3.0
    return Demonstration(time=time, position=position, quaternion=quaternion, wrench=wrench)


@pytest.fixture
def demo() -> Demonstration:
    return make()


@pytest.fixture
def rows(demo: Demonstration) -> list[list[str]]:
    """The demonstration as CSV cells, header first. A test spoils one and writes them."""
    values = np.column_stack([demo.time, demo.position, demo.quaternion, demo.wrench])
    return [HEADER.split(","), *([repr(float(v)) for v in row] for row in values)]


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    def write_cells(cells: list[list[str]], name: str = "demo.csv", meta: str = "") -> Path:
        path = tmp_path / name
        path.write_text("\n".join(",".join(row) for row in cells) + "\n")
        if meta:
            path.with_name(f"{path.stem}.meta.toml").write_text(meta)
        return path

    return write_cells
