"""Assemblies of a benchmark's folder that nothing holds along a direction, and what that leaves to be reached.

    python -m tests.figures.unheld automate [00444 ...]

A part that slides freely along a direction both ways tells nobody where it belongs along it. The best guess is the
place that was shown, and the fixture stands farther from it than what counts as seated in some draws, however good the
skill is. For each such assembly: the direction, how far it slides, and of the draws of the benchmark those in which a
part that is held everywhere else, and stands where it was shown along that direction, is seated.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from skillframe_benchmarks.assembly import DONE, TRIALS, by_level
from skillframe_parts.declared import read_fixture
from skillframe_parts.fit import PartsFit, fit
from skillframe_parts.free_direction import free_direction
from skillframe_parts.solid import read_part

from skillframe.errors import InputError
from skillframe.frames import Float, rotation_matrix


def reached(rows: Sequence[Mapping[str, Any]], parts: PartsFit, along: Float, within: float) -> list[bool]:
    """Whether the place of each row's draw lies so near [m] to the shown one along a direction (3,)."""
    end = np.array([0.0, 0.0, -parts.depth])
    found = []
    for row in rows:
        turn = rotation_matrix(np.array([row[f"fixture.tilt_{axis}"] for axis in "xyz"]))
        place = np.array([row["fixture.offset_x"], row["fixture.offset_y"], 0.0]) + turn @ end
        found.append(abs(float((place - end) @ along)) < within)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("assemblies", nargs="*")
    given = parser.parse_args()
    for path in sorted(given.folder.glob("*/fixture.toml")):
        if given.assemblies and path.parent.name not in given.assemblies:
            continue
        try:
            file = read_fixture(path)
            sides = ((file.tool, True), (file.fixture, False))
            parts = fit(*(read_part(path.parent / each.mesh, each.units, held=held) for each, held in sides), file)
        except InputError as error:
            print(f"{path.parent.name}: {error}", flush=True)
            continue
        within = file.task.seated.sideways
        if (along := free_direction(parts, within)) is None:
            continue
        said = f"{path.parent.name}: slides both ways along {np.round(along, 2).tolist()}"
        plan = json.loads((path.parent / DONE).read_text(encoding="utf-8"))
        for level, rows in by_level(path.parent / TRIALS, plan["levels"], plan["trials"]).items():
            draws = {row["trial"]: row for row in rows}  # the same for every method
            near = reached([*draws.values()], parts, along, within)
            said += f"; {level}: {sum(near)} of {len(near)} can be seated"
        print(said, flush=True)


if __name__ == "__main__":
    main()
