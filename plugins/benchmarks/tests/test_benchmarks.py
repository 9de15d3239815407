"""AutoMate's check in closed form, rates whose unit is the assembly, and the command on two parts of our own."""

import json
import subprocess
import sys
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from skillframe_benchmarks import counts, scores
from skillframe_benchmarks.assembly import Plan
from skillframe_benchmarks.assets import pairs
from skillframe_benchmarks.counts import Cell, cause, share

from skillframe import CampaignResults
from skillframe.cli.main import run
from skillframe.errors import InputError, SkillframeError, UnknownName
from skillframe.frames import matrix_from_quaternion, quaternion_from_matrix, rotation_matrix

DEPTH, ORIGIN, TIP = 0.02, np.array([0.001, -0.002, -0.03]), np.array([0.0, 0.0, 0.2])
DOWN = np.diag([1.0, -1.0, -1.0])


def ended(lift=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    """The end of a trial whose part is turned about its origin and then shifted from where it is when assembled."""
    rotation = rotation_matrix(np.array(turn))
    base = matrix_from_quaternion(np.array([0.1, -0.2, 0.3, np.sqrt(1.0 - 0.14)]))
    tip = rotation @ (np.array([0.0, 0.0, -DEPTH]) - ORIGIN) + ORIGIN + lift
    wrist = tip - rotation @ DOWN @ TIP
    place, center = np.array([0.5, 0.1, 0.2]), np.array([0.0, 0.01, 0.15])
    turned = base @ rotation @ DOWN
    return SimpleNamespace(
        position=(place + base @ wrist + turned @ center)[None], quaternion=quaternion_from_matrix(turned)[None],
        body_position=place[None, None], body_quaternion=quaternion_from_matrix(base)[None, None],
        meta={"params": {"depth": DEPTH, "origin": list(ORIGIN)}, "bodies": [{"name": "fixture"}],
              "frames": {"tip": list(TIP)}, "center_of_compliance": list(center)},
    )  # fmt: skip


def test_a_part_that_was_only_lifted_is_as_high_and_as_far_as_it_was_lifted():
    trace = ended(lift=(0.0, 0.0, 0.005))
    assert scores.height(trace) == pytest.approx(0.005, abs=1e-12)
    assert scores.distance(trace) == pytest.approx(0.005, abs=1e-12)


def test_a_part_turned_about_its_origin_is_no_higher_and_its_key_points_lie_on_chords():
    """Chords of 2 s sin(a / 2) at s = 1/2, 1/6, 1/6 and 1/2 m: 2/3 sin(a / 2) in the mean."""
    trace = ended(turn=(0.04, 0.03, 0.0))
    assert scores.height(trace) == pytest.approx(0.0, abs=1e-12)
    assert scores.distance(trace) == pytest.approx(2.0 / 3.0 * np.sin(0.025), rel=1e-9)


def test_a_turn_about_the_way_in_is_not_seen_by_the_published_check():
    assert scores.distance(ended(turn=(0.0, 0.0, 1.0))) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("height", "distance", "passed"),
    [(0.0, 0.0, True), (-5e-4, 0.0, True), (-2e-3, 0.0, False), (0.009, 0.0, True), (0.011, 0.0, False),
     (0.005, 0.021, False)],
)  # fmt: skip
def test_the_published_check_asks_for_a_height_and_for_key_points(height, distance, passed):
    assert scores.passes(height, distance, 0.01) is passed


def cell(seated, trials=20, checked=None):
    return Cell(trials, seated, checked, {}, 30.0, 2.0)


def test_the_interval_of_a_rate_knows_that_trials_of_one_assembly_are_alike():
    """Half of the assemblies always, half never: 100 trials as if independent would say 40 to 60 %."""
    found = share([cell(20), cell(0)] * 5)
    assert found.rate == 0.5 and found.low <= 0.2 and found.high >= 0.8 and found.often == 5
    assert share([cell(10)] * 10)[1:3] == (0.5, 0.5)


def test_few_assemblies_get_no_interval_and_the_check_is_a_rate_of_its_own():
    assert share([cell(20), cell(0)])[1:3] == (None, None)
    assert share([cell(0, checked=20), cell(20, checked=0)], checked=True).rate == 0.5


@pytest.mark.parametrize(
    ("ended_by", "height", "reached", "word"),
    [("force", 0.0, False, "force"), ("true_force", 0.0, False, "true force"), ("skill", 0.0195, False, "on the rim"),
     ("skill", 0.01, False, "entered and stopped"), ("skill", 0.0005, False, "beside or tilted"),
     ("time", 0.0, True, "seated, not ended")],
)  # fmt: skip
def test_a_failure_has_the_cause_that_ended_it_or_the_place_where_it_stood(ended_by, height, reached, word):
    row = {"ended_by": ended_by, "score.automate_height": height, "score.automate_distance": 0.0,
           "goal_reached": reached}  # fmt: skip
    assert cause(row, DEPTH) == word


@pytest.fixture
def fetched(tmp_path):
    """A folder like AutoMate's, of names alone."""
    for name in ("00004", "00014"):
        (tmp_path / "assets/automate/mesh" / name).mkdir(parents=True)
        for part in ("plug", "socket"):
            (tmp_path / "assets/automate/mesh" / name / f"asset_{part}.obj").write_text("")
    heights = tmp_path / "isaacgymenvs/tasks/automate/data/disassembly_dist.json"
    heights.parent.mkdir(parents=True)
    heights.write_text(json.dumps({"asset_00004": 0.02}))
    return tmp_path


def test_pairs_are_found_in_a_checkout_and_in_its_assets_with_heights_where_they_are_known(fetched):
    assert [(pair.name, pair.way_out) for pair in pairs(fetched)] == [("00004", 0.02), ("00014", None)]
    assert [pair.way_out for pair in pairs(fetched / "assets/automate", ("00014",))] == [None]


def test_a_wrong_folder_a_wrong_name_and_damaged_heights_are_one_sentence_each(fetched, tmp_path, capsys):
    with pytest.raises(InputError, match=r"holds no NUMBER/asset_plug\.obj"):
        pairs(tmp_path / "assets")
    with pytest.raises(UnknownName, match="unknown assembly '4'"):
        pairs(fetched, ("4",))
    (fetched / "isaacgymenvs/tasks/automate/data/disassembly_dist.json").write_text("[1]")
    assert run(["benchmark", "automate", str(fetched), "--list"]) == 2
    assert "is no table of heights" in capsys.readouterr().err


def test_a_folder_that_was_begun_with_another_plan_is_refused(fetched, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/plan.json").write_text(json.dumps({"trials": 7}))
    assert run(["benchmark", "automate", str(fetched), "--out", str(tmp_path / "out")]) == 2
    assert "was begun with" in capsys.readouterr().err
    of_before = json.loads(json.dumps(asdict(Plan())))  # when each level had a campaign of its own
    (tmp_path / "out/plan.json").write_text(json.dumps(of_before))
    assert run(["benchmark", "automate", str(fetched), "--out", str(tmp_path / "out")]) == 2
    assert "was begun with layout = None" in capsys.readouterr().err


@pytest.mark.slow
def test_a_benchmark_that_another_process_runs_is_refused_and_nothing_of_it_is_touched(fetched, tmp_path, capsys):
    out = tmp_path / "out"
    (out / "watch").mkdir(parents=True)
    holds = "import sys; from pathlib import Path; from skillframe.campaign.folder import FolderLock\n"
    holds += "with FolderLock(Path(sys.argv[1])): print('held', flush=True); sys.stdin.read()"
    other = subprocess.Popen(
        [sys.executable, "-c", holds, str(out)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert other.stdout.readline() == "held\n"
        assert run(["benchmark", "automate", str(fetched), "00004", "--out", str(out)]) == 2
        assert f"process {other.pid} on" in capsys.readouterr().err and (out / "watch").is_dir()
    finally:
        other.communicate()


@pytest.mark.slow
@pytest.mark.figures
def test_two_pairs_of_meshes_become_a_table_a_page_and_are_not_run_again(tmp_path, capsys, monkeypatch):
    pytest.importorskip("manifold3d")
    import trimesh
    from skillframe_parts.solid import arrays_of

    from tests import part_meshes

    solids = {
        "00001": part_meshes.round_pair(),
        "00002": (part_meshes.rod(6.0, -12.0, 8.0), part_meshes.hole(5.0, 12.0)),
    }
    for name, pair in solids.items():
        (tmp_path / "mesh" / name).mkdir(parents=True)
        for part, solid in zip(("plug", "socket"), pair, strict=True):
            made = trimesh.Trimesh(*arrays_of(part_meshes.in_metres(solid)), process=False)
            made.export(tmp_path / "mesh" / name / f"asset_{part}.obj")
    (tmp_path / "disassembly_dist.json").write_text(json.dumps({"asset_00001": 0.01}))
    monkeypatch.chdir(tmp_path)
    words = [
        "benchmark",
        "automate",
        ".",
        "--trials",
        "2",
        "--level",
        "1mm-2deg-0.2",
        "--level",
        "1mm-2deg-0.5",
        "--method",
        "push",
        "--workers",
        "1",
        "--trial-seed",
        "4",
    ]
    assert run(words) == 0
    said = capsys.readouterr()
    assert "2 of 2 assemblies done, 1 of them refused" in said.err and "push" in said.out
    found = json.loads((tmp_path / "automate/automate.json").read_text())
    ran, refused = found["assemblies"]
    assert "overlap" in refused["refused"] and not refused["cells"]  # a plug of 6 mm in a hole of 5
    only, other = ran["cells"]
    assert [only["level"], other["level"]] == ["1mm-2deg-0.2", "1mm-2deg-0.5"] and other["trials"] == 2
    rows = CampaignResults(tmp_path / "automate/00001/trials").rows
    assert [row["world.friction"] for row in rows] == [0.2, 0.2, 0.5, 0.5]  # one campaign, so that they run abreast
    assert [rows[i]["fixture.tilt_x"] for i in (0, 1)] == [rows[i]["fixture.tilt_x"] for i in (2, 3)]  # like draws
    assert 'tilt = "90deg"' in (tmp_path / "automate/00001/fixture.toml").read_text()  # seated says nothing of it
    assert only["trials"] == 2 and only["checked"] is not None and ran["cost_s"]["trials"] > 0.0
    page = (tmp_path / "automate/automate.html").read_text()
    assert "00001" in page and "data:image/png" in page and "http://" not in page
    assert run(words) == 0 and "2 of 2 assemblies are there already" in capsys.readouterr().err
    assert "seed = 4\n" in (tmp_path / "automate/00001/trials/campaign.toml").read_text()
    assert "(seed 1; of the samples 4)" in page
    assert run([*words, "--seed", "2"]) == 2 and run([*words, "--trial-seed", "1"]) == 2


def test_the_levels_are_those_that_are_told_and_the_widest_is_the_published_noise():
    from skillframe_benchmarks.assembly import LEVELS

    assert [level.name for level in LEVELS] == ["1mm-2deg-0.2", "1mm-2deg-0.5", "2mm-5deg-0.2", "2mm-5deg-0.5"]
    last = LEVELS[-1].most()
    assert last["fixture.offset_x"] == 0.002  # socket_pos_obs_noise, socket_rot_obs_noise
    assert last["fixture.tilt_z"] == pytest.approx(0.0872665, abs=1e-6)


def test_trials_of_all_levels_follow_each_other_with_like_draws_uniform_up_to_each_level():
    from skillframe_benchmarks.assembly import LEVELS, drawn, levels_of

    levels, trials = levels_of([LEVELS[3].name, LEVELS[0].name]), 400
    assert levels == [LEVELS[0], LEVELS[3]]  # in the order of all, however they were named
    vary = {name: np.array(axis["values"]).reshape(2, trials) for name, axis in drawn(levels, trials, 4).items()}
    assert (vary["world.friction"] == [[0.2], [0.5]]).all()
    for name, (near, far) in vary.items():
        if name != "world.friction":
            most = [level.most()[name] for level in levels]
            assert near / most[0] == pytest.approx(far / most[1])
            assert stats.kstest(far / most[1], stats.uniform(-1.0, 2.0).cdf).pvalue > 1e-3  # one seed in a thousand
    assert drawn(levels, trials, 5)["fixture.tilt_z"] != drawn(levels, trials, 4)["fixture.tilt_z"]
    assert abs(np.corrcoef(vary["fixture.offset_x"][1], vary["fixture.tilt_y"][1])[0, 1]) < 0.16  # 3 / sqrt(400)


def test_rows_of_a_campaign_are_those_of_the_level_whose_draws_they_had(monkeypatch):
    from skillframe_benchmarks import assembly

    rows = [{"trial": trial, "skill": skill} for skill in ("push", "lmc") for trial in range(6)]
    monkeypatch.setattr(assembly, "CampaignResults", lambda folder: SimpleNamespace(rows=rows))
    names = ["2mm-5deg-0.5", "1mm-2deg-0.2", "2mm-5deg-0.2"]
    found = assembly.by_level(None, names, 2)
    assert [*found] == ["1mm-2deg-0.2", "2mm-5deg-0.2", "2mm-5deg-0.5"]
    assert [[row["trial"] for row in each] for each in found.values()] == [[0, 1] * 2, [2, 3] * 2, [4, 5] * 2]


def test_a_plain_spiral_keeps_the_push_and_has_the_figures_that_are_told():
    from skillframe_benchmarks.methods import plain_spiral
    from skillframe_search.example import seating
    from skillframe_search.phase import read_phase
    from skillframe_search.seat_document import check, part_of, read_seat

    whole = seating()
    made = plain_spiral(whole)
    check(made)
    assert made["phases"][0] == whole["phases"][0]
    phase, seat = read_phase(part_of(made, 1)), read_seat(made)
    assert (phase.push.force, phase.stiffness.translation) == (12.0, 2500.0)
    assert (phase.path.pitch, phase.path.radius, phase.path.speed) == (4e-4, 0.003, 0.012)
    assert phase.dither.tilt_nm == phase.dither.turn_nm == 0.0 and phase.path.passes == 1
    assert seat == replace(read_seat(whole), approach=False, settle_s=0.0)


@pytest.mark.parametrize(("fails", "looks", "upright"), [(0, None, True), (1, 5e-4, True), (2, None, False)])
def test_a_demonstration_is_shown_again_until_it_ends_upright_by_pushing_and_else_by_looking(
    monkeypatch, fails, looks, upright
):
    from skillframe_benchmarks import assembly

    asked = []

    def record(robot, scene, teacher, **more):
        asked.append((teacher.vision_error, more["draws"], more["attempts"]))
        if len(asked) <= fails:
            raise SkillframeError("the teacher failed")
        return "shown"

    monkeypatch.setattr(assembly, "robot_of", lambda name: None)
    monkeypatch.setattr(assembly, "scene_of", lambda fixture, ends, depth: (None, ends))
    monkeypatch.setattr(assembly.sessions, "record", record)
    assert assembly._recorded(None, assembly.Plan()) == "shown"
    assert [each[2] for each in asked] == [5, 20, 1][: fails + 1]
    assert (asked[-1][0], "world.tilt" in asked[-1][1]) == (looks, upright)
    assert all("world.sideways" in ends for _, ends, _ in asked)


def test_an_assembly_that_is_not_done_has_no_entry(tmp_path):
    assert counts.read(tmp_path, ()) is None


def test_a_method_that_learns_nothing_leaves_the_others_their_skills_and_says_why_without_a_path(tmp_path, monkeypatch):
    from skillframe_benchmarks import assembly
    from skillframe_benchmarks.assets import Pair

    def refuses(shown):
        raise InputError(tmp_path / "00007" / "demonstration2.npz", "touches nothing", "record it again")

    made = SimpleNamespace(save=lambda path: path.write_text("{}"))
    monkeypatch.setattr(assembly, "METHODS", {"push": lambda shown: made, "lmc": refuses, "replay": lambda shown: made})
    monkeypatch.setattr(assembly, "_world", lambda pair, folder: folder / "fixture.toml")
    monkeypatch.setattr(assembly, "_shown", lambda fixture, folder, plan: [])
    ran = []
    monkeypatch.setattr(assembly, "_campaign", lambda fixture, skills, out, plan: ran.append([*skills]) or {})
    pair = Pair(name="00007", plug=tmp_path / "p.obj", socket=tmp_path / "s.obj", way_out=None)
    plan, told = assembly.Plan(methods=("push", "lmc", "replay"), levels=("1mm-2deg-0.2",)), []
    assembly.run(assembly.AssemblyJob(pair=pair, folder=tmp_path / "00007", plan=plan), told.append)
    assert ran == [["push", "replay"]] and (tmp_path / "00007/replay.skill.json").exists()
    why = "00007/demonstration2.npz: touches nothing"
    unlearned = json.loads((tmp_path / "00007/unlearned.json").read_text())
    assert list(unlearned) == ["lmc"] and unlearned["lmc"].startswith(why) and why in told[0]
    assert not (tmp_path / "00007/refused.json").exists()


def test_an_assembly_that_nobody_demonstrates_is_learned_from_its_removal(tmp_path, monkeypatch):
    from skillframe_benchmarks import assembly
    from skillframe_benchmarks.assets import Pair

    def fails(fixture, folder, plan):
        raise SkillframeError("0 of 20 attempts succeeded")

    made = SimpleNamespace(save=lambda path: path.write_text("{}"))
    monkeypatch.setattr(assembly, "METHODS", {"lmc": lambda shown: made})
    monkeypatch.setattr(assembly, "WITHOUT_DEMONSTRATION", {"removal": lambda shown: made})
    monkeypatch.setattr(assembly, "_world", lambda pair, folder: folder / "fixture.toml")
    monkeypatch.setattr(assembly, "_shown", fails)
    monkeypatch.setattr(assembly, "_removed", lambda fixture, folder, plan: [])
    ran = []
    monkeypatch.setattr(assembly, "_campaign", lambda fixture, skills, out, plan: ran.append([*skills]) or {})
    pair = Pair(name="00308", plug=tmp_path / "p.obj", socket=tmp_path / "s.obj", way_out=None)
    plan = assembly.Plan(methods=("lmc", "removal"), levels=("1mm-2deg-0.2",))
    assembly.run(assembly.AssemblyJob(pair=pair, folder=tmp_path / "00308", plan=plan), lambda line: None)
    assert ran == [["removal"]]
    assert json.loads((tmp_path / "00308/unlearned.json").read_text()) == {"lmc": "0 of 20 attempts succeeded"}
    assert not (tmp_path / "00308/refused.json").exists()


def test_all_trials_of_a_method_that_learned_nothing_count_as_failed_at_every_level(tmp_path):
    from skillframe_benchmarks import page
    from skillframe_benchmarks.assembly import LEVELS, Plan

    whole = {
        "done": {"trials": 20, "levels": [level.name for level in LEVELS]},
        "unlearned": {"lmc": "touches nothing"},
        "parts": {"way_out_m": 0.01, "depth_m": 0.02, "clearance_m": 1e-4},
    }
    for name, value in whole.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(value))
    found = counts.read(tmp_path, LEVELS)
    assert set(found.cells) == {(level.name, "lmc") for level in LEVELS}
    for each in found.cells.values():
        assert (each.trials, each.seated, each.checked, each.causes) == (20, 0, 0, {"not learned": 20})
    given = page.totals([found], LEVELS, ("push", "lmc"))
    assert [(total.method, total.seated.rate) for total in given] == [("lmc", 0.0)] * len(LEVELS)
    drawn = page.render([found], given, Plan(), 1)
    assert "lmc: touches nothing" in drawn and "Of 1 a method learned nothing" in drawn
    assert json.loads(json.dumps(page.plain([found], given), allow_nan=False))["assemblies"][0]["unlearned"] == {
        "lmc": "touches nothing"
    }
