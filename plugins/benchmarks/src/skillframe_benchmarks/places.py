"""Place of a plug that overlaps its socket as published, and the fixture file for it.

    1. raised by some hundredths of a millimetre
    2. moved by v, |v| <= 0.8 mm, to where V(v) + a |v| is least, V the volume that both parts claim
    3. left, with `overlap` up to 20 um accepted, less than contacts sink by

The first that loads is taken. The tolerance of seating shrinks by the move, so that seated stays within 1 mm of the
published height and 2 mm beside it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from skillframe_parts.load import load
from skillframe_parts.solid import read_part

from skillframe.errors import InputError
from skillframe.files import write_whole
from skillframe.frames import Float
from skillframe_benchmarks.assets import Pair

FIXTURE = """\
summary = "AutoMate {name}"
[fixture]
mesh = "asset_socket.obj"
units = "m"
[tool]
mesh = "asset_plug.obj"
units = "m"
{assembled}density = 8000             # as published
[contact]
friction = 0.5             # as published
as_meshed = true           # what is published are the meshes
by = "surface"             # one kind of contact for all, and the faster one for most
{overlap}[task.start]
above_mouth = 0.002
[task.seated]
height = {height:g}
sideways = {sideways:g}
tilt = "90deg"             # a loose part may lean in its socket
"""
PLACE = "the assembled pose"


def text(pair: Pair, moved: tuple[float, float, float] = (0.0, 0.0, 0.0), overlap: float = 0.0) -> str:
    """A fixture file of a pair, with the plug moved from the published place and an accepted overlap [m]."""
    x, y, z = (round(value, 7) for value in moved)
    place = f"assembled = {{ xyz = [{x:g}, {y:g}, {z:g}] }}  # moved: the meshes overlap\n" if any(moved) else ""
    let = f"overlap = {overlap:g}  # the meshes overlap\n" if overlap else ""
    # seated within 1 mm along the way and 2 mm across about the published place
    return FIXTURE.format(
        name=pair.name, assembled=place, overlap=let, height=0.001 - abs(z), sideways=0.002 - math.hypot(x, y)
    )


def fitting(pair: Pair, folder: Path) -> str:
    """Text of the first fixture file that loads or has another error than overlap, else of the published place.

    Args:
        pair: the two parts.
        folder: where copies of their meshes are.
    """
    for each in _texts(pair):
        if _loads(each, folder):
            return each
    return text(pair)


def _loads(said: str, folder: Path) -> bool:
    trial = folder / "trial.toml"
    write_whole(trial, said.encode())
    try:
        load(trial)
    except InputError as error:
        return error.where != PLACE
    finally:
        trial.unlink()
    return True


def _texts(pair: Pair) -> Iterator[str]:
    for raised in (0.0, 2e-5, 5e-5, 1e-4, 2e-4):  # m, of an overlapping plug
        yield text(pair, (0.0, 0.0, raised))
    moved = free_place(pair)
    if 0.0 < float(np.linalg.norm(moved)) <= 8e-4:
        x, y, z = moved.tolist()
        yield text(pair, (x, y, z))
    yield text(pair, overlap=2e-5)  # accepted where nothing else helps


def free_place(pair: Pair) -> Float:
    """Move (3,) of the plug from the published place with the least overlap [m].

    Raises:
        InputError: a mesh cannot be read.
    """
    from scipy.optimize import minimize

    plug, socket = read_part(pair.plug, "m", held=True).solid, read_part(pair.socket, "m").solid

    def cost(moved: Float) -> float:
        volume = abs(float((plug.translate([1e-3 * x for x in moved]) ^ socket).volume()))
        return 1e9 * volume + 1e-6 * float(np.linalg.norm(moved))  # mm3 for each mm moved

    found = []
    for start in np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.0, 0.03, 0.02], [0.0, 0.0, 0.05]]):  # mm
        first = np.vstack([start, start + 0.05 * np.eye(3)])  # size of the first simplex, mm
        options = {"maxfev": 150, "xatol": 1e-3, "fatol": 1e-7, "initial_simplex": first}
        found.append(minimize(cost, start, method="Nelder-Mead", options=options))
    best: Float = 1e-3 * min(found, key=lambda each: float(each.fun)).x
    return best
