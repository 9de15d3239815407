"""Cache of convex pieces by mesh, error, code and library versions, because cutting takes seconds.

Damaged entries are made again.
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
from skillframe.files import cache_dir, write_whole
from skillframe.robot import Hull, meshes
from skillframe_parts import pieces, sections
from skillframe_parts.pieces import ConvexPieces
from skillframe_parts.solid import arrays_of

_CODE = (pieces, sections, meshes)
_LIBRARIES = ("manifold3d", "numpy", "scipy")


def pieces_of(solid: Any, allowed: float, most: int = pieces.MOST_PIECES) -> ConvexPieces:
    """`pieces.pieces_of`, from the cache if possible."""
    file = cache_dir("pieces") / f"{_key(solid, allowed, most)}.json"
    if file.exists():
        try:
            plain = json.loads(file.read_bytes())
            hulls = [
                Hull(_rows(vertices, 3), _rows(faces, 3, np.int64), _rows(planes, 4), float(volume))
                for vertices, faces, planes, volume in plain["hulls"]
            ]
            return ConvexPieces(hulls, float(plain["error"]), str(plain["axis"]), bool(plain["thinned"]))
        except (OSError, ValueError, KeyError, TypeError):
            warnings.warn(f"{file} was damaged, so the part was cut again", SkillframeWarning, stacklevel=1)
    found = pieces.pieces_of(solid, allowed, most)
    rows = [[h.vertices.tolist(), h.faces.tolist(), h.planes.tolist(), h.volume] for h in found.hulls]
    plain = {"hulls": rows, "error": found.error, "axis": found.axis, "thinned": found.thinned}
    write_whole(file, json.dumps(plain).encode())
    return found


def _key(solid: Any, allowed: float, most: int) -> str:
    whole = hashlib.sha256()
    for array in arrays_of(solid):
        whole.update(repr(array.shape).encode() + array.tobytes())
    whole.update(repr((float(allowed), most, [version(name) for name in _LIBRARIES])).encode())
    for module in _CODE:
        whole.update(Path(str(module.__file__)).read_bytes())
    return whole.hexdigest()[:32]


def _rows(values: Any, width: int, kind: Any = np.float64) -> Any:
    return np.array(values, dtype=kind).reshape(-1, width)
