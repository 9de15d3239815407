"""Convex pieces kept in the user's cache, by what they are made of: the mesh, the error allowed, and how they are cut.

Cutting takes seconds, and every worker of a campaign would do it again. An entry that cannot be read is made again.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from skillframe.errors import SkillframeWarning
from skillframe.files import write_whole
from skillframe.parts import pieces, sections
from skillframe.parts.pieces import ConvexPieces
from skillframe.parts.solid import arrays_of
from skillframe.paths import cache_dir
from skillframe.robot import convexity
from skillframe.robot.convexity import Hull

_CODE = (pieces, sections, convexity)
_LIBRARIES = ("manifold3d", "numpy", "scipy")


def pieces_of(solid: Any, allowed: float, most: int = pieces.MOST_PIECES) -> ConvexPieces:
    """`pieces.pieces_of`, from the cache if it was done before.

    Args:
        solid: a `manifold3d.Manifold` [m].
        allowed: error of what is thinned [m]; 0: nothing is thinned, and only what is exact is of use.
        most: pieces that are of use.
    """
    file = cache_dir("pieces") / f"{_key(solid, allowed, most)}.json"
    found = _read(file) if file.exists() else None
    if found is None:
        found = pieces.pieces_of(solid, allowed, most)
        write_whole(file, json.dumps(_plain(found)).encode())
    return found


def _key(solid: Any, allowed: float, most: int) -> str:
    whole = hashlib.sha256()
    for array in arrays_of(solid):
        whole.update(repr(array.shape).encode() + array.tobytes())
    whole.update(repr((float(allowed), most, [version(name) for name in _LIBRARIES])).encode())
    for module in _CODE:
        whole.update(Path(str(module.__file__)).read_bytes())
    return whole.hexdigest()[:32]


def _plain(found: ConvexPieces) -> dict[str, Any]:
    hulls = [[each.vertices.tolist(), each.faces.tolist(), each.planes.tolist(), each.volume] for each in found.hulls]
    return {"hulls": hulls, "error": found.error, "axis": found.axis, "thinned": found.thinned}


def _read(file: Path) -> ConvexPieces | None:
    """What a file holds, or None, with a warning, where it is damaged."""
    try:
        plain = json.loads(file.read_bytes())
        hulls = [
            Hull(_rows(vertices, 3), _rows(faces, 3, np.int64), _rows(planes, 4), float(volume))
            for vertices, faces, planes, volume in plain["hulls"]
        ]
        return ConvexPieces(hulls, float(plain["error"]), str(plain["axis"]), bool(plain["thinned"]))
    except (OSError, ValueError, KeyError, TypeError):
        warnings.warn(f"{file} was damaged, so the part was cut again", SkillframeWarning, stacklevel=2)
        return None


def _rows(values: Any, width: int, kind: Any = np.float64) -> Any:
    return np.array(values, dtype=kind).reshape(-1, width)
