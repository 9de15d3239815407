"""A file of one kind that is given in place of another is named for what it is."""

import pytest

from skillframe.files.documents import COMMANDS, kind_of

FILES = {
    "skill": ("a.skill.json", '{"format": "skillframe.skill", "version": 1}'),
    "campaign": ("c.toml", 'name = "c"\nseed = 1\ntrials = 4\nskills = ["a.skill.json"]\n'),
    "task": ("t.toml", 'name = "t"\nworld = "valley"\nteacher = 2\n'),
    "fixture": ("f.toml", '[fixture]\nmesh = "a.stl"\n[tool]\nmesh = "b.stl"\n'),
    "robot": ("r.toml", 'urdf = "r.urdf"\n'),
}
WANT = {
    "skill": ["show", "{}"], "campaign": ["campaign", "run", "{}", "--out", "o"],
    "fixture": ["worlds", "{}"], "robot": ["robots", "--check", "{}"],
    "demonstration": ["check", "{}"],
}  # fmt: skip


@pytest.mark.parametrize("given", FILES)
def test_a_file_in_the_place_of_another_is_named_with_the_command_that_takes_it(given, tmp_path, monkeypatch, capsys):
    from skillframe.cli.main import run

    name, text = FILES[given]
    (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    assert kind_of(tmp_path / name) == given
    for wanted, command in WANT.items():
        if wanted == given:
            continue
        assert run([word.format(name) for word in command]) == 2
        said = capsys.readouterr().err
        assert f"{name}: is a {given} file, and a {wanted} is wanted here" in said, (wanted, said)
        assert COMMANDS[given].format(name) in said


def test_what_cannot_be_read_and_what_is_of_no_kind_is_left_to_its_reader(tmp_path):
    for name, content in {"a.toml": b"\xff", "b.toml": b"x = ", "c.json": b"[1]", "d.toml": b"x = 1"}.items():
        (tmp_path / name).write_bytes(content)
        assert kind_of(tmp_path / name) == ""
    assert kind_of(tmp_path / "none.toml") == kind_of(tmp_path) == ""
