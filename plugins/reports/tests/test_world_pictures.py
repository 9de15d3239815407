"""`skillframe worlds --pictures FOLDER` draws worlds."""

import pytest
from PIL import Image

from skillframe.cli.main import run
from skillframe.extend.registry import registry


def colours(path):
    """Number of pixels of each colour of a picture."""
    with Image.open(path) as picture:
        return {colour: count for count, colour in picture.convert("RGB").getcolors(1 << 20)}


@pytest.mark.slow
def test_one_world_is_drawn_beside_its_listing_with_tool_and_fixture(tmp_path, capsys):
    assert run(["worlds", "peg_in_hole", "--pictures", str(tmp_path / "new")]) == 0
    assert capsys.readouterr().out.startswith("peg_in_hole (skillframe-worlds)")
    (picture,) = (tmp_path / "new").iterdir()
    assert picture.name == "peg_in_hole.png"
    assert sum(r > b + 60 for r, _, b in colours(picture)) > 10  # the orange tool, shaded
    assert run(["worlds", "--settings", "--pictures", str(tmp_path / "none")]) == 2
    assert "give one of the two" in capsys.readouterr().err and not (tmp_path / "none").exists()


@pytest.mark.slow
def test_every_world_has_a_picture_of_its_own(tmp_path):
    assert run(["worlds", "--pictures", str(tmp_path)]) == 0
    pictures = {path.stem: path.read_bytes() for path in tmp_path.iterdir()}
    assert pictures.keys() == {record.name for record in registry().records("world")}
    assert len(set(pictures.values())) == len(pictures)
