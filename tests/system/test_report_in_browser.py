"""The report as people see it: in a real browser, without console errors, with a replay that moves."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from skillframe_reports.page import write_report

from skillframe.cli.main import run
from tests.report_fakes import campaign, trace

BROWSER = next((b for b in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if b), None)
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
         "--disable-background-networking", "--disable-component-update", "--enable-unsafe-swiftshader",
         "--enable-logging=stderr", "--virtual-time-budget=8000", "--dump-dom"]  # fmt: skip
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")

PROBE = """
<script>
window.addEventListener("load", () => setTimeout(() => {
  const viewer = document.querySelector(".viewer"), canvas = viewer.querySelector("canvas");
  const slider = viewer.querySelector(".slider"), cursor = document.querySelector("svg.time .cursor");
  const state = () => ({ picture: canvas.toDataURL(), clock: viewer.querySelector(".clock").textContent,
    readout: viewer.querySelector(".readout").textContent, cursor: cursor.getAttribute("transform") });
  const seek = (value) => { slider.value = value; slider.dispatchEvent(new Event("input")); return state(); };
  const click = (name) => { viewer.querySelector(name).click(); return state(); };
  const result = { first: seek(0), middle: seek(slider.max / 2), again: seek(0),
    uncut: click(".cut"), far: click(".far"),
    wide: document.documentElement.scrollWidth - document.documentElement.clientWidth };
  const block = document.createElement("pre");
  block.id = "probe"; block.textContent = JSON.stringify(result); document.body.append(block);
}, 1500));
</script>
"""


def opened(page, tmp_path, *more):
    """The DOM after a while, and what the browser logged as errors."""
    command = [BROWSER, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", *more, page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    lines = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return done.stdout, [line for line in lines if "GL Driver Message" not in line]  # the software renderer's chatter


def probed(page, tmp_path, *more):
    page.write_text(page.read_text(encoding="utf-8").replace("</body>", PROBE + "</body>"), encoding="utf-8")
    dom, errors = opened(page, tmp_path, *more)
    found = re.search(r'<pre id="probe">(.*?)</pre>', dom, re.S)
    assert found, f"the page's script did not end: {errors}"
    return json.loads(found[1].replace("&gt;", ">").replace("&amp;", "&")), errors


@pytest.mark.slow
@needs_browser
def test_the_slider_moves_the_scene_the_clock_and_the_cursors_of_the_plots(tmp_path):
    write_report([campaign(tmp_path / "peg")], tmp_path / "r.html")
    state, errors = probed(tmp_path / "r.html", tmp_path, "--window-size=1280,900")
    assert errors == []
    first, middle = state["first"], state["middle"]
    assert first["picture"] != middle["picture"]
    assert (first["clock"], middle["clock"]) == ("0.00 s", "2.00 s")
    assert first["cursor"] != middle["cursor"]
    assert state["again"] == first
    assert len({first["picture"], state["uncut"]["picture"], state["far"]["picture"]}) == 3


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("width", [500, 1280])
def test_the_page_never_scrolls_sideways(tmp_path, width):
    write_report([campaign(tmp_path / "peg")], tmp_path / "r.html")
    state, errors = probed(tmp_path / "r.html", tmp_path, f"--window-size={width},900")
    assert errors == []
    assert state["wide"] <= 0


@pytest.mark.slow
@needs_browser
def test_a_browser_without_webgl_says_so_and_shows_the_rest(tmp_path):
    write_report([campaign(tmp_path / "peg")], tmp_path / "r.html")
    dom, _ = opened(tmp_path / "r.html", tmp_path, "--disable-3d-apis")
    assert "This browser has no WebGL" in dom


@pytest.mark.slow
def test_a_report_with_stills_needs_neither_opengl_nor_the_simulator(tmp_path):
    trace().save(tmp_path / "run.npz")
    code = (
        "import sys; from pathlib import Path; from skillframe_reports.page import write_report;"
        f"write_report([Path({str(tmp_path / 'run.npz')!r})], Path({str(tmp_path / 'r.html')!r}));"
        "print(sorted({'mujoco', 'OpenGL', 'pinocchio', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, "MUJOCO_GL": "disable"}
    )
    assert done.stdout.strip() == "[]", done.stderr
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64,") == 4
    assert "without OpenGL, as a shaded wireframe" in page


@pytest.mark.slow
def test_the_command_writes_the_file_and_says_where(tmp_path, monkeypatch, capsys):
    trace().save(tmp_path / "run.npz")
    monkeypatch.chdir(tmp_path)
    assert run(["report", "run.npz", "--out", "r.html"]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("r.html (") and said.err == ""
    assert run(["report", "nothing.npz", "--out", "r2.html"]) == 2
    assert "no such file" in capsys.readouterr().err
    assert not (tmp_path / "r2.html").exists()
