"""The Python API: objects, names and files mean the same, and it does what the command line does."""

import gc
import shlex
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skillframe_hydraulics.teleoperation import OperatorSettings
from skillframe_teaching.blind import BlindSettings
from skillframe_teaching.teacher import TeacherSettings
from skillframe_testkit.suites import HoldSkill, example_demonstrations

import skillframe
from skillframe import Campaign, CampaignResults, LearnedSkill, SingleRun, learn, record, report, run
from skillframe.cli.main import run as command
from skillframe.errors import InputError, SkillframeError, SkillframeWarning, UnknownName
from skillframe.execution.prepare import load_robot_model, load_world
from skillframe.extend.reading import read_demonstration
from skillframe.robot.spec import load_robot

pytestmark = pytest.mark.needs_plugins
VALLEY = ("valley", "free_tool")
FREE = ("free", "free_tool")
SHORT = {"duration_s": 0.1}


def same(first, second):
    """Whether two runs are the same to the last bit."""
    return np.array_equal(first.trace.wrench, second.trace.wrench) and first.success == second.success


@pytest.mark.slow
def test_a_recording_is_a_sequence_and_what_the_command_writes(demonstrations, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = "record --world valley --robot free_tool --count 2 --seed 1 --out d.csv"
    assert command(words.split()) == 0
    assert demonstrations.save("e.csv") == [Path("e1.csv"), Path("e2.csv")]
    assert [Path(f"d{i}.csv").read_bytes() for i in (1, 2)] == [Path(f"e{i}.csv").read_bytes() for i in (1, 2)]
    assert len(demonstrations) == 2
    assert [d.duration for d in demonstrations] == [demonstrations[i].duration for i in (0, 1)]
    assert f"{demonstrations[1].duration:.2f} s" in repr(demonstrations)


def test_one_demonstration_is_saved_under_its_own_name(demonstrations, tmp_path):
    alone = replace(demonstrations, demonstrations=demonstrations[:1])
    assert alone.save(tmp_path / "one.npz") == [tmp_path / "one.npz"]


@pytest.mark.slow
def test_learning_takes_objects_names_and_files_alike(demonstrations, tmp_path):
    files = demonstrations.save(tmp_path / "d.npz")
    given = [files, [str(f) for f in files], [read_demonstration(files[0]), files[1]], iter(files)]
    documents = [learn(each).document for each in given]
    assert all(document == documents[0] for document in documents)
    one = [learn(each, "replay").phases for each in (files[0], str(files[0]), demonstrations[0])]
    assert one[0] == one[1] == one[2]


def test_settings_of_the_learner_are_keywords(demonstrations):
    assert learn(demonstrations, stiffness_n_m=500.0).phases != learn(demonstrations).phases


def test_what_the_command_learns_is_what_the_function_learns(demonstrations, tmp_path):
    files = demonstrations.save(tmp_path / "d.npz")
    assert command(["learn", *map(str, files), "--at", "tip", "--out", str(tmp_path / "a.json")]) == 0
    learn(files, at="tip").save(tmp_path / "b.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_a_setting_with_the_name_of_an_argument_is_a_setting_on_the_command_line(demonstrations, tmp_path, capsys):
    file, _ = demonstrations.save(tmp_path / "d.npz")
    assert command(["learn", str(file), "--set", "skill=x", "--out", str(tmp_path / "a.json")]) == 2
    assert "unknown" in capsys.readouterr().err


def test_a_skill_that_was_saved_and_read_again_is_the_same_under_the_file_s_name(skill, tmp_path):
    saved = skill.save(tmp_path / "slide.skill.json")
    again = LearnedSkill.load(tmp_path / "slide.skill.json")
    assert (saved.name, again.name, skill.name) == ("slide", "slide", "lmc")
    assert again.document == saved.document == skill.document
    assert skill.words == again.words == str(skill).splitlines()
    assert "slide: lmc, 1 phase from 2 demonstrations" in repr(again)


@pytest.mark.slow
def test_a_skill_draws_the_page_of_the_command(skill, tmp_path):
    path = tmp_path / "slide.skill.json"
    saved = skill.save(path)
    assert command(["show", str(path), "--page", str(tmp_path / "a.html")]) == 0
    assert saved.explain(tmp_path / "b.html") == len(skill.pictures) > 0
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


@pytest.mark.slow
def test_a_run_takes_skill_world_and_robot_as_objects_names_files_and_documents_alike(skill, tmp_path):
    saved = skill.save(tmp_path / "slide.skill.json")
    model, scene = load_robot_model("free_tool"), load_world("free", {})
    folder = load_robot("free_tool").folder
    first = run(skill, *FREE, **SHORT)
    others = [(saved.source, *FREE), (tmp_path / "slide.skill.json", scene, model), (skill.document, "free", folder),
              (skill, scene, load_robot("free_tool"))]  # fmt: skip
    assert all(same(first, run(*each, **SHORT)) for each in others)
    assert not same(first, run(skill, *FREE, seed=1, **SHORT))


@pytest.mark.slow
def test_a_run_is_the_command_s_and_knows_the_words_to_repeat_it(skill, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    saved = skill.save("slide.skill.json")
    done = run(saved, *VALLEY, coc="tip", set={"start.offset_x": "5mm", "world.friction": 0.3}, seed=3, duration_s=0.2)
    command([*shlex.split(done.trace.meta["command"])[1:], "--out", "run.npz"])
    again = SingleRun.load("run.npz")
    assert same(done, again)
    done.save("same.npz")
    assert SingleRun.load("same.npz").trace.meta == again.trace.meta
    assert done.trace.meta["draws"] == {"start.offset_x": 0.005}
    assert done.trace.meta["params"]["friction"] == 0.3


def test_a_run_of_what_nobody_can_type_claims_no_command(skill):
    assert "command" not in run(skill, *FREE, **SHORT).trace.meta


@pytest.mark.slow
def test_a_run_says_how_it_ended(skill):
    good, short = run(skill, *VALLEY, coc="tip"), run(skill, *VALLEY, **SHORT)
    assert good.success
    assert good.failure == ""
    assert "success" in repr(good)
    assert good.peak_force_n > 1.0
    assert good.final_error_m < 0.003
    assert good.final_error_rad < 0.1
    assert not short.success
    assert "time limit" in short.failure
    assert "time limit" in repr(short)
    assert short.duration_s == pytest.approx(0.1)


def test_an_object_that_steps_itself_runs_too():
    done = run(HoldSkill(duration=0.05), *FREE, coc="wrist", duration_s=0.2)
    assert done.trace.meta["skill"] == "HoldSkill"
    assert done.duration_s == pytest.approx(0.05, abs=0.002)  # a tick either way


@pytest.mark.slow
def test_a_run_draws_itself(skill, tmp_path, monkeypatch):
    monkeypatch.setattr("skillframe_reports.outputs.PICTURE", (96, 72))
    done = run(skill, *VALLEY, **SHORT)
    near, far = done.picture(tmp_path / "near.png"), done.picture(tmp_path / "far.png", time=0.05, far=True)
    assert near.read_bytes()[:4] == far.read_bytes()[:4] == b"\x89PNG"
    assert near.read_bytes() != far.read_bytes()
    assert done.video(tmp_path / "run.mp4").stat().st_size > 1000
    assert "<html" in done.replay(tmp_path / "run.html").read_text()[:100]
    bare = replace(done, trace=replace(done.trace, meta={**done.trace.meta, "bodies": []}))
    with pytest.raises(InputError, match="no geometry"):
        bare.picture(tmp_path / "none.png")


def test_ctrl_c_ends_a_run_in_python_and_leaves_what_was_recorded_on_the_command_line(skill, tmp_path, monkeypatch):
    def interrupt(now, longest):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(skill, *FREE, progress=interrupt)
    monkeypatch.setattr("skillframe.cli.output._tenths", lambda *args: interrupt)
    saved, out = skill.save(tmp_path / "slide.skill.json"), tmp_path / "run.npz"
    words = ["run", saved.source, "--world", "free", "--robot", "free_tool", "--out", str(out)]
    assert command(words) not in (0, 1)
    assert SingleRun.load(out).reason == "interrupted"


def test_progress_is_simulated_seconds_of_the_longest(skill):
    seen = []
    run(skill, *FREE, progress=lambda now, longest: seen.append((now, longest)), **SHORT)
    assert seen[0] == (0.0, 0.1)
    assert seen == sorted(seen)


@pytest.mark.parametrize(
    ("wrong", "error", "says"),
    [
        (lambda: record("valey", "free_tool"), UnknownName, "valley"),
        (lambda: record("valley", "free_tol"), UnknownName, "free_tool"),
        (lambda: record(*VALLEY, teacher="blnd"), UnknownName, "blind"),
        (lambda: record(*VALLEY, set={"world.frction": 1.0}), UnknownName, "world.friction"),
        (lambda: record(*VALLEY, teacher=OperatorSettings()), InputError, "for the drive of a plug-in"),
        (lambda: record("pallets", "hiab_xs031", teacher="kinesthetic"), InputError, "by hand"),
        (lambda: record("pallets", "hiab_xs031", teacher=BlindSettings()), InputError, "by hand"),
        (lambda: learn([]), InputError, "at least one"),
        (lambda: learn(3), InputError, "no demonstration"),
        (lambda: learn([3]), InputError, "no demonstration"),
        (lambda: learn("nowhere.npz"), InputError, "no such file"),
        (lambda: learn(example_demonstrations(), "lcm"), UnknownName, "lmc"),
        (lambda: learn(example_demonstrations(), moving=1), SkillframeError, "moving_m"),
        (lambda: run(3, *FREE), InputError, "no skill"),
        (lambda: run({"format": "x"}, *FREE), InputError, "skill document"),
        (lambda: run("nowhere.skill.json", *FREE), InputError, "nowhere.skill.json"),
        (lambda: report([]), InputError, "nothing to report"),
        (lambda: report(3), InputError, "no result"),
        (lambda: report([3]), InputError, "no result"),
        (lambda: Campaign(world="valley"), SkillframeError, "skills"),
        (lambda: Campaign(world="valley", skills=[]), InputError, "empty"),
        (lambda: Campaign(world="valley", skills="nowhere.skill.json"), InputError, "no such file"),
        (lambda: Campaign("nowhere.toml"), InputError, "nowhere.toml"),
        (lambda: CampaignResults("nowhere"), InputError, "not a campaign's folder"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_of_a_skillframe_error(wrong, error, says):
    with pytest.raises(error, match=says):
        wrong()


def test_a_scene_of_one_s_own_takes_quantities_and_no_parameters(skill):
    scene = load_world("free", {})
    assert run(skill, scene, "free_tool", set={"start.offset_x": 0.001}, **SHORT).trace.meta["draws"]
    with pytest.raises(UnknownName, match=r"world\.friction"):
        run(skill, scene, "free_tool", set={"world.clearance": 1.0})


@pytest.mark.slow
def test_a_bare_number_that_looks_like_millimetres_is_warned_of_at_the_line_of_the_user(skill):
    with pytest.warns(SkillframeWarning, match="2mm") as caught:
        run(skill, *FREE, set={"start.offset_x": 2}, **SHORT)
    assert caught[0].filename == __file__
    with pytest.warns(SkillframeWarning, match="2mm") as caught:
        record(*FREE, set={"start.offset_x": 2})
    assert caught[0].filename == __file__


def test_a_recording_given_twice_is_warned_of_at_the_line_of_the_user(demonstrations):
    with pytest.warns(SkillframeWarning, match="repeated") as caught:
        learn([demonstrations[0], demonstrations[0]])
    assert caught[0].filename == __file__


def test_the_command_line_says_what_the_functions_warn_of_even_when_quiet(demonstrations, tmp_path, capsys):
    file, _ = demonstrations.save(tmp_path / "d.npz")
    assert command(["learn", str(file), str(file), "--out", str(tmp_path / "a.json")]) == 0
    assert "warning: " in capsys.readouterr().err
    words = ["run", str(tmp_path / "a.json"), "--world", "free", "--robot", "free_tool", "--duration", "0.1"]
    command([*words, "--quiet", "--set", "start.offset_x=2"])
    assert "warning: start.offset_x is 2 m" in capsys.readouterr().err


@pytest.mark.slow
def test_a_person_in_detail_and_a_rate_are_those_of_the_command(tmp_path):
    how = "--world valley --robot free_tool --set teacher.aim_noise=2deg --rate 250 --seed 1"
    assert command(f"record {how} --out {tmp_path}/a.csv".split()) == 0
    noisy = record(*VALLEY, teacher=TeacherSettings(aim_noise=np.radians(2.0)), seed=1, rate_hz=250.0)
    assert noisy[0].rate == pytest.approx(250.0)
    noisy.save(tmp_path / "b.csv")
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_no_room_has_the_name_of_a_public_function():
    rooms = {path.name.removesuffix(".py") for path in Path(skillframe.__file__).parent.iterdir()}
    assert not rooms & set(skillframe.__all__)


def test_every_public_name_is_offered_for_completion():
    assert set(skillframe.__all__) <= set(dir(skillframe))


@pytest.mark.slow
def test_a_run_of_the_package_s_own_example_raises_no_warning_of_python():
    with warnings.catch_warnings():
        warnings.simplefilter("error", ResourceWarning)
        run(HoldSkill(duration=0.02), *FREE, duration_s=0.05)
        gc.collect()
