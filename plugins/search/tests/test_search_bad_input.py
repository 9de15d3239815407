"""What cannot be searched, on the command line: one sentence on stderr, the exit code, and no file left behind."""

import pytest
from skillframe_search.example import example, searching

from skillframe.cli.main import run
from skillframe.document.file import save
from skillframe.extend.reading import write_demonstration
from skillframe.robot.spec import load_robot

TIP = [0.0, 0.0, 0.2]


@pytest.fixture
def document(tmp_path, monkeypatch):
    """search.json at the tip, 4 s, within some 10 mm of the start."""
    monkeypatch.chdir(tmp_path)
    found = example()
    save(
        {**found, "frame": {**found["frame"], "learned_at": TIP, "center_of_compliance": TIP}}, tmp_path / "search.json"
    )


@pytest.fixture
def robot(tmp_path):
    """The folder of a robot that may move within a box that ends 2 mm beside the start's x."""
    shipped = load_robot("free_tool")
    folder = tmp_path / "fenced"
    folder.mkdir()
    x = shipped.workspace.fixture[0]
    box = f"workspace_m = [[{x - 1.0}, -1.0, -1.0], [{x + 0.002}, 1.0, 2.0]]"
    text = (shipped.folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text.replace("[limits]", f"[limits]\n{box}"))
    (folder / "free_tool.urdf").write_text((shipped.folder / "free_tool.urdf").read_text())
    return folder / "robot.toml"


def said(capsys):
    """The error, which is one sentence."""
    (line,) = (line for line in capsys.readouterr().err.splitlines() if line.strip())
    return line


def test_demonstrations_that_never_touch_teach_no_search(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    hover = searching()
    hover = type(hover)(
        time=hover.time,
        position=hover.position,
        quaternion=hover.quaternion,
        meta=hover.meta,
        wrench=0.01 * hover.wrench,
    )
    write_demonstration(hover, "hover.npz")
    assert run(["learn", "hover.npz", "--skill", "search", "--out", "never.json"]) == 2
    assert "never press on a surface" in said(capsys)
    assert not (tmp_path / "never.json").exists()


@pytest.mark.slow
def test_a_search_that_never_touches_ends_with_exit_1_a_sentence_and_its_trace(document, tmp_path, capsys):
    above = ["--set", "start.offset_z=0.05", "--out", "run.npz", "--duration", "6"]
    assert run(["run", "search.json", "--world", "peg_in_hole", "--robot", "free_tool", *above]) == 1
    text = " ".join("".join(capsys.readouterr()).split())
    assert "touched no surface within" in text and "start the search nearer" in text
    assert (tmp_path / "run.npz").exists()


def test_a_search_area_outside_the_workspace_is_refused_with_both_boxes_ends(document, robot, tmp_path, capsys):
    assert run(["run", "search.json", "--world", "peg_in_hole", "--robot", str(robot), "--out", "run.npz"]) == 2
    text = said(capsys)
    assert "its search area" in text and "leaves the workspace of fenced" in text and "search less far" in text
    assert not (tmp_path / "run.npz").exists()


def test_a_campaign_with_a_search_area_outside_the_workspace_is_refused_before_it_runs(
    document, robot, tmp_path, capsys
):
    text = 'name = "s"\nseed = 1\ntrials = 2\nrobot = "fenced/robot.toml"\nworld = "peg_in_hole"\n'
    text += 'skills = ["search.json"]\n'
    (tmp_path / "campaign.toml").write_text(text)
    assert run(["campaign", "run", "campaign.toml", "--out", "results"]) == 2
    assert "leaves the workspace of fenced" in said(capsys)
    assert not (tmp_path / "results" / "results.csv").exists()


@pytest.mark.slow
def test_without_a_stated_workspace_an_arm_s_is_what_it_reaches(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    found = example()
    phase = found["phases"][0]
    wide = {**phase["exploration"], "covariance": [[0.04, 0.0], [0.0, 0.04]]}  # 0.2 m: half a metre each way
    save({**found, "phases": [{**phase, "exploration": wide}]}, tmp_path / "wide.json")
    assert run(["run", "wide.json", "--world", "peg_in_hole", "--robot", "panda", "--out", "run.npz"]) == 2
    assert "leaves the workspace of panda" in said(capsys)
