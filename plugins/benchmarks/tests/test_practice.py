"""From two meshes to a tried skill without a demonstration, and parts that cannot be practised."""

import json
import shutil

import numpy as np
import pytest
import trimesh
from skillframe_benchmarks.command import agree
from skillframe_benchmarks.practice import Practice

from skillframe import LearnedSkill
from skillframe.cli.main import run
from skillframe.errors import InputError
from tests.part_meshes import box, export, rod, round_pair


def practise(folder, *more, plug="plug.stl", socket="socket.stl"):
    return run(["practise", str(folder / plug), str(folder / socket), "--out", str(folder / "out"), *more])


@pytest.fixture
def meshes(tmp_path):
    plug, socket = round_pair(play=0.3)
    export(plug, tmp_path / "plug.stl")
    export(socket, tmp_path / "socket.stl")
    return tmp_path


def test_a_folder_that_was_begun_with_other_errors_is_refused(tmp_path):
    asked = Practice(files="plug.stl 1")
    agree(tmp_path, asked)
    agree(tmp_path, asked)
    with pytest.raises(InputError, match=r"shift = 0\.002"):
        agree(tmp_path, Practice(files="plug.stl 1", shift=0.001))


def test_parts_that_overlap_or_cannot_come_apart_and_open_meshes_are_refused(meshes, capsys):
    def refused(plug, words):
        export(plug, meshes / "plug.stl")
        assert practise(meshes, "--units", "mm") == 2
        assert words in capsys.readouterr().err
        assert not (meshes / "out" / "fixture.toml").exists()

    refused(rod(6.0, -12.0, 8.0), "overlap by")
    export(box((-15.0, -15.0, -15.0), (15.0, 15.0, 15.0)) - rod(8.0, -8.0, 8.0), meshes / "socket.stl")
    refused(rod(7.0, -7.0, 7.0), "cannot leave")
    trimesh.Trimesh([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], [[0, 1, 2], [0, 1, 3]]).export(meshes / "plug.stl")
    assert practise(meshes, "--units", "mm") == 2
    assert "plug.stl" in capsys.readouterr().err


def test_missing_units_and_two_meshes_of_one_name_are_refused(meshes, capsys):
    assert practise(meshes) == 2
    assert "--units" in capsys.readouterr().err
    (meshes / "other").mkdir()
    shutil.copy(meshes / "plug.stl", meshes / "other" / "plug.stl")
    assert practise(meshes, "--units", "mm", socket="other/plug.stl") == 2
    assert "rename one" in capsys.readouterr().err


@pytest.mark.slow
def test_two_meshes_become_a_skill_that_seats_them_and_a_second_call_makes_nothing_again(meshes, capsys):
    line = ("--units", "mm", "--shift", "0.3mm", "--tilt", "1deg", "--trials", "2", "--seed", "3")
    assert practise(meshes, *line) == 0
    said = capsys.readouterr().out
    assert "2 of 2 trials are seated" in said and "certify.toml" in said
    out = meshes / "out"
    seat = LearnedSkill.load(out / "seat.skill.json").document["seat"]
    # the pin stands 12 mm deep in its hole; removal: the arm's own accuracy
    np.testing.assert_allclose(seat["end"], [0.5, 0.0, 0.2 - 0.012], atol=1e-4)
    assert seat["contact_m"] == pytest.approx(0.013, abs=2e-4) and seat["shift_m"] == pytest.approx(0.0003)
    made = {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")}
    assert {path.name for path in made} >= {"removal.npz"}
    assert practise(meshes, *line, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["successes"], found["trials"]) == (2, 2) and found["interval_95"][0] < 1.0
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")} == made
    assert practise(meshes, *line[:-1], "4") == 2  # another seed
    export(rod(4.0, -12.0, 8.0), meshes / "plug.stl")
    assert practise(meshes, *line) == 2
    assert "is not a mesh of" in capsys.readouterr().err
