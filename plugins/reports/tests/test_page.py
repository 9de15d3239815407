import html
import json
import re
import shutil

import numpy as np
import pytest
from skillframe_reports import learned, runs
from skillframe_reports.learned import skill_block
from skillframe_reports.page import MOST_BYTES, render, write_report
from skillframe_reports.sources import read_chapters

from skillframe.cli.main import run
from skillframe.errors import InputError
from skillframe.extend import Illustration, SkillType
from tests.report_fakes import campaign, skill_document, trace

EVIL = "<script>alert('x')</script>\"'><img src=x onerror=alert(1)>"
OUTSIDE = re.compile(
    r"""(?:\b(?:src|href|srcset|action|poster)\s*=\s*|url\(\s*|@import\s+)["']?(?!["']|data:|#)[^\s>]{0,40}"""
)


@pytest.fixture(autouse=True)
def small_stills(monkeypatch):
    """The stills' size is no matter here, their cost is."""
    monkeypatch.setattr(runs, "STILL_WIDTH", 56)
    monkeypatch.setattr(runs, "STILL_HEIGHT", 42)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return campaign(tmp_path_factory.mktemp("report") / "peg")


@pytest.fixture
def copy(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "peg")
    return tmp_path / "peg"


def page(*paths):
    return render(read_chapters(paths))


@pytest.mark.slow
def test_a_campaign_gives_every_section(folder):
    text = page(folder)
    for word in ("What was learned", "The run", "Where it works", "What went wrong", "How hard it pushed", "SHA-256"):
        assert word in text


def test_the_page_reaches_for_nothing_outside_and_forbids_it(folder):
    text = page(folder)
    assert OUTSIDE.findall(text) == []
    assert not re.search(r"https?://", text)
    assert "default-src &#x27;none&#x27;" in text


def test_the_page_says_which_bodies_nobody_looked_at(copy):
    shutil.rmtree(copy / "traces")  # stills are no matter here
    assert not any("bodies" in text.lower() for text in read_chapters([copy])[0].notes)
    summary = json.loads((copy / "summary.json").read_text())
    said = 'bodies that could touch without ending a trial, by [collisions] ignore of r: <b> with "c"'
    (copy / "summary.json").write_text(json.dumps({**summary, "unwatched": said}))
    assert html.escape(f"B{said[1:]}.") in page(copy)


@pytest.mark.slow
def test_the_same_files_give_the_same_bytes_well_below_the_limit(folder, tmp_path):
    sizes = [write_report([folder], tmp_path / name) for name in ("a.html", "b.html")]
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert sizes[0] < MOST_BYTES / 5


def test_text_from_files_stays_text(tmp_path):
    made = campaign(tmp_path / "peg", failure=EVIL)
    spec = (made / "campaign.toml").read_text().replace("peg, fixture tilted and moved", "<script>alert(2)</script>")
    (made / "campaign.toml").write_text(spec)
    document = {**skill_document("no_such_type"), "learned_from": [{"file": EVIL, "sha256": "0"}]}
    (made / "skills" / "peg.skill.json").write_text(json.dumps(document))
    bodies = [{"name": EVIL, "geoms": [{"kind": "sphere", "size": [0.1]}]}]
    evil = trace(reason=EVIL, bodies=bodies, events=[[1.0, EVIL]], robot=EVIL)
    one = np.zeros((len(evil.time), 1, 3))
    object.__setattr__(evil, "body_position", one)
    object.__setattr__(evil, "body_quaternion", np.tile([0.0, 0, 0, 1], (len(evil.time), 1, 1)))
    evil.save(made / "traces" / "evil.npz")
    text = page(made)
    assert "alert(" in text
    assert "<script>alert" not in text
    assert "<img src=x" not in text
    assert text.count("<script>") == 1


@pytest.mark.slow
def test_loose_traces_give_runs_without_a_campaign(tmp_path):
    trace().save(tmp_path / "a.npz")
    trace(success=False).save(tmp_path / "b.npz")
    text = page(tmp_path / "a.npz", tmp_path / "b.npz")
    assert text.count('class="viewer"') == 2
    assert text.count('id="scene-') == 1
    assert "1 of 2" in text


@pytest.mark.parametrize("name", ["results.csv", "summary.json", "scene.json", "campaign.toml", "skills", "traces"])
@pytest.mark.slow
def test_whatever_is_missing_is_said_and_the_rest_is_shown(copy, name):
    part = copy / name
    shutil.rmtree(part) if part.is_dir() else part.unlink()
    text = page(copy)
    assert "How this was made" in text


@pytest.mark.slow
def test_a_folder_of_campaigns_gives_a_chapter_each(copy, tmp_path):
    shutil.copytree(copy, tmp_path / "peg2")
    text = page(tmp_path)
    assert text.count('class="chapter"') == 2
    assert len(re.findall(r'id="c2-run"', text)) == 1
    assert "(peg)</h1>" in text and "(peg2)</h1>" in text  # of one name


def test_campaigns_in_a_folder_that_holds_their_demonstrations_are_shown_all_the_same(copy, tmp_path):
    (tmp_path / "demonstrations").mkdir()
    assert [chapter.folder for chapter in read_chapters([tmp_path])] == ["peg"]


@pytest.mark.slow
def test_a_broken_trace_in_a_folder_is_named_and_left_out(copy):
    (copy / "traces" / "torn.npz").write_bytes(b"PK not really")
    assert "torn.npz is left out" in page(copy)


def test_a_trace_without_geometry_or_with_gaps_is_still_plotted(tmp_path):
    holes = trace(bodies=[])
    holes.wrench[100:200] = np.nan
    holes.save(tmp_path / "a.npz")
    text = page(tmp_path / "a.npz")
    assert "only be plotted" in text
    assert "nan" not in "".join(re.findall(r' d="([^"]*)"', text)).lower()


def test_a_run_of_one_sample_is_no_crash(tmp_path):
    trace(samples=2).save(tmp_path / "a.npz")
    assert "The run" in page(tmp_path / "a.npz")


@pytest.mark.parametrize("make", ["missing", "empty folder", "text", "archive without arrays"])
def test_input_that_cannot_be_used_is_an_input_error(tmp_path, make, capsys):
    path = tmp_path / "x.npz"
    if make == "empty folder":
        path.mkdir()
    elif make == "text":
        path.write_text("hello")
    elif make == "archive without arrays":
        np.savez(path, time=np.zeros(3), meta=np.array(json.dumps({"format": "skillframe.trace", "version": 1})))
    assert run(["report", str(path), "--out", str(tmp_path / "r.html")]) == 2
    assert "error:" in capsys.readouterr().err
    assert not (tmp_path / "r.html").exists()


@pytest.mark.parametrize("name", ["summary.json", "scene.json", "skills/peg.skill.json", "campaign.toml"])
def test_a_damaged_file_is_refused_by_name(copy, name):
    (copy / name).write_text("{ not this")
    with pytest.raises(InputError, match=name.rsplit("/", 1)[-1]):
        page(copy)


def test_an_absent_plug_in_is_said_and_the_numbers_are_shown():
    text = skill_block("x.skill.json", skill_document("no_such_type"))
    assert "no_such_type" in text
    assert "below are the file" in text
    assert "feasible solid angle" in text


class Registry:
    def __init__(self, kind):
        self.kind = kind

    def skill(self, name):
        return self.kind


def test_a_plug_ins_words_and_pictures_are_shown_as_text_and_image(monkeypatch):
    kind = SkillType(
        name="lmc", summary="", build=lambda d: None, describe=lambda d: ["push along -z", "<b>x</b>"],
        explain=lambda d: [Illustration("<i>t</i>", "why", "<svg onload='alert(1)'/>")],
    )  # fmt: skip
    monkeypatch.setattr(learned, "registry", lambda: Registry(kind))
    text = skill_block("x.skill.json", skill_document())
    assert "push along -z" in text
    assert "&lt;b&gt;" in text
    assert "data:image/svg+xml;base64," in text
    assert "onload" not in text


def test_a_plug_in_that_raises_costs_its_own_part_only(monkeypatch):
    def broken(document):
        raise ZeroDivisionError("oops")

    kind = SkillType(name="lmc", summary="", build=broken, describe=broken, explain=broken)
    monkeypatch.setattr(learned, "registry", lambda: Registry(kind))
    text = skill_block("x.skill.json", skill_document())
    assert "could not describe it (ZeroDivisionError: oops)" in text
    assert "stiffness" in text


@pytest.mark.slow
def test_a_page_that_cannot_be_written_is_an_input_error(folder, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_report([folder], tmp_path / "file" / "r.html")
