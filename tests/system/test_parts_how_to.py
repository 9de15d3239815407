"""docs/how-to/own-parts.md: its file is read, its plug is what it says, and two meshes become a certified skill."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold
from skillframe_parts.declared import DENSITY, read_fixture
from skillframe_parts.found import lines
from skillframe_parts.load import load
from skillframe_parts.second_declared import SecondPart
from skillframe_parts.solid import arrays_of

from skillframe import Campaign, learn, record, run
from skillframe.cli.main import run as typed
from tests import part_meshes

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "how-to" / "own-parts.md").read_text(encoding="utf-8")
UNSAID = ("pose", "density")
"""Keys of a second part that are told by their name, or as of the main parts."""
BLOCKS = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)


def chamfered(low, high, chamfer):
    """A box whose lower end is smaller by a chamfer all round."""
    smaller = part_meshes.box(
        (low[0] + chamfer, low[1] + chamfer, low[2]), (high[0] - chamfer, high[1] - chamfer, high[2])
    )
    shorter = part_meshes.box((low[0], low[1], low[2] + chamfer), high)
    return Manifold.hull_points(np.concatenate([arrays_of(solid)[0] for solid in (smaller, shorter)]))


def plug_and_socket(play=0.15):
    """The page's plug: 20 x 8 mm, 12 mm deep, with a key on its long side, and a socket with play all round."""
    plug = chamfered((-10, -4, -12), (10, 4, 18), 1.0) + chamfered((-2, 3.75, -10), (2, 6.25, 5), 0.5)
    way = part_meshes.box((-10 - play, -4 - play, -12), (10 + play, 4 + play, 1))
    way += part_meshes.box((-2 - play, 3.75 - play, -11), (2 + play, 6.25 + play, 1))
    return plug, part_meshes.box((-20, -15, -17), (20, 15, 0)) - way


@pytest.fixture
def parts(tmp_path):
    return part_meshes.write(tmp_path, *plug_and_socket())


def test_the_pages_file_is_read_and_says_the_defaults(parts):
    shortest = read_fixture(parts)
    parts.write_text(BLOCKS[0], encoding="utf-8")
    shown = read_fixture(parts)
    assert shown.tool.density == DENSITY and shortest.tool.density is None
    assert (shown.fixture, shown.contact) == (shortest.fixture, shortest.contact)
    assert shown.task.start == shortest.task.start and shown.task.seated == shortest.task.seated
    assert shown.task.demonstration.tilt == pytest.approx(shortest.task.demonstration.tilt)


def test_the_pages_second_part_is_read_and_says_the_defaults(parts):
    block = next(block for block in BLOCKS if block.startswith("[[second]]"))
    part_meshes.export(part_meshes.box((0, 0, 0), (1, 1, 1)), parts.parent / "latch.stl")
    parts.write_text(part_meshes.FILE + block, encoding="utf-8")
    (shown,) = read_fixture(parts).second
    (usual,) = (field.default for field in dataclasses.fields(SecondPart) if field.name == "anchor")
    assert (shown.joint, shown.mass, shown.goal, shown.anchor) == ("slide", 0.02, (0.0, 3e-4), usual)
    assert all(f"{field.name} = " in block for field in dataclasses.fields(SecondPart) if field.name not in UNSAID)


def test_the_page_says_what_is_found_in_its_plug(parts):
    assert all(line in PAGE for line in lines(load(parts)))


@pytest.mark.slow
@pytest.mark.needs_plugins
@pytest.mark.filterwarnings("ignore:.*spikes")  # a plug that glances off the rim moves on, and counts as damage
def test_two_meshes_become_a_skill_that_seats_the_part(parts, tmp_path):
    skill = learn(record(parts, count=2, seed=1).save(tmp_path / "demo.npz"))
    once = run(skill, parts, coc="tip", set={"fixture.tilt_y": "1deg"})
    assert once.success
    vary = {"fixture.offset_x": {"uniform": [-3e-4, 3e-4]}, "fixture.tilt_y": {"uniform": [-0.0175, 0.0175]}}
    folder = tmp_path / "results"
    Campaign(world=parts, skills=skill, coc="tip", trials=4, vary=vary, duration_s=15.0).run(folder, traces=1)
    assert (folder / "results.csv").read_text().count("\n") == 1 + 4
    copied = folder / "worlds" / parts.parent.name
    assert sorted(each.name for each in copied.iterdir()) == ["fixture.toml", "plug.stl", "socket.stl"]
    for name in ("fixture.toml", "plug.stl", "socket.stl"):
        (parts.parent / name).unlink()  # the folder needs nothing else
    assert typed(["campaign", "replay", str(folder), "2"]) == 0
