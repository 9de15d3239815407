"""The scripts of `examples/` run, say what they found, and leave a picture; the gallery has a page for each."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import skillframe

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
SAYS = {
    "blind_search": r"found after \d+\.\d s, at most \d+ N",
    "campaign_map": r"peg.skill.json: (\d+) of 16, rate 0\.[5-9]",
    "compare": r"LMC.skill.json: [6-8] of 8[^$]*replay.skill.json: [0-2] of 8",
    "crane_corner": r"wood: success after \d",
    "hose_coupler": r"about the tip: 2 of 2 starts",
    "long_recording": r"phase 2: .*turn about \+z[^$]*success",
    "own_fmu": r"10 ms: largest error 0\.\d+ mm/s",
    "own_robot": r"usable: True[^$]*success after",
    "peg_in_hole": r"learned: push along -z[^$]*success after",
    "two_arms": r"success after[^$]*the right hand went \d+ mm",
}
"""What each has to have found; the skills are not tuned to it, these are what the pages of the tutorial promise too."""


@pytest.mark.slow
@pytest.mark.needs_plugins
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda p: p.stem)
@pytest.mark.figures
def test_an_example_runs_says_what_it_found_and_draws_it(script, tmp_path):
    command = [sys.executable, "-W", "ignore::UserWarning", script, "--quick", "--out", tmp_path]
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, env=environment, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    assert re.search(SAYS[script.stem], done.stdout), done.stdout
    assert [path.name for path in tmp_path.glob("*.png")] == [f"{script.stem}.png"]
    pixels = np.asarray(Image.open(tmp_path / f"{script.stem}.png").convert("RGB"))
    assert pixels.shape[1] >= 600
    assert 0.002 < np.mean(pixels.min(axis=-1) < 128) < 0.5  # there is ink: neither an empty sheet nor a black one


def test_there_are_ten_examples_of_30_to_80_lines_with_a_title_and_a_word_of_explanation():
    assert len(SCRIPTS) == 10
    assert set(SAYS) == {script.stem for script in SCRIPTS}
    lengths = {script.name: len(script.read_text().splitlines()) for script in SCRIPTS}
    assert not {name: count for name, count in lengths.items() if not 30 <= count <= 80}
    assert all(len(each.title) < 100 and len(each.text) > 100 for each in gallery().examples(ROOT / "examples"))


TEN_LINES = re.search(r"```python\n(.*?)```", (ROOT / "docs" / "reference" / "api.md").read_text(), re.DOTALL)[1]


def test_the_ten_lines_of_the_api_page_are_those_of_the_package_s_docstring():
    indented = [line for line in skillframe.__doc__.splitlines() if line.startswith("    ") or not line]
    assert "".join(f"{line[4:]}\n" for line in indented).strip() == TEN_LINES.strip()
    assert len(TEN_LINES.split("\n\n")[1].splitlines()) <= 10


@pytest.mark.slow
@pytest.mark.needs_plugins
def test_the_ten_lines_of_the_api_page_run_as_a_script(tmp_path):
    few = TEN_LINES.replace("vary=tilted", "vary=tilted, trials=2, duration_s=4.0")
    (tmp_path / "ten.py").write_text(few)
    command = [sys.executable, "-W", "ignore::UserWarning", "ten.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    assert "push along -z" in done.stdout
    assert "SingleRun(peg by panda in peg_in_hole: success" in done.stdout
    assert "peg.skill.json: " in done.stdout
    assert (tmp_path / "peg.html").stat().st_size > 100_000


def gallery():
    """The extension of the docs."""
    found = importlib.util.spec_from_file_location("gallery", ROOT / "docs" / "_extensions" / "gallery.py")
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_the_gallery_shows_a_picture_and_what_was_printed_where_they_are_and_says_where_they_are_not(tmp_path):
    module = gallery()
    (first, second, *_) = module.examples(ROOT / "examples")
    (tmp_path / f"{first.name}.png").write_bytes(b"")
    (tmp_path / f"{first.name}.txt").write_text("42 of 43\n")
    drawn, bare = module.page(first, tmp_path), module.page(second, tmp_path)
    assert f"pictures/{first.name}.png" in drawn
    assert "42 of 43" in drawn
    assert "make gallery" in bare
    assert "pictures" not in bare
    page = module.overview([first, second], tmp_path)
    assert page.count(".. figure::") == 1
    assert all(f"<{each.name}>" in page for each in (first, second))
