"""Triangulates a STEP part (ISO 10303-21).

Open CASCADE does it, through cascadio, in its own process, which isolates output and crashes. Input has its own unit,
Open CASCADE counts deflections in millimetres, the result is in metres.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from skillframe.errors import InputError, need

ENDINGS = (".step", ".stp")
TOLERANCE = 5e-6
"""Largest distance of the triangles from the drawn surface [m], a quarter of a play of 0.02 mm."""
LONGEST = 120.0
"""Time limit [s]."""
_CODE = """\
import sys
from cascadio import step_to_glb
sys.exit(step_to_glb(sys.argv[1], sys.argv[2], tol_linear=float(sys.argv[3]), tol_angular=float(sys.argv[4])))
"""


def as_glb(raw: bytes, path: Path) -> bytes:
    """The triangles of a STEP file as a GLB [m]. `path` is for messages.

    Raises:
        MissingDependency: the extra `step` is not installed.
        InputError: it cannot be read, or takes too long.
    """
    need("cascadio")
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder, "part.step"), Path(folder, "part.glb")
        given.write_bytes(raw)
        turn = "0.2"  # largest angle between neighbouring triangles of a curve [rad]: at least 31 sides a turn
        command = [sys.executable, "-P", "-c", _CODE, str(given), str(made), f"{1000.0 * TOLERANCE}", turn]
        try:
            ended = subprocess.run(command, capture_output=True, timeout=LONGEST, check=False).returncode
        except subprocess.TimeoutExpired:
            what = f"takes longer than {LONGEST:g} s to be cut into triangles within {1e6 * TOLERANCE:g} um"
            raise InputError(path, what, "leave out what does not touch, or export it as STL") from None
        if ended or not made.is_file():
            raise InputError(path, "cannot be read as STEP", "export it again, or as STL")
        return made.read_bytes()
