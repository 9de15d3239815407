"""URDFs written by code that shares nothing with skillframe: chains and trees with honest inertias, as XML text."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

LIMIT = '<limit lower="-1.5" upper="1.5" effort="50" velocity="2"/>'


def inertial(mass: float, length: float, com: str | None = None) -> str:
    """A solid cylinder along z, radius a fifth of its length."""
    across = mass * (3 * (length / 5) ** 2 + length**2) / 12
    along = mass * (length / 5) ** 2 / 2
    return (
        f'<inertial><origin xyz="{com or f"0 0 {length / 2}"}"/><mass value="{mass}"/>'
        f'<inertia ixx="{across}" iyy="{across}" izz="{along}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    axis: str = "1 0 0",
    xyz: str = "0 0 0.3",
    inside: str = LIMIT,
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{inside}</joint>'
    )


def robot(*parts: str, name: str = "made") -> str:
    return f'<?xml version="1.0"?><robot name="{name}">{"".join(parts)}</robot>'


def tree(seed: int, size: int, scale: float = 1.0, kinds: tuple[str, ...] = ("revolute",)) -> str:
    """A random tree of `size` moving links. Lengths grow with scale, masses with its cube."""
    rng = random.Random(seed)
    parts = [link("base")]
    for i in range(size):
        length = scale * rng.uniform(0.1, 0.5)
        parts.append(link(f"l{i}", inertial(rng.uniform(0.5, 5.0) * scale**3, length)))
        parent = "base" if i == 0 else f"l{rng.randrange(max(0, i - 3), i)}"
        axis = " ".join(f"{rng.uniform(-1, 1):.4f}" for _ in range(3))
        # names in no particular order: Pinocchio sorts them
        kind = rng.choice(kinds)
        inside = LIMIT if kind in ("revolute", "prismatic") else ""
        xyz = f"{scale * rng.uniform(-0.1, 0.1)} 0 {length}"
        parts.append(joint(f"j{rng.randrange(1000)}_{i}", parent, f"l{i}", kind, axis, xyz, inside))
    return robot(*parts)


@pytest.fixture(scope="session")
def urdf() -> SimpleNamespace:
    """The writers, for tests of any file."""
    return SimpleNamespace(inertial=inertial, link=link, joint=joint, robot=robot, tree=tree, LIMIT=LIMIT)


@pytest.fixture
def save(tmp_path: Path) -> Callable[..., Path]:
    """Write a URDF (and a robot.toml beside it, if given) and return the path of the last one written."""

    def write(text: str, toml: str | None = None, name: str = "made") -> Path:
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        path = folder / f"{name}.urdf"
        path.write_text(text, encoding="utf-8")
        if toml is None:
            return path
        (folder / "robot.toml").write_text(f'urdf = "{name}.urdf"\n{toml}', encoding="utf-8")
        return folder / "robot.toml"

    return write
