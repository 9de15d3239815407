"""What README.md shows one by one is typed, in a folder that holds nothing but the checkout's docs."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from skillframe.cli.main import run
from skillframe.paths import data_dirs

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "README.md").read_text(encoding="utf-8")
STEPS = PAGE.partition("## One by one")[2].partition("```\n")[2].partition("```")[0].splitlines()


def test_every_file_that_the_readme_s_steps_read_is_made_or_shipped_before():
    made: set[str] = set()
    for step in STEPS:
        words = shlex.split(step, comments=True)
        if words[0] == "cp":
            assert (ROOT / words[1]).is_file()
            made.add(Path(words[1]).name)
        outs = [words[i + 1] for i, word in enumerate(words) if word in ("--out", "--video")]
        read = [w for w in words[2:] if re.fullmatch(r"[\w.]+\.(npz|json|toml)", w) and w not in outs]
        assert not [name for name in read if name not in made], step
        made |= {out.replace(".npz", f"{i}.npz") for out in outs for i in (1, 2)} | set(outs)


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_the_readme_s_steps_can_be_typed_one_by_one(tmp_path, monkeypatch):
    shutil.copytree(ROOT / "docs" / "tutorial", tmp_path / "docs" / "tutorial")
    assert data_dirs("robots"), "robots ship with the package and not with the folder"
    monkeypatch.chdir(tmp_path)
    typed = [shlex.split(step, comments=True) for step in STEPS]
    assert typed[0] == ["source", ".venv/bin/activate"]
    for words in typed[1:]:
        if words[0] == "cp":
            shutil.copy(words[1], words[2])
        else:
            assert words[0] == "skillframe" and run(words[1:]) == 0, words
    assert all((tmp_path / name).is_file() for name in ("run.mp4", "peg.crisp.yaml", "report.html"))
