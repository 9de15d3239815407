"""What README.md shows one by one is typed, in a folder that holds nothing but the checkout's docs."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from skillframe.cli.main import run
from skillframe.files import data_dirs

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "README.md").read_text(encoding="utf-8")
PYTHON = PAGE.partition("```python\n")[2].partition("```")[0]
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
    campaign = tmp_path / "docs" / "tutorial" / "peg.toml"
    text = campaign.read_text(encoding="utf-8")
    assert text.count("trials = 96") == 1  # the steps are what is tried here; 8 trials take a twelfth of the time
    campaign.write_text(text.replace("trials = 96", "trials = 8"), encoding="utf-8")
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


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_the_readme_s_python_inserts_the_peg_and_is_about_ten_lines(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert PYTHON.count("trials=40") == 1  # the lines are what is tried here; 4 trials take a tenth of the time
    exec(compile(PYTHON.replace("trials=40", "trials=4"), "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert "SingleRun(peg by panda in peg_in_hole: success" in said and "4 of 4" in said.splitlines()[-1]
    assert len([line for line in PYTHON.splitlines() if line.strip()]) <= 11


def test_the_readme_opens_with_a_moving_picture_that_is_text_and_small():
    first = re.search(r"!\[[^]]*\]\(([^)]+)\)", PAGE)
    picture = (ROOT / first.group(1)).read_text(encoding="utf-8")
    assert PAGE.index(first.group(0)) < PAGE.index("## ")
    assert len(picture) < 300_000
    drawn = re.findall(r'<g class="[fz]"[^>]*>(.*)</g>', picture)
    assert "@keyframes" in picture and len(set(drawn)) == len(drawn) > 20
    assert not re.search(r"(href|url|src)\s*[=(]|<script", picture), (
        "a code host shows it as an image, without a network"
    )


def test_every_figure_of_the_readme_s_table_stands_in_its_evidence():
    evidence = (ROOT / "docs" / "evidence" / "baselines.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (valley|peg in hole|hose coupler)[^|]*\|(.+)\|$", PAGE, re.MULTILINE)
    assert len(rows) == 3
    for world, figures in rows:
        for skill, count in zip(("lmc", "replay", "dmp", "gmr", "seds"), figures.split("|"), strict=True):
            name = world.replace(" ", "_")
            assert re.search(rf"^{name} +{skill} +\d+/12 +{int(count)}/40 ", evidence, re.MULTILINE), (world, skill)
