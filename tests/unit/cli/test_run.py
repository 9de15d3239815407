import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from skillframe_reports.provenance import commands
from skillframe_reports.sources import read_traces
from skillframe_testkit.checks.examples import example_demonstrations

from skillframe.cli.main import run
from skillframe.execution.trace import Trace
from skillframe.extend.reading import write_demonstration

pytestmark = pytest.mark.needs_plugins
FREE = ["--world", "free", "--robot", "free_tool"]


@pytest.fixture
def skill(tmp_path):
    path = tmp_path / "left.npz"
    write_demonstration(example_demonstrations()[0], path)
    return f"lmc:{path}"


@pytest.mark.slow
def test_a_run_leaves_a_trace_a_page_and_a_film(skill, tmp_path, capsys):
    files = {"trace": tmp_path / "run.npz", "replay": tmp_path / "run.html", "video": tmp_path / "run.mp4"}
    options = ["--out", str(files["trace"]), "--replay", str(files["replay"]), "--video", str(files["video"])]
    code = run(["run", skill, *FREE, "--duration", "0.1", *options, "--json"])
    captured = capsys.readouterr()
    said = json.loads(captured.out)
    assert len(re.findall(r"^note: the video was drawn by .* renderer", captured.err, re.MULTILINE)) == 1
    assert code == (0 if said["success"] else 1)
    assert {what: said[what] for what in files} == {what: str(path) for what, path in files.items()}
    assert all(path.stat().st_size > 1000 for path in files.values())


@pytest.mark.slow
def test_what_the_report_says_to_repeat_a_run_repeats_it(skill, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = [*FREE, "--coc", "wrist", "--set", "start.offset_x=0.002", "--seed", "3"]
    run(["run", skill, *options, "--duration", "0.3", "--rate", "50", "--out", "a.npz"])
    first = Trace.load(Path("a.npz"))
    (typed, _) = commands(read_traces([Path("a.npz")]))
    assert shlex.split(typed)[-2:] == ["--out", "a.npz"]
    run([*shlex.split(typed)[1:-1], "b.npz"])
    again = Trace.load(Path("b.npz"))
    assert again.meta == first.meta
    assert np.array_equal(again.wrench, first.wrench)


def test_a_film_that_could_not_be_written_is_refused_before_the_run(skill, tmp_path, capsys):
    assert run(["run", skill, "--world", "free", "--out", str(tmp_path / "run.npz"), "--video", "run.gif"]) == 2
    assert "not the name of a video" in capsys.readouterr().err
    assert not (tmp_path / "run.npz").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--duration", "nan"], "'--duration': nan s is beyond 1ms to 86400s"),
        (["--duration", "-1"], "'--duration': -1 s is beyond 1ms to 86400s"),
        (["--duration", "5mm"], "'--duration': expected a quantity in s, got 5mm"),
        (["--duration", "long"], "'--duration': 'long' is no number; give one, bare or with one of s, ms"),
        (["--rate", "0"], "'--rate': 0 Hz is beyond 0.01Hz"),
        (["--seed", "-1"], "'--seed': -1 is not in the range"),
        (["--set", "start.tilt_y=1e300"], "start.tilt_y: 1e+300 rad is beyond -90deg to 90deg"),
        (["--set", "start.tilt_y=172deg"], "start.tilt_y: 172deg is beyond -90deg to 90deg"),
        (["--set", "sensor.force_noise=-1"], "sensor.force_noise: -1 N is beyond 0N to 100N"),
        (["--coc", "10,0,0"], "point 10,0,0: x: 10 m is beyond -3m to 3m, as no tool is longer; did you mean 10mm?"),
        (["--coc", "0,0,5deg"], "expected a quantity in m, got 5deg"),
        (["--set", "actuator.delay=1"], "has no drive with such a quantity"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(skill, capsys, options, message):
    assert run(["run", skill, *FREE, *options]) == 2
    assert message in capsys.readouterr().err


def test_a_run_that_diverges_exits_1_with_time_cause_and_trace(skill, tmp_path, capsys):
    light = ["--world", "valley", "--robot", "panda", "--set", "robot.mass_scale=1e-6"]
    assert run(["run", skill, *light, "--out", str(tmp_path / "run.npz"), "--json"]) == 1
    said = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert said["failure"].startswith("diverged: ") and said["failure"].endswith(" s)")
    assert said["final_error_m"] is None
    assert (tmp_path / "run.npz").exists()
    assert run(["run", skill, *light]) == 1
    assert "nan" not in capsys.readouterr().out


@pytest.mark.slow  # a panda on a 60 mm way
def test_a_run_names_its_robot_and_world_and_how_deep_it_got(skill, tmp_path, capsys):
    where = ["--world", "peg_in_hole", "--set", "start.offset_x=1mm", "--duration", "1"]
    run(["run", skill, *where, "--json"])
    out, err = capsys.readouterr()
    said = json.loads(out)
    assert (said["robot"], said["world"]) == ("panda", "peg_in_hole")
    assert (said["progress"]["word"], said["progress"]["of_m"]) == ("inserted", 0.06)
    assert 0.0 <= said["progress"]["reached_m"] < 0.06
    assert all(0.0 < said[f"peak_{what}_share"] < 1.0 for what in ("torque", "speed", "range"))
    assert all(said[f"peak_{what}_joint"].startswith("joint") for what in ("torque", "speed", "range"))
    assert isinstance(said["notes"], list)
    assert "not saved; add --out run.npz" in err
    run(["run", skill, *where, "--out", str(tmp_path / "run.npz"), "--quiet"])
    out, err = capsys.readouterr()
    assert err == ""
    assert f"  panda in peg_in_hole, inserted {1000 * said['progress']['reached_m']:.0f} of 60 mm\n" in out


def test_a_run_where_nothing_is_deep_names_robot_and_world_alone(skill, capsys):
    run(["run", skill, *FREE, "--duration", "0.1"])
    assert " free_tool in free\n" in capsys.readouterr().out


def test_millimetres_typed_as_metres_are_warned_of_and_degrees_refused(skill, capsys):
    run(["run", skill, *FREE, "--duration", "0.02", "--set", "start.offset_y=2", "--quiet"])
    assert "warning: start.offset_y is 2 m as typed; if millimetres are meant, type start.offset_y=2mm" in (
        capsys.readouterr().err
    )
    assert run(["run", skill, *FREE, "--duration", "0.02", "--set", "start.offset_y=8"]) == 2
    assert "start.offset_y: 8 m is beyond -3m to 3m" in (said := capsys.readouterr().err)
    assert said.endswith("did you mean 8mm?\n")
    assert run(["run", skill, *FREE, "--duration", "0.02", "--set", "start.tilt_y=5"]) == 2
    assert "did you mean 5deg?" in capsys.readouterr().err
    run(["run", skill, *FREE, "--duration", "0.02", "--set", "start.offset_y=8mm", "--set", "start.tilt_y=5deg"])
    assert "as typed" not in capsys.readouterr().err


@pytest.mark.slow
def test_a_report_names_robot_and_world(skill, tmp_path, capsys):
    trace, page = str(tmp_path / "run.npz"), str(tmp_path / "run.html")
    run(["run", skill, *FREE, "--duration", "0.1", "--out", trace])
    capsys.readouterr()
    assert run(["report", trace, "--out", page]) == 0
    assert capsys.readouterr().out.endswith(": free_tool in free\n")
    assert run(["report", trace, "--out", page, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["chapters"][0]["scenes"] == [{"robot": "free_tool", "world": "free"}]
    assert (said["file"], said["bytes"]) == (page, Path(page).stat().st_size)


def test_a_run_says_both_halves_of_its_end(skill, capsys):
    """The goal of "free" holds everywhere, and a tenth of a second is too short for the skill to end."""
    run(["run", skill, *FREE, "--duration", "0.1", "--json"])
    captured = capsys.readouterr()
    said = json.loads(captured.out)
    assert (said["goal_reached"], said["ended_itself"], said["ended_by"]) == (True, False, "time")
    assert "had not ended by itself" in captured.err + said["failure"]
