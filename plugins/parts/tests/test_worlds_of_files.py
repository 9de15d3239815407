"""`worlds new`, `check`, `show --pictures` on a user's own parts, and a campaign's copy of them."""

import json

import pytest

from skillframe.campaign.folder import _copy_world
from skillframe.campaign.spec import CampaignSpec
from skillframe.cli.main import run
from tests.part_meshes import export, round_pair, write


def meshes(folder):
    plug, socket = round_pair()
    folder.mkdir(exist_ok=True)
    export(plug, folder / "plug.stl")
    export(socket, folder / "socket.stl")
    return [str(folder / "plug.stl"), str(folder / "socket.stl")]


def test_new_writes_a_file_and_says_what_was_found(tmp_path, capsys):
    out = tmp_path / "fixture.toml"
    assert run(["worlds", "new", *meshes(tmp_path), "--units", "mm", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "plug.stl goes 12 mm deep into socket.stl and comes out along (0, 0, 1)" in said
    assert "contact error" in said and "1 of plug.stl, 13 of socket.stl" in said
    assert run(["worlds", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["parts"]
    assert abs(found["depth_m"] - 0.012) < 1e-9 and found["pieces"] == {"tool": 1, "fixture": 13}
    assert run(["worlds", "new", *meshes(tmp_path), "--units", "mm", "--out", str(out)]) == 2
    assert "exists" in capsys.readouterr().err


def test_new_leaves_no_file_of_parts_that_are_refused(tmp_path, capsys):
    out = tmp_path / "fixture.toml"
    for words, said in (([], "units"), (["--units", "m"], 'say units = "mm"'), (["--units", "mile"], "mile")):
        assert run(["worlds", "new", *meshes(tmp_path), *words, "--out", str(out)]) == 2
        assert said in capsys.readouterr().err and not out.exists()
    inside = tmp_path / "other"
    inside.mkdir()
    assert run(["worlds", "new", *meshes(tmp_path), "--units", "mm", "--out", str(inside / "f.toml")]) == 2
    assert "into one folder" in capsys.readouterr().err


@pytest.mark.slow
def test_show_draws_the_parts(tmp_path, capsys):
    path = write(tmp_path / "pin", *round_pair())
    picture = tmp_path / "drawn" / "pin.png"
    assert run(["worlds", str(path), "--pictures", str(tmp_path / "drawn")]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"pin ({path})") and "inserted 12 mm is all the way" in said
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 5000


def test_a_file_that_is_not_there_is_a_sentence(tmp_path, capsys):
    for words in (["worlds"], ["worlds", "--settings"]):
        assert run([*words, str(tmp_path / "none.toml")]) == 2
        assert "no such file" in capsys.readouterr().err


def test_a_campaigns_folder_holds_file_and_meshes(tmp_path):
    path = write(tmp_path / "pin", *round_pair())
    table = {"seed": 1, "trials": 4, "robot": "panda", "world": "pin/fixture.toml", "skills": ["a.skill.json"]}
    (tmp_path / "a.skill.json").write_text("{}")
    spec = CampaignSpec.from_table(table, tmp_path / "plan.toml")
    assert spec.world_name == "pin" and spec.world_place == str(path)
    target = tmp_path / "out"
    assert _copy_world(spec, target) == "worlds/pin/fixture.toml"
    for name in ("fixture.toml", "plug.stl", "socket.stl"):
        assert (target / "worlds" / "pin" / name).read_bytes() == (path.parent / name).read_bytes()
