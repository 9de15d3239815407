"""The 100 pairs of AutoMate in the user's copy."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

from skillframe.errors import InputError, UnknownName

MESHES = (Path("assets/automate/mesh"), Path("mesh"), Path())
"""Folders of the pairs: in a checkout of the published repository, in its assets, or directly."""
HEIGHTS = (Path("isaacgymenvs/tasks/automate/data"), Path("data"), Path())
HEIGHTS_FILE = "disassembly_dist.json"
DEVELOPED = (
    "00004", "00007", "00014", "00028", "00032", "00042", "00062", "00074", "00077", "00081", "00133", "00138", "00143",
    "00175", "00187", "00192", "00210", "00213", "00296", "00301", "00308", "00319", "00340", "00360", "00422", "00437",
    "00444", "00446", "00471", "00486", "00506", "00537", "00638", "00648", "00652", "00755", "00768", "00783", "00863",
    "01026", "01092", "01102", "01132",
)  # fmt: skip
"""Pairs that the method was developed on, reported separately."""


class Pair(NamedTuple):
    """Two parts of one assembly.

    Attributes:
        name: of the assembly, "00004".
        plug, socket: mesh files in metres, in the assembled pose, z out of the hole.
        way_out: height from which the published check no longer counts the plug as assembled [m]; None if unknown.
    """

    name: str
    plug: Path
    socket: Path
    way_out: float | None


def pairs(folder: Path, names: tuple[str, ...] = ()) -> list[Pair]:
    """The pairs in a folder, by name.

    Args:
        folder: a checkout of the published repository (its branch `automate`), or its folder assets/automate.
        names: of the wanted ones; () for all.

    Raises:
        InputError: there is none, or the heights cannot be read.
        UnknownName: no such pair.
    """
    meshes = next((folder / each for each in MESHES if any((folder / each).glob("*/asset_plug.obj"))), None)
    if meshes is None:
        what = "holds no NUMBER/asset_plug.obj"
        raise InputError(folder, what, "give a checkout of IsaacGymEnvs' branch automate, or its assets/automate")
    heights = _heights(folder)
    found = {
        plug.parent.name: Pair(plug.parent.name, plug, plug.with_name("asset_socket.obj"),
                               heights.get(f"asset_{plug.parent.name}"))
        for plug in sorted(meshes.glob("*/asset_plug.obj"))
        if plug.with_name("asset_socket.obj").is_file()
    }  # fmt: skip
    for name in names:
        if name not in found:
            raise UnknownName("assembly", name, found)
    return [found[name] for name in names or found]


def _heights(folder: Path) -> dict[str, float]:
    path = next((folder / each / HEIGHTS_FILE for each in HEIGHTS if (folder / each / HEIGHTS_FILE).is_file()), None)
    if path is None:
        return {}
    try:
        found = {str(name): float(value) for name, value in json.loads(path.read_text(encoding="utf-8")).items()}
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise InputError(path, f"is no table of heights ({error})", "fetch it again") from None
    return found
