"""The page of cuts in a real browser: a boundary is dragged, and the line that the page then says makes that cut."""

import json
import shlex
from itertools import pairwise

import pytest
from skillframe_reports.cuts import page as page_of

from skillframe.cli.main import run
from skillframe.extend.reading import write_demonstration
from tests.browser import BROWSER, Tab
from tests.figures import quasistatic as made

pytestmark = [pytest.mark.slow, pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")]
LINE, TOLD = "document.getElementById('line').textContent", "document.getElementById('told').textContent"
NAMES = ["one.npz", "two.npz", "three.npz"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three recordings of a wipe: three phases, two boundaries in each."""
    where = tmp_path_factory.mktemp("cuts")
    for name, each in zip(NAMES, made.demonstrations("wipe", 21), strict=True):
        write_demonstration(each.demonstration, where / name)
    return where


@pytest.fixture
def page(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert run(["segment", *NAMES, "--out", "p.json", "--page", "p.html"]) == 0
    return folder / "p.html"


def tab(page, tmp_path, **more):
    return Tab(page, tmp_path / "profile", **more)


def handle(recording, boundary):
    return f"#d{recording} .handle[aria-label^='boundary {boundary} ']"


def grip(window, recording, boundary, by=0.0, down=200.0):
    """Where a boundary's line is in the window, and a place beside it [px]."""
    x, y, width, _ = window.box(handle(recording, boundary))
    start = (x + 0.5 * width, y + down)
    return start, (start[0] + by, start[1])


def at(window, recording, boundary):
    return float(window.value(f'document.querySelector("{handle(recording, boundary)}").getAttribute("aria-valuenow")'))


def moves(window):
    words = shlex.split(window.value(LINE))
    return [b for a, b in pairwise(words) if a == "--set-boundary"]


def cuts_of(folder):
    return [row["boundaries"] for row in json.loads((folder / "p.json").read_text())["demonstrations"]]


def test_a_boundary_dragged_with_the_mouse_is_where_the_line_puts_it(page, folder, tmp_path):
    found = cuts_of(folder)
    with tab(page, tmp_path) as window:
        assert shlex.split(window.value(LINE)) == [
            "skillframe",
            "segment",
            *NAMES,
            "--out",
            "p.json",
            "--page",
            "p.html",
        ]
        (x, y), _ = grip(window, 2, 1)
        start, stop = (x + 6.0, y), (x + 46.0, y)  # beside the line: it must not jump to the pointer
        window.mouse("mousePressed", *start)
        window.mouse("mouseMoved", *stop)
        shown = window.value(f'document.querySelector("{handle(2, 1)} i").innerText')
        window.mouse("mouseReleased", *stop)
        there, line = at(window, 2, 1), window.value(LINE)
        width = window.box("#d2 .lanes")[2]
        first, last = window.value("(d => [d.recordings[1].first, d.recordings[1].last])"
                                   "(JSON.parse(document.getElementById('cuts').textContent))")  # fmt: skip
        assert there == pytest.approx(found[1][0] + 40.0 / width * (last - first), abs=0.011)
        assert shown == f"{there:.2f} s"
        assert moves(window) == [f"2:1={there:g}"]
        assert window.errors == []
        assert window.asked == [page.as_uri()]
    assert run(shlex.split(line)[1:]) == 0
    assert cuts_of(folder)[1] == [there, found[1][1]]
    with tab(page, tmp_path) as window:  # made anew by the line: what was moved is still moved, and goes back
        assert moves(window) == [f"2:1={there:g}"]
        window.value('document.querySelector("#d2 li.moved .back").click()')
        assert at(window, 2, 1) == pytest.approx(found[1][0], abs=0.005)
        assert moves(window) == []


def test_a_boundary_stops_a_phase_before_its_neighbours_and_the_ends_and_the_line_is_accepted(page, folder, tmp_path):
    with tab(page, tmp_path) as window:
        window.drag(*grip(window, 1, 1, by=900.0))
        second = at(window, 1, 2)
        assert at(window, 1, 1) == pytest.approx(second - 0.2, abs=0.011)
        assert at(window, 1, 1) <= second - 0.2 + 1e-9
        window.drag(*grip(window, 3, 1, by=-900.0))
        assert at(window, 3, 1) == 0.2
        line = window.value(LINE)
        assert len(moves(window)) == 2
    assert run(shlex.split(line)[1:]) == 0
    assert [cuts_of(folder)[0][0], cuts_of(folder)[2][0]] == [
        float(word.split("=")[1]) for word in line.split() if "=" in word
    ]


def test_keys_step_a_boundary_and_put_it_back_and_a_figure_can_be_typed(page, tmp_path):
    with tab(page, tmp_path, dark=True) as window:
        before = at(window, 1, 2)
        window.value(f'document.querySelector("{handle(1, 2)}").focus()')
        window.key("ArrowRight")
        window.key("ArrowRight", shift=True)
        assert at(window, 1, 2) == pytest.approx(before + 0.11, abs=0.0051)
        window.key("Home")
        assert at(window, 1, 2) == pytest.approx(at(window, 1, 1) + 0.2, abs=0.0101)
        window.key("Escape")
        assert (at(window, 1, 2), moves(window)) == (before, [])
        entry = 'document.querySelector("#d1 .boundaries input")'
        window.value(f"{entry}.value = '-5'; {entry}.dispatchEvent(new Event('change'))")
        assert moves(window) == ["1:1=0.2"]
        window.value("document.getElementById('reset').click()")
        assert moves(window) == []
        assert "Nothing is moved" in window.value(TOLD)


def test_on_a_phone_a_finger_drags_a_boundary_and_scrolls_the_page_beside_it(page, tmp_path):
    with tab(page, tmp_path, width=500, touch=True) as window:
        assert window.value("document.documentElement.scrollWidth - document.documentElement.clientWidth") <= 0
        before = at(window, 1, 1)
        window.swipe(*grip(window, 1, 1, by=30.0))
        assert at(window, 1, 1) > before
        assert moves(window) == [f"1:1={at(window, 1, 1):g}"]
        start, _ = grip(window, 2, 1)
        scrolled = window.value("scrollY")
        window.swipe(start, (start[0], start[1] - 150.0))
        assert window.value("new Promise(done => setTimeout(() => done(scrollY), 300))") > scrolled + 50.0
        assert len(moves(window)) == 1


def test_moving_one_boundary_of_a_recording_that_followed_holds_the_others_where_they_are_seen(page, folder, tmp_path):
    policy = json.loads((folder / "p.json").read_text())
    found = policy["demonstrations"][0]
    followed = {**found, "boundaries": [found["boundaries"][0] + 0.5, found["boundaries"][1]], "found": found}
    policy["demonstrations"][0] = followed
    demonstrations = [each.demonstration for each in made.demonstrations("wipe", 21)]
    (tmp_path / "f.html").write_text(page_of(policy, [], demonstrations, "skillframe segment"), encoding="utf-8")
    with tab(tmp_path / "f.html", tmp_path) as window:
        assert moves(window) == []
        window.value(f'document.querySelector("{handle(1, 2)}").focus()')
        window.key("PageDown")
        assert moves(window) == [f"1:1={at(window, 1, 1):g}", f"1:2={at(window, 1, 2):g}"]
        assert at(window, 1, 1) == pytest.approx(found["boundaries"][0] + 0.5, abs=0.005)
        window.key("Escape")
        assert moves(window) == []


def test_the_line_is_copied(page, tmp_path):
    with tab(page, tmp_path) as window:
        window.call("Page.bringToFront")
        x, y, width, height = window.box("#copy")
        window.drag((x + width / 2, y + height / 2), (x + width / 2, y + height / 2), steps=1)
        assert window.value(f"new Promise(done => setTimeout(() => done({TOLD}), 300))") == "Copied."
        window.value(
            "document.body.append(document.createElement('textarea')); document.querySelector('textarea').focus()"
        )
        window.call("Input.dispatchKeyEvent", type="keyDown", key="v", code="KeyV", modifiers=2, commands=["paste"])
        assert window.value("document.querySelector('textarea').value") == window.value(LINE)
